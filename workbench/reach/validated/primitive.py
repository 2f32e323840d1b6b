"""Functions whose derivative is algebraic: log, atan, asin, acos."""

from __future__ import annotations

from typing import final

import numpy as np

from workbench.reach.validated.composition import NUMBERS, Operation, compose
from workbench.reach.validated.operations import (
    Inverse,
    Linear,
    Product,
    Root,
    like,
    over,
    reciprocal,
    solved,
)
from workbench.reach.validated.series import Series, Weighted, convolution


@final
class Primitive:
    """f with f' w = a': log (w = a), atan (1 + a^2), asin (sqrt(1 - a^2)), acos (minus that)."""

    def __init__(self, name: str, a: Series, w: Series) -> None:
        self._name, self._a, self._w = name, a, w
        self._rate = Weighted(a)
        self.series = like(a)
        self._own_rate = Weighted(self.series)
        self._inverse: Series | None = None

    def extend(self, k: int) -> None:
        """k f_k = (k a_k - sum_{0 < j < k} j f_j w_{k-j}) / w_0."""
        self._rate.extend(k)
        if k == 0:
            self.series.fill(0, *compose(self._name, self._a, lambda x: primitive(self._name, x)))
        else:
            if self._inverse is None:
                self._inverse = self._inverse_weight()
            rest = convolution(self._own_rate.series, self._w, k, first=1, last=k - 1)
            own = solved(self._rate.series, rest, k, self._inverse)
            self.series.fill(k, *over(own, k))
        self._own_rate.extend(k)

    def _inverse_weight(self) -> Series:
        """1 / w_0 as a function of a_0, whose square has no negative values."""
        if self._a.algebra is NUMBERS:
            return reciprocal(self._w, 1.0)
        result = Series(self._a.algebra, 1, self._a.coef.shape[1], steady=True)
        result.fill(0, *compose("inv", self._a, lambda x: _inverse_weight(self._name, x)))
        return result


def primitive(name: str, a: Series) -> list[Operation]:
    """The operations of log, atan, asin or acos, the function last."""
    chain = _weight(name, a)
    return [*chain, Primitive(name, a, chain[-1].series if chain else a)]


def _inverse_weight(name: str, a: Series) -> list[Operation]:
    chain = _weight(name, a)
    return [*chain, Inverse(chain[-1].series if chain else a)]


def _weight(name: str, a: Series) -> list[Operation]:
    """What makes w of a; nothing for log, where it is a."""
    if name == "log":
        return []
    one = Series.constant(a.algebra, np.ones(a.coef.shape[1]), np.zeros(a.coef.shape[1]))
    squared = Product(a, a)
    sum_or_difference = Linear((1.0, one), (1.0 if name == "atan" else -1.0, squared.series))
    chain: list[Operation] = [squared, sum_or_difference]
    if name != "atan":
        chain.append(Root(sum_or_difference.series))
    if name == "acos":
        chain.append(Linear((-1.0, chain[-1].series)))
    return chain
