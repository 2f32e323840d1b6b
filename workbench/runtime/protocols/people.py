"""People on the bus: up to 32 tracks as one set of frames, and what more than 32 mean."""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.protocols.codec import Decoded, Refusal
from workbench.runtime.protocols.frame_sets import FrameSet, NoSet, SetFault, SetLayout
from workbench.runtime.protocols.own_frames import encoded_frames

CAPACITY: Final = 32
_LAYOUT: Final = SetLayout(
    header="PEOPLE",
    parts=("PERSON_POSITION", "PERSON_MOTION", "PERSON_TRACK"),
    count="COUNT",
    index="INDEX",
    over="MORE",
)
_EMPTY: Final = FrameSet(_LAYOUT)


@final
class PersonKind(enum.IntEnum):
    """Who it is: the choices of KIND. ASSUMED: nobody was seen there, and somebody may be."""

    ON_FOOT = 0
    ON_WHEELS = 1
    ASSUMED = 2


@final
@dataclass(frozen=True, slots=True)
class SentPerson:
    """One person of a set: discs of position (m) and velocity (m/s) in the localisation's frame.

    track: number that stays the same from set to set; age_s: how long before the set's stamp they
    were there. The numbers are those of the frames: add `worst_rounding` of their signals before
    relying on a disc.
    """

    track: int
    kind: PersonKind
    x_m: float
    y_m: float
    position_radius_m: float
    x_speed_mps: float
    y_speed_mps: float
    velocity_radius_mps: float
    age_s: float


@final
@dataclass(frozen=True, slots=True)
class PeopleSeen:
    """A whole set: everybody within watched_radius_m of the vehicle, at the sender's stamp_s."""

    number: int
    stamp_s: float
    watched_radius_m: float
    people: tuple[SentPerson, ...]


@final
@dataclass(frozen=True, slots=True)
class PersonSet:
    """Puts people together from frames, as `FrameSet` describes; values in, the next value out.

    More than 32 people (MORE is set) are never truncated: there is no set (OVER_CAPACITY), the
    situation cannot be judged, and the answer to that is BRAKE. Two people of one track number
    are no set either (TRACK_TWICE).
    """

    frames: FrameSet = _EMPTY

    def taking(self, frame: Decoded | Refusal) -> PersonSet:
        """The set after one more frame, of whatever message."""
        return PersonSet(self.frames.taking(frame))

    @property
    def outcome(self) -> PeopleSeen | NoSet:
        """Everybody, or why there is no complete set."""
        found = self.frames.outcome
        if isinstance(found, NoSet):
            return found
        header, *parts = (frame.values for frame in found)
        people = tuple(
            _person({**position, **motion, **track})
            for position, motion, track in zip(parts[::3], parts[1::3], parts[2::3], strict=True)
        )
        if len({person.track for person in people}) < len(people):
            return NoSet(SetFault.TRACK_TWICE, f"{[person.track for person in people]}")
        return PeopleSeen(int(header["SET"]), header["STAMP"], header["WATCHED_RADIUS"], people)


def _person(values: Mapping[str, float]) -> SentPerson:
    return SentPerson(
        track=int(values["TRACK"]),
        kind=PersonKind(int(values["KIND"])),
        x_m=values["X"],
        y_m=values["Y"],
        position_radius_m=values["POSITION_RADIUS"],
        x_speed_mps=values["X_SPEED"],
        y_speed_mps=values["Y_SPEED"],
        velocity_radius_mps=values["VELOCITY_RADIUS"],
        age_s=values["AGE"],
    )


def people_frames(
    people: Sequence[SentPerson], *, number: int, stamp_s: float, watched_radius_m: float
) -> tuple[tuple[int, bytes], ...] | Refusal:
    """The frames (identifier, bytes) of a set in their order, or why a value cannot be sent.

    Of more than 32 people only a header goes out, with MORE set: the receiver brakes. Whoever
    cannot be sent, say for a radius beyond 20 m, must not be left out by the caller: send MORE, or
    nothing.
    """
    over = len(people) > CAPACITY
    header = {
        "SET": number, "COUNT": min(len(people), CAPACITY), "MORE": over, "STAMP": stamp_s,
        "WATCHED_RADIUS": watched_radius_m,
    }  # fmt: skip
    wanted: list[tuple[str, dict[str, float]]] = [("PEOPLE", header)]
    for index, person in enumerate(() if over else people):
        place = {"SET": number, "INDEX": index}
        wanted += [(name, place | values) for name, values in _parts(person).items()]
    return encoded_frames(wanted)


def _parts(person: SentPerson) -> dict[str, dict[str, float]]:
    p = person
    return {
        "PERSON_POSITION": {"X": p.x_m, "Y": p.y_m},
        "PERSON_MOTION": {
            "X_SPEED": p.x_speed_mps,
            "Y_SPEED": p.y_speed_mps,
            "VELOCITY_RADIUS": p.velocity_radius_mps,
        },
        "PERSON_TRACK": {
            "KIND": p.kind,
            "TRACK": p.track,
            "POSITION_RADIUS": p.position_radius_m,
            "AGE": p.age_s,
        },
    }
