"""Where a person may be over time: tubes of moving, growing discs, from predictions and guards."""

from __future__ import annotations

import enum
import itertools
import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError

MOST_PEOPLE = 32
MOST_TUBES = 4
"""Tubes per person."""
MOST_PIECES = 16
"""Pieces per tube, all its bounds together."""
TUBE_NUMBERS = 5
"""Doubles per tube: person, kind, until_s, first piece, pieces."""
PIECE_NUMBERS = 9
"""Doubles per piece: bound, from_s, x, y, vx, vy, radius, growth, growth2."""
FOREVER_S = 1e9
"""What `until_s` says of a tube without an end."""

PIECE_LIMITS = {
    "from_s": (-FOREVER_S, FOREVER_S),
    "x_m": (-1e7, 1e7),
    "y_m": (-1e7, 1e7),
    "vx_mps": (-100.0, 100.0),
    "vy_mps": (-100.0, 100.0),
    "radius_m": (0.0, 1e4),
    "growth_mps": (-1e4, 1e4),
    "growth2_mps2": (0.0, 1e4),
}
"""Least and largest value of every number of a piece: no later product can overflow."""
_LEAST, _MOST = zip(*PIECE_LIMITS.values(), strict=True)


@final
@dataclass(frozen=True, slots=True)
class Person:
    """A disc that contains a person from now on.

    At time tau (s) after the observation: centre (x_m + vx_mps tau, y_m + vy_mps tau), radius
    radius_m + growth_mps tau + growth_mps2 tau^2 / 2.
    """

    name: str
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    radius_m: float
    growth_mps: float
    growth_mps2: float

    @property
    def numbers(self) -> tuple[float, ...]:
        """Centre, velocity, radius and its growth, in the order of a piece's numbers."""
        place = (self.x_m, self.y_m, self.vx_mps, self.vy_mps)
        return (*place, self.radius_m, self.growth_mps, self.growth_mps2)

    @property
    def intent(self) -> PersonTube:
        """The disc as an INTENT tube of one piece, from time 0 without an end."""
        piece = DiscPiece(0.0, *self.numbers)
        return PersonTube(TubeKind.INTENT, ((piece,),), FOREVER_S)


class TubeKind(enum.StrEnum):
    """What a tube claims. INTENT: where the person goes if they want what was predicted; GUARD:
    where they can be at all."""

    INTENT = "intent"
    GUARD = "guard"


KIND_NUMBERS = (TubeKind.INTENT, TubeKind.GUARD)
"""Kind by the number that a kernel reads."""


class RadiusBetween(enum.Enum):
    """Radius between two knots of a timed tube: on the LINE between them, or the LARGER one."""

    LINE = enum.auto()
    LARGER = enum.auto()


@final
@dataclass(frozen=True, slots=True)
class DiscPiece:
    """A disc over time, from `from_s` until the next piece of its bound starts.

    With s = tau - from_s (s): centre (x_m, y_m) + (vx_mps, vy_mps) s, radius
    max(0, radius_m + growth_mps s + growth2_mps2 s^2 / 2), growth2_mps2 >= 0.
    """

    from_s: float
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    radius_m: float
    growth_mps: float
    growth2_mps2: float

    @property
    def numbers(self) -> tuple[float, ...]:
        """The eight numbers in the kernel's order."""
        centre = (self.from_s, self.x_m, self.y_m, self.vx_mps, self.vy_mps)
        return (*centre, self.radius_m, self.growth_mps, self.growth2_mps2)


@final
@dataclass(frozen=True, slots=True)
class PersonTube:
    """One claim about where a person is until `until_s`; unchecked, see `fault_in_person`.

    bounds: runs of pieces, in the order of their starts. Every bound alone is claimed to hold the
    person from its first piece's start to until_s, so that they are in all of them at once.
    Outside of that time nothing is claimed, and nothing is ever proved clear of it.
    """

    kind: TubeKind
    bounds: tuple[tuple[DiscPiece, ...], ...]
    until_s: float


@final
@dataclass(frozen=True, slots=True)
class TrackedPerson:
    """Somebody seen, with everything that is claimed about where they will be."""

    name: str
    tubes: tuple[PersonTube, ...]


def tracked(person: Person) -> TrackedPerson:
    """The person with one INTENT tube."""
    return TrackedPerson(person.name, (person.intent,))


def timed_discs(
    times_s: Sequence[float],
    xs_m: Sequence[float],
    ys_m: Sequence[float],
    radii_m: Sequence[float],
    *,
    between: RadiusBetween,
) -> PersonTube:
    """INTENT tube through discs at given times, on straight lines between them.

    Between two knots the tube contains the disc whose centre lies on the line between theirs, with
    the radius that `between` says; an uncertainty that grows ever slower lies above the line: take
    LARGER. Radii are widened by 2^-48 of the knots' differences, which covers every rounding of the
    velocities (three roundings of 2^-53 each, over a time no longer than the knots'). Raises
    InputError unless all four have the same length of at least 2; numbers that make no sense become
    a fault (`fault_in_person`).
    """
    lengths = {len(times_s), len(xs_m), len(ys_m), len(radii_m)}
    if len(lengths) != 1 or min(lengths) < 2:
        raise InputError(
            "expected times_s, xs_m, ys_m and radii_m of one length of at least 2, got lengths "
            f"{len(times_s)}, {len(xs_m)}, {len(ys_m)} and {len(radii_m)}; give every knot a time, "
            "a place and a radius"
        )
    knots = list(zip(times_s, xs_m, ys_m, radii_m, strict=True))
    pieces = [_line(a, b, between) for a, b in itertools.pairwise(knots)]
    return PersonTube(TubeKind.INTENT, (tuple(pieces),), times_s[-1])


_Knot = tuple[float, float, float, float]


def _line(a: _Knot, b: _Knot, between: RadiusBetween) -> DiscPiece:
    span = b[0] - a[0]
    moved = [end - start for start, end in zip(a[1:], b[1:], strict=True)]
    pad = 2.0**-48 * sum(map(abs, moved)) + 1e-290
    # A step that does not lead forward has no velocity; NaN is a fault that is then named.
    vx, vy, growth = (each / span if span > 0.0 else math.nan for each in moved)
    if between is RadiusBetween.LARGER:
        return DiscPiece(a[0], a[1], a[2], vx, vy, _over(max(a[3], b[3]) + pad), 0.0, 0.0)
    return DiscPiece(a[0], a[1], a[2], vx, vy, _over(a[3] + pad), growth, 0.0)


def _over(rounded: float) -> float:
    return math.nextafter(rounded, math.inf)


@final
@dataclass(frozen=True, slots=True)
class PackedPeople:
    """People as a kernel reads them: TUBE_NUMBERS doubles per tube, PIECE_NUMBERS per piece."""

    count: int
    tubes: tuple[float, ...]
    pieces: tuple[float, ...]


def packed(people: Sequence[TrackedPerson]) -> PackedPeople:
    """All tubes, person by person, and all pieces, tube by tube; expects people without a fault."""
    tubes: list[float] = []
    pieces: list[float] = []
    for index, person in enumerate(people):
        for tube in person.tubes:
            first = len(pieces) // PIECE_NUMBERS
            for place, bound in enumerate(tube.bounds):
                for piece in bound:
                    pieces.append(place)
                    pieces += piece.numbers
            count = len(pieces) // PIECE_NUMBERS - first
            tubes += (index, KIND_NUMBERS.index(tube.kind), tube.until_s, first, count)
    return PackedPeople(len(people), tuple(map(float, tubes)), tuple(map(float, pieces)))


def fault_in_people(people: Sequence[TrackedPerson]) -> str | None:
    """Why these people cannot be judged, or None; more than fits is a fault that names the limit.

    Nobody is ever left out to make room.
    """
    if len(people) > MOST_PEOPLE:
        return f"expected at most {MOST_PEOPLE} people, got {len(people)}"
    for person in people:
        fault = fault_in_person(person)
        if fault is not None:
            return f"person {person.name!r}: {fault}"
    return None


def fault_in_person(person: TrackedPerson) -> str | None:
    """Why this person's tubes cannot be used, or None.

    Expected: 1 to MOST_TUBES tubes, each with at least one bound and 1 to MOST_PIECES pieces;
    finite numbers of a size that no later product can overflow; pieces of a bound that start one
    after the other and before until_s; radius_m and growth2_mps2 >= 0.
    """
    if not 1 <= len(person.tubes) <= MOST_TUBES:
        return f"expected 1 to {MOST_TUBES} tubes, got {len(person.tubes)}"
    for index, tube in enumerate(person.tubes):
        fault = _fault_in_tube(tube)
        if fault is not None:
            return f"tube {index}: {fault}"
    return None


def _fault_in_tube(tube: PersonTube) -> str | None:
    if tube.kind not in KIND_NUMBERS:
        return f"expected the kind intent or guard, got {tube.kind!r}"
    count = sum(map(len, tube.bounds))
    if not tube.bounds or not all(tube.bounds):
        return "expected at least one bound, each with at least one piece"
    if count > MOST_PIECES:
        return f"expected at most {MOST_PIECES} pieces, got {count}"
    if not abs(tube.until_s) <= FOREVER_S:
        return f"expected until_s within +-{FOREVER_S:g}, got {tube.until_s!r}"
    for bound in tube.bounds:
        for piece in bound:
            fault = _fault_in_piece(piece)
            if fault is not None:
                return fault
        starts = [*[piece.from_s for piece in bound], tube.until_s]
        if not all(map(operator.lt, starts, starts[1:])):
            return (
                f"expected pieces that start one after the other and before until_s, got {starts}"
            )
    return None


def _fault_in_piece(piece: DiscPiece) -> str | None:
    numbers = piece.numbers
    # A NaN fails the comparison, so it is named below.
    if all(map(operator.le, _LEAST, numbers)) and all(map(operator.le, numbers, _MOST)):
        return None
    name, value = next(
        (name, value)
        for value, (name, (least, most)) in zip(numbers, PIECE_LIMITS.items(), strict=True)
        if not least <= value <= most
    )
    least, most = PIECE_LIMITS[name]
    return f"expected {name} from {least:g} to {most:g}, got {value!r}"
