"""The lateral loop with held commands, exact: its matrix per sample, for any timing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.controllers.sampling import Jitter, Sampling
from workbench.errors import InputError
from workbench.models.gains.lateral import LateralLoop

Array = NDArray[np.float64]
Matrix = list[list[Fraction]]
Window = tuple[Fraction, Fraction]
# (t, t^2, t^3) of a time, or a point of a simplex around such a curve.
Moments = tuple[Fraction, Fraction, Fraction]

# History beyond which matrices only get large.
MOST_COMMANDS: Final = 12


@final
@dataclass(frozen=True, slots=True)
class Timing:
    """What a `Sampling` allows from measurement to measurement.

    gap: time between two measurements; latency: from a measurement to when its command acts; late:
    how far k gaps may be from k periods, as (per gap, in all), whichever is less; step: what an
    integral's rate is multiplied with.
    """

    period: Fraction
    gap: Window
    latency: Window
    late: tuple[Fraction, Fraction | None]
    step: Window

    @classmethod
    def of(cls, sampling: Sampling) -> Timing:
        """The gap is taken as free from one to the next: more than a clock allows, never less."""
        period, jitter = Fraction(sampling.period_s), Fraction(sampling.jitter_s)
        (m_low, m_high), (a_low, a_high) = (
            tuple(map(Fraction, each))
            for each in (sampling.measurement_delay_s, sampling.actuation_delay_s)
        )
        spread = m_high - m_low
        open_s = spread + (jitter if sampling.jitter is Jitter.DRIFT else 2 * jitter)
        if open_s >= period:
            raise InputError(
                f"expected jitter and measurement delay to leave less than a period open between "
                f"measurements, got {float(open_s):.4g} s of {float(period):.4g} s; lessen them"
            )
        drifting = sampling.jitter is Jitter.DRIFT and jitter > 0
        return cls(
            period,
            (period - open_s, period + open_s),
            (m_low + a_low, m_high + a_high),
            (open_s, None if drifting else open_s),
            sampling.integral_steps_s,
        )

    @property
    def exact(self) -> bool:
        """Whether every sample is like every other."""
        return all(low == high for low, high in (self.gap, self.latency, self.step))

    def age(self, back: int) -> Window:
        """Time from the measurement `back` samples ago to the present one."""
        each, total = self.late
        loose = back * each if total is None else min(back * each, total)
        return back * self.period - loose, back * self.period + loose

    @property
    def commands(self) -> int:
        """How many commands may have a part in the motion between two measurements, less one."""
        back = 0
        while self.latency[1] > self.age(back)[0] and back <= MOST_COMMANDS:
            back += 1
        if back > MOST_COMMANDS:
            raise InputError(
                f"expected delays of at most {MOST_COMMANDS} periods, got "
                f"{float(self.latency[1]):.4g} s at a period of {float(self.period):.4g} s; "
                "shorten the delays or lower the rate"
            )
        return back

    def acting(self, back: int) -> Window:
        """For how much of the end of the gap a command, or a younger one, of `back` samples ago
        acts: (least, most)."""
        age = self.age(back)
        start = self.latency[0] - age[1], self.latency[1] - age[0]
        return (
            max(Fraction(0), self.gap[0] - max(Fraction(0), start[1])),
            max(Fraction(0), self.gap[1] - max(Fraction(0), start[0])),
        )


@final
@dataclass(frozen=True, slots=True)
class HeldLoop:
    """z+ = F z from measurement to measurement; z = (e, psi, delta, I, u_1, ..., u_m).

    The plant's three states are a chain of integrators, so that over a time t with the command u
    held e += v t psi + v^2 t^2 / (2 L) delta + v^2 t^3 / (6 L) u and so on: polynomials, hence
    exact rational matrices. u_k is the command of k samples ago; with ki = 0 there is no I.
    """

    loop: LateralLoop
    commands: int

    @classmethod
    def of(cls, loop: LateralLoop, timing: Timing) -> HeldLoop:
        """With as many commands as the timing needs."""
        return cls(loop, timing.commands)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the entries of z."""
        integral = ("offset_integral",) if self.loop.integral else ()
        sent = tuple(f"command_{k}_ago" for k in range(1, self.commands + 1))
        return ("offset", "heading_error", "steering", *integral, *sent)

    @property
    def size(self) -> int:
        """Number of entries of z."""
        return 3 + (1 if self.loop.integral else 0) + self.commands

    def matrix(self, step: Fraction, gap: Moments, acting: Sequence[Moments]) -> Matrix:
        """F for an integral's step, moments of the gap, and of the times in which commands act.

        acting[k], k = 0 ... m - 1: how long, at the end of the gap, the command of k samples ago or
        a younger one acts; the oldest, m, acts in all that is left. F is affine in all three.
        """
        p = self.loop.exact()
        v, base, ahead = p["speed_mps"], p["wheelbase_m"], p["look_ahead_m"]
        kp, ki, kd = p["proportional"], p["integral"], p["derivative"]
        integral = 1 if ki else 0
        law = [-kp, -(kp * ahead + kd * v), -kd * ahead * v / base]
        law += [-ki] * integral + [Fraction(0)] * self.commands
        rows = [[Fraction(int(i == j)) for j in range(self.size)] for i in range(3 + integral)]
        rows[0][1] += v * gap[0]
        rows[0][2] += v * v * gap[1] / (2 * base)
        rows[1][2] += v * gap[0] / base
        if integral:
            rows[3][0] += step
            rows[3][1] += step * ahead
        weights = [_pushed(v, base, each) for each in (*acting, gap)]
        for k in range(self.commands + 1):
            for i in range(3):
                push = weights[k][i] - (weights[k - 1][i] if k else 0)
                if k == 0:
                    rows[i] = [a + push * b for a, b in zip(rows[i], law, strict=True)]
                else:
                    rows[i][2 + integral + k] += push
        first = 3 + integral
        history = [law] if self.commands else []
        for k in range(1, self.commands):
            history.append([Fraction(int(j == first + k - 1)) for j in range(self.size)])
        return rows + history

    def steady(self, timing: Timing) -> Matrix:
        """F where nothing is uncertain. Raises InputError where something is."""
        if not timing.exact:
            raise InputError("expected one gap and one delay, got intervals; give LOW = HIGH")
        acting = [curve(timing.acting(k)[0]) for k in range(self.commands)]
        return self.matrix(timing.step[0], curve(timing.gap[0]), acting)

    def corner_count(self, timing: Timing) -> int:
        """How many matrices `corners` gives."""
        corners = len(self._steps(timing))
        for low, high in self._windows(timing):
            corners *= 4 if low < high else 1
        return corners

    def _windows(self, timing: Timing) -> list[Window]:
        return [timing.gap, *(timing.acting(k) for k in range(self.commands))]

    def _steps(self, timing: Timing) -> list[Fraction]:
        return list(dict.fromkeys(timing.step if self.loop.integral else timing.step[:1]))

    def corners(self, timing: Timing) -> Iterator[Matrix]:
        """Matrices whose convex hull contains every F that the timing allows.

        Each time t in [a, b] is uncertain by itself; (t, t^2, t^3) is a convex combination of the
        Bernstein control points of the curve, and F is affine in each of them.
        """
        for step in self._steps(timing):
            for gap, *acting in product(*map(control_points, self._windows(timing))):
                yield self.matrix(step, gap, acting)


def curve(t: Fraction) -> Moments:
    """(t, t^2, t^3)."""
    return t, t * t, t * t * t


def control_points(window: Window) -> tuple[Moments, ...]:
    """Four points around the curve (t, t^2, t^3) over [a, b]; one where a = b.

    >>> [point[1] for point in control_points((Fraction(0), Fraction(3)))]
    [Fraction(0, 1), Fraction(0, 1), Fraction(3, 1), Fraction(9, 1)]
    """
    a, b = window
    if a == b:
        return (curve(a),)
    return (
        curve(a),
        ((2 * a + b) / 3, (a * a + 2 * a * b) / 3, a * a * b),
        ((a + 2 * b) / 3, (2 * a * b + b * b) / 3, a * b * b),
        curve(b),
    )


def _pushed(v: Fraction, base: Fraction, t: Moments) -> tuple[Fraction, Fraction, Fraction]:
    """What a command of 1 rad/s over the time t adds to offset, heading error and steering."""
    return v * v * t[2] / (6 * base), v * t[1] / (2 * base), t[0]


def floats(matrix: Matrix) -> Array:
    """Rounded to the nearest floating-point numbers."""
    return np.array([[float(entry) for entry in row] for row in matrix])


def spectral_radius(matrix: Matrix) -> float:
    """Largest modulus of the eigenvalues; rigor NUMERICAL."""
    return float(np.abs(np.linalg.eigvals(floats(matrix))).max())


def schur_stable(matrix: Matrix) -> bool:
    """Whether every eigenvalue lies inside the unit circle; exact.

    Schur and Cohn: with p of degree n, all roots lie inside exactly where |p_0| < |p_n| and those
    of (p_n p - p_0 p*) / z do, p* being p with its coefficients in reverse.
    """
    p = characteristic_of(matrix)[::-1]
    while len(p) > 1:
        if abs(p[0]) >= abs(p[-1]):
            return False
        p = [p[-1] * a - p[0] * b for a, b in zip(p, p[::-1], strict=True)][1:]
        scale = abs(p[-1])
        p = [c / scale for c in p]
    return True


def characteristic_of(matrix: Matrix) -> list[Fraction]:
    """Coefficients of det(z I - F), highest power first, by Faddeev and LeVerrier; exact."""
    size = len(matrix)
    found, power = [Fraction(1)], [[Fraction(0)] * size for _ in range(size)]
    for k in range(1, size + 1):
        for i in range(size):
            power[i][i] += found[-1]
        power = multiplied(matrix, power)
        found.append(-sum((power[i][i] for i in range(size)), Fraction(0)) / k)
    return found


def multiplied(left: Matrix, right: Matrix) -> Matrix:
    """The product, exact."""
    columns = list(zip(*right, strict=True))
    return [
        [sum((a * b for a, b in zip(row, column, strict=True) if a and b), Fraction(0))
         for column in columns]
        for row in left
    ]  # fmt: skip
