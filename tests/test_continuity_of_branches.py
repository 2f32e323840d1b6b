"""Claim: a field with if_else is accepted exactly where its branches meet, and keeps its values."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inclusion_cases import random_operation

from workbench.errors import InputError
from workbench.models import Ode, Ranged, system_from_casadi
from workbench.models.atoms import EVERYTHING
from workbench.models.exact_values import ExactValues
from workbench.models.graph import graph_of
from workbench.models.literals import Literals
from workbench.models.operations import BRANCHES
from workbench.models.polynomials import Polynomial
from workbench.models.signals import Signal
from workbench.sensitivity.kinks import smooth_form

X = ca.SX.sym("x", 2)
U, V = ca.vertsplit(X)
P = ca.SX.sym("p")


def saturated(u: ca.SX, limit: ca.SX | float) -> ca.SX:
    return ca.if_else(u > limit, limit, ca.if_else(u < -limit, -limit, u))


def saturated_from_below(u: ca.SX, limit: ca.SX | float) -> ca.SX:
    return ca.if_else(u < -limit, -limit, ca.if_else(u > limit, limit, u))


def limited_from_below(u: ca.SX, limit: float) -> ca.SX:
    return ca.if_else(u < limit, limit, u)


def system(expression: ca.SX, low: float = 0.125, high: float = 0.25) -> Ode:
    signals = (Signal("x", ""), Signal("y", ""))
    parameter = Ranged("p", "", low, low, high)
    field = ca.vertcat(expression, 0)
    return Ode("loop", signals, (parameter,), (), X, P, ca.SX(0, 1), field)


# Expression and the number of kinks that are left.
ACCEPTED: dict[str, tuple[ca.SX, int]] = {
    "leaky": (ca.if_else(U > 0, U, 0.1 * U), 1),
    "absolute value": (ca.if_else(U < 0, -U, U), 1),
    "parabola, then its tangent": (ca.if_else(U < 1, U**2, 2 * U - 1), 2),
    "the same at a parameter": (ca.if_else(U < P, U**2, 2 * P * U - P**2), 1),
    "saturation": (saturated(U, P), 1),
    "saturation of a sum": (saturated(U + 3 * V, P), 1),
    "saturation of a product": (saturated(P * U, 0.3), 1),
    "saturation, lower limit first": (saturated_from_below(U, P), 1),
    "saturation with numbers": (saturated_from_below(2.5 * U - V, 0.3), 1),
    "limits in the wrong order": (limited_from_below(ca.if_else(U > P, P, U), 0.3), 2),
    "dead zone": (ca.if_else(U > P, U - P, ca.if_else(U < -P, U + P, 0)), 2),
    "dead zone by or": (ca.if_else(ca.logic_or(U > P, U < -P), ca.fabs(U) - P, 0), 2),
    "quadrant by and": (ca.if_else(ca.logic_and(U > 0, V > 0), U * V, 0), 2),
    "not": (ca.if_else(ca.logic_not(U >= 0), 0, U), 1),
    "nothing above": (ca.if_else(U > 0, 0, U), 1),
    "quadrant by and, not": (
        ca.if_else(ca.logic_and(ca.logic_not(U > 0), V > 0), U * V, 0),
        2,
    ),
    "sine, then its tangent": (ca.if_else(U < 0, ca.sin(U), U), 2),
    "sine, then its tangent at a parameter": (
        ca.if_else(U < P, ca.sin(U), ca.sin(P) + (U - P) * ca.cos(P)),
        2,
    ),
    "root on one side": (ca.if_else(U > 1, ca.sqrt(U - 1), 0), 1),
    "hyperbola": (ca.if_else(U < 1, U, 1 / U), 2),
    "exponential": (ca.if_else(U < 0, 1, ca.exp(U)), 1),
    "power": (ca.if_else(U > 0, U**2.5, 0), 1),
    "tangent of a limited angle": (
        ca.if_else(U > P, ca.tan(P), ca.if_else(U < -P, -ca.tan(P), ca.tan(U))),
        2,
    ),
    "disc": (ca.if_else(U * U + V * V < 1, 1, U * U + V * V), 1),
    "moving threshold": (ca.if_else(U < V, U * V, V * V), 1),
    "kink in the condition": (ca.if_else(ca.fabs(U) < P, ca.fabs(U), P), 2),
    "slope below 0.5, brake": (ca.if_else(U > 0.5, -1, -2 * U), 1),
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_continuous_branches_become_minima_and_maxima_of_the_same_value(name: str) -> None:
    expression, kinks = ACCEPTED[name]
    ode = system(expression)
    branchless = ode.branchless_field()
    assert branchless is not None
    literals = branchless.literals
    inputs = [X, P, *literals.symbols]
    rewritten = ca.Function("rewritten", inputs, list(branchless.outputs[0]))
    assert not BRANCHES & {node.name for node in graph_of(rewritten).nodes}
    rng = np.random.default_rng(3)
    for _ in range(400):
        p = rng.choice([0.125, 0.25, rng.uniform(0.125, 0.25)])
        x = rng.normal(size=2) * rng.choice([0.1, 1.0, 10.0])
        x[0] = rng.choice([x[0], x[0], x[1], p, -p, 0.0, 0.5, 1.0, math.nextafter(p, 1.0)])
        expected = float(ode.function()(x, p, [])[0])
        value = float(rewritten(x, p, *literals.values)[0])
        assert value == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert smooth_form(ode).kappa.numel() == kinks


REFUSED: dict[str, tuple[ca.SX, str]] = {
    "jump": (ca.if_else(U > 0, -1, 1), r"if_else\(0 < x_0, -1, 1\).*differ by -2"),
    "jump that only rounding makes": (ca.if_else(U < 0.1, U + 0.2, 0.3), "e-17 there"),
    "hysteresis": (ca.if_else(U > V, 1, 0), "differ by 1 there"),
    "other tangent": (ca.if_else(U < 1, U**2, 2 * U), "differ by -1 there"),
    "sign unknown": (ca.if_else(U > V, V, ca.if_else(U < -V, -V, U)), "if_else"),
    "sine without a known value": (ca.if_else(U < 1, ca.sin(U), ca.sin(1)), "if_else"),
    "inner jump": (ca.if_else(U > 1, U, ca.if_else(U > 0, 1, -1)), "differ by 2 there"),
    "comparison as a factor": ((U > 0) * U, "'lt' is used as a number"),
    "equality": (ca.if_else(ca.eq(U, 0), 0, U), "'eq' has no proved bounds"),
    "number as a condition": (ca.if_else(U, U, 0), "'input' as the condition"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_proved_continuous_is_refused_when_made(name: str) -> None:
    expression, message = REFUSED[name]
    with pytest.raises(InputError, match=message):
        system(expression)
    with pytest.raises(InputError, match=message):
        system_from_casadi(X, ca.vertcat(0, expression), ("x", "y"))


@pytest.mark.parametrize("law", [saturated, saturated_from_below])
def test_a_saturation_needs_limits_in_order(law: Callable[..., ca.SX]) -> None:
    assert system(law(U, P), 0.0, 0.25).branchless_field() is not None
    with pytest.raises(InputError, match="if_else"):
        system(law(U, P), math.nextafter(0.0, -1.0), 0.25)
    with pytest.raises(InputError, match="if_else"):
        system_from_casadi(X, ca.vertcat(law(U, V), 0), ("x", "y"))


def test_a_parameter_turned_state_keeps_its_range_only_if_it_rests() -> None:
    signals = (Signal("x", ""), Signal("y", ""))
    empty = ca.SX(0, 1)
    limit = Ranged("y", "", 0.125, 0.125, 0.25)
    still = ca.vertcat(saturated(U, V), 0)
    assert Ode("still", signals, (), (), X, empty, empty, still, constants=(limit,))
    with pytest.raises(InputError, match=r"derivative is 0, got \['y'\]"):
        moving = ca.vertcat(saturated(U, V), 1)
        Ode("moving", signals, (), (), X, empty, empty, moving, constants=(limit,))


def test_a_range_is_not_trusted_at_switching_points_outside_it() -> None:
    # Where x < 0.1 the guard vanishes at a p outside [0.125, 0.25], where max(p, 0.125) is not p.
    expression = ca.if_else(P < U, ca.fmax(P, 0.125) * U, P * U + ca.sin(P - U))
    try:
        branchless = system(expression).branchless_field()
    except InputError:
        return
    rewritten = ca.Function(
        "rewritten", [X, P, *branchless.literals.symbols], list(branchless.outputs[0])
    )
    for x in (-1.0, 0.0, 0.2, 1.0):
        expected = system(expression).function()([x, 0.0], 0.2, [])[0]
        value = rewritten([x, 0.0], 0.2, *branchless.literals.values)[0]
        assert float(value) == pytest.approx(float(expected), abs=1e-12)


dyadic = st.integers(-64, 64).map(lambda k: k / 8)
decimal = st.integers(-50, 50).map(lambda k: k / 10)
number = st.one_of(dyadic, decimal)


@settings(max_examples=300, deadline=None)
@given(st.lists(number, min_size=6, max_size=6), number, st.booleans())
def test_parabolas_are_accepted_exactly_when_they_meet(
    c: list[float], place: float, mended: bool
) -> None:
    if mended:
        c[3] = 0.0 if place == 0.0 else c[3]
        c = [*c[:2], c[2], c[0], c[1], c[2]] if place else [c[0], c[1], c[2], c[0], c[4], c[5]]
    low = c[0] + U * (c[1] + U * c[2])
    high = c[3] + U * (c[4] + U * c[5])
    at = Fraction(place)
    a, b, d, e, f, g = map(Fraction, c)
    meets = a + at * (b + at * d) == e + at * (f + at * g)
    try:
        system(ca.if_else(place > U, low, high))
    except InputError:
        assert not meets
    else:
        assert meets


def graph_without_branches(seed: int) -> ca.Function:
    rng = random.Random(seed)
    pool: list[ca.SX] = [U, V, P]
    while len(pool) < 14:
        new = random_operation(rng, *(rng.choice(pool[-5:]) for _ in range(3)))
        names = {node.name for node in graph_of(ca.Function("f", [X, P], [new])).nodes}
        if not names & BRANCHES:
            pool.append(new)
    return ca.Function("f", [ca.vertcat(X, P)], [ca.vertcat(*pool)])


def expression_or_nan(values: ExactValues, polynomial: Polynomial) -> ca.SX:
    try:
        return values.expression(polynomial)
    except OverflowError:
        return ca.SX.nan()


@pytest.fixture
def flint():
    module = pytest.importorskip("flint", reason="python-flint (ball arithmetic) is not installed")
    before, module.ctx.prec = module.ctx.prec, 400
    yield module
    module.ctx.prec = before


@pytest.mark.parametrize("seed", range(60))
def test_exact_polynomials_have_the_values_of_the_graph(flint, seed: int) -> None:
    import inclusion_balls

    function, literals = graph_without_branches(seed), Literals()
    span = (Fraction(1, 8), Fraction(1, 4))
    values = ExactValues([ca.vertcat(X, P)], [[EVERYTHING, EVERYTHING, span]], literals)
    graph = graph_of(function)
    exact: list[Polynomial] = []
    for index, node in enumerate(graph.nodes):
        operands = [exact[k] for k in node.operands]
        exact.append(values.of(index, node, operands, ca.SX.nan()))
    outputs = [expression_or_nan(values, exact[row]) for row in graph.outputs[0]]
    known = [k for k, output in enumerate(outputs) if "nan" not in str(output)]
    assert len(known) > len(outputs) // 2
    symbols = ca.vertcat(X, P, *literals.symbols)
    rebuilt = graph_of(ca.Function("g", [symbols], [ca.vertcat(*outputs)]))
    rng = np.random.default_rng(seed)
    for _ in range(20):
        point = [*rng.normal(size=2), rng.uniform(0.125, 0.25), *literals.values]
        arguments = [flint.arb(float(value)) for value in point]
        one, two = (inclusion_balls.evaluated(g, arguments) for g in (graph, rebuilt))
        for k in known:
            if one[k].is_finite() and two[k].is_finite():
                assert one[k].overlaps(two[k])
                assert one[k].rad() < 1e-20 * (1 + abs(one[k]))


polynomials = st.lists(
    st.tuples(
        st.dictionaries(st.integers(0, 2), st.integers(1, 2), max_size=2),
        st.fractions(min_value=-5, max_value=5, max_denominator=8),
    ),
    max_size=4,
).map(lambda terms: Polynomial.of((tuple(sorted(m.items())), c) for m, c in terms))


@settings(deadline=None)
@given(polynomials, polynomials, polynomials)
def test_exact_division_undoes_multiplication_and_nothing_else(
    p: Polynomial, g: Polynomial, r: Polynomial
) -> None:
    if not g.terms:
        assert p.divided_by(g) is None
        return
    assert (p * g).divided_by(g) == p
    quotient = (p * g + r).divided_by(g)
    assert quotient is None or quotient * g == p * g + r


def test_expressions_too_large_to_expand_are_refused_unless_the_same_on_both_sides() -> None:
    x = ca.SX.sym("x", 8)
    names = tuple(f"x{k}" for k in range(8))
    large = ca.sum1(x) ** 4
    rest = ca.SX.zeros(7)
    leaky = ca.if_else(x[0] > 0, large + x[0], large)
    assert system_from_casadi(x, ca.vertcat(leaky, rest), names).branchless_field() is not None
    other = ca.if_else(x[0] > 0, large, ca.sum1(x) ** 5)
    wide = ca.if_else(x[0] > 0, ca.sum1(x) ** 2 * x[1], ca.sum1(x[::-1]) ** 3)
    for expression in (other, wide):
        with pytest.raises(InputError, match="could not be proved continuous"):
            system_from_casadi(x, ca.vertcat(expression, rest), names)


def test_a_field_with_structural_zeros_keeps_its_rows() -> None:
    field = ca.vertcat(ca.SX(1, 1), ca.if_else(U < 1, U, 1))
    form = smooth_form(system_from_casadi(X, field, ("x", "y")))
    assert form.field.shape == (2, 1)
    assert form.field[0].is_zero()
    assert not form.field[1].is_zero()
