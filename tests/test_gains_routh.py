"""Exact pieces of stability along an axis agree with eigenvalues and with closed forms."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.models.gains import routh
from workbench.models.gains.lateral import AXES, LateralLoop
from workbench.models.gains.rational_polynomial import (
    RationalPolynomial,
    _bisected,
    _sturm_chain,
    real_roots,
)
from workbench.models.gains.routh import Reason, conditions, stability_pieces, stable_between
from workbench.models.gains.stability_map import stability_map
from workbench.models.gains.study import default_ranges
from workbench.models.vehicle import gem_e2

WIDTH = Fraction(1, 2**30)
# Half precision keeps fractions short and stays away from numbers that no gain has.
GAIN = st.one_of(st.just(0.0), st.floats(-2.0, 4.0, width=16))
LOOPS = st.builds(
    LateralLoop, st.just(1.75), st.floats(-4.0, 8.0, width=16), st.floats(0.0, 8.0, width=16),
    GAIN, GAIN, GAIN,
)  # fmt: skip
ROOTS = st.lists(st.fractions(-4, 4, max_denominator=50), min_size=1, max_size=5)


def product(roots: list[Fraction]) -> RationalPolynomial:
    found = RationalPolynomial.of([1])
    for root in roots:
        found = found * RationalPolynomial.of([-root, 1])
    return found


@settings(max_examples=80, deadline=None)
@given(ROOTS, st.booleans())
def test_real_roots_finds_each_root_once(roots: list[Fraction], with_complex: bool) -> None:
    polynomial = product(roots)
    if with_complex:
        polynomial = polynomial * RationalPolynomial.of([1, 1, 1])
    found = real_roots(polynomial, Fraction(-3), Fraction(3), width=WIDTH)
    inside = sorted({root for root in roots if -3 < root < 3})
    assert len(found) == len(inside)
    for (low, high), root in zip(found, inside, strict=True):
        assert low <= root <= high
        assert high - low <= WIDTH


@settings(max_examples=30, deadline=None)
@given(ROOTS)
def test_bisection_alone_finds_the_same(roots: list[Fraction]) -> None:
    kept = [root for root in roots if root]
    assume(kept)
    chain = _sturm_chain(product(kept).primitive())
    found = sorted(_bisected(chain, Fraction(-3), Fraction(3), WIDTH))
    inside = sorted({root for root in kept if -3 < root < 3})
    assert len(found) == len(inside)
    assert all(low <= root <= high for (low, high), root in zip(found, inside, strict=True))


def test_roots_that_floating_point_cannot_hold_are_found_all_the_same() -> None:
    tiny = Fraction(1, 2**1200)
    found = real_roots(product([tiny, Fraction(1)]), Fraction(-1), Fraction(2), width=WIDTH)
    assert [low <= root <= high for (low, high), root in zip(found, (tiny, 1), strict=True)]
    assert len(found) == 2


def test_close_roots_are_told_apart() -> None:
    near = [Fraction(1), Fraction(1) + Fraction(1, 10**15), Fraction(1) + Fraction(2, 10**15)]
    found = real_roots(product(near), Fraction(0), Fraction(2), width=WIDTH)
    assert len(found) == 3
    assert all(low <= root <= high for (low, high), root in zip(found, near, strict=True))


@settings(max_examples=150, deadline=None)
@given(LOOPS)
def test_exact_conditions_agree_with_eigenvalues(loop: LateralLoop) -> None:
    poles = loop.poles()
    largest = max(pole.real for pole in poles)
    # Fourth roots of rounding: several poles that meet are known no better.
    assume(abs(largest) > 1e-3 * max(1.0, *(abs(pole) for pole in poles)))
    assert (conditions(loop).reason() is Reason.STABLE) == (largest < 0.0)


@settings(max_examples=40, deadline=None)
@given(
    LOOPS, st.sampled_from(sorted(AXES)), st.lists(st.floats(0.001, 0.999), min_size=3, max_size=3)
)
def test_pieces_tile_the_range_and_hold_inside(
    loop: LateralLoop, name: str, shares: list[float]
) -> None:
    low, high = (0.0 if name == "look-ahead" else -3.0), 6.0
    pieces = stability_pieces(loop, name, low, high)
    assert (pieces[0].low, pieces[-1].high) == (low, high)
    for one, other in itertools.pairwise(pieces):
        assert one.high == other.low
        assert one.reason is not other.reason
    for share in shares:
        value = low + share * (high - low)
        ends = (low, *(piece.high for piece in pieces))
        assume(min(abs(value - end) for end in ends) > 1e-9)
        here = next(piece for piece in pieces if piece.low <= value <= piece.high)
        # At single points, such as ki = 0 where the integral drops out, another rule counts.
        if loop.at({name: value}).integral or not loop.integral:
            assert conditions(loop.at({name: value})).reason() is here.reason


@settings(max_examples=100, deadline=None)
@given(st.floats(0.05, 3.0), st.floats(0.2, 6.0), st.floats(0.2, 8.0))
def test_boundary_in_kd_is_the_closed_form(kp: float, ahead: float, speed: float) -> None:
    # Without integral: kd l (kd v + kp l) = L kp.
    pieces = stability_pieces(LateralLoop(1.75, speed, ahead, kp, 0.0, 1.0), "kd", -1.0, 50.0)
    a, b, c = ahead * speed, kp * ahead**2, -1.75 * kp
    root = (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)
    assume(root < 49.0)
    assert [piece.reason for piece in pieces][-2:] == [Reason.OSCILLATION, Reason.STABLE]
    assert pieces[-1].low == pytest.approx(root, rel=1e-9)
    assert pieces[0].reason is Reason.NO_DAMPING


def test_a_determinant_of_the_wrong_sign_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    right = routh._determinant
    loop = LateralLoop.of(gem_e2())
    ranges = default_ranges(loop)
    assert stability_map(loop, "kd", "kp", ranges=ranges, points=9).disagreeing == 0
    monkeypatch.setattr(routh, "_determinant", lambda c: -right(c))
    assert stability_map(loop, "kd", "kp", ranges=ranges, points=9).disagreeing > 0


@pytest.mark.parametrize("pair", [("speed", "kp"), ("look-ahead", "kd"), ("ki", "kd")])
def test_maps_agree_with_eigenvalues_everywhere(pair: tuple[str, str]) -> None:
    loop = LateralLoop.of(gem_e2())
    found = stability_map(loop, *pair, ranges=default_ranges(loop), points=25)
    assert found.compared > 0.9 * 25 * 25
    assert found.disagreeing == 0
    assert Reason.STABLE in found.reasons()
    assert len(found.rows()) == sum(map(len, found.pieces))


def test_all_speeds_of_a_range_are_proved_stable_or_not() -> None:
    loop = LateralLoop.of(gem_e2())
    assert stable_between(loop, "speed", 0.3, 8.0)
    # Below 0.12 m/s the integral makes it swing.
    assert not stable_between(loop, "speed", 0.1, 8.0)
    assert conditions(loop.at({"speed": 0.1})).reason() is Reason.OSCILLATION
    # An end that lies on the boundary is not stable.
    assert not stable_between(loop.at({"ki": 0.05}), "kd", 0.0, 1.0)


def test_ranges_and_axes_that_cannot_be_are_refused() -> None:
    loop = LateralLoop.of(gem_e2())
    with pytest.raises(InputError, match="LOW < HIGH"):
        stability_pieces(loop, "kp", 1.0, 1.0)
    with pytest.raises(InputError, match="LOW < HIGH"):
        stable_between(loop, "kp", 2.0, 1.0)
    with pytest.raises(InputError, match="expected an axis, one of speed"):
        loop.at({"gain": 1.0})
    with pytest.raises(InputError, match="two different axes"):
        stability_map(loop, "kp", "kp", ranges=default_ranges(loop), points=5)
    with pytest.raises(InputError, match="at least 2 points"):
        stability_map(loop, "kp", "kd", ranges=default_ranges(loop), points=1)
    with pytest.raises(InputError, match="finite"):
        loop.at({"kp": float("nan")})
