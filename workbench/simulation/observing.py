"""What a monitor would have known at a recorded sample: intervals around the recorded state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime import Observation, ObservedPerson, Watched
from workbench.simulation.recording import VehicleSample

Interval = tuple[float, float]


@final
@dataclass(frozen=True, slots=True)
class StateErrors:
    """Half widths put around a recorded state, and what is not recorded.

    position_m, heading_rad, speed_mps, yaw_rate_radps: errors of the recorded values.
    slow_mps: below it yaw rate says nothing about steering. steering_limit_rad,
    steering_rate_limit_radps: of the vehicle. speed_integral_m, offset_integral_ms: ranges +- of
    the integrals of a controller that was never there. Raises InputError for a figure that is not
    finite and above zero (the integrals may be 0).
    """

    position_m: float
    heading_rad: float
    speed_mps: float
    yaw_rate_radps: float
    slow_mps: float
    steering_limit_rad: float
    steering_rate_limit_radps: float
    speed_integral_m: float
    offset_integral_ms: float

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            least = 0.0 if "integral" in name else math.ulp(0.0)
            if not (math.isfinite(value) and value >= least):
                raise InputError(f"{name}: expected a finite number above zero, got {value!r}")
        if self.slow_mps <= self.speed_mps:
            raise InputError(
                f"slow_mps: expected more than speed_mps {self.speed_mps}, got {self.slow_mps}; "
                "steering = atan(L yaw_rate / v) needs v away from 0"
            )

    @classmethod
    def assumed(cls) -> StateErrors:
        """Figures assumed for a GNSS/INS car: 0.1 m, 0.02 rad, 0.1 m/s, 0.02 rad/s."""
        return cls(0.1, 0.02, 0.1, 0.02, 0.5, 0.6, 0.5, 0.1, 0.1)


@final
class Observer:
    """Turns samples, in time order, into observations; remembers the last steering interval.

    tan(steering) = L yaw_rate / v over the intervals of yaw rate and speed, L = wheelbase_m. Too
    slow for that, the last interval grows by the steering rate limit; before any, it is the whole
    range.
    `reference_ahead_m`: distance of the recorded point ahead of the rear axle; `watched_m`: radius
    about the rear axle within which everybody is taken to be seen.
    """

    def __init__(
        self,
        errors: StateErrors,
        *,
        wheelbase_m: float,
        reference_ahead_m: float,
        watched_m: float,
    ) -> None:
        self._errors = errors
        self._watched_m = watched_m
        self._wheelbase_m = wheelbase_m
        self._ahead_m = reference_ahead_m
        self._steering: Interval = (-errors.steering_limit_rad, errors.steering_limit_rad)
        self._past: list[VehicleSample] = []

    def observe(
        self, sample: VehicleSample, people: Sequence[ObservedPerson], *, stamp_s: float
    ) -> Observation:
        """The observation at `sample`; call it for every sample, also those that are not judged.

        stamp_s: the sample's instant on the monitor's clock.
        """
        errors = self._errors
        x_m, y_m = rear_axle(sample, self._ahead_m)
        self._steering = self._next_steering(sample)
        self._past = [s for s in self._past if s.t_s >= sample.t_s - 0.5] + [sample]
        speed = _around(sample.speed_mps, errors.speed_mps)
        return Observation(
            x=_around(x_m, errors.position_m),
            y=_around(y_m, errors.position_m),
            heading=_around(sample.heading_rad, errors.heading_rad),
            steering=self._steering,
            speed=(max(speed[0], 0.0), max(speed[1], 0.0)),
            speed_integral=_around(0.0, errors.speed_integral_m),
            offset_integral=_around(0.0, errors.offset_integral_ms),
            reference_speed_mps=max(sample.speed_mps, 0.0),
            people=tuple(people),
            stamp_s=stamp_s,
            watched=Watched(x_m, y_m, self._watched_m),
        )

    def _next_steering(self, sample: VehicleSample) -> Interval:
        limit = self._errors.steering_limit_rad
        grown = (-limit, limit)
        if self._past:
            change = self._errors.steering_rate_limit_radps * (sample.t_s - self._past[-1].t_s)
            grown = (
                max(self._steering[0] - change, -limit),
                min(self._steering[1] + change, limit),
            )
        measured = self._measured_steering(sample)
        if measured is None:
            return grown
        both = max(grown[0], measured[0]), min(grown[1], measured[1])
        if both[0] <= both[1]:
            return both
        alone = max(measured[0], -limit), min(measured[1], limit)
        return alone if alone[0] <= alone[1] else (-limit, limit)

    def _measured_steering(self, sample: VehicleSample) -> Interval | None:
        rate = self._yaw_rate(sample)
        if rate is None or sample.speed_mps < self._errors.slow_mps:
            return None
        speeds = _around(sample.speed_mps, self._errors.speed_mps)
        quotients = [self._wheelbase_m * r / v for r in rate for v in speeds]
        return math.atan(min(quotients)), math.atan(max(quotients))

    def _yaw_rate(self, sample: VehicleSample) -> Interval | None:
        if sample.yaw_rate_radps is not None:
            return _around(sample.yaw_rate_radps, self._errors.yaw_rate_radps)
        recent = [s for s in self._past if s.t_s >= sample.t_s - 0.5]
        if not recent:
            return None
        elapsed_s = sample.t_s - recent[0].t_s
        turned = sample.heading_rad - recent[0].heading_rad
        error = 2.0 * self._errors.heading_rad / elapsed_s + self._errors.yaw_rate_radps
        return _around(turned / elapsed_s, error)


def rear_axle(sample: VehicleSample, reference_ahead_m: float) -> tuple[float, float]:
    """The rear-axle point (x, y) in m, reference_ahead_m behind the recorded point."""
    return (
        sample.x_m - reference_ahead_m * math.cos(sample.heading_rad),
        sample.y_m - reference_ahead_m * math.sin(sample.heading_rad),
    )


def _around(value: float, radius: float) -> Interval:
    return value - radius, value + radius
