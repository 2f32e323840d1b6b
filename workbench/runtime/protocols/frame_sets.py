"""Sets of frames that only count whole: header first, then every part, in order, of one counter."""

from __future__ import annotations

import dataclasses
import enum
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.protocols.codec import Decoded, Refusal
from workbench.runtime.protocols.integrity import counter_step

SET_BITS: Final = 8


class SetFault(enum.Enum):
    """Why there is no complete set."""

    NOTHING_YET = "no header was received"
    UNFINISHED = "parts are still missing"
    REFUSED = "a frame of the set was refused"
    OUT_OF_ORDER = "a part is missing, out of order, or of another set"
    REPEATED = "the set's counter repeats the one before"
    REGRESSED = "the set's counter or stamp goes backwards"
    OVER_CAPACITY = "there are more people than a set can hold"
    TRACK_TWICE = "two people carry the same track number"
    OTHER_PEOPLE = "it does not belong to the newest set of people"


@final
@dataclass(frozen=True, slots=True)
class NoSet:
    """There is no complete set, for a named reason. Nothing may be taken from its parts."""

    fault: SetFault
    detail: str = ""

    def __str__(self) -> str:
        return f"{self.fault.value}{f' ({self.detail})' if self.detail else ''}"


@final
@dataclass(frozen=True, slots=True)
class SetLayout:
    """How a set is sent: a header with SET and STAMP, then rounds of the named parts.

    count: the header's signal that says how many rounds follow (none: one); index: the parts'
    signal that counts the rounds from 0 (none: they do not say which round is theirs); over: the
    header's flag that the set holds more than it can.
    """

    header: str
    parts: tuple[str, ...]
    count: str | None = None
    index: str | None = None
    over: str | None = None


@final
@dataclass(frozen=True, slots=True)
class FrameSet:
    """Collects the frames of one layout, in the order of their arrival; `taking` returns the next.

    outcome: the frames of the last set once it is whole, header first, or why there is none.
    A frame must be the very one that comes next: same SET, right part, right INDEX. Any other, and
    any refused frame of this layout, breaks the set until the next header; a header begins a new
    one. The one exception: a frame that equals the one before in every value is dropped and counted
    (a controller may deliver a frame twice). A header whose SET repeats or goes backwards (by up to
    half the range), or whose STAMP does not grow, is not believed; a sender that restarts is
    refused until a new FrameSet is begun. Gaps between sets are no fault here: ages are the
    receiver's to check. Frames of other messages are ignored.

    completed, lost, duplicates: how many sets were whole, how many were begun and not finished,
    how many frames were dropped. What this cannot see: a frame that somebody else made, and one
    held back for exactly 256 sets that takes the place of a lost one.
    """

    layout: SetLayout
    outcome: tuple[Decoded, ...] | NoSet = NoSet(SetFault.NOTHING_YET)
    received: tuple[Decoded, ...] = ()
    before: Decoded | None = None
    last: tuple[int, float] | None = None
    completed: int = 0
    lost: int = 0
    duplicates: int = 0

    def taking(self, frame: Decoded | Refusal) -> FrameSet:
        """The collection after one more frame."""
        layout = self.layout
        if frame.message != layout.header and frame.message not in layout.parts:
            return self
        if isinstance(frame, Refusal):
            return self._broken(SetFault.REFUSED, str(frame), before=None)
        if frame == self.before:
            return dataclasses.replace(self, duplicates=self.duplicates + 1)
        if frame.message == layout.header:
            return self._with_header(frame)
        return self._with_part(frame)

    @property
    def _open(self) -> bool:
        return isinstance(self.outcome, NoSet) and self.outcome.fault is SetFault.UNFINISHED

    def _broken(self, fault: SetFault, detail: str, *, before: Decoded | None) -> FrameSet:
        return dataclasses.replace(
            self, outcome=NoSet(fault, detail), received=(), before=before,
            lost=self.lost + self._open,
        )  # fmt: skip

    def _with_header(self, header: Decoded) -> FrameSet:
        number, stamp_s = int(header.values["SET"]), header.values["STAMP"]
        fault = self._stale(number, stamp_s)
        if fault is not None:
            return self._broken(fault, f"SET {number}, STAMP {stamp_s:g} s", before=header)
        lost = self.lost + self._open
        begun = dataclasses.replace(self, before=header, last=(number, stamp_s), lost=lost)
        over = self.layout.over
        if over is not None and header.values[over]:
            outcome = NoSet(SetFault.OVER_CAPACITY, f"SET {number}")
            return dataclasses.replace(begun, outcome=outcome, received=())
        return begun._filled((header,))

    def _stale(self, number: int, stamp_s: float) -> SetFault | None:
        if self.last is None:
            return None
        last_number, last_s = self.last
        step = counter_step(last_number, number, bits=SET_BITS)
        if step == 0:
            return SetFault.REPEATED
        return SetFault.REGRESSED if step < 0 or stamp_s <= last_s else None

    def _with_part(self, part: Decoded) -> FrameSet:
        layout = self.layout
        if not self._open:
            keeps = isinstance(self.outcome, NoSet)
            stands = self if keeps else self._broken(_ORDER, _named(part), before=None)
            return dataclasses.replace(stands, before=part)
        index, kind = divmod(len(self.received) - 1, len(layout.parts))
        expected = layout.parts[kind]
        same_set = part.values["SET"] == self.received[0].values["SET"]
        same_index = layout.index is None or part.values[layout.index] == index
        if part.message != expected or not same_set or not same_index:
            of = "" if layout.index is None else f" of {index}"
            detail = f"{_named(part)}, expected {expected}{of}"
            return self._broken(_ORDER, detail, before=part)
        return dataclasses.replace(self, before=part)._filled((*self.received, part))

    def _filled(self, frames: tuple[Decoded, ...]) -> FrameSet:
        layout, header = self.layout, frames[0]
        rounds = 1 if layout.count is None else int(header.values[layout.count])
        missing = 1 + rounds * len(layout.parts) - len(frames)
        if missing:
            outcome = NoSet(SetFault.UNFINISHED, f"{missing} parts")
            return dataclasses.replace(self, outcome=outcome, received=frames)
        return dataclasses.replace(self, outcome=frames, received=(), completed=self.completed + 1)


_ORDER: Final = SetFault.OUT_OF_ORDER


def _named(part: Decoded) -> str:
    index = part.values.get("INDEX")
    of = "" if index is None else f" of {int(index)}"
    return f"{part.message}{of} in SET {int(part.values['SET'])}"
