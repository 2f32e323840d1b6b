"""Exact polynomials with rational coefficients in numbered indeterminates ("atoms")."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import final

# Rising atom numbers with their exponents; () is the monomial 1.
Monomial = tuple[tuple[int, int], ...]
MOST_TERMS = 100


class TooLargeError(Exception):
    """A polynomial outgrew `MOST_TERMS`; whoever asked goes on without it."""


def _rank(monomial: Monomial) -> tuple[tuple[int, int], ...]:
    """Sort key of the lexicographic order, in which lower atom numbers weigh more."""
    return tuple((-atom, exponent) for atom, exponent in monomial)


def _times(left: Monomial, right: Monomial) -> Monomial:
    exponents = dict(left)
    for atom, exponent in right:
        exponents[atom] = exponents.get(atom, 0) + exponent
    return tuple(sorted(exponents.items()))


def _ratio(left: Monomial, right: Monomial) -> Monomial | None:
    """left / right, None where that is no monomial."""
    exponents = dict(left)
    for atom, exponent in right:
        exponents[atom] = exponents.get(atom, 0) - exponent
    if any(exponent < 0 for exponent in exponents.values()):
        return None
    return tuple(sorted((atom, exponent) for atom, exponent in exponents.items() if exponent))


@final
@dataclass(frozen=True, slots=True)
class Polynomial:
    """A sum of coefficients times monomials; equal polynomials are equal objects.

    terms: without zero coefficients, the leading one of the lexicographic order first.

    >>> x = Polynomial.atom(0)
    >>> (x * x - Polynomial.number(1)).divided_by(x - Polynomial.number(1)) == (
    ...     x + Polynomial.number(1)
    ... )
    True
    """

    terms: tuple[tuple[Monomial, Fraction], ...] = ()

    @classmethod
    def of(cls, terms: Iterable[tuple[Monomial, Fraction]]) -> Polynomial:
        """The sum of terms that may repeat a monomial. Raises TooLargeError."""
        total: dict[Monomial, Fraction] = {}
        for monomial, coefficient in terms:
            total[monomial] = total.get(monomial, Fraction(0)) + coefficient
        kept = [term for term in total.items() if term[1]]
        if len(kept) > MOST_TERMS:
            raise TooLargeError
        return cls(tuple(sorted(kept, key=lambda term: _rank(term[0]), reverse=True)))

    @classmethod
    def number(cls, value: Fraction | int) -> Polynomial:
        """A constant."""
        return cls.of([((), Fraction(value))])

    @classmethod
    def atom(cls, index: int) -> Polynomial:
        """One indeterminate."""
        return cls((((((index, 1),)), Fraction(1)),))

    @property
    def constant(self) -> Fraction | None:
        """The value of a polynomial without atoms."""
        if not self.terms:
            return Fraction(0)
        return self.terms[0][1] if self.terms[0][0] == () else None

    @property
    def leading(self) -> Fraction:
        """Coefficient of the leading term; 0 for the polynomial 0."""
        return self.terms[0][1] if self.terms else Fraction(0)

    @property
    def atoms(self) -> tuple[int, ...]:
        """The atoms that occur, rising."""
        return tuple(sorted({atom for monomial, _ in self.terms for atom, _ in monomial}))

    def coefficient(self, monomial: Monomial) -> Fraction:
        """The coefficient of one monomial, 0 where it does not occur."""
        return dict(self.terms).get(monomial, Fraction(0))

    def __add__(self, other: Polynomial) -> Polynomial:
        return Polynomial.of((*self.terms, *other.terms))

    def __neg__(self) -> Polynomial:
        return self.scaled(Fraction(-1))

    def __sub__(self, other: Polynomial) -> Polynomial:
        return self + -other

    def __mul__(self, other: Polynomial) -> Polynomial:
        if len(self.terms) * len(other.terms) > MOST_TERMS**2 // 2:
            raise TooLargeError
        return Polynomial.of(
            (_times(left, right), a * b) for left, a in self.terms for right, b in other.terms
        )

    def scaled(self, factor: Fraction) -> Polynomial:
        """Product with a number."""
        return Polynomial.of((monomial, factor * c) for monomial, c in self.terms)

    def raised(self, exponent: int) -> Polynomial:
        """The power with an exponent >= 0."""
        result = Polynomial.number(1)
        for _ in range(exponent):
            result = result * self
        return result

    def divided_by(self, divisor: Polynomial) -> Polynomial | None:
        """The exact quotient, None where a rest remains or the division gets long.

        The leading monomial of a multiple of the divisor is a multiple of the divisor's.
        """
        if not divisor.terms:
            return None
        head, weight = divisor.terms[0]
        quotient: list[tuple[Monomial, Fraction]] = []
        rest = self
        while rest.terms:
            monomial = _ratio(rest.terms[0][0], head)
            if monomial is None or len(quotient) > MOST_TERMS:
                return None
            term = (monomial, rest.terms[0][1] / weight)
            quotient.append(term)
            rest = rest - Polynomial((term,)) * divisor
        return Polynomial.of(quotient)
