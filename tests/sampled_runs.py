"""An event simulator of the sampled benchmark loops, written out by hand and nothing shared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from hybrid_runs import advanced

from workbench.controllers.sampling import IntegralStep, Jitter, Sampling, SentCommand

Array = npt.NDArray[np.float64]
WHEELBASE, REFERENCE, AHEAD = 1.75, 2.8, 2.0


@dataclass(frozen=True)
class Plain:
    """Limits (inf for none), bounds on noise (offset, heading, speed) and on what the plant feels
    (steering rate, acceleration)."""

    rate_limit: float = np.inf
    steering_limit: float = np.inf
    accel: tuple[float, float] = (-np.inf, np.inf)
    noise: tuple[float, float, float] = (0.0, 0.0, 0.0)
    felt: tuple[float, float] = (0.0, 0.0)

    def plant(self, x: Array, held: Array, felt: Array) -> Array:
        _, _, steering, speed, heading = x
        turn = np.tan(np.clip(steering, -self.steering_limit, self.steering_limit))
        return np.stack(
            [
                speed * np.cos(heading),
                speed * np.sin(heading),
                held[0] + felt[0],
                held[1] + felt[1],
                speed * turn / WHEELBASE,
            ]
        )

    def law(self, x: Array, noise: Array, integrals: Array) -> tuple[Array, Array]:
        """Commands (2, N) and the integrals' rates (2, N): speed, offset."""
        y, heading, speed = x[1] + noise[0], x[4] + noise[1], x[3] + noise[2]
        turn = np.tan(np.clip(x[2], -self.steering_limit, self.steering_limit))
        error = y + AHEAD * np.sin(heading)
        rate = speed * np.sin(heading) + AHEAD * np.cos(heading) * speed * turn / WHEELBASE
        raw = -(0.6 * error + 0.05 * integrals[1] + 1.0 * rate)
        applied = np.clip(raw, -self.rate_limit, self.rate_limit)
        short = REFERENCE - speed
        push = short + 0.1 * integrals[0]
        given = np.clip(push, *self.accel)
        steps = np.stack([short - (push - given), error + (raw - applied)])
        return np.stack([applied, given]), steps


@dataclass(frozen=True)
class Timing:
    """Instants of measurement (N, K), of both actuations (2, N, U + K), the integrals' steps."""

    measured: Array
    acts: Array
    steps: Array


def _extreme(rng: np.random.Generator, low: float, high: float, shape: tuple[int, ...]) -> Array:
    """Half at the ends, half between; a third of the runs stick to one end."""
    free = rng.uniform(low, high, shape)
    ends = np.where(rng.random(shape) < 0.5, low, high)
    stuck = np.where(rng.random((shape[0], *(1,) * (len(shape) - 1))) < 0.5, low, high)
    kind = rng.random((shape[0], *(1,) * (len(shape) - 1)))
    mixed = np.where(rng.random(shape) < 0.5, ends, free)
    return np.where(kind < 1 / 3, stuck, mixed)


def timing(sampling: Sampling, until_s: float, count: int, rng: np.random.Generator) -> Timing:
    period, jitter = sampling.period_s, sampling.jitter_s
    before = sampling.commands_sent - 1
    ks = np.arange(-before, int(np.ceil(until_s / period)) + 4)
    shake = _extreme(rng, -jitter, jitter, (count, len(ks)))
    latest = sampling.measurement_delay_s[1]
    if sampling.jitter is Jitter.CLOCK:
        ticks = latest + jitter + ks * period + shake
        steps = period + np.diff(shake, axis=1, prepend=shake[:, :1])
    else:
        ticks = np.cumsum(period + shake, axis=1)
        ticks = ticks - ticks[:, before : before + 1] + latest
        steps = period + shake
    measured = ticks - _extreme(rng, *sampling.measurement_delay_s, ticks.shape)
    delays = _extreme(rng, *sampling.actuation_delay_s, (count, 2, len(ks))).transpose(1, 0, 2)
    if sampling.integral_step is IntegralStep.NOMINAL:
        steps = np.full(ticks.shape, period)
    return Timing(measured[:, before:], ticks + delays, steps[:, before:])


def sampled_runs(
    plain: Plain,
    sampling: Sampling,
    sent: tuple[SentCommand, ...],
    *,
    states: Array,
    times: Array,
    seed: int,
) -> Array:
    """Runs (N, m, 7) at `times`; states as in the benchmark loops, integrals last."""
    rng, count = np.random.default_rng(seed), len(states)
    when = timing(sampling, float(times[-1]), count, rng)
    queued = [
        np.stack(
            [rng.uniform(*c.steering_rate_radps, count), rng.uniform(*c.acceleration_mps2, count)]
        )
        for c in sent
    ]
    held, before = queued[0].copy(), len(sent) - 1
    commands = dict(zip(range(-before, 0), queued[1:], strict=True))
    samples, acts = when.measured.shape[1], when.acts.shape[2]
    # Columns of one table of events: samples, both actuators' acts, and what is recorded.
    kinds = np.repeat([0, 1, 2, 3], [samples, acts, acts, len(times)])
    index = np.concatenate(
        [np.arange(samples), *(np.arange(acts) - before,) * 2, np.arange(len(times))]
    )
    clock = np.concatenate(
        [when.measured, *np.maximum(when.acts, 0.0), np.tile(times, (count, 1))], axis=1
    )
    order = np.lexsort((np.tile(kinds, (count, 1)), clock), axis=1)
    x, integrals, now = states[:, :5].T.copy(), states[:, 5:7].T.copy(), np.zeros(count)
    rows = np.zeros((count, len(times), 7))
    computed = np.full((2, count, samples), np.nan)
    sticky = _extreme(rng, -1.0, 1.0, (count, 5))
    for column in order.T:
        then = clock[np.arange(count), column]
        fresh = np.where(rng.random((5, count)) < 0.7, sticky.T, rng.uniform(-1.0, 1.0, (5, count)))
        felt = fresh[:2] * np.array(plain.felt)[:, None]
        x = advanced(lambda s, u=held, w=felt: plain.plant(s, u, w), x, then - now, 3)
        now = then
        kind, which = kinds[column], index[column]
        for run_kind in range(4):
            runs = np.flatnonzero(kind == run_kind)
            if not len(runs):
                continue
            number = which[runs]
            if run_kind == 0:
                noise = fresh[2:, runs] * np.array(plain.noise)[:, None]
                command, rates = plain.law(x[:, runs], noise, integrals[:, runs])
                computed[:, runs, number] = command
                integrals[:, runs] += when.steps[runs, number] * rates
            elif run_kind < 3:
                actuator = run_kind - 1
                late = number >= 0
                held = held.copy()
                held[actuator, runs[late]] = computed[actuator, runs[late], number[late]]
                for early in range(-before, 0):
                    those = runs[number == early]
                    held[actuator, those] = commands[early][actuator, those]
            else:
                rows[runs, number, :5], rows[runs, number, 5:] = x[:, runs].T, integrals[:, runs].T
        if np.all(now > times[-1]):
            break
    return rows
