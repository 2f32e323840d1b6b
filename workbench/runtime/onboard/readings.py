"""What the last reports and the last localisation say of the car, each at its own instant."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from functools import cache
from typing import Final, TypeVar, final

from workbench.runtime.arc import Interval, hull
from workbench.runtime.onboard.dead_reckoning import (
    Driven,
    Pose,
    Quantity,
    Sampled,
    around,
    per_wheelbase,
    plus,
    product,
)
from workbench.runtime.onboard.intake import Intake, Sample
from workbench.runtime.onboard.report_names import Place
from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.onboard.set_streams import SetSeen, Timed
from workbench.runtime.protocols import Localised, NoSet, PeopleSeen, SetFault, worst_rounding

_BEFORE_US: Final = 200_000


class Unobserved(enum.Enum):
    """Why there is no observation."""

    CLOCK = "the instant is no possible one, or before the last frame"
    LOCALISATION = "there is no whole localisation, or it is too old"
    PEOPLE = "there is no whole set of people, or it is too old"
    OVER_CAPACITY = "the newest set of people says that there are more than it can hold"
    REPORT = "a report of speed or steering is missing or too old"
    STEERING_RANGE = "the steering wheel is reported outside its range"
    CONTRADICTION = "reports and localised speed contradict each other or their bounds of change"


@final
@dataclass(frozen=True, slots=True)
class NotObserved:
    """There is no observation, for a named reason."""

    fault: Unobserved
    detail: str

    def __str__(self) -> str:
        return f"{self.fault.value} ({self.detail})"


@final
class NotObservedError(Exception):
    """Carries a `NotObserved` to whoever asked for an observation."""

    def __init__(self, fault: Unobserved, detail: str) -> None:
        super().__init__(detail)
        self.found = NotObserved(fault, detail)


@cache
def rounding(message: str, *signals: str) -> float:
    """By how much the frames may move a point with these coordinates, rounded up."""
    return math.nextafter(
        math.hypot(*(worst_rounding()[(message, signal)] for signal in signals)), math.inf
    )


Value = TypeVar("Value", bound=Timed)


def recent_localisation(intake: Intake, now_us: int, settings: SensorBounds) -> SetSeen[Localised]:
    """The last one; raises NotObservedError where there is none or it is too old."""
    found = intake.localisation
    return _recent(found, now_us, settings.localisation_age_us, Unobserved.LOCALISATION)


def recent_people(intake: Intake, now_us: int, settings: SensorBounds) -> SetSeen[PeopleSeen]:
    """The last set; raises NotObservedError where there is none, or it is too old or too full."""
    return _recent(intake.people, now_us, settings.people_age_us, Unobserved.PEOPLE)


def _recent(
    found: SetSeen[Value] | NoSet, now_us: int, most_us: int, fault: Unobserved
) -> SetSeen[Value]:
    if isinstance(found, NoSet):
        over = found.fault is SetFault.OVER_CAPACITY
        raise NotObservedError(Unobserved.OVER_CAPACITY if over else fault, str(found))
    age_us = now_us - found.stamp_us[0]
    if age_us > most_us:
        raise NotObservedError(fault, f"up to {age_us} us old, {most_us} us allowed")
    return found


def localised_pose(place: Localised) -> Pose:
    """Box of the pose at the stamp, with what the frames may have moved of it and of its radii."""
    return Pose(
        _localised(place.x_m, place.x_radius_m, ("LOC_POSITION", "X"), ("LOC_RADII", "X_RADIUS")),
        _localised(place.y_m, place.y_radius_m, ("LOC_POSITION", "Y"), ("LOC_RADII", "Y_RADIUS")),
        _localised(
            place.heading_rad,
            place.heading_radius_rad,
            ("LOC_MOTION", "HEADING"),
            ("LOC_MOTION", "HEADING_RADIUS"),
        ),
    )


def localised_speed(place: Localised) -> Interval:
    """Holds the speed at the stamp, as above."""
    return _localised(
        place.speed_mps,
        place.speed_radius_mps,
        ("LOC_MOTION", "SPEED"),
        ("LOC_STAMP", "SPEED_RADIUS"),
    )


def _localised(value: float, radius: float, *moved: tuple[str, str]) -> Interval:
    for message, signal in moved:
        radius = math.nextafter(radius + rounding(message, signal), math.inf)
    return around(value, radius)


def driven_of(
    intake: Intake, place: SetSeen[Localised] | None, *, from_us: int, settings: SensorBounds
) -> Driven:
    """Speed and steering around every instant from from_us on, by the reports and `place`'s speed.

    Raises NotObservedError where there is no report, or the steering wheel is out of its range.
    """
    names = intake.names
    speeds = [
        sample_of(speed_of(sample.value, settings), sample.at_us, settings)
        for sample in samples_of(intake, names.speed, from_us=from_us)
    ]
    if place is not None:
        speeds.append(Sampled(localised_speed(place.value), *place.stamp_us))
    angles = [
        sample_of(steering_of(sample.value, settings), sample.at_us, settings)
        for sample in samples_of(intake, names.steering.output, from_us=from_us)
    ]
    rate, limit = settings.steering_rate_radps, settings.steering_limit_rad
    by_time = tuple(sorted(speeds, key=lambda sampled: sampled.from_us))
    return Driven(
        Quantity(by_time, settings.acceleration_mps2, settings.speed_range_mps),
        Quantity(tuple(angles), (-rate, rate), (-limit, limit)),
        per_wheelbase(settings.wheelbase_m),
    )


def require_recent_reports(intake: Intake, now_us: int, settings: SensorBounds) -> None:
    """Raise NotObservedError where speed or steering has not been reported lately."""
    for place in (intake.names.speed, intake.names.steering.output):
        report = intake.reports.get(place.message)
        if report is None:
            raise NotObservedError(Unobserved.REPORT, f"no {place.message} yet")
        age_us = now_us - report.at_us
        if age_us > settings.report_age_us:
            detail = f"{place.message} came {age_us} us ago, {settings.report_age_us} us allowed"
            raise NotObservedError(Unobserved.REPORT, detail)


def samples_of(intake: Intake, place: Place, *, from_us: int) -> list[Sample]:
    """Samples since a little before from_us, the last report among them."""
    kept = intake.samples[place.message]
    found = [sample for sample in kept if sample.at_us >= from_us - _BEFORE_US] or [*kept][-1:]
    report = intake.reports.get(place.message)
    if report is not None and (not found or report.at_us > found[-1].at_us):
        found.append(Sample(report.values[place.signal], report.at_us))
    return found


def speed_of(reported: float, settings: SensorBounds) -> Interval:
    """Speeds that may have been reported so."""
    error = settings.speed_error_mps
    return plus(product((reported, reported), settings.speed_gain), (-error, error))


def steering_of(reported_rad: float, settings: SensorBounds) -> Interval:
    """Road-wheel angles that may belong to a report of the steering wheel."""
    if not abs(reported_rad) <= settings.steering_wheel_limit_rad:
        limit = settings.steering_wheel_limit_rad
        raise NotObservedError(
            Unobserved.STEERING_RANGE, f"{reported_rad:g} rad, up to {limit:g} rad expected"
        )
    low, high = around(reported_rad, settings.steering_wheel_error_rad)
    found = hull(settings.road_wheel(low), settings.road_wheel(high))
    if not -math.inf < found[0] <= found[1] < math.inf:
        raise NotObservedError(
            Unobserved.STEERING_RANGE, f"{reported_rad:g} rad gives no road-wheel angle: {found}"
        )
    return found


def sample_of(value: Interval, at_us: int, settings: SensorBounds) -> Sampled:
    """What a vehicle's report says of the time before it came."""
    least_us, most_us = settings.report_delay_us
    return Sampled(value, at_us - most_us, at_us - least_us)
