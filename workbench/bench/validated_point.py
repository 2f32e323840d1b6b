"""One trajectory enclosed: Taylor steps in fixed-point balls, remainder over a Picard box.

x(t + s) lies in sum_{k<p} x_k s^k + c_p(B) s^p, where B contains the solution over the step
(x + [0, h] f(B) inside B) and c_p is the p-th Taylor coefficient, evaluated over B. Across a kink
p = 2 holds with the hull of both branches' rates, on steps so short that its width is negligible.
Source: R. Moore, Methods and Applications of Interval Analysis, chapter 8.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.bench.balls import ONE, PLACES, Ball, BallAlgebra, UndecidedError
from workbench.bench.taylor import TaylorField

_ALGEBRA = BallAlgebra()
_PICARD_TRIALS = 6
_MOST_STEPS = 5000
_LONGEST_STEP = ONE >> 2
# Steps with an undecided kink are this short (2^-34 s): they widen the state by about 2^-68.
_KINK_STEP = ONE >> 34
# Remainder per step that is small enough (2^-90, in units).
_REMAINDER = ONE >> 90


@final
@dataclass(frozen=True, slots=True)
class PointRun:
    """What to enclose: a field from one state, parameters, and a disturbance held piecewise.

    values[j] (n_w) holds from switches[j-1] to switches[j] (s, ascending); len(switches) + 1 rows.
    """

    field: TaylorField
    state: Sequence[float]
    parameters: Sequence[float]
    switches: Sequence[float]
    values: Sequence[Sequence[float]]


def enclose_point(run: PointRun, times: Sequence[float]) -> list[tuple[Ball, ...]] | None:
    """Balls that contain the state at each of `times` (s, ascending, >= 0), or None.

    None: a kink is met for too long, a pole comes too near, or too many steps are needed. Rigor
    ENCLOSED (Python integers only) for solutions of the field with literals taken as their doubles.
    """
    switches = [_instant(time) for time in run.switches]
    ends = [*switches, max([_instant(time) for time in times], default=0) + 1]
    wanted = [_instant(time) for time in times]
    parameters = [Ball.of(value) for value in run.parameters]
    state, now, trial = tuple(Ball.of(value) for value in run.state), 0, _LONGEST_STEP
    found: list[tuple[Ball, ...]] = []
    steps = itertools.count()
    for end, row in zip(ends, run.values, strict=True):
        inputs = (parameters, [Ball.of(value) for value in row])
        while now < end and len(found) < len(wanted):
            asked = min(trial, end - now)
            step = _step(run.field, state, inputs, asked)
            if step is None or next(steps) > _MOST_STEPS:
                return None
            while len(found) < len(wanted) and wanted[len(found)] <= now + step.length:
                found.append(step.at(wanted[len(found)] - now))
            state, now = step.at(step.length), now + step.length
            trial = min(2 * trial if step.length == asked else step.length, _LONGEST_STEP)
    return found


def _instant(time_s: float) -> int:
    ball = Ball.of(time_s)
    if ball.rad or ball.mid < 0:
        raise ValueError(f"expected a time >= 0 of at most {PLACES} binary places, got {time_s!r}")
    return ball.mid


@final
@dataclass(frozen=True, slots=True)
class _Step:
    """A Taylor polynomial (coefficients[k][i]) whose last coefficient encloses the remainder."""

    coefficients: list[list[Ball]]
    length: int

    def at(self, since: int) -> tuple[Ball, ...]:
        """The state `since` units after the start, 0 <= since <= length."""
        time = Ball(since, 0)
        values = self.coefficients[-1]
        for row in reversed(self.coefficients[:-1]):
            values = [value * time + c for value, c in zip(values, row, strict=True)]
        return tuple(values)


def _step(
    field: TaylorField, state: tuple[Ball, ...], inputs: tuple[list[Ball], ...], length: int
) -> _Step | None:
    """A step of `length` or, where that fails, of a half, a quarter, ... of it."""
    while length > 0:
        order = _order(length)
        try:
            box = _picard(field, state, inputs, length)
            if box is not None:
                step = _taylor(field, state, box, inputs, (length, order))
                if order == 2 or _remainder(step) <= _REMAINDER:
                    return step
        except UndecidedError:
            pass
        if order == 2:
            return None
        length = length >> 1 if length > _KINK_STEP else length
    return None


def _order(length: int) -> int:
    if length <= _KINK_STEP:
        return 2
    if length <= ONE >> 20:
        return 6
    return 24 if length > ONE >> 10 else 12


def _taylor(
    field: TaylorField,
    state: tuple[Ball, ...],
    box: list[Ball],
    inputs: tuple[list[Ball], ...],
    size: tuple[int, int],
) -> _Step:
    length, order = size
    last = field.expand(_ALGEBRA, (box, *inputs), order).state[order]
    return _Step([*field.expand(_ALGEBRA, (state, *inputs), order - 1).state, last], length)


def _remainder(step: _Step) -> int:
    order = len(step.coefficients) - 1
    largest = max(abs(c.mid) + c.rad for c in step.coefficients[-1])
    for _ in range(order):
        largest = (largest * step.length >> PLACES) + 1
    return largest


def _picard(
    field: TaylorField, state: tuple[Ball, ...], inputs: tuple[list[Ball], ...], length: int
) -> list[Ball] | None:
    """A box that contains the solution over the step, or None."""
    box = list(state)
    for _ in range(_PICARD_TRIALS):
        rates = field.expand(_ALGEBRA, (box, *inputs), 1).state[1]
        swept = [_swept(x, rate, length) for x, rate in zip(state, rates, strict=True)]
        if all(s.lower >= b.lower and s.upper <= b.upper for s, b in zip(swept, box, strict=True)):
            return box
        box = [Ball(s.mid, s.rad + (s.rad - x.rad >> 2) + 2)
               for s, x in zip(swept, state, strict=True)]  # fmt: skip
    return None


def _swept(x: Ball, rate: Ball, length: int) -> Ball:
    """x + [0, length] rate."""
    lower = x.lower + min(0, (rate.lower * length) >> PLACES)
    upper = x.upper + max(0, ((rate.upper * length) >> PLACES) + 1)
    mid = (lower + upper) >> 1
    return Ball(mid, upper - mid)
