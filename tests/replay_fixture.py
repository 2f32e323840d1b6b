"""A monitor that answers as told, and recordings made by formula."""

from __future__ import annotations

import math
from collections.abc import Callable

from workbench.claims import Assumption, Rigor, Verdict
from workbench.runtime import Action, Decision, MotionLimits, Observation
from workbench.runtime.policies import Alert, Hypothesis, Outcome, Turn, Violation
from workbench.simulation.recording import (
    PersonSample,
    Recording,
    Shape,
    Track,
    VehicleSample,
)

LIMITS = MotionLimits(2.5, 1.5)


class Scripted:
    """Keeps what it was shown; brakes where `unproved(observation)` holds; sends what it said
    last, TRACK at first."""

    def __init__(self, unproved: Callable[[Observation], bool] = lambda observation: False) -> None:
        self.seen: list[Observation] = []
        self.turns: list[float] = []
        self._unproved = unproved
        self._action = Action.TRACK

    def step(self, observation: Observation) -> Decision:
        self.seen.append(observation)
        braking = self._unproved(observation)
        verdict = Verdict.UNPROVED if braking else Verdict.SAFE
        self._action = Action.BRAKE if braking else Action.TRACK
        violation = Violation(Hypothesis.PEOPLE, "p left the guard", refutes_plan=True)
        ahead = Outcome("LookAhead", verdict, self._action, "as told", (), None, None)
        safe = Outcome("FailSafe", Verdict.SAFE, Action.TRACK, "safe", (), None, 1.5)
        return Decision(
            verdict=verdict,
            action=self._action,
            reason="as told",
            brake_from_s=observation.stamp_s + 0.15,
            look_ahead=ahead,
            fail_safe=safe,
            violations=(violation,) if braking else (),
            alert=Alert("p", "not even braking helps") if braking else None,
            clearance_m=0.25 * len(self.seen) if observation.people else None,
            clearance_time_s=1.0 if observation.people else None,
            clearance_person=observation.people[0].name if observation.people else None,
            occupancy=((1.0, 2.0, 0.1, 2.4, 0.912345),),
            tube_lower=(),
            tube_upper=(),
            stop_occupancy=((1.5, 2.5, 0.2, 2.5, 0.987654),),
            level_verdicts={"track": (verdict, Verdict.SAFE), "stop": (Verdict.SAFE,) * 2},
            deciding_level="whole",
            assumptions=(Assumption("told", "it was told so", "none"),),
            elapsed_s=0.001 * len(self.seen),
            rigor=Rigor.NUMERICAL,
        )

    def turn(self, now_s: float) -> Turn:
        self.turns.append(now_s)
        return Turn(self._action, None)


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
