"""The smallest proved clearance of a car from many people, as the vehicle's kernel finds it.

The same Functions, comparisons and order as `codegen/c/separate.c`: the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final

from workbench.reach.person_gap import box_function, car_function, gap_function
from workbench.reach.tube import Array
from workbench.runtime.layout import NO_CLEARANCE_M, KernelCause
from workbench.runtime.person_tubes import (
    KIND_NUMBERS,
    DiscPiece,
    PersonTube,
    TrackedPerson,
    TubeKind,
)

BLOCK = 6
"""Segments that share one box per tube."""
Window = tuple[float, float]
_Box = list[float]


@final
@dataclass(frozen=True, slots=True)
class Nearest:
    """The smallest proved clearance from the tubes of one kind.

    clearance_m: NO_CLEARANCE_M (1e300) with nobody, -NO_CLEARANCE_M for every cause but PROVED;
    time_s: start of its segment; person, tube: index of the person, and of the tube among theirs.
    """

    clearance_m: float
    time_s: float
    person: int | None
    tube: int | None
    cause: KernelCause


def nearest_people(
    people: Sequence[TrackedPerson],
    *,
    times_s: Array,
    rectangles: Array,
    kinds: frozenset[TubeKind],
    skew_s: tuple[float, float],
) -> dict[TubeKind, Nearest]:
    """Smallest proved clearance per kind of tube.

    In segment k the car is in rectangles[k] (centre x, y, heading, half length, half width; NaN
    where unknown) for all times in [times_s[k], times_s[k+1]]. The people's clock shows the car's
    time plus one unknown constant in skew_s, so their tubes are taken over [times_s[k] + skew_s[0],
    times_s[k+1] + skew_s[1]]. A bound's clearance is the smallest gap over its pieces, a tube's the
    largest over its bounds. Where a tube's box over BLOCK segments is further away than the
    smallest clearance so far, it is not looked at more closely. Everybody needs a tube of each kind
    asked for. Expects people without a fault. Rigor: ENCLOSED, given rectangles and tubes that
    contain what they should.
    """
    found = {kind: _start(people, kind, float(times_s[0]), kind in kinds) for kind in KIND_NUMBERS}
    tubes = [
        _Listed(i, index, tube)
        for i, each in enumerate(people)
        for index, tube in enumerate(each.tubes)
    ]
    for k, row in enumerate(rectangles):
        start, end = float(times_s[k]), float(times_s[k + 1])
        if k % BLOCK == 0:
            last = float(times_s[min(k + BLOCK, len(rectangles))])
            boxes = [_tube_box(each.tube, people_window(start, last, skew_s)) for each in tubes]
        segment = _Segment(start, people_window(start, end, skew_s), row)
        _clear_segment(
            [pair for pair in zip(tubes, boxes, strict=True) if pair[0].tube.kind in kinds],
            segment, found,
        )  # fmt: skip
    return found


@final
@dataclass(frozen=True, slots=True)
class _Listed:
    """A tube with the index of its person, and its own among theirs."""

    person: int
    index: int
    tube: PersonTube


@final
@dataclass(frozen=True, slots=True)
class _Segment:
    """When it starts for the car, the people's times, and the car's rectangle."""

    time_s: float
    window: Window
    rectangle: Array


def _clear_segment(
    tubes: Sequence[tuple[_Listed, _Box]], segment: _Segment, found: dict[TubeKind, Nearest]
) -> None:
    """Takes the tubes' clearances in one segment into `found`."""
    car, ok = car_function()(segment.rectangle)
    known = float(ok) == 1.0
    box = [float(value) for value in car.nonzeros()[2:]]
    for listed, around in tubes:
        best = found[listed.tube.kind]
        cause, gap = KernelCause.NOT_COMPUTED, 0.0
        if known:
            if _far(box, around, best.clearance_m):
                continue
            cause, gap = _tube_gap(listed.tube, segment, car)
        clearance = gap if cause is KernelCause.PROVED else -NO_CLEARANCE_M
        if not clearance >= best.clearance_m:
            found[listed.tube.kind] = Nearest(
                clearance, segment.time_s, listed.person, listed.index, cause
            )


def people_window(start_s: float, end_s: float, skew_s: tuple[float, float]) -> Window:
    """The people's times while the car's are in [start_s, end_s], rounded outward.

    A sum that is exact stays as it is, so that a tube that holds until the horizon covers it.
    """
    return _sum_outward(start_s, skew_s[0], -1.0), _sum_outward(end_s, skew_s[1], 1.0)


def _sum_outward(a: float, b: float, side: float) -> float:
    # Knuth's error of a sum, which is exact.
    total = a + b
    part = total - a
    error = (a - (total - part)) + (b - part)
    return total + side * (abs(total) * 2.0**-52 + 2.0**-1021) if error * side > 0.0 else total


def _start(people: Sequence[TrackedPerson], kind: TubeKind, time_s: float, asked: bool) -> Nearest:
    if not asked:
        return Nearest(-NO_CLEARANCE_M, time_s, None, None, KernelCause.NOT_ASKED)
    for i, person in enumerate(people):
        if all(tube.kind != kind for tube in person.tubes):
            return Nearest(-NO_CLEARANCE_M, time_s, i, None, KernelCause.NOT_PREDICTED)
    return Nearest(NO_CLEARANCE_M, time_s, None, None, KernelCause.PROVED)


def _covers(tube: PersonTube, bound: Sequence[DiscPiece], window: Window) -> bool:
    return bound[0].from_s <= window[0] <= window[1] <= tube.until_s


def _parts(bound: Sequence[DiscPiece], window: Window) -> Iterator[tuple[DiscPiece, Window]]:
    """The pieces that hold in the window, each with the part in which it does."""
    for j, piece in enumerate(bound):
        following = bound[j + 1].from_s if j + 1 < len(bound) else math.inf
        if not (piece.from_s > window[1] or following <= window[0]):
            yield piece, (max(piece.from_s, window[0]), min(following, window[1]))


def _tube_box(tube: PersonTube, window: Window) -> _Box:
    common = [-math.inf, math.inf, -math.inf, math.inf]
    for bound in tube.bounds:
        hull = _bound_box(bound, window) if _covers(tube, bound, window) else None
        if hull is not None:
            common = [f(a, b) for f, a, b in zip((max, min) * 2, common, hull, strict=True)]
    return common


def _bound_box(bound: Sequence[DiscPiece], window: Window) -> _Box | None:
    hull = [math.inf, -math.inf, math.inf, -math.inf]
    for piece, part in _parts(bound, window):
        box, ok = box_function()(piece.numbers, part)
        if float(ok) != 1.0:
            return None
        hull = [f(a, b) for f, a, b in zip((min, max) * 2, hull, box.nonzeros(), strict=True)]
    return hull


def _far(one: _Box, other: _Box, best_m: float) -> bool:
    """Whether two boxes are certainly further apart than `best_m`; see the C for the rounding."""
    need = (best_m * best_m * (1.0 + 2.0**-40) if best_m > 0.0 else 0.0) + 1e-300
    x = max(one[0] - other[1], other[0] - one[1], 0.0)
    y = max(one[2] - other[3], other[2] - one[3], 0.0)
    return x * x + y * y > need


def _tube_gap(tube: PersonTube, segment: _Segment, car: object) -> tuple[KernelCause, float]:
    cause, largest = KernelCause.NOT_PREDICTED, -NO_CLEARANCE_M
    for bound in tube.bounds:
        if not _covers(tube, bound, segment.window):
            continue
        smallest = math.inf
        for piece, part in _parts(bound, segment.window):
            gap, ok = gap_function()(segment.rectangle, car, piece.numbers, part)
            if float(ok) != 1.0:
                return KernelCause.NOT_COMPUTED, 0.0
            smallest = min(smallest, float(gap))
        if not smallest <= NO_CLEARANCE_M:
            return KernelCause.NOT_COMPUTED, 0.0
        cause, largest = KernelCause.PROVED, max(largest, smallest)
    return cause, largest
