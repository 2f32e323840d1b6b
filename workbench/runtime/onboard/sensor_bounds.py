"""What the sensors, the vehicle and the people around it are stated to keep to."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.arc import Interval
from workbench.runtime.onboard.stamps import Instants, StampBounds
from workbench.runtime.person_guard import MotionLimits


@final
@dataclass(frozen=True, slots=True)
class PersonBounds:
    """limits: what nobody of a kind exceeds; intent_mps2: by how much a second the velocity of one
    who keeps on going as they do may change, at most the limit."""

    limits: MotionLimits
    intent_mps2: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SensorBounds:
    """Everything that an Observation rests on; raises InputError where it makes no sense.

    stamps: clocks and delays of those who send localisation and people. report_delay_us: (least,
    most) time from the instant at which a vehicle's report is true to the one that it is received
    with: sampling, bus, and the longest that our loop leaves frames unread; nothing on the bus
    shows it. Our own clock runs true; how far it does not is part of the gain. true speed = report
    x a number of speed_gain, +- speed_error_mps (its last count among them), always within
    speed_range_mps; acceleration_mps2: all that ever happens to it, 0 inside. The steering wheel's
    report is within steering_wheel_error_rad; road_wheel gives, of a steering-wheel angle (rad),
    all road-wheel angles that may belong to it: both ends of it must grow with the angle, and it is
    asked up to steering_wheel_limit_rad and no further. The road wheel is always within
    steering_limit_rad and turns by up to steering_rate_radps. wheelbase_m: holds the true one.
    on_foot, on_wheels: people; unseen_speed_mps: of whoever is not on the list, not below the
    bundle's guard. The ages: how old (us) what is used may be.
    """

    stamps: StampBounds
    report_delay_us: Instants
    speed_gain: Interval
    speed_error_mps: float
    speed_range_mps: Interval
    acceleration_mps2: Interval
    steering_wheel_error_rad: float
    steering_wheel_limit_rad: float
    road_wheel: Callable[[float], Interval]
    steering_limit_rad: float
    steering_rate_radps: float
    wheelbase_m: Interval
    on_foot: PersonBounds
    on_wheels: PersonBounds
    unseen_speed_mps: float
    localisation_age_us: int
    people_age_us: int
    report_age_us: int

    def __post_init__(self) -> None:
        for name in ("speed_gain", "speed_range_mps", "acceleration_mps2", "wheelbase_m"):
            low, high = getattr(self, name)
            if not -math.inf < low <= high < math.inf:
                raise InputError(f"{name}: expected finite lower <= upper, got {(low, high)!r}")
        for name in (
            "speed_error_mps",
            "steering_wheel_error_rad",
            "steering_wheel_limit_rad",
            "steering_rate_radps",
            "unseen_speed_mps",
        ):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise InputError(f"{name}: expected a finite number >= 0, got {value!r}")
        if not (self.wheelbase_m[0] > 0.0 and self.speed_gain[0] > 0.0):
            raise InputError(
                "expected wheelbase_m and speed_gain above 0, got "
                f"{self.wheelbase_m!r} and {self.speed_gain!r}"
            )
        if not self.acceleration_mps2[0] <= 0.0 <= self.acceleration_mps2[1]:
            raise InputError(
                f"acceleration_mps2: expected 0 inside, got {self.acceleration_mps2!r}; a car may "
                "keep its speed"
            )
        if not 0.0 < self.steering_limit_rad < 1.5:
            raise InputError(
                f"steering_limit_rad: expected from 0 to 1.5, got {self.steering_limit_rad!r}"
            )
        self._check_times()
        for name in ("on_foot", "on_wheels"):
            bounds = getattr(self, name)
            limits = (bounds.limits.speed_mps, bounds.limits.acceleration_mps2)
            if not (
                all(0.0 <= limit < math.inf for limit in limits)
                and 0.0 <= bounds.intent_mps2 <= limits[1]
            ):
                raise InputError(
                    f"{name}: expected finite limits >= 0 and intent_mps2 within the limit, got "
                    f"{bounds!r}"
                )

    def _check_times(self) -> None:
        least, most = self.report_delay_us
        if not 0 <= least <= most:
            raise InputError(
                f"report_delay_us: expected 0 <= least <= most, got {self.report_delay_us!r}"
            )
        for name in ("localisation_age_us", "people_age_us", "report_age_us"):
            if not 0 < getattr(self, name) <= 10_000_000:
                raise InputError(
                    f"{name}: expected above 0 and up to 10 s, got {getattr(self, name)!r}"
                )
