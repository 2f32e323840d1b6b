"""Random schedules of samples that repeat, and the growth that the worst of them brings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.controllers.sampling import IntegralStep, Jitter, Sampling
from workbench.models.gains.held import Timing
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.spectral import matrices, radius

Array = NDArray[np.float64]
_LONGEST_PATTERN: Final = 10


@final
@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """A schedule that repeats, and the growth per sample that it brings.

    gaps_s: between measurements; latencies_s: from each measurement to when its command acts;
    steps_s: what integrals were stepped by; growth: |largest eigenvalue of the product|^(1/length).
    Above 1 the schedule makes the linearised loop unstable (NUMERICAL); below 1 says nothing about
    other schedules.
    """

    gaps_s: tuple[float, ...]
    latencies_s: tuple[float, ...]
    steps_s: tuple[float, ...]
    growth: float


def worst_pattern(loop: LateralLoop, sampling: Sampling, *, patterns: int, seed: int) -> Pattern:
    """The worst of `patterns` random schedules of each length up to 10 that the sampling allows.

    A search, not a proof: half of all times at the ends of their intervals, half between.
    """
    rng = np.random.default_rng(seed)
    timing = Timing.of(sampling)
    values = {name: np.array(float(value)) for name, value in loop.exact().items()}
    worst = Pattern((), (), (), 0.0)
    for length in range(1, _LONGEST_PATTERN + 1):
        gaps, latencies, steps = drawn_schedules(sampling, patterns, length, rng)
        acting = acting_times(gaps, latencies, timing.commands)
        F = matrices(
            {n: np.broadcast_to(v, gaps.shape) for n, v in values.items()}, steps, gaps, acting
        )
        product = F[:, 0]
        for k in range(1, length):
            product = F[:, k] @ product
        growth = radius(product, integral=bool(loop.integral)) ** (1.0 / length)
        top = int(np.argmax(growth))
        if growth[top] > worst.growth:
            worst = Pattern(
                tuple(gaps[top].tolist()), tuple(latencies[top].tolist()),
                tuple(steps[top].tolist()), float(growth[top]),
            )  # fmt: skip
    return worst


def drawn_schedules(
    sampling: Sampling, patterns: int, length: int, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Gaps, latencies and integral steps, each (patterns, length), of schedules that repeat."""
    shape = (patterns, length)

    def anywhere(low: float, high: float) -> Array:
        ends = np.where(rng.random(shape) < 0.5, low, high)
        return np.where(rng.random(shape) < 0.5, ends, rng.uniform(low, high, shape))

    shake = anywhere(-sampling.jitter_s, sampling.jitter_s)
    measuring = anywhere(*sampling.measurement_delay_s)
    latencies = measuring + anywhere(*sampling.actuation_delay_s)
    if sampling.jitter is Jitter.CLOCK:
        between = sampling.period_s + np.roll(shake, -1, axis=1) - shake
    else:
        between = sampling.period_s + shake
    gaps = between - (np.roll(measuring, -1, axis=1) - measuring)
    nominal = sampling.integral_step is IntegralStep.NOMINAL
    steps = np.full(shape, sampling.period_s) if nominal else np.roll(between, 1, axis=1)
    return gaps, latencies, steps


def acting_times(gaps: Array, latencies: Array, commands: int) -> list[Array]:
    """See `HeldLoop.matrix`: from the schedule itself, its past being its own repetition."""
    found, age = [], np.zeros_like(gaps)
    for k in range(commands):
        start = np.roll(latencies, k, axis=1) - age
        found.append(gaps - np.clip(start, 0.0, gaps))
        age = age + np.roll(gaps, k + 1, axis=1)
    return found
