"""Three judges without proof that others use, each with one parameter.

All see the people that the monitor is told of, without those who are only assumed behind boxes,
and the car where the localisation has it; all want the same clearance as the monitor, and end a
brake as `LookAhead` does, after five clear decisions in a row. A car that is slower than 1 m/s
counts as one of 1 m/s, so that it does not creep into people.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.models.vehicle import Vehicle
from workbench.runtime import Action, Decision, Observation, ObservedPerson
from workbench.runtime.path import PathTable
from workbench.runtime.policies import Turn
from workbench.simulation.campaign.scripted_judges import plain_decision
from workbench.simulation.clock import SetClock
from workbench.simulation.people import Body
from workbench.simulation.rig import MakeJudge

RELEASE_STEPS: Final = 5
CLEARANCE_M: Final = 0.2
_CORRIDOR_M: Final = 0.5
_GROWTH_MPS: Final = 0.5
_LEAST_MPS: Final = 1.0
_STEP_S: Final = 0.1


@final
@dataclass(frozen=True, slots=True)
class Baseline:
    """A rule by name, the unit of its parameter, and the range it is looked for in."""

    name: str
    unit: str
    least: float
    most: float
    blocked: Callable[[Look, float], bool]


@final
class Look:
    """What a rule looks at: the car (rear axle, m; speed, m/s), its path and the people."""

    def __init__(self, observation: Observation, vehicle: Vehicle, path: PathTable) -> None:
        x, y, heading = (
            0.5 * (ends[0] + ends[1])
            for ends in (observation.x, observation.y, observation.heading)
        )
        shape = vehicle.geometry
        self.body = Body(x, y, heading, shape.front_m, shape.rear_m, shape.half_width_m)
        speed_mps = 0.5 * (observation.speed[0] + observation.speed[1])
        self.speed_mps = max(speed_mps, _LEAST_MPS)
        self.people = [each for each in observation.people if not each.assumed]
        self.path = path
        self.node = nearest_node(path, (x, y))


def nearest_node(path: PathTable, place: tuple[float, float]) -> int:
    """Of the path's nodes."""
    x, y = place
    return min(range(len(path.x)), key=lambda j: (path.x[j] - x) ** 2 + (path.y[j] - y) ** 2)


def within_distance(look: Look, metres: float) -> bool:
    """Whether somebody's disc reaches into the path's corridor (body and 0.5 m on either side)
    within a way ahead of the front."""
    path, shape = look.path, look.body
    first = look.node
    count = math.ceil((shape.front_m + metres) / path.spacing_m)
    nodes = range(first, min(first + count, len(path.x) - 1) + 1)
    for person in look.people:
        x, y, reach = _now(person, 0.0)
        for j in nodes:
            dx, dy = x - path.x[j], y - path.y[j]
            wide_m = shape.half_width_m + _CORRIDOR_M + reach
            if dx * dx + dy * dy <= wide_m * wide_m:
                return True
    return False


def time_to_collision(look: Look, seconds: float) -> bool:
    """Whether body and somebody's disc meet within a time, both at constant velocity."""
    body = look.body
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    for person in look.people:
        x, y, reach = _now(person, 0.0)
        dx, dy = x - body.x_m, y - body.y_m
        vx, vy = person.guard.velocity.x, person.guard.velocity.y
        along, across = cos * dx + sin * dy, cos * dy - sin * dx
        v_along, v_across = cos * vx + sin * vy - look.speed_mps, cos * vy - sin * vx
        wide = reach + CLEARANCE_M
        slabs = (
            (along, v_along, -body.rear_m - wide, body.front_m + wide),
            (across, v_across, -body.half_width_m - wide, body.half_width_m + wide),
        )
        low, high = 0.0, seconds
        for at, speed, least, most in slabs:
            low, high = _during((at, speed), (least, most), (low, high))
        if low <= high:
            return True
    return False


def growing_disc(look: Look, seconds: float) -> bool:
    """Whether the body, along its path at constant speed, meets somebody's disc within a time; the
    disc goes on at constant velocity and grows by 0.5 m/s."""
    path, shape = look.path, look.body
    for k in range(math.floor(seconds / _STEP_S) + 1):
        t = k * _STEP_S
        body = shape
        if k:
            j = look.node + round(look.speed_mps * t / path.spacing_m)
            j = min(j, len(path.x) - 1)
            body = Body(
                path.x[j], path.y[j], path.heading[j], shape.front_m, shape.rear_m,
                shape.half_width_m,
            )  # fmt: skip
        for person in look.people:
            x, y, reach = _now(person, t)
            if body.distance(x, y) <= reach + _GROWTH_MPS * t + CLEARANCE_M:
                return True
    return False


BASELINES: Final = (
    Baseline("fixed distance", "m", 0.5, 24.0, within_distance),
    Baseline("time to collision", "s", 0.25, 10.0, time_to_collision),
    Baseline("constant-velocity disc", "s", 0.25, 8.0, growing_disc),
)


def baseline(name: str) -> Baseline:
    """By name; raises InputError for another."""
    for each in BASELINES:
        if each.name == name:
            return each
    raise InputError(
        f"expected a baseline, one of {', '.join(each.name for each in BASELINES)}, got {name!r}"
    )


@final
class RuleJudge:
    """BRAKE while a rule says that somebody is in the way, and until it has not for five decisions
    in a row; BRAKE too while nobody has been looked for."""

    def __init__(self, blocked: Callable[[Look], bool], vehicle: Vehicle, path: PathTable) -> None:
        self._blocked, self._vehicle, self._path = blocked, vehicle, path
        self._clear, self._action = 0, Action.BRAKE

    def turn(self, now_s: float) -> Turn:  # noqa: ARG002
        """As `Judge` says."""
        return Turn(self._action, None)

    def step(self, observation: Observation) -> Decision:
        """As `Judge` says."""
        unseen = observation.watched.radius_m <= 0.0
        if unseen or self._blocked(Look(observation, self._vehicle, self._path)):
            self._clear, self._action = 0, Action.BRAKE
            return plain_decision(Action.BRAKE, "somebody is in the way")
        self._clear += 1
        if self._clear >= RELEASE_STEPS:
            self._action = Action.TRACK
        return plain_decision(self._action, "nobody is in the way")


def judge_of(rule: Baseline, parameter: float, vehicle: Vehicle) -> MakeJudge:
    """As `Rig.at_desk` takes it."""

    def made(path: PathTable, clock: SetClock) -> RuleJudge:  # noqa: ARG001
        return RuleJudge(lambda look: rule.blocked(look, parameter), vehicle, path)

    return made


def _now(person: ObservedPerson, after_s: float) -> tuple[float, float, float]:
    """Middle and radius (m) of the disc at a time after the stamp, at constant velocity."""
    guard = person.guard
    t = after_s - guard.at_s
    return (
        guard.position.x + guard.velocity.x * t,
        guard.position.y + guard.velocity.y * t,
        guard.position.radius,
    )


def _during(
    motion: tuple[float, float], slab: tuple[float, float], span: tuple[float, float]
) -> tuple[float, float]:
    """When, of a time span, a point on a line is in a slab; low > high: never."""
    (at, speed), (least, most), (low, high) = motion, slab, span
    if speed == 0.0:
        return (low, high) if least <= at <= most else (math.inf, -math.inf)
    first, second = sorted(((least - at) / speed, (most - at) / speed))
    return max(low, first), min(high, second)
