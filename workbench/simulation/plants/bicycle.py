"""The kinematic bicycle: the model of the analysis, moved on without slip, lag or load."""

from __future__ import annotations

import math
from typing import Final, final

from workbench.simulation.plants.chassis import Motion, Start, not_finite

LONGEST_STEP_S: Final = 0.01


@final
class BicycleChassis:
    """x' = v cos(heading), y' = v sin(heading), heading' = v tan(steering) / L, steering' = u,
    v' = a, about the middle of the rear axle; v >= 0 and |steering| <= steering_limit_rad.

    Between the instants at which the car stops or the wheels reach their limit, v and steering are
    linear in time, so that Simpson's rule gives heading and place: an error of order 4 in steps of
    at most 10 ms. wheelbase_m, steering_limit_rad > 0, the latter below 1.5. Raises InputError.
    """

    __slots__ = (
        "_acceleration", "_heading", "_limit", "_motion", "_speed", "_steering", "_wheelbase", "_x",
        "_y",
    )  # fmt: skip

    def __init__(self, wheelbase_m: float, steering_limit_rad: float, *, start: Start) -> None:
        start.require_possible(wheelbase_m, steering_limit_rad)
        self._wheelbase, self._limit = wheelbase_m, steering_limit_rad
        self._x, self._y, self._heading = start.x_m, start.y_m, start.heading
        self._speed, self._steering = start.speed_mps, start.road_wheel_rad
        self._acceleration = 0.0
        self._motion: Motion | None = None

    @property
    def motion(self) -> Motion:
        """Where it is and how it moves; its acceleration is the mean of the latest advance."""
        if self._motion is None:
            turning = self._speed * math.tan(self._steering) / self._wheelbase
            self._motion = Motion(
                self._x, self._y, self._heading, self._speed, 0.0, turning, self._steering,
                self._acceleration,
            )  # fmt: skip
        return self._motion

    def advance(
        self, acceleration_mps2: float, steering_rate_radps: float, duration_s: float
    ) -> None:
        """Go on for a time; what is asked of it happens at once. Raises InputError where the motion
        is no longer finite."""
        before, left, self._motion = self._speed, duration_s, None
        while left > 0.0:
            step = left if left < LONGEST_STEP_S else LONGEST_STEP_S
            # A rest no longer than rounding is done with the step before it.
            left = 0.0 if left - step < 1e-12 else left - step
            self._pieces(acceleration_mps2, steering_rate_radps, step)
        if not math.isfinite(self._heading + self._steering):
            raise not_finite(acceleration_mps2, steering_rate_radps)
        if duration_s > 0.0:
            self._acceleration = (self._speed - before) / duration_s

    def _pieces(self, a: float, u: float, step: float) -> None:
        """One step, cut where the car stops and where its wheels reach their limit."""
        if a < 0.0 and self._speed + a * step < 0.0:
            stops = self._speed / -a
            self._steered(a, u, stops)
            self._speed = 0.0
            self._steered(0.0, u, step - stops)
        else:
            self._steered(a, u, step)

    def _steered(self, a: float, u: float, step: float) -> None:
        """A part in which the car does not stop, cut where its wheels reach their limit."""
        steering, limit = self._steering, self._limit
        if abs(steering + u * step) > limit:
            end = math.copysign(limit, u)
            reaches = (end - steering) / u
            self._smooth(a, u, reaches)
            self._steering = end
            self._smooth(a, 0.0, step - reaches)
        else:
            self._smooth(a, u, step)

    def _smooth(self, a: float, u: float, h: float) -> None:
        """Simpson's rule over a time in which speed and steering are linear."""
        v0, s0 = self._speed, self._steering
        v1, s1 = v0 + a * h, s0 + u * h
        vm, share = 0.5 * (v0 + v1), 1.0 / self._wheelbase
        r0 = v0 * math.tan(s0) * share
        r1 = v1 * math.tan(s1) * share
        rm = vm * math.tan(0.5 * (s0 + s1)) * share
        heading = self._heading
        # The parabola through the three yaw rates, integrated over the first half and over all.
        middle = heading + h / 24.0 * (5.0 * r0 + 8.0 * rm - r1)
        end = heading + h / 6.0 * (r0 + 4.0 * rm + r1)
        sixth = h / 6.0
        self._x += sixth * (
            v0 * math.cos(heading) + 4.0 * vm * math.cos(middle) + v1 * math.cos(end)
        )
        self._y += sixth * (
            v0 * math.sin(heading) + 4.0 * vm * math.sin(middle) + v1 * math.sin(end)
        )
        self._heading, self._speed, self._steering = end, v1, s1
