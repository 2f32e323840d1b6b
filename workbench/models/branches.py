"""The forms with fmin and fmax that one if_else may take, each with its proof."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import final

import casadi as ca

from workbench.models.atoms import EVERYTHING
from workbench.models.exact_values import ExactValues
from workbench.models.polynomials import Polynomial, TooLargeError
from workbench.models.signs import is_nonnegative, resolved


@final
@dataclass(frozen=True, slots=True)
class Value:
    """An SX expression and the same as an exact polynomial.

    capped: (d, limit) when the expression is fmin(d, limit).
    """

    expression: ca.SX
    exact: Polynomial
    capped: tuple[ca.SX, Value] | None = None


@final
@dataclass(frozen=True, slots=True)
class Branch:
    """if_else(guard < 0, below, above), where `difference` is below - above."""

    guard: Value
    below: Value
    above: Value
    difference: Polynomial


def joined(values: ExactValues, branch: Branch) -> Value | None:
    """The branch as a continuous expression, None where no proof was found.

    Of several forms the first has the tightest range. A correction by a number times the guard is
    decided exactly where the condition is, a minimum of two branches only where their difference
    is; around a number each branch is left alone where it is taken.
    """
    if not branch.difference.terms:
        return branch.above
    attempts: tuple[Callable[[ExactValues, Branch], Value | None], ...] = (
        _limited,
        partial(_corrected, numbers=True),
        partial(_projected, numbers=True),
        partial(_corrected, numbers=False),
        _extremum,
        partial(_projected, numbers=False),
    )
    for attempt in attempts:
        try:
            result = attempt(values, branch)
        except (TooLargeError, OverflowError):
            continue
        if result is not None:
            return result
    return None


def gap(values: ExactValues, branch: Branch) -> float | None:
    """below - above where the guard is 0, if that is one number."""
    try:
        for atom, place, _ in _places(values, branch.guard.exact):
            size = values.atoms.substituted(branch.difference, {atom: place}).constant
            if size is not None:
                return float(size)
    except (TooLargeError, OverflowError):
        return None
    return None


def _limited(values: ExactValues, branch: Branch) -> Value | None:
    """The minimum or maximum where one branch is a limit that depends on parameters alone."""
    ends = (branch.below, branch.above)
    return _extremum(values, branch) if any(values.is_parameter(e.exact) for e in ends) else None


def _extremum(values: ExactValues, branch: Branch) -> Value | None:
    """min(a, b) when D <= 0 where g <= 0 and D >= 0 where g >= 0; max(a, b) the other way."""
    atoms, g, difference = values.atoms, branch.guard.exact, branch.difference
    # The kinks' rule for clips expects the limit second.
    limit_first = values.is_parameter(branch.below.exact)
    pair = (branch.above, branch.below) if limit_first else (branch.below, branch.above)
    if is_nonnegative(atoms, -difference, [-g]) and is_nonnegative(atoms, difference, [g]):
        exact = branch.above.exact + atoms.function("min0", difference)
        smaller = ca.fmin(pair[0].expression, pair[1].expression)
        return Value(smaller, exact, (pair[0].expression, pair[1]))
    if is_nonnegative(atoms, difference, [-g]) and is_nonnegative(atoms, -difference, [g]):
        exact = branch.above.exact - atoms.function("min0", -difference)
        return Value(_larger(values, *pair), exact)
    return None


def _larger(values: ExactValues, value: Value, other: Value) -> ca.SX:
    """max(value, other), of which max(min(d, high), low) with low <= high becomes the clip
    min(max(d, low), high)."""
    if value.capped is not None and values.is_parameter(other.exact):
        driver, high = value.capped
        if is_nonnegative(values.atoms, high.exact - other.exact, []):
            return ca.fmin(ca.fmax(driver, other.expression), high.expression)
    return ca.fmax(value.expression, other.expression)


def _projected(values: ExactValues, branch: Branch, *, numbers: bool) -> Value | None:
    """a on its side, b on its side, less the common value; `numbers`: where v* is one."""
    for atom, place, rising in _places(values, branch.guard.exact):
        if numbers == (place.constant is not None):
            result = _around(values, branch, atom=atom, place=place, rising=rising)
            if result is not None:
                return result
    return None


def _places(values: ExactValues, guard: Polynomial) -> Iterator[tuple[int, Polynomial, bool]]:
    """(v, v*, whether the guard rises with v) for each v that the guard is affine in.

    Inputs with a range are left out: v* may lie outside it, where the exact polynomials, simplified
    for the range, no longer hold.
    """
    for atom in guard.atoms:
        v = Polynomial.atom(atom)
        slope = guard.coefficient(((atom, 1),))
        rest = guard - v.scaled(slope)
        free = values.atoms[atom].name == "input" and values.atoms.bounds(v) == EVERYTHING
        if free and slope and not values.atoms.depends(rest, atom):
            yield atom, rest.scaled(-1 / slope), slope > 0


def _around(
    values: ExactValues, branch: Branch, *, atom: int, place: Polynomial, rising: bool
) -> Value | None:
    atoms, a, b = values.atoms, branch.below, branch.above
    common = atoms.substituted(b.exact, {atom: place})
    if (resolved(atoms, atoms.substituted(a.exact, {atom: place}) - common, [])).terms:
        return None
    v, limit = Polynomial.atom(atom), values.expression(place)
    low = place + atoms.function("min0", v - place)
    high = v + place - low
    symbol = values.symbol(atom)
    least, most = ca.fmin(symbol, limit), ca.fmax(symbol, limit)
    sides = ((a, least, low), (b, most, high)) if rising else ((a, most, high), (b, least, low))
    moved = [
        Value(
            ca.substitute(side.expression, symbol, part), atoms.substituted(side.exact, {atom: q})
        )
        for side, part, q in sides
    ]
    if not atoms.depends(b.exact, atom):
        return moved[0]
    if not atoms.depends(a.exact, atom):
        return moved[1]
    return Value(
        moved[0].expression + moved[1].expression - values.expression(common),
        moved[0].exact + moved[1].exact - common,
    )


def _corrected(values: ExactValues, branch: Branch, *, numbers: bool) -> Value | None:
    """b + q min(g, 0) with D = q g where g <= 0, or a - q max(g, 0) with D = q g where g >= 0.

    numbers: where q is one.
    """
    atoms, g = values.atoms, branch.guard
    below = atoms.function("min0", g.exact)
    sides = (
        (-g.exact, branch.above, Value(ca.fmin(g.expression, 0.0), below)),
        (g.exact, branch.below, Value(-ca.fmax(g.expression, 0.0), below - g.exact)),
    )
    for side, base, kink in sides:
        quotient = resolved(atoms, branch.difference, [side]).divided_by(g.exact)
        if quotient is None or numbers != (quotient.constant is not None):
            continue
        correction = kink.expression
        if quotient.constant != 1:
            correction = values.expression(quotient) * correction
        return Value(base.expression + correction, base.exact + quotient * kink.exact)
    return None
