"""The lateral loop about a straight path at one speed: its polynomial, its open loop, its state."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, TypeVar, final

import control
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.models.gains.rational_polynomial import RationalPolynomial
from workbench.models.polynomials import Polynomial
from workbench.models.section_reading import require_positive

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle

Array = NDArray[np.float64]
Ring = TypeVar("Ring", Fraction, Array, RationalPolynomial, Polynomial)


@final
@dataclass(frozen=True, slots=True)
class Axis:
    """A quantity that a map or a sweep may vary: its field in `LateralLoop`, words and unit."""

    field: str
    words: str
    unit: str

    @property
    def label(self) -> str:
        """Words with the unit in brackets."""
        return f"{self.words} ({self.unit})"


AXES: dict[str, Axis] = {
    "speed": Axis("speed_mps", "speed v", "m/s"),
    "look-ahead": Axis("look_ahead_m", "look-ahead l", "m"),
    "kp": Axis("proportional", "kp", "rad/(s m)"),
    "ki": Axis("integral", "ki", "rad/(s² m)"),
    "kd": Axis("derivative", "kd", "rad/m"),
}


def axis(name: str) -> Axis:
    """The axis of this name. Raises InputError on another."""
    if name not in AXES:
        raise InputError(f"expected an axis, one of {', '.join(AXES)}, got {name!r}")
    return AXES[name]


@final
@dataclass(frozen=True, slots=True)
class LateralLoop:
    """e' = v psi, psi' = v delta / L, delta' = -(kp e_l + ki I + kd e_l'), I' = e_l = e + l psi.

    wheelbase_m: L; speed_mps: v (below 0: in reverse); look_ahead_m: l; proportional kp
    (rad/(s m)), integral ki (rad/(s^2 m)), derivative kd (rad/m). This is the closed loop of
    `ClosedLoop` in TRACK, linearised on a straight path; it is true of the car while deviations are
    small, the speed is constant and no limit is met. Raises InputError on a wheelbase <= 0 and on
    values that are not finite.
    """

    wheelbase_m: float
    speed_mps: float
    look_ahead_m: float
    proportional: float
    integral: float
    derivative: float

    def __post_init__(self) -> None:
        require_positive(self, "wheelbase_m")
        for each in dataclasses.fields(self):
            value = getattr(self, each.name)
            if not np.isfinite(value):
                raise InputError(f"{each.name}: expected a finite number, got {value!r}")

    @classmethod
    def of(cls, vehicle: Vehicle, *, speed_mps: float | None = None) -> LateralLoop:
        """The loop of a vehicle's file, at its reference speed where none is given."""
        gains = vehicle.steering_pid
        return cls(
            vehicle.geometry.wheelbase_m,
            vehicle.operation.reference_speed_mps if speed_mps is None else speed_mps,
            gains.look_ahead_m,
            gains.proportional_radps_per_m,
            gains.integral_radps_per_ms,
            gains.derivative_rad_per_m,
        )

    def at(self, values: Mapping[str, float]) -> LateralLoop:
        """With other values, by the names of `AXES`."""
        return dataclasses.replace(self, **{axis(n).field: float(v) for n, v in values.items()})

    def value(self, name: str) -> float:
        """The value on the axis of this name."""
        return float(getattr(self, axis(name).field))

    def exact(self) -> dict[str, Fraction]:
        """All values as fractions, by field."""
        return {f.name: Fraction(getattr(self, f.name)) for f in dataclasses.fields(self)}

    def polynomial(self) -> tuple[Fraction, ...]:
        """The characteristic polynomial, exact, highest power first; see `characteristic`."""
        found = characteristic(self.exact())
        return found if self.integral else found[:-1]

    def poles(self) -> tuple[complex, ...]:
        """Its roots, largest real part first."""
        found = np.roots([float(c) for c in self.polynomial()])
        return tuple(complex(z) for z in sorted(found, key=lambda z: (-z.real, z.imag)))

    def open_loop(self) -> control.TransferFunction:
        """(kp + ki/s + kd s)(v^2 + l v s) / (L s^3): broken open at the steering rate."""
        top = [float(c) for c in self.polynomial()]
        return control.tf(top[1:], [top[0]] + [0.0] * (len(top) - 1))

    def state_space(self) -> control.StateSpace:
        """The closed loop; states offset, heading error, steering, integral; output the offset."""
        v, ahead, base = self.speed_mps, self.look_ahead_m, self.wheelbase_m
        kp, ki, kd = self.proportional, self.integral, self.derivative
        law = [-kp, -(kp * ahead + kd * v), -kd * ahead * v / base, -ki]
        matrix = [[0, v, 0, 0], [0, 0, v / base, 0], law, [1, ahead, 0, 0]]
        keep = 4 if ki else 3
        A = np.array(matrix, dtype=float)[:keep, :keep]
        return control.ss(A, np.zeros((keep, 1)), np.eye(1, keep), np.zeros((1, 1)))


def characteristic(p: Mapping[str, Ring]) -> tuple[Ring, Ring, Ring, Ring, Ring]:
    """L s^4 + kd l v s^3 + (kd v^2 + kp l v) s^2 + (kp v^2 + ki l v) s + ki v^2.

    From e'' = v psi' and e''' = (v^2 / L) u. p: values by field of `LateralLoop`, in any ring; the
    coefficients come back highest power first. With ki = 0 the last one is 0: the integral, which
    nothing then reads, keeps its pole at 0 to itself. With l = 0 the second one is 0 whatever the
    gains: the poles sum to 0, so that they cannot all lie in Re < 0.
    """
    v, ahead = p["speed_mps"], p["look_ahead_m"]
    kp, ki, kd = p["proportional"], p["integral"], p["derivative"]
    return (
        p["wheelbase_m"],
        kd * ahead * v,
        kd * v * v + kp * ahead * v,
        kp * v * v + ki * ahead * v,
        ki * v * v,
    )


class Schedule(enum.Enum):
    """How gains follow the speed, from their values at the reference speed v0; r = v / v0.

    FIXED: not at all. DISTANCE: kp r, ki r^2, kd and l as they are: the poles grow like v, so that
    the same offset is corrected over the same distance. TIME: l r, all three gains / r^2: the poles
    stay where they are, so that it is corrected in the same time. Both are exact for `LateralLoop`
    at each frozen speed.
    """

    FIXED = "fixed gains"
    DISTANCE = "same response over distance"
    TIME = "same response over time"

    def at(self, loop: LateralLoop, speed_mps: float) -> LateralLoop:
        """The loop at another speed, `loop` being the one at the reference speed."""
        r = speed_mps / loop.speed_mps
        if self is Schedule.FIXED:
            return dataclasses.replace(loop, speed_mps=speed_mps)
        if self is Schedule.DISTANCE:
            return dataclasses.replace(
                loop,
                speed_mps=speed_mps,
                proportional=loop.proportional * r,
                integral=loop.integral * r * r,
            )
        return dataclasses.replace(
            loop,
            speed_mps=speed_mps,
            look_ahead_m=loop.look_ahead_m * r,
            proportional=loop.proportional / (r * r),
            integral=loop.integral / (r * r),
            derivative=loop.derivative / (r * r),
        )
