"""What people may want on the bus: the ways that they may take, as discs at given times."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.protocols.codec import Decoded, Reason, Refusal
from workbench.runtime.protocols.frame_sets import FrameSet, NoSet, SetFault, SetLayout
from workbench.runtime.protocols.own_frames import OWN, encoded_frames
from workbench.runtime.protocols.people import PeopleSeen, SentPerson
from workbench.runtime.protocols.tables import load_protocol

MOST_KNOTS: Final = 16
"""Of a way."""
MOST_WAYS: Final = 3
"""Of a person: with the guard they are all the tubes of somebody that a decision takes."""
MOST_PARTS: Final = 96
"""Knots of all ways together."""
_PERIOD_ERROR_S: Final = 2.0**-30
_LAYOUT: Final = SetLayout(header="INTENTS", parts=("PERSON_WAY",), count="COUNT")
_EMPTY: Final = FrameSet(_LAYOUT)

Knot = tuple[float, float, float]
"""x, y and radius (m) of a disc that holds the whole body."""
Way = tuple[Knot, ...]
"""Discs at 0, 1, 2, ... periods after the stamp; in between the centre is on the straight line and
the radius is the larger of both."""


@final
@dataclass(frozen=True, slots=True)
class PersonWay:
    """One way of a set: index: place of the person in the set of people; knots: x and y from where
    that set has the person. The numbers are those of the frames: see `SentPerson`."""

    index: int
    knots: Way


@final
@dataclass(frozen=True, slots=True)
class IntentsSeen:
    """A whole set; number, stamp_s: those of the set of people that it belongs to.

    Of every person in it there are all ways, one after the other; more: some who have ways were
    left out.
    """

    number: int
    stamp_s: float
    knot_period_s: float
    more: bool
    ways: tuple[PersonWay, ...]


@final
@dataclass(frozen=True, slots=True)
class IntentSet:
    """Puts ways together from frames, as `FrameSet` describes; values in, the next value out.

    Parts have no number of their own. So a set is none (OUT_OF_ORDER), too, where persons, their
    intents and the knots do not come in order, where an intent or a knot is left out, and where a
    way has a single knot.
    """

    frames: FrameSet = _EMPTY

    def taking(self, frame: Decoded | Refusal) -> IntentSet:
        """The set after one more frame, of whatever message."""
        return IntentSet(self.frames.taking(frame))

    @property
    def outcome(self) -> IntentsSeen | NoSet:
        """All ways, or why there is no complete set."""
        found = self.frames.outcome
        if isinstance(found, NoSet):
            return found
        header, *parts = (frame.values for frame in found)
        groups = itertools.groupby(parts, key=lambda part: (int(part["INDEX"]), part["INTENT"]))
        rows = [(index, intent, list(knots)) for (index, intent), knots in groups]
        fault = _fault_in_order(rows)
        if fault is not None:
            return NoSet(SetFault.OUT_OF_ORDER, fault)
        ways = (
            PersonWay(index, tuple((knot["X"], knot["Y"], knot["RADIUS"]) for knot in knots))
            for index, _, knots in rows
        )
        period_s, more = header["KNOT_PERIOD"], bool(header["MORE"])
        return IntentsSeen(int(header["SET"]), header["STAMP"], period_s, more, tuple(ways))


def _fault_in_order(
    rows: Sequence[tuple[int, float, Sequence[Mapping[str, float]]]],
) -> str | None:
    """rows: person, intent and knots of each way in the order of arrival."""
    indices = [index for index, _, _ in rows]
    for place, (index, intent, knots) in enumerate(rows):
        expected, most = indices[:place].count(index), max(indices[: place + 1])
        numbers = [int(knot["KNOT"]) for knot in knots]
        named = f"knots {numbers} of intent {int(intent)} of {index}"
        if index < most or intent != expected:
            return f"{named}, expected intent {expected} of {most}"
        if len(numbers) < 2 or numbers != list(range(len(numbers))):
            return f"{named}, expected 0, 1 and so on"
    return None


@final
@dataclass(frozen=True, slots=True)
class SentIntents:
    """The frames (identifier, bytes) of a set in their order; left_out: whose ways are not in it,
    by track number, and why."""

    frames: tuple[tuple[int, bytes], ...]
    left_out: Mapping[int, str]


def intent_frames(
    people: PeopleSeen, ways: Mapping[int, Sequence[Way]], *, knot_period_s: float
) -> SentIntents | Refusal:
    """The ways of the people in a set, to be sent after it; or why its header cannot be sent.

    ways: by track number, the most important person first; absolute places in the frame of people.
    knot_period_s: a whole number of 5 ms, as it is not rounded. All ways of a person are sent or
    none: more than 3, a knot too far away, or what does not fit into the 96 knots of a set, leave
    that person out, which is said here and, by MORE, in the set. The receiver takes who has no way
    to go on as they do; nobody is dropped from the set of people.
    """
    placed = {person.track: (index, person) for index, person in enumerate(people.people)}
    chosen: dict[int, tuple[tuple[int, bytes], ...]] = {}
    left_out: dict[int, str] = {}
    room = MOST_PARTS
    for track, person_ways in ways.items():
        made = _person_frames(placed.get(track), person_ways, number=people.number)
        if not isinstance(made, str) and len(made[1]) > room:
            made = f"expected at most {room} more knots, got {len(made[1])}"
        if isinstance(made, str):
            left_out[track] = made
            continue
        index, frames = made
        chosen[index] = frames
        room -= len(frames)
    header = _header(people, MOST_PARTS - room, knot_period_s, more=bool(left_out))
    if isinstance(header, Refusal):
        return header
    parts = itertools.chain.from_iterable(chosen[index] for index in sorted(chosen))
    return SentIntents((*header, *parts), left_out)


def _header(
    people: PeopleSeen, count: int, knot_period_s: float, *, more: bool
) -> tuple[tuple[int, bytes], ...] | Refusal:
    values = {
        "SET": people.number, "COUNT": count, "MORE": more, "STAMP": people.stamp_s,
        "KNOT_PERIOD": knot_period_s,
    }  # fmt: skip
    frames = encoded_frames([("INTENTS", values)])
    if isinstance(frames, Refusal):
        return frames
    message = load_protocol(OWN).by_name["INTENTS"]
    signal = message.signal("KNOT_PERIOD")
    ((_, data),) = frames
    sent_s = signal.value_of(signal.raw_in(int.from_bytes(data, "big")))
    if abs(sent_s - knot_period_s) > _PERIOD_ERROR_S:
        detail = f"{knot_period_s!r}, expected a whole number of {signal.value_of(1):g} s"
        return Refusal(Reason.OUT_OF_RANGE, message.frame_id, message.name, signal.name, detail)
    return frames


def _person_frames(
    placed: tuple[int, SentPerson] | None, ways: Sequence[Way], *, number: int
) -> tuple[int, tuple[tuple[int, bytes], ...]] | str:
    """Place of the person in the set and the frames of all their ways, or why there are none."""
    if placed is None:
        return "expected the track of somebody in the set"
    if not 1 <= len(ways) <= MOST_WAYS:
        return f"expected 1 to {MOST_WAYS} ways, got {len(ways)}"
    index, person = placed
    wanted: list[tuple[str, dict[str, float]]] = []
    for intent, way in enumerate(ways):
        if not 2 <= len(way) <= MOST_KNOTS:
            return f"expected 2 to {MOST_KNOTS} knots, got {len(way)}"
        for knot, (x_m, y_m, radius_m) in enumerate(way):
            place = {"SET": number, "INDEX": index, "INTENT": intent, "KNOT": knot}
            disc = {"X": x_m - person.x_m, "Y": y_m - person.y_m, "RADIUS": radius_m}
            wanted.append(("PERSON_WAY", place | disc))
    frames = encoded_frames(wanted)
    return str(frames) if isinstance(frames, Refusal) else (index, frames)
