"""Whether a tube keeps clear of people: the ground the car covers against their tubes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Protocol, final

import numpy as np

from workbench.claims import Rigor, Verdict, weakest
from workbench.errors import InputError
from workbench.reach.occupancy import occupancy_function
from workbench.reach.person_clearance import Nearest, nearest_people
from workbench.reach.tube import Array, ReachTube
from workbench.runtime.contents import VehicleBody
from workbench.runtime.layout import KernelCause
from workbench.runtime.observation import Person
from workbench.runtime.path import PathTable
from workbench.runtime.person_tubes import (
    FOREVER_S,
    KIND_NUMBERS,
    TrackedPerson,
    TubeKind,
    fault_in_people,
    tracked,
)

_OCCUPANCY = cache(occupancy_function)


class Ground(Protocol):
    """How states become places: says for one segment of a tube where its states are."""

    @property
    def names(self) -> tuple[str, str, str]:
        """The states it reads: along the path, across it, and the heading's."""

    @property
    def rigor(self) -> Rigor:
        """How far the places themselves are proved."""

    def places(self, lower: dict[str, float], upper: dict[str, float]) -> Places:
        """The node frame, the box in it and the curvature for states in [lower, upper]."""

    def poses(self, states: Array) -> Array:
        """x (m), y (m) and heading (rad), (..., 3), of `states` (..., 3); floats, for searching."""


@final
@dataclass(frozen=True, slots=True)
class Places:
    """lower, upper (3): station m, offset m, heading error rad; node (4): station, x, y, heading;
    curvature (2): its range in 1/m between the node and the box."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    node: tuple[float, float, float, float]
    curvature: tuple[float, float]


@final
@dataclass(frozen=True, slots=True)
class PlaneGround:
    """Tubes over x, y and heading in the plane: the x axis is the path."""

    @property
    def names(self) -> tuple[str, str, str]:
        """The pose itself."""
        return "x", "y", "heading"

    @property
    def rigor(self) -> Rigor:
        """Nothing is added to the states."""
        return Rigor.ENCLOSED

    def poses(self, states: Array) -> Array:
        """The states themselves."""
        return states

    def places(self, lower: dict[str, float], upper: dict[str, float]) -> Places:
        """The states themselves, seen from the origin."""
        low, high = ((s["x"], s["y"], s["heading"]) for s in (lower, upper))
        return Places(low, high, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0))


@final
@dataclass(frozen=True, slots=True)
class PathGround:
    """Tubes over station, offset and heading_error along `path`."""

    path: PathTable

    @property
    def names(self) -> tuple[str, str, str]:
        """The coordinates along the path."""
        return "station", "offset", "heading_error"

    @property
    def rigor(self) -> Rigor:
        """The table's nodes and curvatures are taken from measurement."""
        return Rigor.NUMERICAL

    def poses(self, states: Array) -> Array:
        """Seen from the nearest node, with the curvature of the bin in between."""
        path = self.path
        station, offset, error = (states[..., i] for i in range(3))
        place = (np.nan_to_num(station) - path.start_m) / path.spacing_m
        j = np.clip(np.rint(place), 0, len(path.x) - 1).astype(int)
        bins = np.clip(np.floor(place), 0, len(path.x) - 2).astype(int)
        curvature = 0.5 * (np.array(path.curvature_lower) + np.array(path.curvature_upper))[bins]
        delta = station - (path.start_m + j * path.spacing_m)
        turn = curvature * delta
        chord = delta * np.sinc(0.5 * turn / np.pi)
        along = chord * np.cos(0.5 * turn) - offset * np.sin(turn)
        across = chord * np.sin(0.5 * turn) + offset * np.cos(turn)
        c, s = (f(np.array(path.heading)[j]) for f in (np.cos, np.sin))
        x, y = (np.array(ends)[j] for ends in (path.x, path.y))
        heading = np.array(path.heading)[j] + error + turn
        return np.stack([x + along * c - across * s, y + along * s + across * c, heading], axis=-1)

    def places(self, lower: dict[str, float], upper: dict[str, float]) -> Places:
        """Seen from the node nearest to the middle station. InputError off the path table."""
        path = self.path
        middle = 0.5 * (lower["station"] + upper["station"])
        j = min(max(round((middle - path.start_m) / path.spacing_m), 0), len(path.x) - 1)
        station = path.start_m + j * path.spacing_m
        first = math.floor((min(lower["station"], station) - path.start_m) / path.spacing_m)
        last = math.floor((max(upper["station"], station) - path.start_m) / path.spacing_m)
        if first < 0 or last >= len(path.x):
            raise InputError(
                f"the tube reaches stations {lower['station']:.2f} to {upper['station']:.2f} m, "
                f"the table covers {path.start_m:.2f} to {path.end_m:.2f} m; extend the path"
            )
        bins = slice(first, min(last, len(path.x) - 2) + 1)
        names = ("station", "offset", "heading_error")
        low, high = (tuple(s[name] for name in names) for s in (lower, upper))
        return Places(
            (low[0], low[1], low[2]), (high[0], high[1], high[2]),
            (station, path.x[j], path.y[j], path.heading[j]),
            (min(path.curvature_lower[bins]), max(path.curvature_upper[bins])),
        )  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Comparison:
    """Which tubes of the people count, and on which clock they run.

    kinds: everybody is compared by all their tubes of each of these kinds, and is never clear
    without one; None: by every tube they have. skew_s: least and largest reading of the people's
    clock when the car's shows 0; one constant in between, unknown.
    """

    kinds: frozenset[TubeKind] | None
    skew_s: tuple[float, float]

    def __post_init__(self) -> None:
        low, high = self.skew_s
        if not (-FOREVER_S <= low <= high <= FOREVER_S) or self.kinds == frozenset():
            raise InputError(
                f"expected at least one kind (or None) and skew_s in order within +-{FOREVER_S:g}, "
                f"got {self.kinds!r} and {self.skew_s!r}"
            )


EVERY_TUBE = Comparison(None, (0.0, 0.0))
"""All tubes of everybody, on the car's own clock."""


@final
@dataclass(frozen=True, slots=True)
class Separation:
    """verdict: SAFE when every proved clearance reaches what was required, INVALID when the tube is
    not complete, UNPROVED otherwise.

    clearance_m: smallest proved clearance, inf with nobody, -inf where none was found; time_s:
    start of its segment; person: who; occupancy (K x 5): one rectangle per segment that contains
    the body: centre x, y (m), heading (rad), half length, half width (m), NaN where none was found;
    rigor: the weaker one of the tube's and the ground's; tube: index of the person's tube that gave
    it; by_kind: the same per kind of tube, see `Nearest`.
    """

    verdict: Verdict
    clearance_m: float
    time_s: float | None
    person: str | None
    occupancy: Array
    rigor: Rigor
    tube: int | None
    by_kind: dict[TubeKind, Nearest]


def check_separation(
    tube: ReachTube,
    *,
    ground: Ground,
    body: VehicleBody,
    people: Sequence[Person | TrackedPerson],
    clearance_required_m: float,
    comparison: Comparison = EVERY_TUBE,
) -> Separation:
    """Compare the swept body with everybody's tubes, segment by segment in time.

    tube: over the states that `ground` reads; people: their tubes' times are the tube's own, up to
    the skew of `comparison`; a `Person` counts as one tube without an end (`tracked`).
    Conservative: the body's rectangle is taken over the whole segment box, a person's disc over the
    whole segment, skew included (`nearest_people`). A tube that is not complete gives INVALID.
    Rigor: the weaker one of the tube's and the ground's. Raises InputError on a clearance that is
    negative or not finite, on people with a fault, and where the tube leaves the path table.
    """
    if not (math.isfinite(clearance_required_m) and clearance_required_m >= 0):
        raise InputError(
            f"expected a finite clearance_required_m >= 0, got {clearance_required_m!r}"
        )
    crowd = [tracked(each) if isinstance(each, Person) else each for each in people]
    fault = fault_in_people(crowd)
    if fault is not None:
        raise InputError(f"{fault}; mend the tubes, or ask about fewer people at once")
    occupancy = covered_ground(tube, ground=ground, body=body)
    by_kind = _by_kind(crowd, tube.times, occupancy, comparison)
    asked = [found for found in by_kind.values() if found.cause is not KernelCause.NOT_ASKED]
    least = min(asked, key=lambda found: found.clearance_m, default=None)
    smallest, when, who, which = math.inf, None, None, None
    if least is not None and least.person is not None:
        smallest = least.clearance_m if least.cause is KernelCause.PROVED else -math.inf
        when, who, which = least.time_s, crowd[least.person].name, least.tube
    safe = bool(np.all(np.isfinite(occupancy))) and smallest >= clearance_required_m
    verdict = Verdict.SAFE if safe else Verdict.UNPROVED
    return Separation(
        verdict if tube.complete else Verdict.INVALID, smallest, when, who, occupancy,
        weakest(tube.rigor, ground.rigor), which, by_kind,
    )  # fmt: skip


def _by_kind(
    crowd: Sequence[TrackedPerson], times: Array, occupancy: Array, comparison: Comparison
) -> dict[TubeKind, Nearest]:
    """Per kind; with kinds None, each kind among those who have a tube of it."""

    def ask(people: Sequence[TrackedPerson], kinds: frozenset[TubeKind]) -> dict[TubeKind, Nearest]:
        return nearest_people(
            people, times_s=times, rectangles=occupancy, kinds=kinds, skew_s=comparison.skew_s
        )

    if comparison.kinds is not None:
        return ask(crowd, comparison.kinds)
    found = {}
    for kind in KIND_NUMBERS:
        having = [i for i, each in enumerate(crowd) if any(t.kind == kind for t in each.tubes)]
        answer = ask([crowd[i] for i in having], frozenset([kind] if having else []))[kind]
        at = None if answer.person is None else having[answer.person]
        found[kind] = dataclasses.replace(answer, person=at)
    return found


def covered_ground(tube: ReachTube, *, ground: Ground, body: VehicleBody) -> Array:
    """Rectangles (K x 5) that contain the body on every segment of `tube`; NaN where there is none
    (the heading spreads beyond 1.5 rad, or leaves the range of the trigonometry)."""
    function = _OCCUPANCY()
    size = [body.front_m, body.rear_m, body.half_width_m]
    rows = []
    for low, high in zip(tube.lower, tube.upper, strict=True):
        places = ground.places(
            dict(zip(tube.names, map(float, low), strict=True)),
            dict(zip(tube.names, map(float, high), strict=True)),
        )
        rectangle, ok = function(places.lower, places.upper, places.node, places.curvature, size)
        row = np.array(rectangle).ravel()
        rows.append(row if float(ok) == 1.0 else np.full(5, math.nan))
    return np.array(rows).reshape(len(rows), 5)
