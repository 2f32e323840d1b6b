"""The angle of a point in the plane as a Taylor series."""

from __future__ import annotations

import math
from typing import final

import numpy as np

from workbench.reach.validated.algebra import UNIT, Array
from workbench.reach.validated.composition import Operation, OutsideDomainError, interval_of
from workbench.reach.validated.operations import (
    Inverse,
    Linear,
    Product,
    like,
    over,
    reciprocal,
    solved,
)
from workbench.reach.validated.primitive import primitive
from workbench.reach.validated.series import Series, Weighted, convolution

# Below pi; an angle that stays inside has not met the cut.
_CUT = 3.1415926


@final
class Angle:
    """atan2(y, x) away from its cut {y = 0, x <= 0}: f' (x^2 + y^2) = x y' - y x'."""

    def __init__(self, y: Series, x: Series, square: Series) -> None:
        self._y, self._x, self._square = y, x, square
        self._rates = Weighted(y), Weighted(x)
        self.series = like(y, x)
        self._own_rate = Weighted(self.series)
        self._inverse: Series | None = None

    def extend(self, k: int) -> None:
        """k f_k = ((x y' - y x')_k - sum_{0 < j < k} j f_j (x^2 + y^2)_{k-j}) / (x^2 + y^2)_0."""
        for rate in self._rates:
            rate.extend(k)
        if k == 0:
            self.series.fill(0, *_start(self._y, self._x))
        else:
            if self._inverse is None:
                self._inverse = reciprocal(self._square, 1.0)
            forward, spread = convolution(self._x, self._rates[0].series, k)
            back, more = convolution(self._y, self._rates[1].series, k)
            source = Series(self.series.algebra, k + 1, len(spread))
            turned = forward - back
            source.fill(k, turned, spread + more + UNIT * np.abs(turned).sum(axis=-1))
            rest = convolution(self._own_rate.series, self._square, k, first=1, last=k - 1)
            self.series.fill(k, *over(solved(source, rest, k, self._inverse), k))
        self._own_rate.extend(k)


def _start(y: Series, x: Series) -> tuple[Array, Array]:
    """atan2(c) + atan((c_x y - c_y x) / (c_x x + c_y y)) about the centre c = (c_x, c_y).

    Holds where the denominator is positive: the angle to the centre is then below a quarter turn.
    """
    steady = [_order_zero(s) for s in (y, x)]
    zero = np.zeros(y.coef.shape[1])
    center = [Series.constant(y.algebra, s.coef[0][:, 0].copy(), zero) for s in steady]
    (y0, x0), (cy, cx) = steady, center
    products = [Product(cx, y0), Product(cy, x0), Product(cx, x0), Product(cy, y0)]
    sine = Linear((1.0, products[0].series), (-1.0, products[1].series))
    cosine = Linear((1.0, products[2].series), (1.0, products[3].series))
    inverse = Inverse(cosine.series)
    ratio = Product(sine.series, inverse.series)
    chain: list[Operation] = [*products, sine, cosine, inverse, ratio]
    chain += primitive("atan", ratio.series)
    for operation in chain[:6]:
        operation.extend(0)
    low, _ = cosine.series.algebra.bounds(cosine.series.coef[0], cosine.series.radius[0])
    if not np.all(low > 0.0):
        raise OutsideDomainError("atan2")
    for operation in chain[6:]:
        operation.extend(0)
    found = chain[-1].series
    base, spread = _base_angle(cy.coef[0][:, 0], cx.coef[0][:, 0])
    coef = found.coef[0].copy()
    coef[:, 0] += base
    radius = found.radius[0] + spread + UNIT * np.abs(coef[:, 0])
    low, high = found.algebra.bounds(coef, radius)
    if not (np.all(low > -_CUT) and np.all(high < _CUT)):
        raise OutsideDomainError("atan2")
    return coef, radius


def _base_angle(y: Array, x: Array) -> tuple[Array, Array]:
    """atan2 of points: atan of the quotient of the smaller by the larger, plus quarter turns."""
    steep = np.abs(y) > np.abs(x)
    larger = np.where(steep, y, x)
    if np.any(larger == 0.0):
        raise OutsideDomainError("atan2")
    quotient = np.where(steep, -x, y) / larger
    slack = 2.0 * UNIT * np.abs(quotient) + 1e-300
    low, high = interval_of("atan", quotient - slack, quotient + slack)
    side = np.where(np.where(steep, y, np.where(y < 0.0, y, 1.0)) < 0.0, -1.0, 1.0)
    quarters = np.where(steep, 1.0, np.where(x < 0.0, 2.0, 0.0))
    turn = side * quarters * (math.pi / 2.0)
    mid = 0.5 * (low + high) + turn
    # The double of pi is off by less than one part in 2^52, and two roundings were made.
    return mid, (high - low) + 8.0 * UNIT * (np.abs(turn) + np.abs(mid))


def _order_zero(series: Series) -> Series:
    held = Series(series.algebra, 1, series.coef.shape[1], steady=True)
    held.fill(0, series.coef[0], series.radius[0])
    return held
