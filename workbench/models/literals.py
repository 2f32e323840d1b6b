"""Symbols in place of constants, because CasADi folds constants in rounded arithmetic."""

from __future__ import annotations

from fractions import Fraction
from typing import final

import casadi as ca

# Products of these with any double are exact, so CasADi's folding cannot change them.
_FOLDS_EXACTLY = {0.0, 1.0, -1.0, 2.0, -2.0, 0.5, -0.5}


@final
class Literals:
    """Hands out one symbol for each constant; `values[k]` is the double behind `symbols[k]`.

    >>> literals = Literals()
    >>> literals.of(0.1), literals.of(2.0), literals.of(0.1), literals.values
    (SX(constant_1), SX(2), SX(constant_1), [0.1])
    """

    __slots__ = ("symbols", "values")

    def __init__(self) -> None:
        self.symbols: list[ca.SX] = []
        self.values: list[float] = []

    def of(self, value: float) -> ca.SX:
        """The constant itself where folding products is exact, else its symbol."""
        return ca.SX(value) if value in _FOLDS_EXACTLY else self.symbol(value)

    def symbol(self, value: float) -> ca.SX:
        """The symbol of a constant."""
        if value not in self.values:
            self.values.append(value)
            self.symbols.append(ca.SX.sym(f"constant_{len(self.values)}"))
        return self.symbols[self.values.index(value)]

    def exactly(self, value: Fraction) -> ca.SX:
        """A rational number as a sum of symbols, or as a quotient of two such sums."""
        parts = _doubles(value)
        if parts is None:
            numerator, denominator = (_doubles(Fraction(n)) for n in value.as_integer_ratio())
            if numerator is None or denominator is None:
                raise OverflowError
            return self._sum(numerator) / self._sum(denominator)
        return self._sum(parts)

    def _sum(self, parts: list[float]) -> ca.SX:
        total = ca.SX(0.0)
        for part in parts:
            total = total + self.symbol(part)
        return total


def _doubles(value: Fraction) -> list[float] | None:
    """At most four doubles with exactly this sum."""
    parts: list[float] = []
    while value and len(parts) < 4:
        parts.append(float(value))
        value -= Fraction(parts[-1])
    return None if value else parts
