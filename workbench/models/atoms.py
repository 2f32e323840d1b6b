"""Canonical atoms of exact polynomials: inputs, and functions of polynomials."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import final

from workbench.models.polynomials import Polynomial, TooLargeError

# Ends are rational or an infinity; Python compares the two exactly.
End = Fraction | float
Range = tuple[End, End]
EVERYTHING: Range = (-math.inf, math.inf)
_ODD = frozenset({"sin", "tan", "asin", "atan", "sinh", "tanh"})
_EVEN = frozenset({"cos", "cosh"})
_KNOWN_VALUES: dict[tuple[str, Fraction], int] = {
    **{(name, Fraction(0)): 0 for name in (*_ODD, "sqrt")},
    **{(name, Fraction(0)): 1 for name in (*_EVEN, "exp")},
    ("acos", Fraction(1)): 0,
    ("log", Fraction(1)): 0,
    ("sqrt", Fraction(1)): 1,
}
_RANGES: dict[str, Range] = {
    "sin": (Fraction(-1), Fraction(1)),
    "cos": (Fraction(-1), Fraction(1)),
    "tanh": (Fraction(-1), Fraction(1)),
    "asin": (Fraction(-2), Fraction(2)),
    "atan": (Fraction(-2), Fraction(2)),
    "acos": (Fraction(0), Fraction(4)),
    "atan2": (Fraction(-4), Fraction(4)),
    "cosh": (Fraction(1), math.inf),
    "exp": (Fraction(0), math.inf),
    "sqrt": (Fraction(0), math.inf),
}


@final
@dataclass(frozen=True, slots=True)
class Atom:
    """An input ("input", of no arguments) or a function of polynomials.

    key: which input, or which node of the graph for an "unknown", whose formula was too large.
    """

    name: str
    arguments: tuple[Polynomial, ...] = ()
    key: tuple[int, ...] = ()


@final
class Atoms:
    """All atoms of one graph. Equal values that it can recognise become equal polynomials.

    min(p, 0) is the only kink: min(-p, 0) = min(p, 0) - p, min(c p, 0) = c min(p, 0) for c > 0.
    """

    __slots__ = ("_atoms", "_numbers", "_ranges")

    def __init__(self) -> None:
        self._atoms: list[Atom] = []
        self._numbers: dict[Atom, int] = {}
        self._ranges: list[Range] = []

    def __getitem__(self, index: int) -> Atom:
        return self._atoms[index]

    def input(self, key: tuple[int, ...], span: Range) -> Polynomial:
        """The atom of one input element, which stays in `span`."""
        return self._made(Atom("input", key=key), span)

    def unknown(self, node: int) -> Polynomial:
        """The atom of a node about which nothing is known."""
        return self._made(Atom("unknown", key=(node,)), EVERYTHING)

    def function(self, name: str, *arguments: Polynomial) -> Polynomial:
        """The value of a function that is not a polynomial."""
        first = arguments[0]
        value = first.constant
        if name == "min0":
            return self._minimum_with_zero(first)
        if name == "inv":
            return self._inverse(first)
        if name == "pow" and _is_trivial_power(first, arguments[1]):
            return first
        if len(arguments) == 1 and value is not None and (name, value) in _KNOWN_VALUES:
            return Polynomial.number(_KNOWN_VALUES[name, value])
        if name in _ODD and first.leading < 0:
            return -self.function(name, -first)
        if name in _EVEN and first.leading < 0:
            return self.function(name, -first)
        return self._made(Atom(name, arguments), _RANGES.get(name, EVERYTHING))

    def bounds(self, polynomial: Polynomial) -> Range:
        """Bounds of the polynomial, term by term."""
        low: End = Fraction(0)
        high: End = Fraction(0)
        for monomial, coefficient in polynomial.terms:
            span: Range = (coefficient, coefficient)
            for atom, exponent in monomial:
                span = _product(span, _power(self._ranges[atom], exponent))
            low, high = _sum(low, span[0]), _sum(high, span[1])
        return low, high

    def depends(self, polynomial: Polynomial, on: int) -> bool:
        """Whether the atom `on` occurs, inside functions too; unknown values may hold it."""
        return any(
            index == on or self._atoms[index].name == "unknown" for index in self.within(polynomial)
        )

    def within(self, polynomial: Polynomial) -> set[int]:
        """All atoms that occur, inside functions too; each is opened once."""
        found: set[int] = set()
        ahead = list(polynomial.atoms)
        while ahead:
            index = ahead.pop()
            if index not in found:
                found.add(index)
                for inner in self._atoms[index].arguments:
                    ahead.extend(inner.atoms)
        return found

    def substituted(
        self, polynomial: Polynomial, values: Mapping[int, Polynomial], *, deep: bool = True
    ) -> Polynomial:
        """The polynomial with atoms replaced; `deep`: inside functions too."""
        # Grows by every atom that is met, so that what many share is replaced once.
        return self._substituted(polynomial, dict(values), deep)

    def _substituted(
        self, polynomial: Polynomial, known: dict[int, Polynomial], deep: bool
    ) -> Polynomial:
        result = Polynomial()
        for monomial, coefficient in polynomial.terms:
            term = Polynomial.number(coefficient)
            for index, exponent in monomial:
                term = term * self._replaced(index, known, deep).raised(exponent)
            result = result + term
        return result

    def _replaced(self, index: int, known: dict[int, Polynomial], deep: bool) -> Polynomial:
        if index not in known:
            atom = self._atoms[index]
            if deep and atom.name == "unknown":
                raise TooLargeError
            known[index] = Polynomial.atom(index)
            if deep and atom.arguments:
                inner = [self._substituted(each, known, deep) for each in atom.arguments]
                known[index] = self.function(atom.name, *inner)
        return known[index]

    def _minimum_with_zero(self, argument: Polynomial) -> Polynomial:
        low, high = self.bounds(argument)
        if low >= 0:
            return Polynomial()
        if high <= 0:
            return argument
        if argument.leading < 0:
            return self._minimum_with_zero(-argument) + argument
        monic = argument.scaled(1 / argument.leading)
        least = self.bounds(monic)[0]
        return self._made(Atom("min0", (monic,)), (least, Fraction(0))).scaled(argument.leading)

    def _inverse(self, argument: Polynomial) -> Polynomial:
        if not argument.terms:
            raise TooLargeError
        if argument.constant is not None:
            return Polynomial.number(1 / argument.constant)
        monic = argument.scaled(1 / argument.leading)
        low, high = self.bounds(monic)
        span = (
            Fraction(0) if low >= 0 else -math.inf,
            Fraction(0) if high <= 0 else math.inf,
        )
        return self._made(Atom("inv", (monic,)), span).scaled(1 / argument.leading)

    def _made(self, atom: Atom, span: Range) -> Polynomial:
        if atom not in self._numbers:
            self._numbers[atom] = len(self._atoms)
            self._atoms.append(atom)
            self._ranges.append(span)
        return Polynomial.atom(self._numbers[atom])


def _is_trivial_power(base: Polynomial, exponent: Polynomial) -> bool:
    """0^c = 0 with a number c > 0, and 1^c = 1."""
    if base.constant == 0:
        return exponent.constant is not None and exponent.constant > 0
    return base.constant == 1


def _sum(left: End, right: End) -> End:
    if isinstance(left, Fraction) and isinstance(right, Fraction):
        return left + right
    return right if isinstance(left, Fraction) else left


def _times(left: End, right: End) -> End:
    if left == 0 or right == 0:
        return Fraction(0)
    if isinstance(left, Fraction) and isinstance(right, Fraction):
        return left * right
    return math.inf if (left > 0) == (right > 0) else -math.inf


def _product(left: Range, right: Range) -> Range:
    corners = [_times(a, b) for a in left for b in right]
    return min(corners), max(corners)


def _power(span: Range, exponent: int) -> Range:
    result = span
    for _ in range(exponent - 1):
        result = _product(result, span)
    if exponent % 2 == 0:
        return max(Fraction(0), result[0]), result[1]
    return result
