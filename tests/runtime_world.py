"""Paths, people and observations for tests of the monitor."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from runtime_fixture import fake_bundle

from workbench.claims import Verdict
from workbench.runtime import (
    Action,
    Decision,
    Disc,
    Guard,
    Monitor,
    MotionLimits,
    Observation,
    ObservedPerson,
    PathTable,
    Person,
    Timing,
    Watched,
)

LIMITS = MotionLimits(2.5, 2.0)
TIMING = Timing(period_s=0.1, latency_s=0.05, send_gap_s=0.04)


def arc_table(
    curvature: float, *, nodes: int = 200, spacing_m: float = 0.25, start_m: float = -10.0
) -> PathTable:
    """An arc through the origin at station 0, facing along x there."""
    stations = [start_m + j * spacing_m for j in range(nodes)]
    points = [arc_point(curvature, s, 0.0) for s in stations]
    return PathTable(
        start_m,
        spacing_m,
        tuple(x for x, _ in points),
        tuple(y for _, y in points),
        tuple(curvature * s for s in stations),
        (curvature,) * (nodes - 1),
        (curvature,) * (nodes - 1),
    )


def arc_point(curvature: float, station: float, offset: float) -> tuple[float, float]:
    """The point with these path coordinates, in closed form."""
    turn = curvature * station
    if abs(turn) < 1e-12:
        return station, offset
    along = math.sin(turn) / curvature
    across = 2.0 * math.sin(0.5 * turn) ** 2 / curvature
    return along - offset * math.sin(turn), across + offset * math.cos(turn)


class Clock:
    """A clock that stands still unless it is set."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def observation(
    *people: Person | ObservedPerson,
    at: tuple[float, float] = (0.0, 0.0),
    speed: tuple[float, float] = (1.9, 2.1),
) -> Observation:
    """A vehicle near `at`, facing along x, with 0.1 m of position error; 2 m/s fast."""
    x, y = at
    return Observation(
        x=(x - 0.1, x + 0.1),
        y=(y - 0.1, y + 0.1),
        heading=(-0.01, 0.01),
        steering=(-0.01, 0.01),
        speed=speed,
        speed_integral=(0.0, 0.0),
        offset_integral=(0.0, 0.0),
        reference_speed_mps=2.8,
        people=tuple(
            each if isinstance(each, ObservedPerson) else observed(each) for each in people
        ),
        stamp_s=100.0,
        watched=Watched(x, y, 200.0),
    )


def observed(person: Person, *, limits: MotionLimits = LIMITS, at_s: float = 0.0) -> ObservedPerson:
    """The person with one prediction, and with a guard from the same disc."""
    position = Disc(person.x_m, person.y_m, person.radius_m)
    guard = Guard(at_s, position, Disc(person.vx_mps, person.vy_mps, 0.1), limits)
    return ObservedPerson(person.name, (person.intent,), guard)


def standing(name: str, x_m: float, y_m: float) -> Person:
    """A person who stands still."""
    return Person(name, x_m, y_m, 0.0, 0.0, 0.3, 0.0, 0.0)


class Asked:
    """A monitor with a clock of its own, whose people are asked about by LookAhead if nothing else
    is said; every observation comes 0.1 s after the last."""

    def __init__(self, kind: int = 0, *, level: int = 0, **settings: Any) -> None:
        self.clock = Clock()
        table = settings.pop("path", None) or arc_table(0.0, nodes=300)
        usual: dict[str, Any] = {"release_steps": 1, "clearance_required_m": 0.5, "timing": TIMING}
        self.monitor = Monitor(
            fake_bundle(kind, level), table, clock=self.clock, **(usual | settings)
        )
        # The sender turns from the start, so that BRAKE is sent before anything is measured.
        self.monitor.turn()

    def step(self, seen: Observation, *, after_s: float = 0.1, age_s: float = 0.0) -> Decision:
        """The decision on what held at a stamp `after_s` after the last, asked `age_s` later."""
        self.clock.now_s += after_s
        seen = replace(seen, stamp_s=self.clock.now_s - age_s)
        return self.monitor.step(seen)


def assert_invalid(decision: Decision, reason: str) -> None:
    """Nothing is claimed, the vehicle brakes, everybody is warned."""
    assert decision.verdict is Verdict.INVALID
    assert decision.action is Action.BRAKE
    assert reason in decision.reason
    assert decision.clearance_m is None
    assert decision.clearance_person is None
    assert len(decision.tube_lower) == len(decision.occupancy) == 0
    assert len(decision.stop_occupancy) == len(decision.level_verdicts) == 0
    assert decision.alert is not None
