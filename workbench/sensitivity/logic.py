"""Comparisons, logic and branches on symbolic intervals.

A truth value is an interval with end points in {0, 1}: lower 1 means certainly true, upper 0
certainly false. Nonzero counts as true, as in CasADi.
"""

from __future__ import annotations

import casadi as ca

from workbench.sensitivity.intervals import SymbolicInterval
from workbench.sensitivity.validity import verbatim


@verbatim()
def less(left: SymbolicInterval, right: SymbolicInterval) -> SymbolicInterval:
    """Truth of left < right."""
    return _truth(left, right, left.upper < right.lower, left.lower < right.upper)


@verbatim()
def less_equal(left: SymbolicInterval, right: SymbolicInterval) -> SymbolicInterval:
    """Truth of left <= right."""
    return _truth(left, right, left.upper <= right.lower, left.lower <= right.upper)


@verbatim()
def equal(left: SymbolicInterval, right: SymbolicInterval) -> SymbolicInterval:
    """Truth of left == right; certain only for two equal points."""
    return _truth(
        left,
        right,
        ca.logic_and(left.upper <= right.lower, right.upper <= left.lower),
        ca.logic_and(left.lower <= right.upper, right.lower <= left.upper),
    )


def not_equal(left: SymbolicInterval, right: SymbolicInterval) -> SymbolicInterval:
    """Truth of left != right."""
    return logical_not(equal(left, right))


def logical_not(value: SymbolicInterval) -> SymbolicInterval:
    """Truth of not value."""
    certain, possible = _certain_and_possible(value)
    with verbatim():
        return _truth(value, value, ca.logic_not(possible), ca.logic_not(certain))


def logical_and(left: SymbolicInterval, right: SymbolicInterval) -> SymbolicInterval:
    """Truth of left and right."""
    (certain, possible), (certain_2, possible_2) = map(_certain_and_possible, (left, right))
    with verbatim():
        return _truth(
            left, right, ca.logic_and(certain, certain_2), ca.logic_and(possible, possible_2)
        )


def logical_or(left: SymbolicInterval, right: SymbolicInterval) -> SymbolicInterval:
    """Truth of left or right."""
    (certain, possible), (certain_2, possible_2) = map(_certain_and_possible, (left, right))
    with verbatim():
        return _truth(
            left, right, ca.logic_or(certain, certain_2), ca.logic_or(possible, possible_2)
        )


def if_else_zero(condition: SymbolicInterval, value: SymbolicInterval) -> SymbolicInterval:
    """{value where condition, else 0}: the hull of both where the condition is undecided."""
    zero = SymbolicInterval.exactly(0.0, value.validity)
    return if_else(condition, value, zero)


def if_else(
    condition: SymbolicInterval, value: SymbolicInterval, other: SymbolicInterval
) -> SymbolicInterval:
    """{value where condition, else other}: the hull of both where the condition is undecided.

    Both branches must be valid, also the one that is not taken.
    """
    certain, possible = _certain_and_possible(condition)
    value.watched()
    other.watched()
    with verbatim():
        low = ca.if_else(possible, ca.fmin(value.lower, other.lower), other.lower)
        high = ca.if_else(possible, ca.fmax(value.upper, other.upper), other.upper)
        return SymbolicInterval(
            ca.if_else(certain, value.lower, low),
            ca.if_else(certain, value.upper, high),
            value.validity,
            value.nonnegative and other.nonnegative,
        )


def _certain_and_possible(value: SymbolicInterval) -> tuple[ca.SX, ca.SX]:
    value.watched()
    with verbatim():
        certain = value.lower > 0.0
        if not value.nonnegative:
            certain = ca.logic_or(certain, value.upper < 0.0)
        return certain, ca.logic_or(ca.ne(value.lower, 0.0), ca.ne(value.upper, 0.0))


def _truth(
    left: SymbolicInterval, right: SymbolicInterval, certain: ca.SX, possible: ca.SX
) -> SymbolicInterval:
    left.watched()
    right.watched()
    return SymbolicInterval(certain, possible, left.validity, nonnegative=True)
