"""From a kernel's numbers to a verdict: every number is doubted before it is believed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

from workbench.claims import Verdict
from workbench.runtime.bundle import Result
from workbench.runtime.layout import (
    KERNEL_VERDICTS,
    NO_CLEARANCE_M,
    OCCUPANCY_NUMBERS,
    KernelStatus,
)

_STATUS_TEXTS = {
    KernelStatus.COMPLETE: "complete",
    KernelStatus.LEFT_REGION: "the tube left the path table or the operating region",
    KernelStatus.ENCLOSURE_FAILED: "no enclosure of the motion was found",
    KernelStatus.SINGULAR: "the path coordinates became singular",
    KernelStatus.BAD_INPUT: "the kernel found its input not finite or out of range",
}


@final
class CannotJudgeError(Exception):
    """Ends a judgement with INVALID; its text becomes the reason."""


@final
@dataclass(frozen=True, slots=True)
class Question:
    """What was asked, as far as the answer can be checked against it.

    initial_center: of the path states; people: names in the order sent; steps, step_s: the tube's.
    """

    initial_center: Sequence[float]
    people: tuple[str, ...]
    clearance_required_m: float
    steps: int
    step_s: float


@final
@dataclass(frozen=True, slots=True)
class Judgement:
    """Verdict with its reason and what was proved; see `Decision` for the fields."""

    verdict: Verdict
    reason: str
    clearance_m: float | None = None
    clearance_time_s: float | None = None
    clearance_person: str | None = None
    occupancy: Sequence[tuple[float, ...]] = field(default=(), repr=False)
    tube_lower: Sequence[tuple[float, ...]] = field(default=(), repr=False)
    tube_upper: Sequence[tuple[float, ...]] = field(default=(), repr=False)


def judge(result: Result, question: Question) -> Judgement:
    """Check a result and say what it means; raises CannotJudgeError for anything out of order.

    SAFE is believed only when the kernel ran to its end over all steps, every number is finite, the
    tube is ordered and starts around the initial centre, everybody was looked at, and the clearance
    reaches what was required.
    """
    if result.code != 0:
        raise CannotJudgeError(f"the kernel refused the query (code {result.code})")
    verdict = KERNEL_VERDICTS[_whole(result, "verdict", 0, len(KERNEL_VERDICTS) - 1)]
    status = KernelStatus(_whole(result, "status", 0, max(KernelStatus)))
    if verdict is Verdict.INVALID or status is KernelStatus.BAD_INPUT:
        raise CannotJudgeError(f"the kernel calls the query invalid: {_STATUS_TEXTS[status]}")
    steps = _whole(result, "steps_done", 0, question.steps)
    complete = status is KernelStatus.COMPLETE
    if complete and steps != question.steps:
        raise CannotJudgeError(f"the kernel says complete after {steps} of {question.steps} steps")
    if verdict is Verdict.SAFE and not complete:
        raise CannotJudgeError(f"the kernel says SAFE, but also: {_STATUS_TEXTS[status]}")
    width = len(question.initial_center)
    lower = result.rows("tube_lower", width=width, count=steps)
    upper = result.rows("tube_upper", width=width, count=steps)
    occupancy = result.rows("occupancy", width=OCCUPANCY_NUMBERS, count=steps)
    _check_tube(result, question, steps)
    clearance_m, time_s, person = _clearance(result, question)
    if verdict is Verdict.SAFE:
        reason = _safe_reason(clearance_m, person, question)
    elif not complete:
        reason = f"unproved: {_STATUS_TEXTS[status]} after {steps * question.step_s:.2f} s"
    elif person is None or clearance_m is None:
        raise CannotJudgeError("the kernel says unproved, but names nobody and no failure")
    else:
        reason = (
            f"unproved: separation from {person} at {time_s:.2f} s, clearance {clearance_m:.2f} m "
            f"of {question.clearance_required_m:.2f} m required"
        )
    return Judgement(verdict, reason, clearance_m, time_s, person, occupancy, lower, upper)


def _whole(result: Result, name: str, least: int, most: int) -> int:
    value = result.scalar(name)
    # NaN fails both comparisons, so it ends here too.
    if not (least <= value <= most and value == math.floor(value)):
        raise CannotJudgeError(
            f"the kernel's {name} is {value!r}, expected a whole number from {least} to {most}"
        )
    return int(value)


def _check_tube(result: Result, question: Question, steps: int) -> None:
    width = len(question.initial_center)
    lower = result.values("tube_lower")[: steps * width]
    upper = result.values("tube_upper")[: steps * width]
    occupancy = result.values("occupancy")[: steps * OCCUPANCY_NUMBERS]
    for name, numbers in (("tube", lower), ("tube", upper), ("occupancy", occupancy)):
        if not all(map(math.isfinite, numbers)):
            raise CannotJudgeError(f"the kernel's {name} holds numbers that are not finite")
    if any(low > high for low, high in zip(lower, upper, strict=True)):
        raise CannotJudgeError("the kernel's tube is inside out: a lower bound exceeds the upper")
    half_sizes = (*occupancy[3::OCCUPANCY_NUMBERS], *occupancy[4::OCCUPANCY_NUMBERS])
    if any(size < 0.0 for size in half_sizes):
        raise CannotJudgeError("the kernel's occupancy holds a rectangle of negative size")
    # zip ends early, with nothing to compare, when no step was done.
    for low, center, high in zip(lower, question.initial_center, upper, strict=False):
        if not low <= center <= high:
            raise CannotJudgeError("the kernel's tube does not start around the initial state")


def _clearance(result: Result, question: Question) -> tuple[float | None, float | None, str | None]:
    index = _whole(result, "clearance_person", -1, len(question.people) - 1)
    clearance_m, time_s = result.scalar("clearance_m"), result.scalar("clearance_time_s")
    horizon_s = question.steps * question.step_s
    if index < 0:
        if clearance_m != NO_CLEARANCE_M:
            raise CannotJudgeError(f"the kernel reports a clearance of {clearance_m!r} m to nobody")
        return None, None, None
    # A grid of times ends within rounding of the horizon, never a step beyond it.
    if not (math.isfinite(clearance_m) and 0.0 <= time_s <= horizon_s * (1.0 + 1e-9)):
        raise CannotJudgeError(
            f"the kernel reports a clearance of {clearance_m!r} m at {time_s!r} s, "
            f"the horizon is {horizon_s!r} s"
        )
    return clearance_m, time_s, question.people[index]


def _safe_reason(clearance_m: float | None, person: str | None, question: Question) -> str:
    if clearance_m is None:
        if question.people:
            raise CannotJudgeError("the kernel says SAFE without having looked at anybody")
        return "safe: nobody is near"
    if clearance_m < question.clearance_required_m:
        raise CannotJudgeError(
            f"the kernel says SAFE with a clearance of {clearance_m!r} m, "
            f"{question.clearance_required_m!r} m were required"
        )
    return f"safe: at least {clearance_m:.2f} m from {person}"
