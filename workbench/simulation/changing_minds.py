"""Generated people beside a straight road who change their goal, or want one that nobody knows,
just as a car comes: where they walk, and what is measured of them."""

from __future__ import annotations

import dataclasses
import enum
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.estimation.goals import Goal
from workbench.models.spline_path import SplinePath
from workbench.models.vehicle import Vehicle
from workbench.runtime import Action
from workbench.simulation.crossing import PERIOD_S
from workbench.simulation.driving import Driver
from workbench.simulation.recording import PersonSample, Track

ROAD = tuple((float(x), 0.0) for x in range(0, 81, 8))
"""Waypoints of the car's way, m."""
_SEEN_S = 2.0
"""Everybody has been in view for so long at time 0."""
_AFTER_S = 5.0
"""The scene goes on for so long after the car would have met the person."""
_LONGEST_S = 20.0
_TURNS_MPS2 = 1.2


class Change(enum.Enum):
    """What the person does all of a sudden."""

    ACROSS = "turns across, to a goal of the set"
    ELSEWHERE = "turns across, to a goal not in the set"
    STAYS = "walks alongside, then stops or turns back"


@final
@dataclass(frozen=True, slots=True)
class Turned:
    """A person on foot who walks straight on and at changed_s takes to another velocity.

    x_m, y_m, before_mps: where they are at changed_s and their velocity until then; after_mps:
    the velocity that they come to with acceleration_mps2, a straight line in velocities.
    """

    name: str
    x_m: float
    y_m: float
    before_mps: tuple[float, float]
    after_mps: tuple[float, float]
    changed_s: float
    acceleration_mps2: float

    @property
    def turning_s(self) -> float:
        """How long the change of velocity takes."""
        return math.dist(self.before_mps, self.after_mps) / self.acceleration_mps2

    def at(self, t_s: float) -> tuple[float, float]:
        """The place at t_s: the velocity is linear while it changes, constant before and after."""
        since = t_s - self.changed_s
        (ux, uy), (wx, wy) = self.before_mps, self.after_mps
        if since <= 0.0:
            return self.x_m + ux * since, self.y_m + uy * since
        # Times for which the old and the new velocity would lead as far.
        rise_s = self.turning_s
        part = min(since, rise_s)
        new_s = since - rise_s / 2.0 if since > rise_s else 0.5 * part * part / rise_s
        old_s = part - 0.5 * part * part / rise_s if rise_s > 0.0 else 0.0
        return self.x_m + ux * old_s + wx * new_s, self.y_m + uy * old_s + wy * new_s

    def aside_s(self, way_m: float) -> float:
        """How long after the change they have gone way_m aside, straight on along x before."""
        rise_s, aside_mps = self.turning_s, abs(self.after_mps[1])
        turning_s = math.sqrt(2.0 * rise_s * way_m / aside_mps)
        return turning_s if turning_s <= rise_s else 0.5 * rise_s + way_m / aside_mps

    def track(self, duration_s: float) -> Track:
        """One sample per decision, from 2 s before the scene begins."""
        first = -round(_SEEN_S / PERIOD_S)
        times = [k * PERIOD_S for k in range(first, round(duration_s / PERIOD_S) + 1)]
        return Track(self.name, "ped", tuple(PersonSample(t, *self.at(t)) for t in times))


@final
@dataclass(frozen=True, slots=True)
class Mind:
    """One scene: who walks, what is known of goals, and what is right after the change.

    right: names of goals that are right after it (the unknown goal always is); until_s: the intents
    are judged until then; met_s: when a car that nobody stops meets the person, None where it does
    not; duration_s: of the scene.
    """

    change: Change
    walker: Turned
    goals: tuple[Goal, ...]
    right: tuple[str, ...]
    until_s: float
    met_s: float | None
    duration_s: float

    @property
    def story(self) -> str:
        """What the person does, in words."""
        if self.change is not Change.STAYS:
            return str(self.change.value)
        stops = self.walker.after_mps == (0.0, 0.0)
        return "walks alongside, then stops" if stops else "walks alongside, then turns back"


@final
@dataclass(frozen=True, slots=True)
class Way:
    """Stations (m) of a car that sets off from standstill at time 0, every PERIOD_S."""

    stations_m: tuple[float, ...]

    @classmethod
    def of(cls, vehicle: Vehicle) -> Way:
        """Along ROAD, undisturbed."""
        driver = Driver(vehicle, SplinePath.through(ROAD))
        state, found = driver.start(0.0), []
        for _ in range(round(_LONGEST_S / PERIOD_S)):
            found.append(state.values[0])
            state = driver.drive(state, Action.TRACK, PERIOD_S)
        return cls(tuple(found))

    def station_m(self, t_s: float) -> float:
        """At t_s, linear between the instants."""
        k = min(int(t_s / PERIOD_S), len(self.stations_m) - 2)
        share = t_s / PERIOD_S - k
        return (1.0 - share) * self.stations_m[k] + share * self.stations_m[k + 1]


def mind(change: Change, vehicle: Vehicle, way: Way, seed: int) -> Mind:
    """A scene by chance: the person walks 1.6 to 3 m beside the car's way at 1 to 1.6 m/s.

    Who turns across is in front of the car, or beside its body, when it gets there undisturbed, 6
    to 9 s after it set off; nobody is nearer to its way than 1.6 m before. All keep to 1.6 m/s and
    1.2 m/s^2. Raises InputError for a seed below 0.
    """
    if seed < 0:
        raise InputError(f"seed: expected 0 or more, got {seed}")
    # By value: what a seed gives does not change with the order of the members.
    chance = random.Random(f"{change.value} {seed}")
    side, beside_m = chance.choice((-1.0, 1.0)), chance.uniform(1.6, 3.0)
    along, away = chance.uniform(1.0, 1.6), chance.uniform(1.0, 1.6)
    slant, met_s = chance.uniform(-0.3, 0.3), chance.uniform(6.0, 9.0)
    shape = vehicle.geometry
    met = (
        way.station_m(met_s) + chance.uniform(-shape.rear_m, shape.front_m),
        chance.uniform(-1.0, 1.0) * shape.half_width_m,
    )
    across = (away * math.sin(slant), -side * away * math.cos(slant))
    # As if they turned across at the origin at time 0.
    turning = Turned("walker", 0.0, 0.0, (along, 0.0), across, 0.0, _TURNS_MPS2)
    crossing_s = turning.aside_s(abs(side * beside_m - met[1]))
    after = across
    if change is Change.STAYS:
        after = (0.0, 0.0) if chance.random() < 0.5 else (-along, 0.0)
    walker = dataclasses.replace(
        turning, x_m=met[0] - turning.at(crossing_s)[0], y_m=side * beside_m, after_mps=after,
        changed_s=met_s - crossing_s,
    )  # fmt: skip
    beyond_s = (4.0 - abs(met[1])) / abs(across[1])
    goals = _goals(change, walker)
    right = {Change.ACROSS: ("across",), Change.ELSEWHERE: ()}.get(change, ("back",))
    stops = after == (0.0, 0.0)
    return Mind(
        change, walker, goals, () if stops else right,
        walker.changed_s + 5.0 if change is Change.STAYS else met_s + beyond_s,
        None if change is Change.STAYS else met_s, met_s + _AFTER_S,
    )  # fmt: skip


def _goals(change: Change, walker: Turned) -> tuple[Goal, ...]:
    """Ahead, back, and across the road or, where that is not known, away from it."""
    side = math.copysign(1.0, walker.y_m)
    x_m, y_m = walker.x_m, walker.y_m
    third = Goal("away", x_m, y_m + side * 10.0, 1.0)
    if change is Change.ACROSS:
        (vx, vy), t = walker.after_mps, walker.turning_s
        far_s = (abs(y_m) + 9.0) / abs(vy)
        third = Goal("across", x_m + 0.5 * t * walker.before_mps[0] + vx * far_s, -side * 9.0, 1.0)
    elif change is Change.STAYS:
        third = Goal("across", x_m, -side * 9.0, 1.0)
    return (Goal("ahead", x_m + 25.0, y_m, 1.0), Goal("back", x_m - 25.0, y_m, 1.0), third)


def measured(track: Track, *, noise_m: float, seed: int) -> Track:
    """The track as measured: errors independent, uniform in a disc of radius noise_m."""
    chance = random.Random(f"measured {track.name} {seed}")

    def off(sample: PersonSample) -> PersonSample:
        size, turn = noise_m * math.sqrt(chance.random()), chance.uniform(0.0, math.tau)
        x_m, y_m = sample.x_m + size * math.cos(turn), sample.y_m + size * math.sin(turn)
        return PersonSample(sample.t_s, x_m, y_m)

    return Track(track.name, track.kind, tuple(map(off, track.samples)))


def leads_after_s(leaders: Sequence[tuple[float, str]], mind: Mind, *, unknown: str) -> float:
    """Time after the change from which on a right goal or the unknown one leads to the end, s.

    leaders: (time, name of the likeliest goal) in order of time; inf where one never does.
    """
    allowed, since = (*mind.right, unknown), math.inf
    for t_s, leader in leaders:
        if mind.walker.changed_s <= t_s <= mind.until_s:
            since = min(since, t_s) if leader in allowed else math.inf
    return since - mind.walker.changed_s
