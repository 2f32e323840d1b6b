"""Scenarios from points of a unit cube: the same point is the same scenario, always."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.stats import qmc

from workbench.errors import InputError
from workbench.models.spline_path import SplinePath
from workbench.simulation.campaign.sampled_people import PERSON_AXES, person
from workbench.simulation.frames import Point
from workbench.simulation.scenarios.company import Company, Part, Told
from workbench.simulation.scenarios.frames_of_path import PathFrame
from workbench.simulation.scenarios.scenario import Dropout, Ghost, Occluder, Scenario, Sensing
from workbench.simulation.walkers.moving import Who, body_radius_m
from workbench.simulation.walkers.scripted import Leg, Script

FAMILY: Final = 2
"""Of the mapping below, and of who drives which point; a change of it is another family, and
results must not be mixed."""
DURATION_S: Final = 18.0
PASSED_M: Final = 26.0
MOST_PEOPLE: Final = 3
_LENGTH_M: Final = 40.0
_EVERY_M: Final = 4.0
_TIGHTEST_PER_M: Final = 1.0 / 28.0
"""Of the waypoints' turn; the spline through them stays above 25 m of radius."""

_AXES: Final = (
    "bend", "bend after", "how many", "cyclist", "cyclist's place", "cyclist's speed", "box",
    "box's place", "box's side", "people lost", "people lost when", "people lost how long",
    "place lost", "place lost when", "place lost how long", "ghost", "ghost's place",
    "ghost's side", "position error", "heading error", "speed error", "person error",
    "person's speed error",
)  # fmt: skip
MOST_POINTS: Final = 2**30
"""Of the sequence."""
DIMENSIONS: Final = len(_AXES) + MOST_PEOPLE * len(PERSON_AXES)


@final
@dataclass(frozen=True, slots=True)
class SampledScenario:
    """A point of the unit cube, `DIMENSIONS` coordinates in [0, 1), and the seed of everything that
    chance decides on the way: errors, actuators and who wanders.

    Raises InputError for another number of coordinates and for one outside.
    """

    point: tuple[float, ...]
    seed: int

    def __post_init__(self) -> None:
        if len(self.point) != DIMENSIONS or not all(0.0 <= u < 1.0 for u in self.point):
            raise InputError(
                f"point: expected {DIMENSIONS} numbers in [0, 1), got {len(self.point)} within "
                f"[{min(self.point, default=math.nan):g}, {max(self.point, default=math.nan):g}]; "
                "take one that a survey has written"
            )
        if self.seed < 1:
            raise InputError(f"seed: expected at least 1, got {self.seed}")

    def scenario(self, name: str) -> Scenario:
        """The scenario that the point stands for; nothing is expected of any policy."""
        values = dict(zip(_AXES, self.point, strict=False))
        waypoints = _waypoints(values)
        frame = PathFrame(SplinePath.through(waypoints))
        count = _how_many(values["how many"])
        parts: list[Part] = []
        for k in range(count):
            first = len(_AXES) + k * len(PERSON_AXES)
            coordinates = self.point[first : first + len(PERSON_AXES)]
            parts.append(person(f"person {k + 1}", coordinates, frame))
        if values["cyclist"] < 0.15:
            parts.append(_cyclist(values, frame))
        return Scenario(
            name, f"Sampled scenario {name}", "Drawn from the family of surveys.", waypoints,
            DURATION_S, PASSED_M, Company(tuple(parts)), _sensing(values, frame),
        )  # fmt: skip


def sobol_points(indices: range, seed: int) -> list[tuple[float, ...]]:
    """Points of the scrambled Sobol sequence, by index; seed: of the scrambling."""
    sequence = qmc.Sobol(DIMENSIONS, scramble=True, rng=np.random.default_rng(seed))
    if indices.start:
        sequence.fast_forward(indices.start)
    with warnings.catch_warnings():
        # Balance needs powers of 2; parts of the sequence are taken here, and the whole is summed.
        warnings.simplefilter("ignore", UserWarning)
        rows = sequence.random(len(indices))
    return [tuple(float(u) for u in row) for row in np.minimum(rows, np.nextafter(1.0, 0.0))]


def sampled(indices: range, seed: int) -> list[SampledScenario]:
    """The scenarios of a survey; each index has a seed of its own."""
    points = sobol_points(indices, seed)
    return [
        SampledScenario(point, 1 + index + 10_000_019 * seed)
        for index, point in zip(indices, points, strict=True)
    ]


def _how_many(u: float) -> int:
    """0 to 3 people: 5, 45, 30 and 20 in a hundred."""
    return sum(u >= bound for bound in (0.05, 0.5, 0.8))


def _waypoints(values: dict[str, float]) -> tuple[Point, ...]:
    """Two bends, one going over into the other; a third of all paths are straight."""
    first, second = values["bend"], values["bend after"]
    if first < 1.0 / 3.0:
        first_per_m = second_per_m = 0.0
    else:
        first_per_m = _TIGHTEST_PER_M * (3.0 * first - 2.0)
        second_per_m = _TIGHTEST_PER_M * (2.0 * second - 1.0)
    x_m = y_m = heading = 0.0
    points = [(x_m, y_m)]
    for k in range(round(_LENGTH_M / _EVERY_M)):
        share = min(max((k * _EVERY_M - 12.0) / 12.0, 0.0), 1.0)
        turned = _EVERY_M * ((1.0 - share) * first_per_m + share * second_per_m)
        x_m += _EVERY_M * math.cos(heading + 0.5 * turned)
        y_m += _EVERY_M * math.sin(heading + 0.5 * turned)
        heading += turned
        points.append((x_m, y_m))
    return tuple(points)


def _cyclist(values: dict[str, float], frame: PathFrame) -> Told:
    """Along the path, beside it, with the car or against it."""
    u, side = values["cyclist's place"], 1.0
    if u < 0.5:
        side = -1.0
    left_m = side * (2.4 + 4.0 * abs(2.0 * u - 1.0))
    speed_mps = 2.0 + 3.0 * values["cyclist's speed"]
    ahead = values["cyclist"] < 0.075
    begin, end = ((-6.0, left_m), (80.0, left_m)) if ahead else ((45.0, left_m), (-40.0, left_m))
    script = Script(
        frame.place(begin), frame.legs(begin, (Leg(end, speed_mps),)), start_mps=0.99 * speed_mps
    )
    return Told(Who("cyclist", "cyclist", body_radius_m("cyclist")), script)


def _sensing(values: dict[str, float], frame: PathFrame) -> Sensing:
    """Errors up to the defaults of `Sensing` for the car, up to the paper's 0.5 m for people."""
    dropouts, ghosts, boxes = [], [], []
    for what, axis, longest_s in (
        ("people", "people lost", 1.0),
        ("localisation", "place lost", 0.8),
    ):
        if values[axis] < 0.15:
            from_s = 1.0 + 12.0 * values[f"{axis} when"]
            until_s = from_s + 0.2 + (longest_s - 0.2) * values[f"{axis} how long"]
            dropouts.append(Dropout(what, from_s, until_s))
    if values["ghost"] < 0.1:
        left_m = 10.0 * values["ghost's side"] - 5.0
        x_m, y_m = frame.place((8.0 + 16.0 * values["ghost's place"], left_m))
        from_s = 20.0 * values["ghost"] + 2.0
        ghosts.append(Ghost(x_m, y_m, from_s, from_s + 1.5))
    if values["box"] < 0.15:
        side = 1.0 if values["box's side"] < 0.5 else -1.0
        left_m = side * (3.2 + 2.0 * abs(2.0 * values["box's side"] - 1.0))
        x_m, y_m = frame.place((8.0 + 14.0 * values["box's place"], left_m))
        boxes.append(Occluder(x_m - 1.8, y_m - 0.9, x_m + 1.8, y_m + 0.9))
    return Sensing(
        position_m=0.02 + 0.08 * values["position error"],
        heading_rad=0.005 + 0.015 * values["heading error"],
        speed_mps=0.01 + 0.04 * values["speed error"],
        person_m=0.1 + 0.4 * values["person error"],
        person_mps=0.05 + 0.25 * values["person's speed error"],
        dropouts=tuple(dropouts), ghosts=tuple(ghosts), occluders=tuple(boxes),
    )  # fmt: skip
