"""Order 0 of an elementary function: its Taylor polynomial in the deviation, with remainder.

f(c + u) = sum_{i < j} f_i(c) u^i + f_j(X) u^j for X = c + u and every j <= D + 1 (Lagrange); the
j with the least remainder is taken. The f_i come from the recurrences in time, run on numbers with
radii for x(s) = c + s and x(s) = X + s; f itself is the proved inclusion function of the operation.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from workbench.reach.validated.algebra import UNIT, Algebra, Array, upward
from workbench.reach.validated.picard import NoEnclosureError
from workbench.reach.validated.series import Series, convolution
from workbench.sensitivity.inclusion import inclusion

NUMBERS = Algebra.of(deep=0, degree=0, shallow=0)


# Operations with a pole or a border of their domain; all others are defined everywhere.
BORDERED = frozenset({
    "div", "inv", "sqrt", "log", "tan", "asin", "acos", "atan2", "pow", "constpow"
})  # fmt: skip


class OutsideDomainError(Exception):
    """A value reaches a pole, a branch cut or the border of a domain; says of which operation."""


class Operation(Protocol):
    """One node of a tape: `series` is filled order by order."""

    series: Series

    def extend(self, k: int) -> None:
        """Fill order k; the operands' orders 0 .. k are there."""


# From the series of the argument to the operations whose last one is the function.
Build = Callable[[Series], Sequence[Operation]]


def compose(
    name: str, a: Series, build: Build, *, exponent: float | None = None
) -> tuple[Array, Array]:
    """f(a_0), coefficients and radius; `build` makes the operations of f."""
    if a.algebra is NUMBERS:
        return _number(name, a, exponent)
    alg, batch = a.algebra, a.coef.shape[1]
    deviation = a.coef[0].copy()
    deviation[:, 0] = 0.0
    size = upward(np.abs(deviation).sum(axis=-1) + a.radius[0])
    center = a.coef[0][:, 0]
    derivatives = _derivatives(center, _range(a, center, size), alg.degree + 2, build)
    remainders = _remainders(derivatives, size, batch)
    last = np.argmin(remainders, axis=0)
    u = Series(alg, 1, batch, steady=True)
    u.give(0, deviation, a.radius[0])
    total = Series(alg, 1, batch, steady=True)
    for i in range(alg.degree, -1, -1):
        value = np.where(i < last, derivatives.coef[i, :batch, 0], derivatives.coef[i, batch:, 0])
        value = np.where(i <= last, value, 0.0)
        spread = np.where(i < last, derivatives.radius[i, :batch], 0.0)
        product, radius = convolution(total, u, 0)
        product[:, 0] += value
        total.fill(0, product, radius + spread + UNIT * np.abs(product[:, 0]))
    return total.coef[0], total.radius[0] + remainders[last, np.arange(batch)]


def _remainders(derivatives: Series, size: Array, batch: int) -> Array:
    """Bounds (D + 2, B) of (f_j(X) - mid) |u|^j for j <= D, and of f_j(X) |u|^j for j = D + 1."""
    over_set = derivatives.radius[:, batch:].copy()
    over_set[-1] += derivatives.size(len(over_set) - 1)[batch:]
    # A power that underflows would hide a derivative that is huge.
    powers = np.maximum(size ** np.arange(len(over_set))[:, None], np.finfo(np.float64).tiny)
    bounds = upward(over_set * powers)
    return np.asarray(np.where(np.isnan(bounds), np.inf, bounds))


def _range(a: Series, center: Array, size: Array) -> tuple[Array, Array]:
    """Bounds (B,) of order 0, which also hold its constant coefficients."""
    low, high = a.algebra.bounds(a.coef[0], a.radius[0])
    low = np.minimum(np.maximum(low, np.nextafter(center - size, -np.inf)), center)
    return low, np.maximum(np.minimum(high, np.nextafter(center + size, np.inf)), center)


def _derivatives(center: Array, over: tuple[Array, Array], orders: int, build: Build) -> Series:
    """f_i at the centres (first half of the batch) and over the ranges (second half)."""
    batch = len(center)
    middle = 0.5 * over[0] + 0.5 * over[1]
    size = upward(np.maximum(over[1] - middle, middle - over[0]))
    x = Series(NUMBERS, orders, 2 * batch)
    points = np.concatenate([center, middle])
    x.give(0, points[:, None], np.concatenate([np.zeros(batch), size]))
    for k in range(1, orders):
        x.give(k, np.full((2 * batch, 1), float(k == 1)), np.zeros(2 * batch))
    chain = build(x)
    for k in range(orders):
        for operation in chain:
            operation.extend(k)
    return chain[-1].series


def _number(name: str, a: Series, exponent: float | None) -> tuple[Array, Array]:
    """f over the intervals of order 0, as centre and radius."""
    center, radius = a.coef[0][:, 0], a.radius[0]
    lower = np.nextafter(center - radius, -np.inf)
    upper = np.nextafter(center + radius, np.inf)
    exact = radius == 0.0
    low, high = interval_of(
        name, np.where(exact, center, lower), np.where(exact, center, upper), exponent
    )
    mid = 0.5 * low + 0.5 * high
    return mid[:, None], np.maximum(high - mid, mid - low)


def interval_of(
    name: str, lower: Array, upper: Array, exponent: float | None = None
) -> tuple[Array, Array]:
    """Bounds (B,) of a one-argument operation over [lower, upper] (B,)."""
    if not np.all(np.isfinite(lower) & np.isfinite(upper)):
        raise NoEnclosureError("the set left the range of numbers")
    values = np.array(_inclusion(name, exponent, len(lower))(lower[None, :], upper[None, :]))
    values = values.reshape(3, -1)
    if not np.all(values[2] == 1.0):
        raise OutsideDomainError(name)
    return values[0], values[1]


@functools.lru_cache(maxsize=512)
def _inclusion(name: str, exponent: float | None, batch: int) -> ca.Function:
    x = ca.SX.sym("x")
    if name == "inv":
        value = 1.0 / x
    else:
        value = x**exponent if exponent is not None else getattr(ca, name)(x)
    bounds = inclusion(ca.Function(name, [x], [value]))
    lower, upper = ca.MX.sym("lower", 1, batch), ca.MX.sym("upper", 1, batch)
    return ca.Function("mapped", [lower, upper], [ca.vertcat(*bounds.map(batch)(lower, upper))])
