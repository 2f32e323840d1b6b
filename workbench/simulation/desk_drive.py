"""A scenario driven without a bus: the same kernel, policies, law, drive-by-wire, plant and people,
with observations made from the truth. For campaigns: several times as fast as over frames.

What is left out: frames with their rounding, dead reckoning, the checks for faults, and arming. In
their place stand errors within the same bounds, and intervals about as wide as the core's were in
drives of the library; the delay of the localisation is in these. People come as late as on the bus,
with stamps of another clock. A car whose place or people are too old, or whose place is known less
well than the proof grants its controller, brakes, and what it is asked about then is INVALID.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime import Action, Observation
from workbench.runtime.arc import Interval
from workbench.runtime.decision import Decision
from workbench.runtime.onboard.actuation import Sent, Wanted, actuate, brake_outputs, resting
from workbench.runtime.onboard.dead_reckoning import Pose
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.pid import (
    Integrals,
    LawCommand,
    Reading,
    TrackLaw,
    advanced,
    ramped_reference_mps,
)
from workbench.runtime.onboard.times import DECIDE_EVERY, TURN_US
from workbench.runtime.policies import Ground
from workbench.simulation.bus_sensing import LOCALISED_US, Sensors
from workbench.simulation.clock import SetClock
from workbench.simulation.desk_people import DeskPeople
from workbench.simulation.measures import Judge
from workbench.simulation.objections import Objections
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.scene import Scene

_CHECK_S: Final = (0.005, 0.03)
# Beside what the localisation claims: what delays and frames add on board, and what each second
# since the last one adds. The speed is known by the car's own reports.
_POSITION_M, _HEADING_RAD, _STEERING_RAD, _SPEED_MPS = 0.1, 0.03, 0.019, 0.19
_POSITION_MPS, _HEADING_RADPS = 0.1, 0.03


@final
@dataclass(frozen=True, slots=True)
class Errors:
    """What the controller reads wrongly until the next localisation: m, m, rad, m/s."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float


@final
@dataclass(frozen=True, slots=True)
class Widths:
    """Half widths of what is known: place (m, each way), heading (rad), speed (m/s)."""

    position_m: float
    heading_rad: float
    speed_mps: float


@final
@dataclass(frozen=True, slots=True)
class Driving:
    """Who decides and what the car is told by: judge reads clock; law, settings: of the bundle;
    heeds_faults: whether it brakes for what is not measured, whatever the judge permits."""

    judge: Judge
    clock: SetClock
    law: TrackLaw
    settings: OnboardSettings
    heeds_faults: bool = True


@final
class DeskLoop:
    """Turn by turn: the law at every one, a decision at every third.

    The same scene, driving and seed give the same run.
    """

    def __init__(self, scene: Scene, driving: Driving, *, seed: int) -> None:
        self._scene, self._driving = scene, driving
        self._chance = random.Random(f"desk {seed}")
        self._sensors = Sensors(scene.scenario.sensing, random.Random(f"sensors {seed}"), 0)
        self._errors = Errors(0.0, 0.0, 0.0, 0.0)
        self._people = DeskPeople(scene, driving.settings.sensors, seed=seed)
        self._due_us = self._located_us = 0
        self._integrals, self._command = Integrals(), LawCommand(0.0, 0.0, 0.0, 0.0)
        self._reference_mps, self._turns = 0.0, 0
        self._action = Action.BRAKE
        sent = resting(driving.settings.drive_by_wire, 0.0)
        assert sent is not None, "a straight wheel is within its limits"
        self._sent: Sent = sent
        self._objections = Objections()
        self.grounds: tuple[Ground, ...] = ()
        self.decision: Decision | None = None

    @property
    def command(self) -> LawCommand:
        """What the law commanded last; of BRAKE, its steering."""
        return self._command

    @property
    def reference_mps(self) -> float:
        """The speed that TRACK goes for, m/s."""
        return self._reference_mps

    @property
    def tracks(self) -> bool:
        """Whether TRACK is what was sent last."""
        return self._action is Action.TRACK

    def turn(self) -> None:
        """One turn: look, decide where it is time, send, and let the scene go on."""
        scene, driving = self._scene, self._driving
        now_s = driving.clock.now_s = scene.now_us / 1e6
        self._measure()
        motion = scene.car.motion
        permitted = driving.judge.turn(now_s).action
        blind = self._blind
        action = Action.BRAKE if blind and driving.heeds_faults else permitted
        decides = self._turns % DECIDE_EVERY == 0
        self._drive(action, motion)
        self.grounds = self._objections.after(None, blind=blind)
        if decides:
            self._objections.after(self._decide(motion, now_s))
        scene.advance(TURN_US)
        self._turns += 1

    @property
    def _widths(self) -> Widths:
        sensing = self._scene.scenario.sensing
        age_s = (self._scene.now_us - self._located_us) / 1e6
        return Widths(
            sensing.position_m + _POSITION_M + _POSITION_MPS * age_s,
            sensing.heading_rad + _HEADING_RAD + _HEADING_RADPS * age_s,
            max(sensing.speed_mps, _SPEED_MPS),
        )

    @property
    def _blind(self) -> bool:
        """Whether place or people are too old, or anything is known less well than the proof
        grants."""
        settings, widths = self._driving.settings, self._widths
        granted = settings.reading
        return (
            self._people.lost
            or self._scene.now_us - self._located_us > settings.sensors.localisation_age_us
            or widths.position_m > granted.offset_m
            or widths.heading_rad > granted.heading_rad
            or widths.speed_mps > granted.speed_mps
        )

    def _decide(self, motion: Motion, now_s: float) -> Decision:
        """Ask the judge; TRACK is about the next reference speed, which then holds."""
        driving, turn_s = self._driving, TURN_US / 1e6
        next_mps = ramped_reference_mps(
            driving.law, self._reference_mps,
            target_mps=driving.settings.reference_speed_mps,
            slew_mps3=driving.settings.drive_by_wire.pedals.slew_mps3, step_s=turn_s,
        )  # fmt: skip
        observation = self._observation(motion, next_mps, now_s)
        driving.clock.now_s = now_s + self._chance.uniform(*_CHECK_S)
        self.decision = driving.judge.step(observation)
        if self.decision.action is Action.TRACK:
            self._reference_mps = next_mps
        return self.decision

    def _measure(self) -> None:
        """Where the car is, ten times a second, and who is around."""
        scene, at_us = self._scene, self._scene.now_us
        if at_us >= self._due_us:
            self._due_us += LOCALISED_US
            place = self._sensors.localised(scene.car.motion, at_us)
            if place is not None:
                self._located_us = at_us
                true = scene.car.motion
                self._errors = Errors(
                    place.x_m - true.x_m, place.y_m - true.y_m,
                    math.remainder(place.heading_rad - true.heading, math.tau),
                    place.speed_mps - true.speed_mps,
                )  # fmt: skip
        self._people.look(self._sensors)

    def _drive(self, action: Action, motion: Motion) -> None:
        """The law on what it reads, through the drive-by-wire, to the car."""
        driving, turn_s = self._driving, TURN_US / 1e6
        wire = driving.settings.drive_by_wire
        self._integrals = advanced(self._integrals, self._command, turn_s)
        if action is not self._action:
            self._integrals = Integrals(0.0, self._integrals.offset_ms)
        self._action = action
        reading = self._reading(motion)
        wheel_rad = self._scene.car.wheel_rad
        if action is Action.TRACK:
            self._command = driving.law.track(
                reading, self._integrals, reference_speed_mps=self._reference_mps
            )
            wanted = Wanted(self._command.acceleration_mps2, self._command.steering_rate_radps)
            actuated = actuate(
                wire, wanted, read_back_rad=wheel_rad, before=self._sent, elapsed_s=turn_s
            )
        else:
            self._reference_mps = max(reading.speed_mps, 0.0)
            self._command = driving.law.brake(
                reading, self._integrals, stop_speed_mps=wire.stop_speed_mps
            )
            actuated = brake_outputs(
                wire, self._command.steering_rate_radps, read_back_rad=wheel_rad,
                before=self._sent, elapsed_s=turn_s,
            )  # fmt: skip
        self._sent = actuated.sent
        outputs = actuated.sent.outputs
        self._scene.car.command(
            accelerator=outputs.accelerator, brake=outputs.brake, wheel_rad=outputs.wheel_rad,
            wheel_rate_radps=outputs.wheel_rate_radps,
        )  # fmt: skip

    def _reading(self, motion: Motion) -> Reading:
        errors, place = self._errors, self._scene.place()
        aside_m = errors.y_m * math.cos(place.tangent) - errors.x_m * math.sin(place.tangent)
        return Reading(
            place.offset_m + aside_m,
            math.remainder(motion.heading - place.tangent, math.tau) + errors.heading_rad,
            motion.road_wheel_rad,
            motion.speed_mps + errors.speed_mps,
            place.curvature_per_m,
        )

    def _observation(self, motion: Motion, reference_mps: float, now_s: float) -> Observation:
        errors, widths = self._errors, self._widths
        pose = Pose(
            _around(motion.x_m + errors.x_m, widths.position_m),
            _around(motion.y_m + errors.y_m, widths.position_m),
            _around(motion.heading + errors.heading_rad, widths.heading_rad),
        )
        return Observation(
            x=(math.nan, math.nan) if self._blind else pose.x,
            y=pose.y,
            heading=pose.heading,
            steering=_around(motion.road_wheel_rad, _STEERING_RAD),
            speed=_around(motion.speed_mps + errors.speed_mps, widths.speed_mps),
            speed_integral=(self._integrals.speed_m, self._integrals.speed_m),
            offset_integral=(self._integrals.offset_ms, self._integrals.offset_ms),
            reference_speed_mps=reference_mps,
            people=self._people.observed(),
            stamp_s=now_s,
            watched=self._people.watched(pose),
        )


def _around(value: float, radius: float) -> Interval:
    return value - radius, value + radius
