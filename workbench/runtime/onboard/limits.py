"""From where on something is a fault: the numbers behind the table of faults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.arc import Interval


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FaultLimits:
    """When a condition counts; times in us.

    report_age_us: oldest needed report; report_period_us: how often they come; localisation_age_us,
    people_age_us: oldest sets, from their stamps; recent_us: how long something that happened once
    stays a reason not to arm. refused_in_a_row: frames; speed_mps, accel_mps2, wheel_rate_radps:
    what the vehicle can do, physically, and how fast its reports may change; speed_step_mps,
    wheel_step_rad: by how much besides; yaw_rate_radps: error of a reported yaw rate. frozen_us,
    frozen_mps, frozen_m: what FROZEN takes; agree_m: distance over which localisation and reports
    must agree after they contradicted each other. pedal: ratio from which a driver's foot counts;
    stands_mps: reported speed up to which the car stands; enable_us: longest time to enable;
    echo_us, follow_us: longest time until the vehicle repeats a command and until its output
    follows; count: ratio, rad; pedal_error, wheel_error_rad: how far output and command may be
    apart. busy_frames: most frames within 0.1 s (up to 0.2 s are counted); release_us: how long a
    fault that brakes must be gone.
    """

    report_age_us: int
    report_period_us: int
    localisation_age_us: int
    people_age_us: int
    recent_us: int
    refused_in_a_row: int
    speed_mps: Interval
    accel_mps2: float
    wheel_rate_radps: float
    speed_step_mps: float
    wheel_step_rad: float
    yaw_rate_radps: float
    frozen_us: int
    frozen_mps: float
    frozen_m: float
    agree_m: float
    pedal: float
    stands_mps: float
    enable_us: int
    echo_us: int
    follow_us: int
    count: float
    pedal_error: float
    wheel_error_rad: float
    busy_frames: int
    release_us: int

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not isinstance(value, tuple) and not value > 0:
                raise InputError(f"{name}: expected a number > 0, got {value!r}")
        low, high = self.speed_mps
        if not low < high:
            raise InputError(f"speed_mps: expected (lowest, highest), got {self.speed_mps!r}")


def pacmod2_limits(*, localisation_age_us: int, people_age_us: int) -> FaultLimits:
    """Limits for a PACMod 2 shuttle whose reports come every 33 ms.

    Three periods for reports (the vehicle's own rule for commands); the family's largest speed and
    braking with a margin for sliding wheels; the driver's foot at the vehicle's own threshold. The
    ages of sets are those that observations are made up to.
    """
    return FaultLimits(
        report_age_us=100_000,
        report_period_us=33_333,
        localisation_age_us=localisation_age_us,
        people_age_us=people_age_us,
        recent_us=1_000_000,
        refused_in_a_row=3,
        speed_mps=(-5.0, 15.0),
        accel_mps2=12.0,
        wheel_rate_radps=20.0,
        speed_step_mps=0.3,
        wheel_step_rad=0.2,
        yaw_rate_radps=0.05,
        frozen_us=600_000,
        frozen_mps=0.6,
        frozen_m=0.25,
        agree_m=2.0,
        pedal=0.05,
        stands_mps=0.05,
        enable_us=1_000_000,
        echo_us=200_000,
        follow_us=500_000,
        count=0.0025,
        pedal_error=0.15,
        wheel_error_rad=0.6,
        busy_frames=500,
        release_us=1_000_000,
    )
