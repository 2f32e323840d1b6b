"""Claim: statuses and `unsaturated` of a validated tube say nothing false; misuse is refused."""

from __future__ import annotations

import time

import casadi as ca
import numpy as np
import pytest
from tube_cases import box, disturbed, system_of

from workbench.errors import InputError
from workbench.models import Ode, Ranged
from workbench.reach import ReachTube, ValidatedTube, compute_tube
from workbench.reach.tube import TubeStatus
from workbench.reach.validated.lines import chebyshev_line
from workbench.sensitivity.inclusion import FirstInvalid

X, Y = ca.SX.sym("x"), ca.SX.sym("y")
ABOVE = {
    "fmin(1, x)": ca.fmin(1, X),
    "fmin(x, 1)": ca.fmin(X, 1),
    "fmin(1, fmax(-1, x))": ca.fmin(1, ca.fmax(-1, X)),
    "fmax(-1, fmin(1, x))": ca.fmax(-1, ca.fmin(1, X)),
    "fmax(-1, -x)": ca.fmax(-1, -X),
    "if_else, limit first": ca.if_else(X > 1, 1, X),
    "if_else, limit second": ca.if_else(X < 1, X, 1),
    "if_else, limit moves": ca.if_else(X > 0.5 * X + 0.5, 0.5 * X + 0.5, X),
    "fmin, limit moves": ca.fmin(0.5 * X + 0.5, X),
    "fabs": ca.fabs(-X),
}


def along(field: ca.SX, low: float, high: float, horizon_s: float = 0.2) -> ReachTube:
    return compute_tube(
        system_of(lambda x: [ca.substitute(field, X, x)], "x"),
        initial_set=box(x=(low, high)),
        horizon_s=horizon_s,
    )


@pytest.mark.parametrize("name", ABOVE)
def test_unsaturated_is_not_said_beyond_a_limit_however_it_is_written(name: str) -> None:
    tube = along(ABOVE[name], 2.0, 3.0)
    assert tube.complete
    assert tube.kinks is not None
    assert tube.kinks.share == 1.0
    assert not tube.kinks.unsaturated


@pytest.mark.parametrize("name", [name for name in ABOVE if "1" in name or "first" in name])
def test_unsaturated_is_said_within_constant_limits_however_they_are_written(name: str) -> None:
    tube = along(ABOVE[name], -0.5, 0.5)
    assert tube.kinks is not None
    assert tube.kinks.unsaturated


@pytest.mark.parametrize(("low", "high", "within"), [(-0.5, 0.5, True), (2.0, 3.0, False)])
def test_a_limit_with_a_range_is_a_limit(low: float, high: float, within: bool) -> None:
    system = disturbed(
        lambda x, p, w: [ca.fmin(p[0], ca.fmax(-1, x[0]))],
        ("x",),
        parameters=(Ranged("limit", "", 1.0, 0.9, 1.1),),
    )
    tube = compute_tube(system, initial_set=box(x=(low, high)), horizon_s=0.2)
    assert tube.kinks is not None
    assert tube.kinks.unsaturated is within


def test_a_tube_without_rows_does_not_say_unsaturated() -> None:
    tube = along(ca.fmin(X, 1) + X**2, 1e10, 1e10, 1.0)
    assert tube.status is TubeStatus.ENCLOSURE_FAILED
    assert len(tube.lower) == 0
    assert tube.kinks is not None
    assert not tube.kinks.unsaturated


GROWTH = {
    "exp": (ca.exp(X), 1.0, 1.0),
    "sinh": (ca.sinh(X), 3.0, 3.0),
    "cosh": (ca.cosh(X), 3.0, 5.0),
    "tanh": (-ca.tanh(200 * X), 1.0, 1.1),
    "sin": (1e4 * X**2 + ca.sin(X), 1.0, 1.0),
    "a product": (1e308 * X, 1.0, 1.0),
}


@pytest.mark.parametrize("name", GROWTH)
def test_growth_is_no_singularity(name: str) -> None:
    field, low, high = GROWTH[name]
    tube = along(field, low, high, 2.0)
    assert tube.status is TubeStatus.ENCLOSURE_FAILED


SINGULAR = {
    "tan": ca.tan(X) ** 2 + 1,
    "division": -1 - 0.01 / X,
    "log": -1 - ca.log(X) ** 2,
    "sqrt": -ca.sqrt(X),
    "asin": 1 + ca.asin(X) ** 2,
    "power": -(X**1.7) - 1,
    "atan2": ca.atan2(X - 0.5, X) - 1,
}


@pytest.mark.parametrize("name", SINGULAR)
def test_a_pole_and_the_border_of_a_domain_are_singular(name: str) -> None:
    tube = along(SINGULAR[name], 0.8, 0.9, 5.0)
    assert tube.status is TubeStatus.SINGULAR
    assert "reaches the border of the domain of" in tube.message


@pytest.mark.parametrize(("low", "high"), [(-0.3, -0.2), (0.2, 1.4), (2.0, 3.0)])
def test_a_line_through_crossed_limits_is_the_ceiling(low: float, high: float) -> None:
    slope, offset, gap = chebyshev_line(*(np.array([v]) for v in (low, high, 1.0, 0.0)))
    driver = np.linspace(low, high, 9)
    assert np.all(np.abs(slope * driver + offset) <= gap)


def test_the_first_invalid_operation_is_named() -> None:
    find = FirstInvalid(ca.Function("f", [X], [ca.exp(ca.sqrt(X)) + ca.log(X)]))
    assert find(ca.DM(1.0), ca.DM(2.0)) is None
    assert find(ca.DM(-1.0), ca.DM(2.0)) == "sqrt"
    assert find(ca.DM(1.0), ca.DM(1e6)) == "exp"
    assert find(ca.DM(0.0), ca.DM(2.0)) == "log"


def test_high_integer_powers_take_negative_bases() -> None:
    tube = along(-(X**101), -0.5, 0.5, 1.0)
    assert tube.complete
    assert np.all(np.abs(tube.upper_at) < 0.5 + 1e-9)


@pytest.mark.parametrize(
    ("horizon_s", "step_s"), [(1e9, 0.05), (1e300, 0.05), (1.0, 1e-320), (1e-320, 0.05)]
)
def test_grids_without_measure_are_refused(horizon_s: float, step_s: float) -> None:
    system = system_of(lambda x: [-x], "x")
    with pytest.raises(InputError, match="expected"):
        compute_tube(
            system,
            initial_set=box(x=(0.0, 1.0)),
            horizon_s=horizon_s,
            method=ValidatedTube(step_s),
        )


def test_too_many_terms_are_refused_before_they_are_made() -> None:
    names = tuple(f"x{i}" for i in range(60))
    system: Ode = system_of(lambda *x: [-each for each in x], *names)
    start = time.monotonic()
    with pytest.raises(InputError, match="60 uncertain axes with degree 4"):
        compute_tube(
            system,
            initial_set=box(**dict.fromkeys(names, (0.0, 1.0))),
            horizon_s=1.0,
            method=ValidatedTube(degree=4),
        )
    assert time.monotonic() - start < 30.0
