"""The distance of two given runs lies between the proved bounds, which are narrow."""

from __future__ import annotations

import math

import casadi as ca
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode, system_from_casadi
from workbench.reach.inner.distance import proved_distance


def _decay() -> Ode:
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    ranges = (Ranged("decay", "1/s", 1.0, 0.5, 2.0),)
    return Ode("decay", (Signal("x", ""),), ranges, (), x, p, ca.SX(0, 1), -p * x)


@settings(max_examples=15, deadline=None)
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.sampled_from([0.5, 1.0, 2.0]))
def test_a_closed_form_lies_between(first: float, second: float, decay: float) -> None:
    bounds = proved_distance(
        _decay(), ((first,), (second,)), parameters=(decay,), time_s=0.3, state="x"
    )
    assert bounds is not None
    low, high = bounds
    exact = abs(second - first) * math.exp(-0.3 * decay)
    assert low <= exact * (1.0 + 1e-15)
    assert exact * (1.0 - 1e-15) <= high
    assert high - low < 1e-6


def test_at_the_start_it_is_the_distance_itself() -> None:
    bounds = proved_distance(_decay(), ((1.0,), (1.5,)), parameters=(1.0,), time_s=0.0, state="x")
    assert bounds == pytest.approx((0.5, 0.5), abs=1e-15)


def test_a_run_that_cannot_be_enclosed_proves_nothing() -> None:
    x = ca.SX.sym("x")
    system = system_from_casadi(x, x**2, ("x",))
    bounds = proved_distance(system, ((1.0,), (0.1,)), parameters=(), time_s=1.5, state="x")
    assert bounds is None


def test_a_parameter_outside_its_range_is_refused() -> None:
    with pytest.raises(InputError, match="in their ranges"):
        proved_distance(_decay(), ((1.0,), (1.5,)), parameters=(3.0,), time_s=0.1, state="x")
