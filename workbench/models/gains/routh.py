"""Hurwitz' conditions of the lateral loop in exact arithmetic, and what each says when it fails."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Final, final

from workbench.errors import InputError
from workbench.models.gains.lateral import LateralLoop, Ring, axis, characteristic
from workbench.models.gains.rational_polynomial import Interval, RationalPolynomial, real_roots

_WIDTH: Final = Fraction(1, 2**40)


class Reason(enum.Enum):
    """Why a lateral loop is stable, or is not; the value says it in words.

    In the order in which they are asked; the first that holds counts.
    """

    NO_DAMPING = "no damping: kd l v is not > 0, the poles do not sum to less than 0"
    DRIFT = "drift: with the integral ki v² must be > 0, without it kp v², or one pole is not < 0"
    NO_RESTORING = (
        "no restoring: a middle coefficient, kd v² + kp l v or kp v² + ki l v, is not > 0"
    )
    OSCILLATION = "growing oscillation: kp or ki too large for kd and l at this speed"
    STABLE = "asymptotically stable"

    @property
    def short(self) -> str:
        """The words before the colon."""
        return self.value.partition(":")[0]


@final
@dataclass(frozen=True, slots=True)
class Conditions:
    """Exact numbers, or polynomials, that must all be > 0.

    damping: coefficient behind the leading one; last: the last one; middle: those between;
    oscillation: the last but one Hurwitz determinant. By Hurwitz' theorem (Gantmacher, The Theory
    of Matrices, XV.6) all > 0 holds exactly where every root has a real part < 0.
    """

    damping: Fraction
    last: Fraction
    middle: tuple[Fraction, ...]
    oscillation: Fraction

    def reason(self) -> Reason:
        """The first condition that fails, or that none does."""
        if self.damping <= 0:
            return Reason.NO_DAMPING
        if self.last <= 0:
            return Reason.DRIFT
        if min(self.middle) <= 0:
            return Reason.NO_RESTORING
        return Reason.STABLE if self.oscillation > 0 else Reason.OSCILLATION


def _determinant(c: Sequence[Ring]) -> Ring:
    """a1 a2 - a0 a3 of a cubic, a3 (a1 a2 - a0 a3) - a1^2 a4 of a quartic."""
    if len(c) == 4:
        return c[1] * c[2] - c[0] * c[3]
    return c[3] * (c[1] * c[2] - c[0] * c[3]) - c[1] * c[1] * c[4]


def _of_coefficients(c: Sequence[Fraction]) -> Conditions:
    return Conditions(c[1], c[-1], tuple(c[2:-1]), _determinant(c))


def conditions(loop: LateralLoop) -> Conditions:
    """The conditions of one loop, exact."""
    return _of_coefficients(loop.polynomial())


@final
@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch of one axis on which one reason holds throughout; proved.

    low, high: its ends. Where `low_is_root` (`high_is_root`) the end is a boundary, known to 2^-40
    of the axis' range; else it is the end of the range.
    """

    low: float
    high: float
    reason: Reason
    low_is_root: bool
    high_is_root: bool


def stability_pieces(loop: LateralLoop, name: str, low: float, high: float) -> tuple[Piece, ...]:
    """All of [low, high] on the axis `name`, cut where stability or its reason changes.

    The conditions are polynomials in the one variable; their roots are isolated by Sturm chains and
    their signs in between are exact: rigor ENCLOSED, about the linearised loop. A piece is about
    the inside of its stretch: at the boundaries themselves a condition is 0, and so may one be at
    single points inside at which it only touches 0. Raises InputError unless low < high.
    """
    if not low < high:
        raise InputError(f"{name}: expected a range with LOW < HIGH, got {low:g} {high:g}")
    coefficients = _along(loop, name)
    ends = Fraction(low), Fraction(high)
    cuts = _apart(_boundaries(coefficients, ends))
    edges: list[Interval] = [(ends[0], ends[0]), *cuts, (ends[1], ends[1])]
    found: list[Piece] = []
    for k, (left, right) in enumerate(pairwise(edges)):
        middle = (left[1] + right[0]) / 2
        reason = _of_coefficients([part(middle) for part in coefficients]).reason()
        start = found.pop() if found and found[-1].reason is reason else None
        found.append(
            Piece(
                start.low if start else float(sum(left) / 2),
                float(sum(right) / 2),
                reason,
                start.low_is_root if start else k > 0,
                k + 2 < len(edges),
            )
        )
    return tuple(found)


def _along(loop: LateralLoop, name: str) -> tuple[RationalPolynomial, ...]:
    """The coefficients as polynomials in the value on one axis."""
    values = {key: RationalPolynomial.of([value]) for key, value in loop.exact().items()}
    values[axis(name).field] = RationalPolynomial.of([0, 1])
    found = characteristic(values)
    return found if found[-1].degree >= 0 else found[:-1]


def _boundaries(coefficients: tuple[RationalPolynomial, ...], ends: Interval) -> list[Interval]:
    """Where one of the conditions is 0 inside the range."""
    width = _WIDTH * (ends[1] - ends[0])
    parts = (*coefficients[1:], _determinant(coefficients))
    return sorted(root for part in parts for root in real_roots(part, *ends, width=width))


def _apart(roots: list[Interval]) -> list[Interval]:
    """Intervals that overlap, because two conditions are 0 at almost one place, as one."""
    found: list[Interval] = []
    for low, high in roots:
        if found and low <= found[-1][1]:
            found[-1] = found[-1][0], max(high, found[-1][1])
        else:
            found.append((low, high))
    return found


def stable_between(loop: LateralLoop, name: str, low: float, high: float) -> bool:
    """Whether the loop is stable at every value of one axis in [low, high]; proved where true.

    Of frozen values: a value that changes with time is another matter. Raises InputError unless
    low < high.
    """
    if not low < high:
        raise InputError(f"{name}: expected a range with LOW < HIGH, got {low:g} {high:g}")
    return (
        conditions(loop.at({name: low})).reason() is Reason.STABLE
        and conditions(loop.at({name: high})).reason() is Reason.STABLE
        and not _boundaries(_along(loop, name), (Fraction(low), Fraction(high)))
    )
