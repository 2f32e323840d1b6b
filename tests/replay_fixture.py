"""A monitor that answers as told, and recordings made by formula."""

from __future__ import annotations

import math
from collections.abc import Callable

from workbench.claims import Assumption, Rigor, Verdict
from workbench.runtime import Action, Decision, Observation
from workbench.simulation.recording import (
    PersonSample,
    Recording,
    Shape,
    Track,
    VehicleSample,
)


class Scripted:
    """Keeps what it was shown; brakes where `unproved(observation)` holds."""

    def __init__(self, unproved: Callable[[Observation], bool] = lambda observation: False) -> None:
        self.seen: list[Observation] = []
        self._unproved = unproved

    def step(self, observation: Observation) -> Decision:
        self.seen.append(observation)
        braking = self._unproved(observation)
        return Decision(
            verdict=Verdict.UNPROVED if braking else Verdict.SAFE,
            action=Action.BRAKE if braking else Action.TRACK,
            reason="as told",
            clearance_m=0.25 * len(self.seen) if observation.people else None,
            clearance_time_s=1.0 if observation.people else None,
            clearance_person=observation.people[0].name if observation.people else None,
            assumptions=(Assumption("told", "it was told so", "none"),),
            occupancy=((1.0, 2.0, 0.1, 2.4, 0.912345),),
            tube_lower=(),
            tube_upper=(),
            elapsed_s=0.001 * len(self.seen),
            rigor=Rigor.NUMERICAL,
        )


def on_circle(t_s: float, *, radius_m: float, speed_mps: float, ahead_m: float) -> VehicleSample:
    """A car whose rear axle turns left on a circle through the origin, heading +x there."""
    angle = speed_mps * t_s / radius_m
    return VehicleSample(
        t_s,
        radius_m * math.sin(angle) + ahead_m * math.cos(angle),
        radius_m * (1.0 - math.cos(angle)) + ahead_m * math.sin(angle),
        angle,
        speed_mps,
        0.0,
        0.0,
        speed_mps / radius_m,
    )


def drive(
    *, speed_mps: float = 4.0, radius_m: float = 20.0, people: tuple[Track, ...] = ()
) -> Recording:
    """Four seconds on a circle."""
    samples = tuple(
        on_circle(0.1 * k, radius_m=radius_m, speed_mps=speed_mps, ahead_m=0.3) for k in range(41)
    )
    return Recording("made", "ego", "car", Shape(3.5, 1.3, 0.91, 2.71), samples, people)


def standing(name: str, x_m: float, y_m: float, *, first_s: float = 0.0) -> Track:
    """A pedestrian who stands, sampled from first_s to 4 s."""
    times = (0.1 * k for k in range(41))
    return Track(name, "ped", tuple(PersonSample(t, x_m, y_m) for t in times if t >= first_s))
