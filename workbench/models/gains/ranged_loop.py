"""The lateral loop of a car that is not the one its controller was given: ranges, exact answers."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Final, TypeVar, final

from workbench.errors import InputError
from workbench.models.gains.lateral import Array, LateralLoop
from workbench.models.gains.rational_polynomial import RationalPolynomial, real_roots

if TYPE_CHECKING:
    from collections.abc import Mapping

Interval = tuple[float, float]
Numbers = TypeVar("Numbers", Fraction, Array)
_LEAST_SCALE: Final = 0.05


@final
@dataclass(frozen=True, slots=True)
class Car:
    """One true car: wheelbase (m), speed scale (none), delay of the steering command (s).

    The car moves at speed_scale times the speed that it measures.
    """

    wheelbase_m: float
    speed_scale: float
    delay_s: float


@final
@dataclass(frozen=True, slots=True)
class Ranges:
    """All cars with these three numbers, each constant and anywhere in its range.

    Raises InputError where a range is not LOW <= HIGH, or holds a wheelbase or speed scale that is
    not above 0, or a delay below 0.
    """

    wheelbase_m: Interval
    speed_scale: Interval
    delay_s: Interval

    def __post_init__(self) -> None:
        for name, what in (("wheelbase_m", "> 0"), ("speed_scale", "> 0"), ("delay_s", ">= 0")):
            low, high = getattr(self, name)
            allowed = low >= 0.0 if name == "delay_s" else low > 0.0
            if not (allowed and low <= high and math.isfinite(high)):
                raise InputError(
                    f"{name}: expected a range LOW <= HIGH of numbers {what}, got {low:g} {high:g}"
                )

    @property
    def ends(self) -> tuple[Interval, Interval, Interval]:
        """The three ranges, in the order of `Car`."""
        return self.wheelbase_m, self.speed_scale, self.delay_s

    @property
    def middle(self) -> Car:
        """The car in the middle of each range."""
        return Car(*(low + 0.5 * (high - low) for low, high in self.ends))

    def corners(self) -> tuple[Car, ...]:
        """Cars with each number at an end of its range, each once."""
        return tuple(dict.fromkeys(Car(*ends) for ends in itertools.product(*self.ends)))

    def at_size(self, share: float) -> Ranges:
        """Ranges about the same middle, `share` times as long; cut where no car could be."""
        if share == 1.0:
            return self
        middle = dataclasses.astuple(self.middle)
        cut = (0.5 * self.wheelbase_m[0], min(_LEAST_SCALE, self.speed_scale[0]), 0.0)
        return Ranges(
            *(
                (max(least, min(m, m + share * (low - m))), max(m, m + share * (high - m)))
                for (low, high), m, least in zip(self.ends, middle, cut, strict=True)
            )
        )


def coefficients(
    p: Mapping[str, Numbers], wheelbase: Numbers, scale: Numbers
) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """(c3, c2, c1, c0) of s^4 + (c3 s^3 + c2 s^2 + c1 s + c0) exp(-s delay).

    p: the loop as the controller knows it, by field of `LateralLoop`: wheelbase L0, measured speed
    v0. The car moves at v = scale v0 with wheelbase L; the controller reads offset, heading error
    and steering, and computes the deviation's rate with its own L0 and v0:

        e' = v psi, psi' = v delta / L, delta'(t) = u(t - delay),
        u = -(kp e_l + ki I + kd (v0 psi + l v0 delta / L0)), I' = e_l = e + l psi.

    c3 = kd l v0 / L0 knows nothing of the car; c2 = scale v0 (kd v0 + kp l) / L,
    c1 = scale v0 (kp scale v0 + ki l) / L, c0 = ki (scale v0)^2 / L. With L = L0 and scale = 1
    these are `characteristic` over L0.
    """
    known, ahead = p["speed_mps"], p["look_ahead_m"]
    kp, ki, kd = p["proportional"], p["integral"], p["derivative"]
    true = scale * known
    return (
        kd * ahead * known / p["wheelbase_m"],
        true * (kd * known + kp * ahead) / wheelbase,
        true * (kp * true + ki * ahead) / wheelbase,
        ki * true * true / wheelbase,
    )


def exact_coefficients(loop: LateralLoop, car: Car) -> tuple[Fraction, ...]:
    """The four, exact, of one car."""
    return coefficients(loop.exact(), Fraction(car.wheelbase_m), Fraction(car.speed_scale))


def stable_without_delay(loop: LateralLoop, car: Car) -> bool:
    """Hurwitz' conditions of one car with delay 0, exact."""
    c3, c2, c1, c0 = exact_coefficients(loop, car)
    if not loop.integral:
        return min(c3, c2, c1) > 0 and c3 * c2 > c1
    return min(c3, c2, c1, c0) > 0 and c1 * (c3 * c2 - c1) > c3 * c3 * c0


def everywhere_stable_without_delay(loop: LateralLoop, ranges: Ranges) -> bool:
    """Whether every car of the ranges is stable with delay 0; exact, true and false.

    The corners decide. Put b = kp v0^2 scale + ki l v0, affine in the scale, and a = kd v0^2 +
    kp l v0. c3 does not depend on the car; the signs of c2, c1, c0 are those of a, b, ki. With an
    integral the last condition times (L / scale)^2 is c3 a b - b^2 - c3^2 ki v0^2 L > 0, concave
    in the scale and affine in L; without one it is, times L / scale, c3 a - b > 0, affine. Both are
    least at a corner.
    """
    return all(stable_without_delay(loop, car) for car in ranges.corners())


def crossings(loop: LateralLoop, car: Car) -> Iterator[tuple[Fraction, Fraction, int]]:
    """Squares x of the frequencies at which |open loop| = 1, each as (low, high, direction).

    Zeros of W(x) = x^4 - |c3 s^3 + c2 s^2 + c1 s + c0|^2 with s^2 = -x, isolated exactly; they do
    not depend on the delay. direction: the sign of W' there: with it roots cross the imaginary axis
    as the delay grows, +1 to the right (K. Walton, J. E. Marshall, Direct method for TDS stability
    analysis, 1987); 0 where W only touches.
    """
    c3, c2, c1, c0 = exact_coefficients(loop, car)
    excess = RationalPolynomial.of(
        [-c0 * c0, 2 * c0 * c2 - c1 * c1, 2 * c1 * c3 - c2 * c2, -c3 * c3, 1]
    )
    most = 1 + max(abs(c) for c in excess.coefficients)  # Cauchy's bound on all roots
    for low, high in real_roots(excess, Fraction(0), most, width=most / 2**90):
        before, after = excess(low), excess(high)
        yield low, high, 0 if before * after >= 0 else 1 if after > 0 else -1
