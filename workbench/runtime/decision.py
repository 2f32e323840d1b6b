"""What the monitor answers."""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from workbench.claims import Assumption, Rigor, Verdict

if TYPE_CHECKING:
    from workbench.runtime.policies.cycle import Alert, Ground, Outcome, Violation


class Action(enum.Enum):
    """What the vehicle does until the next decision."""

    TRACK = "TRACK"
    BRAKE = "BRAKE"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """One answer of the monitor.

    verdict: the worst of the deciding policies'; action: TRACK only if all of them say so; reason:
    theirs. brake_from_s: instant of the clock from which BRAKE is sent, if no later decision says
    otherwise (`Monitor.turn` does it). look_ahead, fail_safe: what each policy said, deciding or
    not. violations: hypotheses that failed; alert: whom not even braking is proved to keep clear
    of. grounds: what the deciding policies have against TRACK; () where nothing is but that braking
    once begun goes on.

    Of TRACK against where people are expected to go: clearance_m, clearance_time_s,
    clearance_person: smallest proved clearance over the horizon, when and to whom; None when there
    is none. occupancy (rows: centre x, y, heading, half length, half width), tube_lower, tube_upper
    (rows: path states): one row per proved time segment. stop_occupancy: the same of TRACK, then
    BRAKE to standstill. level_verdicts: by the name of the tube (track, stop, brake), a verdict for
    every nested set, the largest first; deciding_level: whose verdict counts. All of these are
    empty where the kernel's answer could not be had or believed.

    assumptions: what a SAFE rests on; rigor: grade of its mathematics. elapsed_s: duration of the
    step.
    """

    verdict: Verdict
    action: Action
    reason: str
    brake_from_s: float
    look_ahead: Outcome
    fail_safe: Outcome
    violations: tuple[Violation, ...]
    alert: Alert | None
    clearance_m: float | None
    clearance_time_s: float | None
    clearance_person: str | None
    occupancy: Sequence[tuple[float, ...]]
    tube_lower: Sequence[tuple[float, ...]]
    tube_upper: Sequence[tuple[float, ...]]
    stop_occupancy: Sequence[tuple[float, ...]]
    level_verdicts: Mapping[str, tuple[Verdict, ...]]
    deciding_level: str
    assumptions: tuple[Assumption, ...]
    elapsed_s: float
    rigor: Rigor
    grounds: tuple[Ground, ...] = ()
