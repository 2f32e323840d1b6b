"""A scenario as values: what happens around a car, and what is expected of each policy."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, final

from workbench.estimation.goals import Goal
from workbench.models.spline_path import SplinePath
from workbench.simulation.frames import Point
from workbench.simulation.walkers.pedestrian import Pedestrian


class Expected(enum.Enum):
    """What a policy should do in a scenario. Whatever is expected but COLLIDES includes that the
    moving car touches nobody."""

    PASSES = "passes"
    """Sets off and does not brake again before it has gone `passed_m`."""
    BRAKES = "brakes"
    """Sets off, and brakes at least once before `passed_m` because of people: clearance from
    somebody is not proved, or people are not who and where they were taken to be."""
    BRAKES_BLIND = "brakes_blind"
    """The same because something is not measured, or not well enough."""
    BRAKES_UNPROVED = "brakes_unproved"
    """The same because the car's own motion is not proved, whoever is around."""
    STAYS = "stays"
    """Does not set off, or is never faster than walking pace, 1.5 m/s."""
    COLLIDES = "collides"
    """Touches somebody while it moves: shown where a policy promises nothing else."""
    ANY = "any"
    """Brakes or not, touches nobody while it moves."""


@final
@dataclass(frozen=True, slots=True)
class Dropout:
    """Nothing of one kind ("localisation", "people") is measured between two instants (s)."""

    what: str
    from_s: float
    until_s: float


@final
@dataclass(frozen=True, slots=True)
class Ghost:
    """Somebody who is not there and is reported from from_s until until_s, standing at a place."""

    x_m: float
    y_m: float
    from_s: float
    until_s: float


@final
@dataclass(frozen=True, slots=True)
class Occluder:
    """A box (axis-aligned, m) that people cannot be seen through, a parked van or a hedge."""

    x_min_m: float
    y_min_m: float
    x_max_m: float
    y_max_m: float


@final
@dataclass(frozen=True, slots=True)
class Sensing:
    """How the world is measured; the paper's figures are its defaults where it gives any.

    position_m: largest error of a localised position, in any direction; it changes with every
    range, at 3 Hz, the sets come at 10 Hz; heading_rad,
    speed_mps: likewise; dropped: share of localisation sets that are lost, by chance; person_m:
    largest error of a person's position (the paper: 0.5), at 5 Hz; person_mps: of their velocity;
    delay_s: least and greatest time from measuring to the frame; watched_m: radius about the car
    within which everybody in sight is reported.
    """

    position_m: float = 0.1
    heading_rad: float = 0.02
    speed_mps: float = 0.05
    dropped: float = 0.005
    person_m: float = 0.2
    person_mps: float = 0.2
    delay_s: tuple[float, float] = (0.005, 0.03)
    watched_m: float = 30.0
    dropouts: tuple[Dropout, ...] = ()
    ghosts: tuple[Ghost, ...] = ()
    occluders: tuple[Occluder, ...] = ()
    assumes_unseen: bool = True
    """Whether somebody is reported as assumed at the edge of what an occluder hides."""


class Cast(Protocol):
    """Who is in a scenario; a new set of people for each run."""

    def people(self, seed: int, path: SplinePath) -> tuple[Pedestrian, ...]:
        """Everybody, at the scenario's beginning."""


@final
@dataclass(frozen=True, slots=True)
class Scenario:
    """What happens around a car that starts at standstill at the beginning of its path.

    name: a word; title, story: for a report; waypoints (m) of the path; duration_s: from the car's
    permission to drive; passed_m: station behind which whatever the scenario is about is over;
    goals: where people may want to go, for the estimation of intent, () for none known; expected:
    by policy ("LookAhead", "FailSafe", "both").
    """

    name: str
    title: str
    story: str
    waypoints: tuple[Point, ...]
    duration_s: float
    passed_m: float
    cast: Cast
    sensing: Sensing = Sensing()
    goals: tuple[Goal, ...] = ()
    expected: Mapping[str, Expected] = field(default_factory=dict)

    @property
    def path(self) -> SplinePath:
        """The path through the waypoints."""
        return SplinePath.through(self.waypoints)
