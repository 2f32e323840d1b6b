"""Polynomials in one variable with rational coefficients, and where their real roots are."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import final

import numpy as np

Interval = tuple[Fraction, Fraction]
# Coefficients from the constant up, without a common factor and without a zero at the end.
Integers = list[int]


@final
@dataclass(frozen=True, slots=True)
class RationalPolynomial:
    """Coefficients from the constant up; no zero at the end, so that equal ones are equal objects.

    >>> x = RationalPolynomial.of([0, 1])
    >>> (x * x - RationalPolynomial.of([2]))(Fraction(3))
    Fraction(7, 1)
    """

    coefficients: tuple[Fraction, ...]

    @classmethod
    def of(cls, coefficients: Iterable[Fraction | int]) -> RationalPolynomial:
        """From the constant up; zeros at the end go."""
        kept = [Fraction(c) for c in coefficients]
        while kept and not kept[-1]:
            kept.pop()
        return cls(tuple(kept))

    @property
    def degree(self) -> int:
        """-1 for the polynomial 0."""
        return len(self.coefficients) - 1

    def __call__(self, x: Fraction) -> Fraction:
        """The value at x."""
        value = Fraction(0)
        for c in reversed(self.coefficients):
            value = value * x + c
        return value

    def __add__(self, other: RationalPolynomial) -> RationalPolynomial:
        size = max(len(self.coefficients), len(other.coefficients))
        return RationalPolynomial.of(
            a + b for a, b in zip(self._padded(size), other._padded(size), strict=True)
        )

    def __neg__(self) -> RationalPolynomial:
        return RationalPolynomial(tuple(-c for c in self.coefficients))

    def __sub__(self, other: RationalPolynomial) -> RationalPolynomial:
        return self + -other

    def __mul__(self, other: RationalPolynomial) -> RationalPolynomial:
        size = len(self.coefficients) + len(other.coefficients)
        product = [Fraction(0)] * size
        for i, a in enumerate(self.coefficients):
            for j, b in enumerate(other.coefficients):
                product[i + j] += a * b
        return RationalPolynomial.of(product)

    def _padded(self, size: int) -> tuple[Fraction, ...]:
        return self.coefficients + (Fraction(0),) * (size - len(self.coefficients))

    def divided(self, divisor: RationalPolynomial) -> tuple[RationalPolynomial, RationalPolynomial]:
        """Quotient and rest. Raises ZeroDivisionError on the divisor 0."""
        if divisor.degree < 0:
            raise ZeroDivisionError
        rest = list(self.coefficients)
        quotient = [Fraction(0)] * max(0, self.degree - divisor.degree + 1)
        for k in range(len(quotient) - 1, -1, -1):
            quotient[k] = rest[k + divisor.degree] / divisor.coefficients[-1]
            for j, c in enumerate(divisor.coefficients):
                rest[k + j] -= quotient[k] * c
        return RationalPolynomial.of(quotient), RationalPolynomial.of(rest)

    def primitive(self) -> Integers:
        """A positive multiple with whole coefficients that have no common factor."""
        scale = math.lcm(*(c.denominator for c in self.coefficients))
        return _reduced([c.numerator * (scale // c.denominator) for c in self.coefficients])


def real_roots(
    polynomial: RationalPolynomial, low: Fraction, high: Fraction, *, width: Fraction
) -> list[Interval]:
    """Intervals of at most `width`, not overlapping, each with exactly one root in (low, high).

    A root that is hit exactly comes as an interval of width 0. Outside of them the polynomial has
    no root in (low, high) and keeps its sign between neighbours. Exact: guesses come from floating
    point, and count where the sign changes across each and Sturm's theorem finds no more of them;
    else by bisection with Sturm chains. The polynomial 0 has none.
    """
    if polynomial.degree < 1:
        return []
    terms = polynomial.primitive()
    zeros = next(k for k, c in enumerate(terms) if c)
    found: list[Interval] = [(Fraction(0), Fraction(0))] if zeros and low < 0 < high else []
    terms = terms[zeros:]
    if len(terms) > 1:
        chain = _sturm_chain(terms)
        found += _confirmed(chain, low, high, width / 2) or _bisected(chain, low, high, width)
    return sorted(found)


def _confirmed(
    chain: Sequence[Integers], low: Fraction, high: Fraction, half: Fraction
) -> list[Interval]:
    """Intervals about guessed roots, where these are proved to be all; else none."""
    found: list[Interval] = []
    for guess in _guesses(chain[0]):
        a, b = max(low, guess - half), min(high, guess + half)
        ends = _sign(chain[0], a), _sign(chain[0], b)
        if a < b and (not found or found[-1][1] < a) and ends[0] * ends[1] < 0:
            found.append((a, b))
    roots = _changes(chain, low) - _changes(chain, high) - (_sign(chain[0], high) == 0)
    return found if len(found) == roots else []


def _guesses(terms: Integers) -> list[Fraction]:
    """Real roots as floating point has them, rising; none where it fails on them."""
    top = max(map(abs, terms))
    try:
        with np.errstate(all="ignore"):
            found = np.roots([float(Fraction(c, top)) for c in reversed(terms)])
    except np.linalg.LinAlgError:
        return []
    near = np.abs(found.imag) < 1e-7 * np.maximum(1.0, np.abs(found))
    return sorted(Fraction(float(z)) for z in found.real[near & np.isfinite(found)])


def _bisected(
    chain: Sequence[Integers], low: Fraction, high: Fraction, width: Fraction
) -> list[Interval]:
    found: list[Interval] = []
    stack = [(low, high)]
    while stack:
        a, b = stack.pop()
        roots = _changes(chain, a) - _changes(chain, b) - (_sign(chain[0], b) == 0)
        if roots == 0:
            continue
        if roots == 1 and b - a <= width and _sign(chain[0], a) * _sign(chain[0], b) < 0:
            found.append((a, b))
            continue
        middle = (a + b) / 2
        if _sign(chain[0], middle) == 0:
            found.append((middle, middle))
        stack += [(a, middle), (middle, b)]
    return found


def _sturm_chain(terms: Integers) -> list[Integers]:
    """Of the squarefree part: each root counts once, and no two neighbours share one."""
    chain = [terms, _reduced([k * c for k, c in enumerate(terms) if k])]
    while len(chain[-1]) > 1:
        rest = _remainder(chain[-2], chain[-1])
        if not rest:
            common = RationalPolynomial.of(chain[-1])
            return [RationalPolynomial.of(p).divided(common)[0].primitive() for p in chain]
        chain.append([-c for c in rest])
    return chain


def _remainder(dividend: Integers, divisor: Integers) -> Integers:
    """A positive multiple of the rest of the division."""
    rest, head = list(dividend), divisor[-1]
    while len(rest) >= len(divisor):
        factor, shift = rest[-1], len(rest) - len(divisor)
        rest = [abs(head) * c for c in rest]
        for k, c in enumerate(divisor):
            rest[k + shift] -= (factor if head > 0 else -factor) * c
        rest.pop()
        while rest and not rest[-1]:
            rest.pop()
    return _reduced(rest)


def _reduced(terms: Integers) -> Integers:
    common = math.gcd(*terms) if terms else 1
    return [c // common for c in terms] if common > 1 else terms


def _sign(terms: Integers, x: Fraction) -> int:
    value, scale = 0, 1
    for c in reversed(terms):
        value = value * x.numerator + c * scale
        scale *= x.denominator
    return (value > 0) - (value < 0)


def _changes(chain: Sequence[Integers], x: Fraction) -> int:
    """Sign changes along the chain; zeros do not count."""
    signs = [sign for sign in (_sign(each, x) for each in chain) if sign]
    return sum(a != b for a, b in pairwise(signs))
