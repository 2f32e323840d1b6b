"""What a decision is asked in the benchmark: random scenes of a road, and the worst there are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.bench.decision_kernel import shipped_loop
from workbench.models.spline_path import SplinePath
from workbench.models.vehicle import Vehicle, gem_e2
from workbench.reach.tube import Array
from workbench.runtime.layout import MOST_PIECES_IN_ALL
from workbench.runtime.path import PathTable
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import (
    FOREVER_S,
    MOST_PIECES,
    MOST_TUBES,
    DiscPiece,
    PersonTube,
    RadiusBetween,
    TrackedPerson,
    TubeKind,
    packed,
    timed_discs,
)

PEOPLE: Final = 8
TUBES_PER_PERSON: Final = 3
_SHARES: Final = (1.0, 2 / 3, 1 / 3)
_PATHS: Final = 16
_CROWDS: Final = 500
_NODE_M: Final = 0.25
_BEFORE_M: Final = 4.0
_LENGTH_M: Final = 26.0
# A period of 30 Hz after the stamp, its delays, and one more period: when an order is in force.
_DRIVING: Final = {"switch_s": (0.15, 0.1834), "start_s": (0.0, 0.0), "brake_s": (0.0, 0.0834)}
_HELD: Final = {"switch_s": (0.25, 0.2834), "start_s": (0.05, 0.0834), "brake_s": (0.0, 0.0834)}
# Knots of an intended walk, as often as a predictor writes them.
_KNOTS_S: Final = tuple(0.55 * k - 0.2 for k in range(11))

Values = Mapping[str, Sequence[float]]


@final
@dataclass(frozen=True, slots=True)
class Scene:
    """A query by its fields, and a name for it."""

    name: str
    values: Values


@final
@dataclass(frozen=True, slots=True)
class Start:
    """Path states of the shipped vehicle: centre, radius; held: it stands and may be told to go."""

    center: Sequence[float]
    radius: Sequence[float]
    held: bool = False


def random_scenes(count: int, *, seed: int) -> Iterator[Scene]:
    """`count` scenes of 8 people with 3 tubes each (two intents, one guard), the same per seed.

    One of 16 paths (straight, and waves down to a radius of about 7 m), one of 500 crowds, and a
    start drawn anew: up to 0.5 m beside the path, 0.1 rad across it, 0 to 3 m/s, radii of any share
    of the vehicle file's initial set; one in ten stands and is told to go.
    """
    rng = np.random.default_rng(seed)
    base, widest = _base(gem_e2()), np.array(initial_start(1.0).radius)
    roads = [path_values(_wave(rng, k)) for k in range(_PATHS)]
    crowds: dict[int, Values] = {}
    for k in range(count):
        road, which = roads[rng.integers(_PATHS)], int(rng.integers(_CROWDS))
        if which not in crowds:
            crowds[which] = _random_crowd(seed, which)
        start = _random_start(rng, widest)
        yield Scene(f"random {k}", {**base, **road, **crowds[which], **start_values(start)})


def scene(
    name: str, start: Start, people: Sequence[TrackedPerson], *, wave_m: float = 0.0
) -> Scene:
    """One scene on a straight road, or on one that swings by 2 wave_m to the left and back."""
    road = path_values(_road(wave_m, 0.3))
    values = _base(gem_e2()) | road | people_values(people) | start_values(start)
    return Scene(name, values)


def telling_scenes() -> tuple[Scene, ...]:
    """Scenes with 8 people beside the road, from the least to be computed to the most."""
    aside = crowd(PEOPLE, np.random.default_rng(5), nearest_m=12.0)
    near = crowd(PEOPLE, np.random.default_rng(5), nearest_m=2.4)
    whole, third = initial_start(1.0), initial_start(1 / 3)
    point = Start((0.0, 0.0, 0.0, 2.8, 0.0, 0.0, 0.0), (0.0,) * 7)
    standing = Start((0.0, -0.3, 0.2, 0.05, 0.05, 0.0, 0.0), third.radius, held=True)
    return (
        scene("one state, straight road", point, aside),
        scene("standing, told to go", standing, aside),
        scene("third of the initial set", third, aside),
        scene("initial set", whole, aside),
        scene("initial set, bends", whole, aside, wave_m=1.0),
        scene("initial set, people near", whole, near),
    )


def hostile_scenes() -> tuple[Scene, ...]:
    """Scenes that use up the budget: nothing is proved, or only of small cells, at limits."""
    in_the_way = worst_people(PEOPLE, tubes=MOST_TUBES, bounds=MOST_PIECES)
    wide = initial_start(1.0)
    limits = Start((0.0, 0.8, 0.0, 2.0, 0.1, 0.0, 0.0), (0.1, 0.3, 0.1, 0.3, 0.1, 0.3, 0.3))
    far = crowd(PEOPLE, np.random.default_rng(5), nearest_m=12.0)
    return (
        scene("initial set, bends, people in the way", wide, in_the_way, wave_m=1.0),
        scene("wide, at the rate limit, bends", limits, far, wave_m=1.0),
        scene("wide, at the rate limit, people in the way", limits, in_the_way),
    )


def worst_people(count: int, *, tubes: int, bounds: int) -> list[TrackedPerson]:
    """People who are never skipped: every disc covers the car at all times, every piece is a bound
    of its own and counts in each row. Guards, whom a stop heeds, and intents in turn.

    Each tube has `bounds` pieces, or as many as fit where all together may not have so many.
    """
    each = min(bounds, MOST_PIECES_IN_ALL // max(1, tubes * count))
    piece = DiscPiece(-101.0, 0.0, 0.0, -3.0, 1.5, 0.3, 3.5, 0.0)
    claimed = [(TubeKind.INTENT, TubeKind.GUARD)[k % 2] for k in range(tubes)]
    own = tuple(PersonTube(kind, ((piece,),) * each, 1000.0) for kind in claimed)
    return [TrackedPerson(f"person {i}", own) for i in range(count)]


def standing_person(aside_m: float, *, ahead_m: float = 6.0) -> TrackedPerson:
    """Somebody who intends to stand beside the road; the guard is far away, so that only what is
    intended counts."""
    stays = DiscPiece(-1.0, ahead_m, aside_m, 0.0, 0.0, 0.3, 0.0, 0.0)
    far = DiscPiece(-1.0, 0.0, 500.0, 0.0, 0.0, 0.3, 0.0, 0.0)
    return TrackedPerson("person", (
        PersonTube(TubeKind.INTENT, ((stays,),), FOREVER_S),
        PersonTube(TubeKind.GUARD, ((far,),), FOREVER_S),
    ))  # fmt: skip


def initial_start(share: float) -> Start:
    """The vehicle file's initial set, its radii times `share`."""
    box = gem_e2().initial_set.reordered(shipped_loop().names)
    return Start(box.center, [share * radius for radius in box.radius])


def crowd(count: int, rng: np.random.Generator, *, nearest_m: float) -> list[TrackedPerson]:
    """People along 30 m of the road, none of whom begins nearer to its middle than `nearest_m`.

    Each may walk on along the road, or turn towards it, in 10 pieces; the guard has the vehicle
    file's limits.
    """
    limits = gem_e2().guard
    most = MotionLimits(limits.speed_max_mps, limits.accel_max_mps2)
    people = []
    for i in range(count):
        side, ahead = rng.choice([-1.0, 1.0], 2)
        x, y = rng.uniform(-5.0, 25.0), side * (nearest_m + rng.exponential(3.0))
        intents = [_walk(x, y, 1.4 * ahead, -side * across) for across in (0.0, 0.5)]
        seen = Guard(0.0, Disc(x, y, 0.3), Disc(1.4 * ahead, 0.0, 0.2), most)
        guard = guard_disc(seen, from_s=-0.2, until_s=FOREVER_S)
        people.append(TrackedPerson(f"person {i}", (*intents, guard)))
    return people


def _walk(x_m: float, y_m: float, vx_mps: float, vy_mps: float) -> PersonTube:
    return timed_discs(
        _KNOTS_S, [x_m + vx_mps * t for t in _KNOTS_S], [y_m + vy_mps * t for t in _KNOTS_S],
        [0.3 + 0.05 * k for k in range(len(_KNOTS_S))], between=RadiusBetween.LARGER,
    )  # fmt: skip


def people_values(people: Sequence[TrackedPerson]) -> dict[str, Sequence[float]]:
    """The fields that hold people."""
    numbers = packed(people)
    return {
        "people_count": (float(numbers.count),),
        "tubes_count": (float(sum(len(person.tubes) for person in people)),),
        "people_tubes": numbers.tubes, "people_pieces": numbers.pieces,
    }  # fmt: skip


def start_values(start: Start) -> dict[str, Sequence[float]]:
    """The fields that hold the nested sets, and when which order is in force."""
    return {
        "initial_center": [*start.center] * len(_SHARES),
        "initial_radius": [share * radius for share in _SHARES for radius in start.radius],
        **(_HELD if start.held else _DRIVING),
    }


def path_values(table: PathTable) -> dict[str, Sequence[float]]:
    """The fields that hold the path."""
    return {
        "path_count": (float(len(table.x)),), "path_start_m": (table.start_m,),
        "path_spacing_m": (table.spacing_m,), "path_x": table.x, "path_y": table.y,
        "path_heading": table.heading, "path_curvature_lower": table.curvature_lower,
        "path_curvature_upper": table.curvature_upper,
    }  # fmt: skip


def _base(vehicle: Vehicle) -> dict[str, Sequence[float]]:
    body = vehicle.geometry
    return {
        "parameters": shipped_loop().parameter_values(), "front_m": (body.front_m,),
        "rear_m": (body.rear_m,), "half_width_m": (body.half_width_m,),
        "clearance_required_m": (0.2,), "skew_s": (-0.01, 0.02),
    }  # fmt: skip


def _wave(rng: np.random.Generator, k: int) -> PathTable:
    """The first is straight."""
    swing_m = 0.0 if k == 0 else rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 1.5)
    return _road(swing_m, rng.uniform(0.1, 0.3))


def _road(swing_m: float, wave_per_m: float) -> PathTable:
    x: Array = np.arange(0.0, _LENGTH_M + 1.0, 2.0)
    y = swing_m * (1.0 - np.cos(wave_per_m * x))
    return SplinePath.through(np.column_stack([x, y])).table(_NODE_M, before_m=_BEFORE_M)


def _random_crowd(seed: int, which: int) -> Values:
    rng = np.random.default_rng([seed, which])
    return people_values(crowd(PEOPLE, rng, nearest_m=float(rng.uniform(1.5, 10.0))))


def _random_start(rng: np.random.Generator, widest: Array) -> Start:
    held = rng.random() < 0.1
    center = rng.uniform([0, -0.5, -0.1, 0, -0.1, -0.1, -0.1], [3, 0.5, 0.1, 3, 0.1, 0.1, 0.1])
    if held:
        center[3] = 0.05
    return Start(center.tolist(), (rng.random() * widest).tolist(), held)
