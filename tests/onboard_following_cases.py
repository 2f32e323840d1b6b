"""Reports and commands of which a test says every figure, and what is doubted about them."""

from __future__ import annotations

from dataclasses import replace

from onboard_core_bench import OWN, PACMOD2, framed
from onboard_core_cases import SENSORS, SETTINGS

from workbench.runtime.onboard.actuation import Outputs
from workbench.runtime.onboard.faults import Found
from workbench.runtime.onboard.following import Following
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.policies import BrakeBounds

LIMITS = replace(
    SETTINGS.limits, echo_us=200_000, follow_us=500_000, frozen_us=600_000, count=0.125,
    pedal_error=0.25, wheel_error_rad=0.5, frozen_mps=0.5, stands_mps=0.25, report_period_us=31_250,
)  # fmt: skip
BRAKE = BrakeBounds(deceleration_min_mps2=2.0, delay_s=0.125, build_up_s=0.0625)
FREE = Outputs(0.0, 0.0, 0.0, 0.5)
S = 1_000_000


def bare() -> Intake:
    return Intake(PACMOD2, OWN, stamps=SENSORS.stamps)


def with_speed(made: Intake, value: float, *at_us: int) -> Intake:
    for each in at_us:
        told = {"VEHICLE_SPEED": value, "VEHICLE_SPEED_VALID": 1}
        made.receive(*framed("VEHICLE_SPEED_RPT", told), each)
    return made


def with_system(made: Intake, message: str, commanded: float, output: float, at_us: int) -> Intake:
    told = {"MANUAL_INPUT": 0.0, "COMMANDED_VALUE": commanded, "OUTPUT_VALUE": output}
    if message == "BRAKE_RPT":
        told["BRAKE_ON_OFF"] = 1
    made.receive(*framed(message, told), at_us)
    return made


def sends(*sent: tuple[int, Outputs]) -> Following:
    return Following(sent=sent or ((0, FREE),), apart_us={})


def doubts(following: Following, made: Intake, now_us: int) -> list[Found]:
    return list(following.found(made, LIMITS, now_us, brake=BRAKE, error_mps=0.125))
