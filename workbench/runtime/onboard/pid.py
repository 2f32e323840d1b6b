"""The control law of the bundle's loop in plain floats: both PIDs, their limits and integrals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.contents import Parameter

_NAMES = (
    "wheelbase", "steering_min", "steering_max", "look_ahead", "steering_gain_proportional",
    "steering_gain_integral", "steering_gain_derivative", "steering_rate_min", "steering_rate_max",
    "speed_gain_proportional", "speed_gain_integral", "acceleration_min", "acceleration_max",
)  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Reading:
    """What the law reads: offset (m), heading error (rad), road-wheel angle (rad), speed (m/s), and
    the path's curvature (1/m) there."""

    offset_m: float
    heading_error_rad: float
    steering_rad: float
    speed_mps: float
    curvature_per_m: float


@final
@dataclass(frozen=True, slots=True)
class Integrals:
    """The loop's integral states: of the speed's error (m) and of the offset ahead (m s)."""

    speed_m: float = 0.0
    offset_ms: float = 0.0


@final
@dataclass(frozen=True, slots=True)
class LawCommand:
    """What the law commands after its limits, and the rates of both integrals."""

    acceleration_mps2: float
    steering_rate_radps: float
    speed_integral_rate_mps: float
    offset_integral_rate_m: float


NOTHING = LawCommand(math.nan, math.nan, math.nan, math.nan)
"""The answer to what cannot be computed; `actuate` makes BRAKE of it."""


@final
@dataclass(frozen=True, slots=True)
class TrackLaw:
    """The law of `workbench.controllers` on the bicycle along a path, as in `ClosedLoop`.

    e' = v sin psi, s' = v cos psi / (1 - kappa e), psi' = v tan(clip(steering)) / L - kappa s';
    e_l = e + l sin psi, u = clip(-(kp e_l + ki I + kd (e' + l cos psi psi'))),
    I' = e_l + (u_raw - u); a = clip(kp_v (v_ref - v) + ki_v J), J' = v_ref - v - (a_raw - a). Same
    operations in the same order as the expressions that the bundle's tubes are made of. `law_of`
    reads the numbers.
    """

    wheelbase_m: float
    steering_min_rad: float
    steering_max_rad: float
    look_ahead_m: float
    steering_proportional: float
    steering_integral: float
    steering_derivative: float
    rate_min_radps: float
    rate_max_radps: float
    speed_proportional: float
    speed_integral: float
    accel_min_mps2: float
    accel_max_mps2: float

    def track(
        self, reading: Reading, integrals: Integrals, *, reference_speed_mps: float
    ) -> LawCommand:
        """TRACK; `NOTHING` where a number is not finite or 1 - kappa e > 0 fails. Never raises."""
        steered = self._steering(reading, integrals)
        if not all(map(math.isfinite, (*steered, integrals.speed_m, reference_speed_mps))):
            return NOTHING
        error = reference_speed_mps - reading.speed_mps
        raw = self.speed_proportional * error + self.speed_integral * integrals.speed_m
        applied = min(max(raw, self.accel_min_mps2), self.accel_max_mps2)
        return _finite(LawCommand(applied, steered[0], error - (raw - applied), steered[1]))

    def brake(self, reading: Reading, integrals: Integrals, *, stop_speed_mps: float) -> LawCommand:
        """The steering of BRAKE: the path is followed, and the wheels rest as the car stops.

        As `VehicleBrake`: both rates times clip(v / stop_speed - 1, 0, 1), which is 0 for v < 0 as
        well. The acceleration is the brake's own and 0 here.
        """
        rate, integral_rate = self._steering(reading, integrals)
        share = min(max(reading.speed_mps / stop_speed_mps - 1.0, 0.0), 1.0)
        return _finite(LawCommand(0.0, share * rate, 0.0, share * integral_rate))

    def at_rest(self, reading: Reading, *, most_ms: float) -> float:
        """Integral of the offset (m s), up to +- most_ms, with which TRACK begins without turning.

        - kp e_l / ki of a standing car; 0 where there is no such number.
        """
        ahead_m = reading.offset_m + self.look_ahead_m * math.sin(reading.heading_error_rad)
        if not (math.isfinite(ahead_m) and self.steering_integral > 0.0):
            return 0.0
        wanted = -self.steering_proportional * ahead_m / self.steering_integral
        return min(max(wanted, -most_ms), most_ms)

    def _steering(self, reading: Reading, integrals: Integrals) -> tuple[float, float]:
        """Steering rate and the rate of its integral; NaN where they cannot be computed."""
        r, integral, speed = reading, integrals.offset_ms, reading.speed_mps
        numbers = (r.offset_m, r.heading_error_rad, r.steering_rad, speed, r.curvature_per_m)
        gap = 1.0 - r.curvature_per_m * r.offset_m
        if not all(map(math.isfinite, (*numbers, integral))) or not gap > 0.0:
            return math.nan, math.nan
        sine, cosine = math.sin(r.heading_error_rad), math.cos(r.heading_error_rad)
        steering = min(max(r.steering_rad, self.steering_min_rad), self.steering_max_rad)
        along = speed * cosine / gap
        turning = speed * math.tan(steering) / self.wheelbase_m - r.curvature_per_m * along
        error = r.offset_m + self.look_ahead_m * sine
        error_rate = speed * sine + self.look_ahead_m * cosine * turning
        raw = -(
            self.steering_proportional * error
            + self.steering_integral * integral
            + self.steering_derivative * error_rate
        )
        applied = min(max(raw, self.rate_min_radps), self.rate_max_radps)
        return applied, error + (raw - applied)


def advanced(integrals: Integrals, command: LawCommand, step_s: float) -> Integrals:
    """The integrals one step later; unchanged where something is not finite."""
    new = Integrals(
        integrals.speed_m + step_s * command.speed_integral_rate_mps,
        integrals.offset_ms + step_s * command.offset_integral_rate_m,
    )
    return new if math.isfinite(new.speed_m) and math.isfinite(new.offset_ms) else integrals


def ramped_reference_mps(
    law: TrackLaw, reference_speed_mps: float, *, target_mps: float, slew_mps3: float, step_s: float
) -> float:
    """The next reference speed on the way to a target, one step_s later.

    It changes by at most slew / kp_v * step: then the law's acceleration asks for no more than the
    pedals' slew. Begin with the measured speed, not with the target: a jump of the reference is a
    jump of the acceleration that the slew withholds.
    """
    change = slew_mps3 / law.speed_proportional * step_s
    return min(max(target_mps, reference_speed_mps - change), reference_speed_mps + change)


def law_of(parameters: Sequence[Parameter]) -> TrackLaw:
    """The law with a bundle's own numbers (`Manifest.parameters`).

    Raises InputError where one of them is missing, or has a range: the law could not be one law.
    """
    known = {parameter.name: parameter for parameter in parameters}
    missing = [name for name in _NAMES if name not in known]
    if missing:
        raise InputError(
            f"expected a bundle whose loop has the parameters {missing}; build it from a vehicle "
            "file with `workbench build`"
        )
    return TrackLaw(*(known[name].nominal for name in _NAMES))


def _finite(command: LawCommand) -> LawCommand:
    numbers = (
        command.acceleration_mps2,
        command.steering_rate_radps,
        command.speed_integral_rate_mps,
        command.offset_integral_rate_m,
    )
    return command if all(map(math.isfinite, numbers)) else NOTHING
