"""From a kernel's numbers to answers: every number is doubted before it is believed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import final

from workbench.claims import Verdict
from workbench.runtime.bundle import Result
from workbench.runtime.layout import TUBES, KernelStatus
from workbench.runtime.person_tubes import TubeKind
from workbench.runtime.policies.cycle import Answer, Ground, ProvedTube, StopAnswer, Watched
from workbench.runtime.tube_answers import (
    KernelFaultError,
    Question,
    believed,
    kernel_tube,
    whole,
)

__all__ = [
    "CannotJudgeError",
    "Judgement",
    "KernelFaultError",
    "Question",
    "farthest_m",
    "judge",
    "unjudged",
]

# Rotating and adding four numbers errs by less than this, relatively.
_OUTWARD = 1.0 + 2.0**-48


@final
class CannotJudgeError(Exception):
    """Ends a judgement with INVALID; its text becomes the reason, its ground the answers'."""

    def __init__(self, reason: str, ground: Ground = Ground.READING) -> None:
        super().__init__(reason)
        self.ground = ground


@final
@dataclass(frozen=True, slots=True)
class Judgement:
    """What was found in one cycle, for the policies and for the decision.

    track_intent, brake_intent, brake_guard, stop_guard: see `Cycle`; level_verdicts, occupancy,
    tube_lower, tube_upper, stop_occupancy: see `Decision`.
    """

    track_intent: Answer
    brake_intent: Answer
    brake_guard: Answer
    stop_guard: StopAnswer
    level_verdicts: Mapping[str, tuple[Verdict, ...]] = field(default_factory=dict)
    occupancy: Sequence[tuple[float, ...]] = field(default=(), repr=False)
    tube_lower: Sequence[tuple[float, ...]] = field(default=(), repr=False)
    tube_upper: Sequence[tuple[float, ...]] = field(default=(), repr=False)
    stop_occupancy: Sequence[tuple[float, ...]] = field(default=(), repr=False)


def unjudged(reason: str, ground: Ground) -> Judgement:
    """Nothing was found, because of `reason`: every answer is INVALID."""
    answer = Answer(Verdict.INVALID, f"invalid: {reason}", None, None, None, 0.0, ground)
    nothing = ProvedTube((0.0,), (), ())
    stop = StopAnswer(answer, nothing, (math.inf, -math.inf), None, math.inf)
    return Judgement(answer, answer, answer, stop)


def judge(result: Result, question: Question) -> Judgement:
    """Check a result and say what it means; raises KernelFaultError for anything out of
    order, CannotJudgeError where the kernel refuses the query.

    SAFE is believed only when the tube is complete (TRACK: over all steps; the others: to
    standstill), every number of it is finite, it is ordered and starts around the measured set of
    the level that it is of, this level contains the deciding one, everybody was looked at, and the
    clearance reaches what was required.
    """
    if result.code != 0:
        raise KernelFaultError(f"the kernel refused the query (code {result.code})")
    status = KernelStatus(whole(result, "status", least=0, most=max(KernelStatus)))
    if status is KernelStatus.BAD_INPUT:
        raise CannotJudgeError(status.text)
    if status is not KernelStatus.COMPLETE:
        raise KernelFaultError(f"the kernel says of the whole query: {status.text}")
    whole(result, "spent", least=0, most=question.budget)
    track, stop, brake = (kernel_tube(result, name, question) for name in TUBES)
    return Judgement(
        believed(track, TubeKind.INTENT, question),
        believed(brake, TubeKind.INTENT, question),
        believed(brake, TubeKind.GUARD, question),
        StopAnswer(
            believed(stop, TubeKind.GUARD, question),
            ProvedTube(question.times_s[: len(stop.lower) + 1], stop.lower, stop.upper),
            question.switch_s,
            question.start_s,
            _above(farthest_m(stop.occupancy, question.watched) + question.clearance_required_m),
        ),
        {name: tube.verdicts for name, tube in zip(TUBES, (track, stop, brake), strict=True)},
        track.occupancy,
        track.lower,
        track.upper,
        stop.occupancy,
    )


def farthest_m(occupancy: Sequence[tuple[float, ...]], watched: Watched) -> float:
    """Largest distance (m) of a rectangle's corner from the centre of `watched`, rounded up.

    With the centre at (u, v) from the middle along and across the rectangle and half sizes a, b:
    sqrt((|u| + a)^2 + (|v| + b)^2). 0 without rectangles.
    """
    largest = 0.0
    for x, y, heading, half_length, half_width in occupancy:
        dx, dy = x - watched.x_m, y - watched.y_m
        c, s = math.cos(heading), math.sin(heading)
        along, across = abs(c * dx + s * dy) + half_length, abs(c * dy - s * dx) + half_width
        largest = max(largest, along * along + across * across)
    return math.sqrt(largest) * _OUTWARD


def _above(rounded: float) -> float:
    return math.nextafter(rounded, math.inf)
