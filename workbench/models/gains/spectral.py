"""Spectral radius of the loop with held commands over two axes, all points at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.controllers.sampling import IntegralStep, Jitter, Sampling
from workbench.errors import InputError
from workbench.models.gains.held import MOST_COMMANDS, HeldLoop, Timing, schur_stable
from workbench.models.gains.lateral import AXES, LateralLoop, axis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
# Axes of sampled maps besides those of `AXES`.
TIMES: Final[Mapping[str, str]] = {"period": "period (s)", "delay": "delay (s)"}
_MOST_COMMANDS: Final = 40


def matrices(
    values: Mapping[str, Array], step: Array, gap: Array, acting: Sequence[Array]
) -> Array:
    """`HeldLoop.matrix` in floating point for arrays of one shape; (..., n, n), with an integral.

    values: by field of `LateralLoop`; step, gap: s; acting[k]: see `HeldLoop.matrix`, not more
    than the gap. Where ki is 0 the integral only keeps a pole at 1; see `radius`.
    """
    v, base, ahead = values["speed_mps"], values["wheelbase_m"], values["look_ahead_m"]
    kp, ki, kd = values["proportional"], values["integral"], values["derivative"]
    count = len(acting)
    shape = np.broadcast_shapes(*(np.shape(a) for a in (v, base, ahead, kp, ki, kd, gap, step)))
    F = np.zeros((*shape, 4 + count, 4 + count))
    for k in range(4):
        F[..., k, k] = 1.0
    F[..., 0, 1], F[..., 0, 2] = v * gap, v * v * gap**2 / (2.0 * base)
    F[..., 1, 2] = v * gap / base
    F[..., 3, 0], F[..., 3, 1] = step, step * ahead
    law = np.zeros((*shape, 4 + count))
    law[..., 0], law[..., 1] = -kp, -(kp * ahead + kd * v)
    law[..., 2], law[..., 3] = -kd * ahead * v / base, -ki
    before = np.zeros((*shape, 3))
    for k, time in enumerate((*acting, gap)):
        t = np.broadcast_to(time, shape)
        pushed = np.stack([v * v * t**3 / (6.0 * base), v * t**2 / (2.0 * base), t], axis=-1)
        if k == 0:
            F[..., :3, :] += pushed[..., :, None] * law[..., None, :]
        else:
            F[..., :3, 3 + k] += pushed - before
        before = pushed
    if count:
        F[..., 4, :] = law
        for k in range(1, count):
            F[..., 4 + k, 3 + k] = 1.0
    return F


def radius(F: Array, *, integral: bool) -> Array:
    """Spectral radius of each matrix; without an integral, of what is left without it."""
    if not integral:
        kept = [k for k in range(F.shape[-1]) if k != 3]
        F = F[..., kept, :][..., kept]
    found: Array = np.abs(np.linalg.eigvals(F)).max(axis=-1)
    return found


@final
@dataclass(frozen=True, slots=True, eq=False)
class SampledMap:
    """Spectral radius per sample (m x n) over two axes, without jitter; below 1 is stable.

    x_label, y_label: names with units; x (n), y (m). Rigor NUMERICAL.
    """

    loop: LateralLoop
    period_s: float
    delay_s: float
    x_label: str
    y_label: str
    x: Array
    y: Array
    radius: Array

    def rows(self) -> list[dict[str, float]]:
        """One row per point."""
        return [
            {self.x_label: float(x), self.y_label: float(y), "spectral radius": float(value)}
            for y, line in zip(self.y, self.radius, strict=True)
            for x, value in zip(self.x, line, strict=True)
        ]

    def plot(self) -> Figure:
        """The map as a matplotlib figure."""
        from workbench.models.gains.pictures import figure, paint_sampled

        return figure(lambda canvas: paint_sampled(canvas, self))


def sampled_map(
    loop: LateralLoop,
    timing: tuple[float, float],
    x: tuple[str, tuple[float, float]],
    y: tuple[str, tuple[float, float]],
    *,
    points: int,
) -> SampledMap:
    """The map over two axes, each as (name, (low, high)): of `AXES`, or period, or delay.

    timing: (period_s, delay_s) where they are no axis; the delay runs from measurement to act.
    Raises InputError on unknown or equal axes, and where a delay is more than 40 periods.
    """
    grid = {x[0]: np.linspace(*x[1], points)[None, :], y[0]: np.linspace(*y[1], points)[:, None]}
    if len(grid) != 2:
        raise InputError(f"expected two different axes for a map, got {x[0]!r} twice")
    fields = {name: np.array(float(value)) for name, value in loop.exact().items()}
    fields.update({axis(n).field: value for n, value in grid.items() if n not in TIMES})
    shape = (points, points)
    period = np.broadcast_to(grid.get("period", np.array(timing[0])), shape)
    delay = np.broadcast_to(grid.get("delay", np.array(timing[1])), shape)
    if not (period.min() > 0.0 and delay.min() >= 0.0):
        raise InputError("expected periods > 0 and delays >= 0, in s")
    count = int(np.ceil((delay / period).max() - 1e-12))
    if count > _MOST_COMMANDS:
        raise InputError(
            f"expected delays of at most {_MOST_COMMANDS} periods, got {count}; shorten the delays "
            "or lower the rate"
        )
    acting = [np.clip(period - (delay - k * period), 0.0, period) for k in range(count)]
    everywhere = {name: np.broadcast_to(value, shape) for name, value in fields.items()}
    F = matrices(everywhere, period, period, acting)
    found = radius(F, integral=bool(np.any(fields["integral"])))
    labels = [TIMES[n] if n in TIMES else AXES[n].label for n, _ in (x, y)]
    return SampledMap(
        loop, *timing, labels[0], labels[1], grid[x[0]].ravel(), grid[y[0]].ravel(), found
    )


def steady_sampling(period_s: float, delay_s: float) -> Sampling:
    """Samples without jitter, one delay from measurement to act."""
    return Sampling(
        period_s, 0.0, Jitter.CLOCK, (0.0, 0.0), (delay_s, delay_s), IntegralStep.NOMINAL
    )


@final
@dataclass(frozen=True, slots=True)
class CriticalDelay:
    """Delays (s) between which the loop without jitter loses stability at one rate.

    stable_s: stable there; unstable_s: not stable there; both proved by exact Schur and Cohn
    conditions. None where none was found: not stable even without delay, or stable up to the
    longest tried.
    """

    period_s: float
    stable_s: float | None
    unstable_s: float | None


def critical_delay(loop: LateralLoop, period_s: float, longest_s: float) -> CriticalDelay:
    """The first loss of stability as the delay grows, to 1e-5 of the longest delay tried.

    That is `longest_s`, or 12 periods where they are less. Candidates come from spectral radii on a
    grid and bisection; the two delays that are returned are judged exactly.
    """
    # A little less, so that rounding makes no command more of it.
    longest_s = min(longest_s, (MOST_COMMANDS - 1e-9) * period_s)
    values = {name: np.array(float(value)) for name, value in loop.exact().items()}

    def unstable(delays: Array) -> NDArray[np.bool_]:
        period = np.full(delays.shape, period_s)
        count = int(np.ceil(delays.max() / period_s - 1e-12))
        acting = [np.clip(period - (delays - k * period), 0.0, period) for k in range(count)]
        F = matrices(
            {n: np.broadcast_to(v, delays.shape) for n, v in values.items()}, period, period, acting
        )
        return radius(F, integral=bool(loop.integral)) >= 1.0

    grid = np.linspace(0.0, longest_s, 65)
    bad = np.flatnonzero(unstable(grid))
    if len(bad) == 0:
        return CriticalDelay(
            period_s, longest_s if _exactly_stable(loop, period_s, longest_s) else None, None
        )
    if bad[0] == 0:
        return CriticalDelay(period_s, None, 0.0)
    low, high = float(grid[bad[0] - 1]), float(grid[bad[0]])
    while high - low > 1e-5 * longest_s:
        middle = (low + high) / 2
        low, high = (low, middle) if unstable(np.array([middle]))[0] else (middle, high)
    return CriticalDelay(
        period_s,
        low if _exactly_stable(loop, period_s, low) else None,
        None if _exactly_stable(loop, period_s, high) else high,
    )


def _exactly_stable(loop: LateralLoop, period_s: float, delay_s: float) -> bool:
    timing = Timing.of(steady_sampling(period_s, delay_s))
    return schur_stable(HeldLoop.of(loop, timing).steady(timing))
