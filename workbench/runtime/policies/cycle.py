"""What the policies are given each cycle, and what they answer."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

from workbench.claims import Verdict
from workbench.runtime.arc import Interval
from workbench.runtime.decision import Action
from workbench.runtime.person_guard import Guard
from workbench.sets import Box


@final
@dataclass(frozen=True, slots=True)
class ProvedTube:
    """Rows of a tube: row k encloses every path state on [times_s[k], times_s[k + 1]] (s after the
    stamp; K + 1 times, the first 0); lower, upper: K rows of path states."""

    times_s: Sequence[float]
    lower: Sequence[Sequence[float]]
    upper: Sequence[Sequence[float]]


class Ground(enum.Enum):
    """What stands against TRACK; the reason beside it says it in words.

    PEOPLE: clearance from somebody is not proved, or people are not who and where they were taken
    to be. MOTION: the car's own motion is not proved to the end that was asked for, or is not as it
    was proved. REGION: what is measured or asked for lies outside of what the proof covers.
    READING: what is measured is missing or cannot be used. TIME: a clock, an age or an instant is
    out of order. ARITHMETIC: the kernel, its arithmetic or the program cannot be trusted.
    """

    PEOPLE = "people"
    MOTION = "motion"
    REGION = "region"
    READING = "reading"
    TIME = "time"
    ARITHMETIC = "arithmetic"


@final
@dataclass(frozen=True, slots=True)
class Answer:
    """What the kernel found for one tube against one kind of the people's tubes.

    verdict: SAFE, UNPROVED, or INVALID for what could not be judged; reason: a sentence;
    clearance_m, clearance_time_s (after the stamp), clearance_person: the smallest proved
    clearance, None with nobody; holds_s: until when after the stamp tube and people's tubes were
    compared. ground: why it is not SAFE, None where it is.
    """

    verdict: Verdict
    reason: str
    clearance_m: float | None
    clearance_time_s: float | None
    clearance_person: str | None
    holds_s: float
    ground: Ground | None = None


@final
@dataclass(frozen=True, slots=True)
class StopAnswer:
    """The answer for TRACK, then BRAKE to standstill, against the guards.

    tube: its rows; switch_s: every instant after the stamp at which BRAKE may be commanded;
    start_s: None where TRACK is in force at the stamp; otherwise the car stands at the stamp and
    TRACK is commanded at any instant of this interval after it. farthest_m: everything within
    the clearance that is required of the body stays within this distance of the centre of
    `Cycle.watched`, all along the tube.
    """

    answer: Answer
    tube: ProvedTube = field(repr=False)
    switch_s: Interval
    start_s: Interval | None
    farthest_m: float


@final
@dataclass(frozen=True, slots=True)
class SeenPerson:
    """Somebody at one instant, and how they may move from then on.

    guard: discs that contain position (the body included) and velocity, and the limits; its at_s is
    an instant of the clock, not after the stamp. assumed: nobody was seen; somebody may be there,
    at the edge of what is seen.
    """

    name: str
    guard: Guard
    assumed: bool = False


@final
@dataclass(frozen=True, slots=True)
class Watched:
    """A disc (m) within which everybody is among the cycle's people, seen or assumed."""

    x_m: float
    y_m: float
    radius_m: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """One observation and what the kernel answered about it; times from one monotonic clock.

    stamp_s: instant at which `measured` and `watched` hold; started_s, finished_s: of the check,
    the latter taken just before the policies are asked. measured: nested boxes of path states,
    largest first. track_intent: TRACK over the look-ahead time against intent tubes; brake_intent,
    brake_guard: BRAKE to standstill against intent tubes and guards; stop_guard: see `StopAnswer`.
    fault: why the arithmetic of this cycle cannot be trusted (rounding mode, kernel), or None.
    """

    stamp_s: float
    started_s: float
    finished_s: float
    measured: tuple[Box, ...]
    people: tuple[SeenPerson, ...]
    watched: Watched
    track_intent: Answer
    brake_intent: Answer
    brake_guard: Answer
    stop_guard: StopAnswer
    fault: str | None


class Hypothesis(enum.Enum):
    """What the guarantee rests on, as far as a cycle can refute it; docs/fail-safe-induction.md."""

    CLOCK = "times come from one monotonic clock"
    ARITHMETIC = "the floating-point mode and the kernel are in order"
    AGE = "the check ended soon enough after its stamp"
    ON_TIME = "the check ended before the switch of the plan in force"
    SENDER = "BRAKE was sent within the switch interval of the plan in force"
    STATE = "the state lies in the proved tube"
    PEOPLE = "people move within the guard of the plan in force"
    NOBODY_NEW = "new people were covered by somebody assumed or came from beyond the watched disc"
    NOBODY_LOST = "everybody the plan in force knows is still known or covered"
    STANDSTILL = "the car stands once its brake must have stopped it"


@final
@dataclass(frozen=True, slots=True)
class Violation:
    """A hypothesis that failed, and how.

    refutes_plan: the proof of the plan in force no longer holds, so the car brakes at once;
    otherwise that plan is carried out.
    """

    hypothesis: Hypothesis
    detail: str
    refutes_plan: bool

    def __str__(self) -> str:
        return f"{self.hypothesis.name}: {self.detail}"


@final
@dataclass(frozen=True, slots=True)
class Alert:
    """A warning to a person: not even braking is proved to keep clear of them."""

    person: str | None
    reason: str


@final
@dataclass(frozen=True, slots=True)
class Outcome:
    """What one policy says of one cycle.

    action: TRACK is permission until brake_from_s (None: until the next decision); BRAKE is to be
    sent from brake_from_s on (a clock instant). verdict: of the tube that decides; reason: a
    sentence; violations: hypotheses that failed, to be logged by name; alert: see `Alert`.
    """

    policy: str
    verdict: Verdict
    action: Action
    reason: str
    violations: tuple[Violation, ...]
    alert: Alert | None
    brake_from_s: float | None
