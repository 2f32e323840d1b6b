"""How steadily the real loop turns in real time, and what answers a deadline that it misses."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, final

import numpy as np

from workbench.bench.onboard_programs import Cores, told_by
from workbench.bench.onboard_turns import Told, told
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.states import COMMANDING, State
from workbench.runtime.onboard.times import TURN_US


class TurnSeen(NamedTuple):
    """A turn: its begin, the end of its decision, its end, when its set of commands was whole (us);
    frames that were made and not sent, of all turns so far; its state afterwards, its faults."""

    begun_us: int
    decided_us: int | None
    ended_us: int
    set_us: int | None
    unsent: int
    state: str
    faults: Sequence[str]


@final
@dataclass(frozen=True, slots=True)
class Missed:
    """Deadlines of one kind that one answer followed.

    kind: "turn begun late" (more than the proof's gap after the last), "decision late" (more than
    its latency after its turn's begin), "frames not sent in time" (they stay), "set on the bus
    late" (whole later after the last turn's begin than the gap), "turn ended late" (after the next
    one was due). answered: whether the answer is the one that is owed; a late set that brakes is
    its own, and a turn that ended late owes none but the next one at once.
    """

    kind: str
    answer: str
    times: int
    answered: bool


@final
@dataclass(frozen=True, slots=True)
class Period:
    """The loop over some seconds.

    jitter_us: how far the time between the begins of two turns is from the period; gap_us: longest
    between two whole sets of commands, as long as it commanded; from_begin_us: longest from a
    turn's begin until the next one's set was whole; states: share of the turns; stale: frames that
    were dropped because they might have waited too long.
    """

    cores: Cores
    seconds: float
    turns: int
    jitter_us: Told
    gap_us: int | None
    from_begin_us: int | None
    missed: tuple[Missed, ...]
    states: dict[str, float]
    stale: int

    @property
    def unanswered(self) -> int:
        """Missed deadlines without the answer that is owed."""
        return sum(each.times for each in self.missed if not each.answered)


def period(bundle: Path, seconds: float, *, cores: Cores) -> Period:
    """Run the loop on the `virtual` bus for so long."""
    with told_by("onboard_live.py", [str(bundle), repr(seconds)], cores=cores) as (said, _):
        seen = [TurnSeen(*each) for each in said["turns"]]
        gap_s, latency_s = said["allowed_s"]
    begun = np.array([turn.begun_us for turn in seen], dtype=float)
    counts = Counter(turn.state for turn in seen)
    sets = [*_sets(seen)]
    pairs = [(begun_us, before, now) for begun_us, before, now in sets if before is not None]
    return Period(
        cores, seconds, len(seen), told(np.abs(np.diff(begun) - TURN_US)),
        max((now - before for _, before, now in pairs), default=None),
        max((now - begun_us for begun_us, _, now in pairs), default=None),
        missed_deadlines(seen, gap_us=gap_s * 1e6, latency_us=latency_s * 1e6),
        {name: count / len(seen) for name, count in counts.items()}, said["stale"],
    )  # fmt: skip


def _sets(seen: Sequence[TurnSeen]) -> Iterator[tuple[int, int | None, int]]:
    """For every whole set: the begin of the turn before, when the last one was whole (None: it did
    not command in between), when this one was."""
    before_us: int | None = None
    for last, turn in itertools.pairwise(seen):
        if State[turn.state] not in COMMANDING:
            before_us = None
        elif turn.set_us is not None:
            yield last.begun_us, before_us, turn.set_us
            before_us = turn.set_us


def missed_deadlines(
    seen: Sequence[TurnSeen], *, gap_us: float, latency_us: float
) -> tuple[Missed, ...]:
    """Every deadline that was missed, by what followed."""
    found: Counter[tuple[str, str, bool]] = Counter()
    for last, turn, after in zip(seen, seen[1:], seen[2:], strict=False):
        late_us = turn.begun_us - last.begun_us
        decided_us = turn.begun_us if turn.decided_us is None else turn.decided_us
        set_us = last.begun_us if turn.set_us is None else turn.set_us
        tracks = turn.state == State.TRACKING.name
        for kind, holds, owed in (
            ("turn begun late", late_us > gap_us, Fault.LATE_TURN),
            ("decision late", decided_us - turn.begun_us > latency_us, Fault.OVERRUN),
            ("frames not sent in time", turn.unsent > last.unsent, Fault.NOT_COVERED),
            ("set on the bus late", set_us - last.begun_us > gap_us,
             Fault.NOT_COVERED if tracks else None),
            ("turn ended late", turn.ended_us - turn.begun_us > TURN_US, None),
        ):  # fmt: skip
            if holds:
                named = {*turn.faults, *after.faults}
                answered = owed is None or owed.name in named
                found[kind, _answer(named, after, owed), answered] += 1
    return tuple(
        Missed(kind, answer, times, answered)
        for (kind, answer, answered), times in sorted(found.items())
    )


def _answer(named: set[str], after: TurnSeen, owed: Fault | None) -> str:
    """What the turn or the next one said, and the state that followed."""
    told_us = {each.name for each in _TIMELY} & named
    if owed is not None and owed.name not in named:
        told_us |= {f"no {owed.name}"}
    said = ", ".join(sorted(told_us)) or "no fault"
    return f"{said}; {after.state}"


_TIMELY = (Fault.LATE_TURN, Fault.OVERRUN, Fault.BUS_ERROR, Fault.NOT_COVERED)
