"""A proved way to stop, and what must hold for it to be taken over."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

from workbench.claims import Verdict
from workbench.runtime.arc import Interval
from workbench.runtime.policies.cycle import (
    Cycle,
    Hypothesis,
    ProvedTube,
    StopAnswer,
    Violation,
)
from workbench.runtime.policies.guards import Scene
from workbench.runtime.policies.horizon import GRAIN_S, BrakeBounds
from workbench.sets import Box

SPEED = "speed"
"""The state, in m/s, that standstill is read from; below 0 the car stands."""


@final
@dataclass(frozen=True, slots=True)
class Plan:
    """TRACK, then BRAKE commanded at any instant of switch_s, then standstill by standstill_s.

    All instants are the clock's. tube: its rows count from scene.stamp_s; scene: the people it was
    proved against; names: of the rows' states; start_s: when TRACK must begin, None where it was in
    force at the stamp.
    """

    tube: ProvedTube = field(repr=False)
    names: tuple[str, ...]
    scene: Scene = field(repr=False)
    switch_s: Interval
    start_s: Interval | None
    standstill_s: float


def state_violation(plan: Plan, measured: Box, stamp_s: float) -> Violation | None:
    """STATE if the measured set and the plan's tube have no state in common at stamp_s.

    The measured set contains the state and so does the tube; where they are disjoint, one of them
    is wrong. More cannot be asked of a measurement: it reaches beyond the tube whenever its error
    is wider than the tube, with the state inside both. Speeds below 0 are standstill, in both.
    After the tube's end its last row holds: a standing car stays.
    """
    first, last = _rows_at(plan.tube.times_s, stamp_s - plan.scene.stamp_s)
    apart = [
        _apart(plan.names, plan.tube.lower[k], plan.tube.upper[k], measured)
        for k in range(first, last + 1)
    ]
    if not all(apart):
        return None
    return Violation(Hypothesis.STATE, f"{apart[-1]} is measured outside the proved tube", True)


def _rows_at(times_s: Sequence[float], elapsed_s: float) -> tuple[int, int]:
    end = len(times_s) - 2
    first = bisect_left(times_s, elapsed_s - GRAIN_S) - 1
    last = bisect_right(times_s, elapsed_s + GRAIN_S) - 1
    return min(max(first, 0), end), min(max(last, 0), end)


def _apart(
    names: Sequence[str], lower: Sequence[float], upper: Sequence[float], measured: Box
) -> str:
    """A state in which box and row are disjoint (or NaN), or the empty string."""
    for name, low, high in zip(names, lower, upper, strict=True):
        least, most = measured.interval(name)
        if name == SPEED:
            least, most, low, high = (max(value, 0.0) for value in (least, most, low, high))
        if not (least <= high and low <= most):
            return name
    return ""


def proved_standstill_s(
    tube: ProvedTube, names: Sequence[str], *, switch_by_s: float, brake: BrakeBounds
) -> float:
    """When after the stamp the car stands for certain; inf if the tube does not tell.

    The earlier one of: the begin of the rows, up to the last, whose speeds are all <= 0, not before
    the switch; and switch_by_s + `brake.stop_s` of the largest speed of the rows until then.
    """
    speeds = [row[list(names).index(SPEED)] for row in tube.upper]
    if not (speeds and all(map(math.isfinite, speeds)) and tube.times_s[-1] > switch_by_s):
        return math.inf
    begun = bisect_left(tube.times_s, switch_by_s)
    by_brake_s = switch_by_s + brake.stop_s(max(speeds[: max(begun, 1)]))
    k = len(speeds)
    while k > begun and speeds[k - 1] <= 0.0:
        k -= 1
    by_rows_s = tube.times_s[k] if k < len(speeds) else math.inf
    return min(by_rows_s, by_brake_s)


def fault_in_answer(
    cycle: Cycle, level: int, *, standstill_s: float, needed: Interval
) -> str | None:
    """Why the stop answer does not permit anything, or None.

    needed: the switch interval after the stamp that it must cover; standstill_s: after the stamp.
    """
    stop, measured = cycle.stop_guard, cycle.measured[level]
    answer, tube = stop.answer, stop.tube
    if answer.verdict is not Verdict.SAFE:
        return answer.reason
    if not (len(tube.times_s) == len(tube.lower) + 1 == len(tube.upper) + 1 >= 2):
        return "the tube has no rows, or not as many as times"
    ends = list(zip(tube.lower[0], measured.lower, measured.upper, tube.upper[0], strict=True))
    if tube.times_s[0] != 0.0 or not all(a <= b <= c <= d for a, b, c, d in ends):
        return "the tube does not start around the measured set"
    if not (stop.switch_s[0] <= needed[0] and needed[1] <= stop.switch_s[1]):
        return f"BRAKE may be commanded within {stop.switch_s} s, needed is {needed}"
    if not standstill_s <= min(answer.holds_s, tube.times_s[-1]):
        return (
            f"the car is proved to stand after {standstill_s:.2f} s, tube and guards hold for "
            f"{min(answer.holds_s, tube.times_s[-1]):.2f} s"
        )
    return None


def starts_fault(
    stop: StopAnswer, begun_s: float | None, *, stamp_s: float, granted: Interval
) -> str | None:
    """Why the tube's TRACK does not begin when the car's does, or None.

    begun_s: when TRACK was first commanded in this run, None before; granted: when it will be then.
    """
    if stop.start_s is None:
        if begun_s is None:
            return "the tube tracks from the stamp on, but the car stands"
        late = not begun_s <= stamp_s
        return "TRACK was commanded after the stamp, the tube has it before" if late else None
    first, last = granted if begun_s is None else (begun_s, begun_s)
    least, most = stop.start_s
    if least <= first - stamp_s and last - stamp_s <= most:
        return None
    return (
        f"TRACK begins {first - stamp_s:.3f} to {last - stamp_s:.3f} s after the stamp, the tube "
        f"has {stop.start_s}"
    )
