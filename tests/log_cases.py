"""What tests of logs share: a header, turns with real decisions, and a core that is easy to check.

`EchoCore` sums up all it is given in order, and shows the sum in what it makes, so that nothing can
be left out, added, swapped or shifted by a microsecond without its frames and decisions changing.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from workbench.claims import Rigor, Verdict
from workbench.runtime import Action, Decision, MotionLimits, Observation, PathTable
from workbench.runtime.observation import ObservedPerson
from workbench.runtime.onboard.playback import DecisionLogged
from workbench.runtime.onboard.recorder import RecordedCore
from workbench.runtime.onboard.recorder_entries import (
    LoggedFrame,
    Mark,
    decision_of,
    turn_frames,
    turn_record,
)
from workbench.runtime.onboard.recorder_header import LogHeader
from workbench.runtime.person_guard import Disc, Guard
from workbench.runtime.person_tubes import Person
from workbench.runtime.policies.cycle import Alert, Hypothesis, Outcome, Violation, Watched
from workbench.runtime.protocols import Refusal
from workbench.runtime.protocols.own_frames import encoded_frames

TURN_US = 33_333
TURNS = 12


@dataclass(frozen=True, slots=True)
class Frame:
    """As the core's."""

    identifier: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Found:
    """As the core's."""

    fault: str
    detail: str
    since_us: int


@dataclass(frozen=True, slots=True)
class Result:
    """As the core's `TurnResult`."""

    at_us: int
    frames: tuple[Frame, ...]
    state: str
    decision: Decision | None
    decided_us: int | None
    observation: Observation | None
    faults: tuple[Found, ...]
    events: tuple[str, ...]


def header() -> LogHeader:
    """Of a straight path."""
    n = 5
    path = PathTable(
        0.0, 1.0, tuple(map(float, range(n))), (0.1 + 0.2,) * n, (0.0,) * n,
        (0.0,) * (n - 1), (0.0,) * (n - 1),
    )  # fmt: skip
    settings = {"least": 0.1 + 0.2, "names": ["a", "b"]}
    return LogHeader(
        "ab" * 32, "SHADOW", "pacmod2", path, settings, (2.3, 0.5, 0.7), 1_700_000_000_000_000,
        "workbench test",
    )  # fmt: skip


def outcome(name: str) -> Outcome:
    violation = Violation(Hypothesis.AGE, "0.4 s", refutes_plan=False)
    return Outcome(name, Verdict.SAFE, Action.TRACK, "clear", (violation,), None, None)


def observation(seed: float) -> Observation:
    """One person, whose numbers have no short decimal digits."""
    guard = Guard(-0.1, Disc(5.0, 1.0, 0.3), Disc(0.1, 0.2, 0.3), MotionLimits(2.5, 3.0))
    intent = Person("anna", 5.0, 1.0, 0.1, 0.2, 0.3, 0.1, 0.0).intent
    near = (seed / 3, math.nextafter(seed / 3, math.inf))
    return Observation(
        near, near, near, near, near, near, near, 2.8,
        (ObservedPerson("anna", (intent,), guard),), seed, Watched(0.0, 0.0, 30.0),
    )  # fmt: skip


def decision(seed: float) -> Decision:
    """A decision that is different for every seed, with 40 rows of everything."""
    rows = tuple(tuple(seed / (k + 3) + j for j in range(5)) for k in range(40))
    return Decision(
        verdict=Verdict.SAFE, action=Action.TRACK, reason=f"clear at {seed!r}",
        brake_from_s=math.inf, look_ahead=outcome("LookAhead"), fail_safe=outcome("FailSafe"),
        violations=(), alert=Alert("anna", "near"), clearance_m=seed / 7, clearance_time_s=None,
        clearance_person="anna", occupancy=rows, tube_lower=rows, tube_upper=rows,
        stop_occupancy=rows, level_verdicts={"track": (Verdict.SAFE, Verdict.UNPROVED)},
        deciding_level="likely", assumptions=(), elapsed_s=seed, rigor=Rigor.NUMERICAL,
    )  # fmt: skip


def own(name: str, **values: float) -> Frame:
    """A frame of ours."""
    frames = encoded_frames([(name, values)])
    assert not isinstance(frames, Refusal)
    return Frame(*frames[0])


class EchoCore:
    """Makes frames and decisions out of everything that it was ever given."""

    def __init__(self, *, decides_every: int = 3) -> None:
        self._heard = hashlib.sha256()
        self._turns = 0
        self._decides_every = decides_every

    def _take(self, *what: Any) -> None:
        self._heard.update(repr(what).encode())

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        self._take("frame", identifier, data, at_us)

    def receive_upstream(self, identifier: int, data: bytes, at_us: int) -> None:
        self._take("upstream", identifier, data, at_us)

    def bus_error(self, kind: Any, at_us: int) -> None:
        self._take("error", kind, at_us)

    def request(self, request: Any, at_us: int) -> None:
        self._take("request", request, at_us)

    def turn(self, at_us: int, clock: Callable[[], int]) -> Any:
        self._take("turn", at_us)
        decides = self._turns % self._decides_every == 0
        decided_us = clock() if decides else None
        self._take("decided", decided_us)
        count, tag = self._turns % 256, self._heard.digest()[0]
        stamp_s = round(at_us / 100) / 1e4
        frames = [
            Frame(0x6B, self._heard.digest()[:8]),
            own("HEARTBEAT", COUNTER=count, STATE=3, MODE=2, STAMP=stamp_s, BUNDLE_TAG=tag),
        ]
        made, seen = None, None
        if decides:
            seed = int.from_bytes(self._heard.digest()[:6], "big") / 7
            made, seen = decision(seed), observation(seed)
            frames.append(
                own("DECISION", COUNTER=count, ACTION=2, VERDICT=3, ALERT=1, STAMP=stamp_s,
                    PEOPLE_SET=tag)
            )  # fmt: skip
        faults = (Found("STALE_SPEED", "0.2 s", at_us),) if tag % 2 else ()
        events = ("began",) if self._turns == 0 else ()
        self._turns += 1
        return Result(at_us, tuple(frames), "TRACKING", made, decided_us, seen, faults, events)


def drive(core: Any, *, turns: int, frames: int = 5, details: Callable[[Any], None]) -> None:
    """So many turns with so many frames before each; a decision takes 1.234 ms."""
    for k in range(turns):
        at_us = k * TURN_US
        for j in range(frames):
            hear = core.receive_upstream if j == 1 else core.receive
            hear(0x6F + j, bytes([k % 256, j]), at_us + 7 * j)
        begun_us = at_us + TURN_US - 11
        details(core.turn(begun_us, lambda begun_us=begun_us: begun_us + 1234))


class Kept:
    """A recorder that keeps what it is told."""

    def __init__(self) -> None:
        self.lines: list[Any] = []

    def received(self, identifier: int, data: bytes, at_us: int, *, upstream: bool = False) -> None:
        self.lines.append(LoggedFrame(at_us, identifier, data, False, upstream))

    def mark(self, mark: Mark, number: int, at_us: int) -> None:
        self.lines.append(LoggedFrame.mark(mark, number, at_us=at_us))

    def turn(self, result: Any, ended_us: int | None) -> None:
        self.lines += turn_frames(result, ended_us)

    def details(self, result: Any) -> None:
        if result.decision is not None:
            said = json.loads(json.dumps(decision_of(turn_record(result))))
            self.lines.append(DecisionLogged(result.at_us, said))


def recorded() -> list[Any]:
    kept = Kept()
    core = RecordedCore(EchoCore(), kept)  # type: ignore[arg-type]
    drive(core, turns=TURNS, details=kept.details)
    return kept.lines
