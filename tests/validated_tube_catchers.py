"""Counts of what a validated tube or its parts miss of known solutions; 0 where they are sound."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import casadi as ca
import flint
import numpy as np
import numpy.typing as npt
import validated_cases as cases
from scipy.integrate import quad
from scipy.linalg import expm
from tube_cases import box, dense_times, disturbed, march
from tube_cases import escapes as escaping_runs
from validated_balls import Inputs, monomial_values, precise
from validated_balls import escapes as coefficients_outside
from validated_catchers import OPERATIONS, operation

from workbench.models import Ranged, benchmarks
from workbench.reach import compute_tube
from workbench.reach.validated.algebra import Algebra
from workbench.reach.validated.forcing import Forced, forced
from workbench.reach.validated.sets import PolynomialSet
from workbench.reach.validated.step import Stepper
from workbench.reach.validated.tube import ValidatedTube

Array = npt.NDArray[np.float64]
FORMS = {form.name: form for form in (*cases.SMOOTH, *cases.PLANAR, *cases.KINKED)}


def outside_operation(name: str, size: float = 0.2) -> int:
    """Exact coefficients outside the series of an operation, on wide and on narrow elements."""
    found = 0
    for seed, (deep, degree, shallow) in enumerate(((2, 2, 2), (3, 3, 0), (1, 1, 0), (1, 2, 0))):
        algebra = Algebra.of(deep=deep, degree=degree, shallow=shallow)
        inputs = Inputs.random(algebra, OPERATIONS[name][1], (1e-6, size), orders=6, seed=seed)
        found += coefficients_outside(operation(name), inputs)
    return found


def outside_box_tube(name: str, *, step_s: float = 0.05, degree: int = 2) -> int:
    """Solutions of a closed form outside the tube from its box."""
    form = FORMS[name]
    tube = form.tube(step_s=step_s, degree=degree)
    return len(cases.escapes(tube, form, cases.points(form.start, 4), per_row=9))


def outside_point_tube(name: str, *, step_s: float = 0.05) -> int:
    """The same from the upper end, so that the tube is as wide as the rounding."""
    form = FORMS[name]
    state = np.array(form.start.upper)
    tube = form.at(state).tube(step_s=step_s)
    return len(cases.escapes(tube, form, state[None, :], per_row=1))


def outside_step(name: str, *, h: float, order: int, point: bool = False) -> int:
    """Solutions outside one step: of the polynomial and zonotope themselves, and of the row.

    No slack of a hull is in the way, and the order is not adapted to the step.
    """
    form = FORMS[name]
    if point:
        form = form.at(cases.points(form.start, 1)[-1])
    lower, upper = np.array([form.start.lower]), np.array([form.start.upper])
    start = PolynomialSet.of_boxes(lower, upper, degree=2)
    result = Stepper(form.system).step(start, h, order)
    found = 0
    with precise():
        for d in _deviations(start):
            monomials = monomial_values(start.algebra, d)
            state = _states(start.coef[0], monomials)
            spread = [sum(map(flint.arb, map(float, np.abs(g)))) for g in result.end.generators[0]]
            reached = _states(result.end.coef[0], monomials)
            exact = form.solution(state, flint.arb(h))
            found += sum(
                bool(abs(a - b) > s) for a, b, s in zip(exact, reached, spread, strict=True)
            )
            for share in np.linspace(0.0, 1.0, 9):
                there = form.solution(state, flint.arb(float(share * h)))
                found += sum(
                    bool(v < float(low)) or bool(v > float(high))
                    for v, low, high in zip(there, result.lower[0], result.upper[0], strict=True)
                )
    return found


def _deviations(start: PolynomialSet) -> Array:
    """Vertices and some points inside, over all variables of the algebra; shallow ones rest."""
    deep = start.algebra.deep
    corners = np.indices((2,) * deep).reshape(deep, 2**deep).T * 2.0 - 1.0
    inside = np.random.default_rng(2).uniform(-1, 1, (3, deep))
    deviations = np.concatenate([corners, inside])
    rest = np.zeros((len(deviations), start.algebra.shallow))
    return np.concatenate([deviations, rest], axis=1)


def _states(coef: Array, monomials: list[Any]) -> list[Any]:
    return [
        sum((flint.arb(float(c)) * m for c, m in zip(row, monomials, strict=True)), flint.arb(0))
        for row in coef
    ]


def runs_outside_the_loop() -> int:
    """Sampled runs of the benchmark loop B1 that leave its tube: vertices and interior."""
    loop = benchmarks.b1()
    tube = compute_tube(loop.system, initial_set=loop.initial_set, horizon_s=1.0)
    ordered = loop.initial_set.reordered(loop.system.ode.names)
    times = dense_times(tube, 4)
    return escaping_runs(tube, times, march(loop.system, cases.points(ordered, 60), times))


def outside_bang_bang() -> int:
    """x'' = -x + w with |w| <= 0.5 from a point, in steps of 0.4 s; 0.5 integral of |sin|."""
    w = (Ranged.symmetric("w", "", 0.5),)
    system = disturbed(lambda x, p, w: [x[1], -x[0] + w[0]], ("x", "y"), disturbances=w)
    start = box(x=(0.0, 0.0), y=(0.0, 0.0))
    tube = compute_tube(system, initial_set=start, horizon_s=3.0, method=ValidatedTube(0.4))
    dense = dense_times(tube, 8)
    rows = np.clip(np.searchsorted(tube.times, dense) - 1, 0, len(tube.lower) - 1)
    worst = 0.5 * (1 - np.cos(np.minimum(dense, math.pi)))
    at = 0.5 * (1 - np.cos(tube.times))
    return int(
        np.sum(tube.upper[rows, 0] < worst - 1e-14) + np.sum(tube.upper_at[:, 0] < at - 1e-14)
    )


def outside_disturbed_knee() -> int:
    """x' = fmin(w, 0.5 w), |w| <= 1, reaches from -t to 0.5 t."""
    w = (Ranged.symmetric("w", "", 1.0),)
    system = disturbed(lambda x, p, w: [ca.fmin(w[0], 0.5 * w[0])], ("x",), disturbances=w)
    tube = compute_tube(system, initial_set=box(x=(0.0, 0.0)), horizon_s=1.0)
    return int(
        np.sum(tube.lower_at[:, 0] > -tube.times) + np.sum(tube.upper_at[:, 0] < 0.5 * tube.times)
    )


def outside_ranged_parameter() -> int:
    """x' = -p x with p in [0.5, 1.5]."""
    p = (Ranged("p", "", 1.0, 0.5, 1.5),)
    system = disturbed(lambda x, p, w: [-p[0] * x[0]], ("x",), parameters=p)
    tube = compute_tube(system, initial_set=box(x=(1.0, 1.2)), horizon_s=1.0)
    return int(
        np.sum(tube.lower_at[:, 0] > np.exp(-1.5 * tube.times) + 1e-14)
        + np.sum(tube.upper_at[:, 0] < 1.2 * np.exp(-0.5 * tube.times) - 1e-14)
    )


def box_ends_lost() -> int:
    """Ends of a box that centre and radius of its polynomial do not reach, in exact arithmetic."""
    rng = np.random.default_rng(4)
    lower = rng.normal(size=(400, 1)) * 2.0 ** rng.integers(-8, 0, (400, 1))
    upper = lower + np.abs(rng.normal(size=(400, 1)))
    made = PolynomialSet.of_boxes(lower, upper, degree=1)
    lost = 0
    for low, high, (center, radius) in zip(lower, upper, made.coef[:, 0, :2], strict=True):
        middle, reach = Fraction(float(center)), Fraction(float(radius))
        lost += middle - reach > Fraction(float(low[0]))
        lost += middle + reach < Fraction(float(high[0]))
    return lost


def forced_shortfall() -> int:
    """Directions in which the worst inputs of a linear system push farther than `forced` says.

    x' = A x + B v with any A and B in their ranges: the support of the end is the integral of
    |l e^(A (h-s)) B| radius, the largest distance from the chord that of its kernel.
    """
    rng = np.random.default_rng(8)
    h, short = 0.1, 0
    # What is uncertain: nothing, A about 0, B, both; and one input or two.
    for flow, a_spread, b_spread, columns in (
        (1.0, 0.0, 0.0, 1), (0.0, 0.3, 0.0, 2), (1.0, 0.0, 0.3, 2), (1.0, 0.3, 0.3, 2),
    ):  # fmt: skip
        a_mid, b_mid = flow * rng.normal(size=(2, 2)), rng.normal(size=(2, columns))
        a = a_mid + a_spread * rng.choice([-1.0, 1.0], a_mid.shape)
        b = b_mid + b_spread * rng.choice([-1.0, 1.0], b_mid.shape)
        radius = rng.uniform(0.1, 1.0, columns)
        effect = forced(
            ((a_mid - a_spread)[None], (a_mid + a_spread)[None]),
            ((b_mid - b_spread)[None], (b_mid + b_spread)[None]),
            radius[None], h,
        )  # fmt: skip
        short += _beyond_end(effect, (a, b), radius, h) + _beyond_chord(effect, (a, b), radius, h)
    return short


def _integral(kernel: Callable[[float], Array], h: float, split: float) -> float:
    total, _ = quad(lambda s: float(np.sum(np.abs(kernel(s)))), 0.0, h, points=[split], limit=200)
    return float(total)


def _beyond_end(effect: Forced, true: tuple[Array, Array], radius: Array, h: float) -> int:
    a, b = true
    short = 0
    angles = np.linspace(0.0, math.pi, 7)
    mean = h * b[:, 0] + 0.5 * h * h * a @ b[:, 0]
    across = np.array([-mean[1], mean[0]]) / np.linalg.norm(mean)
    for way in (across, *np.stack([np.cos(angles), np.sin(angles)], axis=1)):
        worst = _integral(lambda s, way=way: way @ expm(a * (h - s)) @ b * radius, h, h / 2)  # type: ignore[misc]
        said = np.abs(way @ effect.generators[0]).sum() + np.abs(way) @ effect.box[0]
        short += worst > said + 1e-9
    return short


def _beyond_chord(effect: Forced, true: tuple[Array, Array], radius: Array, h: float) -> int:
    a, b = true
    short = 0
    for i in range(2):
        for share in (0.25, 0.5, 0.75):
            t = share * h

            def kernel(s: float, i: int = i, t: float = t, share: float = share) -> Array:
                now = expm(a * (t - s)) if s < t else np.zeros((2, 2))
                return np.asarray((now - share * expm(a * (h - s)))[i] @ b * radius)

            short += _integral(kernel, h, t) > effect.chord[0, i] + 1e-9
    return short
