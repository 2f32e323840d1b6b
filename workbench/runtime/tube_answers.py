"""One of the kernel's tubes, read with doubt, and what it answers about the people's tubes."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.claims import Verdict
from workbench.runtime.arc import Interval
from workbench.runtime.bundle import Result, Rows
from workbench.runtime.layout import (
    KERNEL_VERDICTS,
    NO_CLEARANCE_M,
    OCCUPANCY_NUMBERS,
    KernelCause,
    KernelStatus,
)
from workbench.runtime.person_tubes import MOST_TUBES, TubeKind
from workbench.runtime.policies.cycle import Answer, Ground, Watched
from workbench.runtime.policies.plan import SPEED
from workbench.sets import Box

TRACK, STOP, BRAKE = "track", "stop", "brake"


@final
class KernelFaultError(Exception):
    """The kernel's answer contradicts itself or the question; its text says how."""


@final
@dataclass(frozen=True, slots=True)
class Question:
    """What was asked, as far as the answer can be checked against it.

    measured: the nested sets of path states, the largest first; deciding: index of the one that
    counts; people: names in the order sent; times_s: of the rows, after the stamp, one more than
    rows; budget: most steps that one call may spend; switch_s, start_s: of the stop tube, see
    `StopAnswer`.
    """

    measured: tuple[Box, ...]
    deciding: int
    people: tuple[str, ...]
    clearance_required_m: float
    times_s: Sequence[float]
    budget: int
    watched: Watched
    switch_s: Interval
    start_s: Interval | None


@final
@dataclass(frozen=True, slots=True)
class Nearest:
    """The nearest person of one kind of tube; clearance_m: None with nobody, or where none is
    proved; person: None with nobody."""

    cause: KernelCause
    clearance_m: float | None
    time_s: float
    person: str | None


@final
@dataclass(frozen=True, slots=True)
class KernelTube:
    """A tube that is in order: its rows, whether they are all that was asked for, its verdicts."""

    name: str
    verdicts: tuple[Verdict, ...]
    verdict: Verdict
    status: KernelStatus
    ends_s: float
    nearest: dict[TubeKind, Nearest]
    lower: Rows
    upper: Rows
    occupancy: Rows

    @property
    def complete(self) -> bool:
        """Whether it is proved to its end."""
        return self.status is KernelStatus.COMPLETE


def kernel_tube(result: Result, name: str, question: Question) -> KernelTube:
    """One of the result's tubes; raises KernelFaultError for any number that is out of order."""
    steps, width = len(question.times_s) - 1, len(question.measured[0].names)
    verdicts = _verdicts(result, name, len(question.measured))
    status = KernelStatus(whole(result, f"{name}_status", least=0, most=max(KernelStatus)))
    if status is KernelStatus.BAD_INPUT:
        raise KernelFaultError(f"the kernel calls the query invalid: {status.text}")
    rows = whole(result, f"{name}_rows", least=0, most=steps)
    level = whole(result, f"{name}_level", least=-1, most=question.deciding)
    whole(result, f"{name}_cells", least=0 if level < 0 else 1, most=question.budget)
    tube = KernelTube(
        name,
        verdicts,
        verdicts[question.deciding],
        status,
        question.times_s[rows],
        {kind: _nearest(result, f"{name}_{kind}", question) for kind in TubeKind},
        result.rows(f"{name}_lower", width=width, count=rows),
        result.rows(f"{name}_upper", width=width, count=rows),
        result.rows(f"{name}_occupancy", width=OCCUPANCY_NUMBERS, count=rows),
    )
    _check_rows(tube)
    if rows:
        _check_begin(tube, level, question)
    _check_end(tube, rows, question)
    return tube


def believed(tube: KernelTube, kind: TubeKind, question: Question) -> Answer:
    """What the tube answers about people's tubes of one kind; raises KernelFaultError where the
    kernel says SAFE and its numbers do not.

    BRAKE is compared with both kinds at once, under one verdict: SAFE is then what the numbers of
    each kind say, but not of both where the kernel does not say so.
    """
    nearest = tube.nearest[kind]
    fault = _objection(tube, nearest, question)
    if tube.verdict is Verdict.SAFE and fault:
        raise KernelFaultError(f"the kernel says SAFE of the tube {tube.name}, but also: {fault}")
    safe = not fault
    if tube.verdict is not Verdict.SAFE:
        others = [tube.nearest[other] for other in TubeKind if other is not kind]
        safe = safe and tube.name == BRAKE and any(_objection(tube, o, question) for o in others)
        fault = fault or "not proved within the kernel's budget"
    if not safe:
        verdict, reason = Verdict.UNPROVED, f"unproved: {fault}"
    elif nearest.clearance_m is None:
        verdict, reason = Verdict.SAFE, "safe: nobody is near"
    else:
        verdict = Verdict.SAFE
        reason = f"safe: at least {nearest.clearance_m:.2f} m from {nearest.person}"
    time_s = None if nearest.clearance_m is None else nearest.time_s
    ground = Ground.PEOPLE if tube.complete else Ground.MOTION
    return Answer(
        verdict, reason, nearest.clearance_m, time_s, nearest.person, tube.ends_s,
        None if safe else ground,
    )  # fmt: skip


def whole(result: Result, name: str, *, least: int, most: int, at: int = 0) -> int:
    """The field's number at an index, which must be whole and within the limits."""
    value = result.values(name)[at]
    # NaN fails both comparisons, so it ends here too.
    if not (least <= value <= most and value == math.floor(value)):
        raise KernelFaultError(
            f"the kernel's {name} is {value!r}, expected a whole number from {least} to {most}"
        )
    return int(value)


def _verdicts(result: Result, name: str, levels: int) -> tuple[Verdict, ...]:
    field, most = f"{name}_verdicts", len(KERNEL_VERDICTS) - 1
    verdicts = tuple(
        KERNEL_VERDICTS[whole(result, field, least=0, most=most, at=level)]
        for level in range(levels)
    )
    if Verdict.INVALID in verdicts:
        raise KernelFaultError(f"the kernel calls the tube {name} invalid, but not the query")
    # What is proved of a set is proved of every set in it.
    if Verdict.SAFE in verdicts and Verdict.UNPROVED in verdicts[verdicts.index(Verdict.SAFE) :]:
        raise KernelFaultError(f"the kernel says SAFE of a set, but not of a smaller one: {field}")
    return verdicts


def _nearest(result: Result, name: str, question: Question) -> Nearest:
    clearance_m, time_s = result.values(name)[:2]
    index = whole(result, name, least=-1, most=len(question.people) - 1, at=2)
    whole(result, name, least=-1, most=MOST_TUBES - 1, at=3)
    cause = KernelCause(whole(result, name, least=0, most=max(KernelCause), at=4))
    person = None if index < 0 else question.people[index]
    none = NO_CLEARANCE_M if cause is KernelCause.PROVED else -NO_CLEARANCE_M
    proved = cause is KernelCause.PROVED and person is not None
    late_s = 0.0 if question.start_s is None else question.start_s[1]
    # A grid of times ends within rounding of the horizon, never a step beyond it.
    last_s = (question.times_s[-1] + late_s) * (1.0 + 1e-9)
    if not (math.isfinite(clearance_m) and 0.0 <= time_s <= last_s):
        raise KernelFaultError(
            f"the kernel reports a clearance of {clearance_m!r} m at {time_s!r} s, "
            f"its tubes end at {last_s!r} s"
        )
    if proved != (abs(clearance_m) < NO_CLEARANCE_M) or not (proved or clearance_m == none):
        raise KernelFaultError(
            f"the kernel reports a clearance of {clearance_m!r} m to {person or 'nobody'}, and as "
            f"its cause {cause.name}"
        )
    return Nearest(cause, clearance_m if proved else None, time_s, person)


def _check_rows(tube: KernelTube) -> None:
    lower, upper, occupancy = (r.numbers for r in (tube.lower, tube.upper, tube.occupancy))
    # A sum is finite only if every term is.
    for what, numbers in (("tube", lower), ("tube", upper), ("occupancy", occupancy)):
        if not math.isfinite(sum(numbers)):
            raise KernelFaultError(f"the kernel's {what} {tube.name} holds numbers not finite")
    if any(map(operator.gt, lower, upper)):
        raise KernelFaultError(
            f"the kernel's tube {tube.name} is inside out: a lower bound exceeds the upper"
        )
    sizes = (*occupancy[3::OCCUPANCY_NUMBERS], *occupancy[4::OCCUPANCY_NUMBERS])
    if sizes and min(sizes) < 0.0:
        raise KernelFaultError(
            f"the kernel's occupancy {tube.name} holds a rectangle of negative size"
        )


def _check_begin(tube: KernelTube, level: int, question: Question) -> None:
    if level < 0:
        raise KernelFaultError(f"the kernel's tube {tube.name} has rows, but is of no level")
    box = question.measured[level]
    low, high = tube.lower[0], tube.upper[0]
    if any(map(operator.gt, low, box.lower)) or any(map(operator.lt, high, box.upper)):
        raise KernelFaultError(
            f"the kernel's tube {tube.name} does not start around the measured state"
        )


def _check_end(tube: KernelTube, rows: int, question: Question) -> None:
    if not tube.complete:
        return
    steps = len(question.times_s) - 1
    if tube.name == TRACK and rows != steps:
        raise KernelFaultError(f"the kernel says complete after {rows} of {steps} steps")
    speed = question.measured[0].names.index(SPEED)
    if not rows or (tube.name != TRACK and tube.upper[-1][speed] > 0.0):
        raise KernelFaultError(f"the kernel calls the tube {tube.name} complete before standstill")


def _objection(tube: KernelTube, nearest: Nearest, question: Question) -> str:
    """Why the numbers do not say SAFE, or the empty string."""
    required_m = question.clearance_required_m
    if not tube.complete:
        return f"{tube.status.text} after {tube.ends_s:.2f} s"
    if nearest.cause is not KernelCause.PROVED:
        who = nearest.person or "somebody"
        return f"{_CAUSES[nearest.cause]} {who} at {nearest.time_s:.2f} s"
    if nearest.clearance_m is None:
        return "nobody was looked at" if question.people else ""
    if nearest.clearance_m < required_m:
        return (
            f"separation from {nearest.person} at {nearest.time_s:.2f} s, clearance "
            f"{nearest.clearance_m:.2f} m of {required_m:.2f} m required"
        )
    return ""


_CAUSES = {
    KernelCause.NOT_PREDICTED: "nothing is predicted of",
    KernelCause.NOT_COMPUTED: "no distance was found to",
    KernelCause.NOT_ASKED: "nobody asked about",
}
