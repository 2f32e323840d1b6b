"""What lies between drive-by-wire commands and a chassis, inside what the vehicle file claims."""

from __future__ import annotations

import math
import random
from collections import deque
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime.arc import Interval
from workbench.runtime.onboard.drive_by_wire import DriveByWire
from workbench.simulation.plants.chassis import Chassis, Motion
from workbench.simulation.plants.response import Line, Ramp

STEP_US: Final = 5_000
"""Longest time in which pedals and steering rate are taken as constant."""
# Motors turn faster than the most they are told, by as much at most when drawn.
_FASTER: Final = 1.5


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Actuators:
    """How one car's actuators differ from the middle of what its file says; all constant in time.

    pedal_delay_s, steering_delay_s: from a command to the begin of its effect; accelerator_up_s,
    brake_up_s: in which a pedal's ratio then comes up, linearly; steering_up_s: in which the
    wheel's rate changes from end to end. accelerator_dead: ratio below which that pedal is idle.
    accelerator_share, brake_share, road_wheel_share: where in the map's band the effect lies, -1 at
    its lower edge, 1 at its upper. rate_share: how much the wheel's rate exceeds the commanded one;
    wheel_dead_rad: distance from the target at which the wheel rests; wheel_rate_limit_radps: the
    motor's. coast_mps2: with no pedal pressed.
    """

    pedal_delay_s: float
    accelerator_up_s: float
    brake_up_s: float
    accelerator_dead: float
    accelerator_share: float
    brake_share: float
    coast_mps2: float
    steering_delay_s: float
    steering_up_s: float
    road_wheel_share: float
    rate_share: float
    wheel_dead_rad: float
    wheel_rate_limit_radps: float

    @classmethod
    def middle(cls, wire: DriveByWire) -> Actuators:
        """Everything in the middle of its band."""
        return cls(**{name: 0.5 * (low + high) for name, (low, high) in bands(wire).items()})

    @classmethod
    def drawn(cls, wire: DriveByWire, source: random.Random) -> Actuators:
        """Everything somewhere in its band, uniformly and independently."""
        return cls(**{name: source.uniform(*band) for name, band in bands(wire).items()})

    def require_within(self, wire: DriveByWire) -> None:
        """Raise InputError for what lies outside of its band."""
        for name, (low, high) in bands(wire).items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(
                    f"actuators: {name}: expected within [{low!r}, {high!r}], as the vehicle "
                    f"file's [drive_by_wire] says, got {value!r}; change it, or measure the file"
                )


def bands(wire: DriveByWire) -> dict[str, Interval]:
    """What the file allows for each part of `Actuators`.

    The accelerator may be dead as far as its map's band, and that of coasting, reach 0; the motor
    turns no slower than the most it is told.
    """
    steering, pedals = wire.steering, wire.pedals
    fastest = steering.wheel_rate_limit_radps
    return {
        "pedal_delay_s": pedals.delay_s,
        "accelerator_up_s": pedals.build_up_s,
        "brake_up_s": pedals.build_up_s,
        "accelerator_dead": _dead_ratios(wire),
        "accelerator_share": (-1.0, 1.0),
        "brake_share": (-1.0, 1.0),
        "coast_mps2": pedals.coast_mps2,
        "steering_delay_s": steering.delay_s,
        "steering_up_s": steering.build_up_s,
        "road_wheel_share": (-1.0, 1.0),
        "rate_share": (-steering.rate_error, steering.rate_error),
        "wheel_dead_rad": (0.0, steering.dead_band_rad),
        "wheel_rate_limit_radps": (fastest, _FASTER * fastest),
    }


def _dead_ratios(wire: DriveByWire) -> Interval:
    """From the begin of the map to the last ratio of which coasting is a possible effect, or to the
    least that is ever sent."""
    pedals = wire.pedals
    curve = pedals.accelerator
    least, sent = curve.commands[0], curve.command_for(pedals.coast_below_mps2)
    for low, high, ratio, following in zip(
        curve.lowest, curve.lowest[1:], curve.command, curve.command[1:], strict=False
    ):
        if low <= pedals.coast_mps2[0] < high:
            share = (pedals.coast_mps2[0] - low) / (high - low)
            return least, max(min(ratio + share * (following - ratio), sent), least)
    return least, least if curve.lowest[0] > pedals.coast_mps2[0] else sent


@final
class DriveByWireCar:
    """A chassis that takes accelerator and brake (ratios) and a target for its steering wheel.

    Commands have effect after their delay; pedals then come up linearly; the wheel turns towards
    its target at the commanded rate and rests within its dead band. At every instant the pedals'
    ratios lie between those commanded within the longest delay and build-up. The same calls give
    the same bits. Raises InputError for actuators outside of what `wire` claims.
    """

    def __init__(self, chassis: Chassis, wire: DriveByWire, actuators: Actuators) -> None:
        actuators.require_within(wire)
        self._chassis, self._is = chassis, actuators
        self._now_us = 0
        self._pedal_delay_us = round(1e6 * actuators.pedal_delay_s)
        self._steering_delay_us = round(1e6 * actuators.steering_delay_s)
        self._accelerator = Ramp(round(1e6 * actuators.accelerator_up_s))
        self._brake = Ramp(round(1e6 * actuators.brake_up_s))
        self._pedals_due: deque[int] = deque()
        self._steer_due: deque[tuple[int, float, float]] = deque()
        self._target: tuple[float, float] | None = None
        self._pressed = (0.0, 0.0)
        self._wheel_rate = 0.0
        self._pushes = Line(wire.pedals.accelerator, actuators.accelerator_share)
        self._holds = Line(wire.pedals.brake, actuators.brake_share)
        self._road = Line(wire.steering.road_wheel, actuators.road_wheel_share)
        self._far_rad = wire.steering.wheel_limit_rad
        self._wheel_rad = self._road.command_for(chassis.motion.road_wheel_rad)

    @property
    def motion(self) -> Motion:
        """Of the chassis."""
        return self._chassis.motion

    @property
    def accelerator(self) -> float:
        """Where the pedal is, a ratio."""
        return self._pressed[0]

    @property
    def brake(self) -> float:
        """Where the pedal is, a ratio."""
        return self._pressed[1]

    @property
    def wheel_rad(self) -> float:
        """Angle of the steering wheel, positive to the left."""
        return self._wheel_rad

    @property
    def now_us(self) -> int:
        """Time since the start."""
        return self._now_us

    def command(
        self, *, accelerator: float, brake: float, wheel_rad: float, wheel_rate_radps: float
    ) -> None:
        """What it is told from now on; a pedal or angle beyond its range counts as its end.

        Raises InputError for what is not finite, and for a rate below 0.
        """
        if not all(map(math.isfinite, (accelerator, brake, wheel_rad, wheel_rate_radps))):
            raise InputError(
                "command: expected finite numbers, got "
                f"{(accelerator, brake, wheel_rad, wheel_rate_radps)!r}"
            )
        if wheel_rate_radps < 0.0:
            raise InputError(f"wheel_rate_radps: expected >= 0, got {wheel_rate_radps!r}")
        self._press(accelerator, brake)
        target_rad = min(max(wheel_rad, -self._far_rad), self._far_rad)
        at_us = self._now_us + self._steering_delay_us
        self._steer_due.append((at_us, target_rad, wheel_rate_radps))

    def release(self) -> None:
        """Nothing commands it any more: its pedals come back, its wheel stays where it is."""
        self._press(0.0, 0.0)
        self._steer_due.clear()
        self._target, self._wheel_rate = None, 0.0

    def advance(self, duration_us: int) -> None:
        """Go on for a time, in sub-steps that end where a command takes effect."""
        end_us = self._now_us + duration_us
        while self._now_us < end_us:
            now_us = self._now_us
            while self._pedals_due and self._pedals_due[0] <= now_us:
                self._pedals_due.popleft()
            while self._steer_due and self._steer_due[0][0] <= now_us:
                _, target_rad, rate_radps = self._steer_due.popleft()
                self._target = target_rad, rate_radps
            until_us = min(now_us + STEP_US, end_us)
            if self._pedals_due:
                until_us = min(until_us, self._pedals_due[0])
            if self._steer_due:
                until_us = min(until_us, self._steer_due[0][0])
            self._now_us = until_us
            self._step((until_us - now_us) / 1e6)

    def _press(self, accelerator: float, brake: float) -> None:
        at_us = self._now_us + self._pedal_delay_us
        self._accelerator.set(at_us, min(max(accelerator, 0.0), 1.0))
        self._brake.set(at_us, min(max(brake, 0.0), 1.0))
        self._pedals_due.append(at_us)

    def _step(self, step_s: float) -> None:
        # The ramps' values at the end of the sub-step are values of commands already in force.
        self._pressed = self._accelerator.at(self._now_us), self._brake.at(self._now_us)
        self._turn_wheel(step_s)
        turns = self._road.effect(self._wheel_rad) - self._chassis.motion.road_wheel_rad
        self._chassis.advance(self._push(), turns / step_s, step_s)

    def _push(self) -> float:
        """Acceleration by the pedals where they are."""
        accelerator, brake = self._pressed
        coast = self._is.coast_mps2
        if brake > 0.0:
            coast, hold = 0.0, max(self._holds.effect(brake), 0.0)
        else:
            hold = 0.0
        if accelerator < self._is.accelerator_dead:
            return coast - hold
        return max(self._pushes.effect(accelerator), coast) - hold

    def _turn_wheel(self, step_s: float) -> None:
        """Towards the target; its rate changes as fast as the build-up lets it."""
        short, wanted = 0.0, 0.0
        if self._target is not None:
            short = self._target[0] - self._wheel_rad
            if abs(short) > self._is.wheel_dead_rad:
                fast = self._target[1] * (1.0 + self._is.rate_share)
                wanted = math.copysign(min(fast, self._is.wheel_rate_limit_radps), short)
        most = math.inf
        if self._is.steering_up_s > 0.0:
            most = 2.0 * self._is.wheel_rate_limit_radps * step_s / self._is.steering_up_s
        self._wheel_rate += min(max(wanted - self._wheel_rate, -most), most)
        turned = self._wheel_rate * step_s
        if wanted and turned * short > 0.0 and abs(turned) >= abs(short):
            turned, self._wheel_rate = short, 0.0
        self._wheel_rad = min(max(self._wheel_rad + turned, -self._far_rad), self._far_rad)
