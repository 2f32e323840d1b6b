"""The search looks where a bound is tightest, sets out in several directions, and tries ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest

from workbench.claims import Rigor
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode
from workbench.sensitivity import Discrepancy, Examiner, cross_examine
from workbench.sensitivity.ascent import Pairs
from workbench.sensitivity.examine_search import _aims, _different
from workbench.sets import Box

_EXAMINER = Examiner(
    samples=50,
    seed=0,
    step_s=0.1,
    goals_per_coordinate=4,
    rounds=3,
    starts=2,
    second_order_rounds=1,
    any_centre=False,
    closer=False,
    stays_in_region=Rigor.ENCLOSED,
)


@dataclass(frozen=True)
class _Growing:
    """0.9999 exp(t) times the initial distance: a lie for the fastest growth alone."""

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        return (0.9999 * math.exp(t_s) * initial[0] if t_s > 0.0 else initial[0],)


def test_parameters_go_to_the_end_of_their_range_where_a_lie_hides() -> None:
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    ranges = (Ranged("growth", "1/s", 0.0, -1.0, 1.0),)
    ode = Ode("grow", (Signal("x", ""),), ranges, (), x, p, ca.SX(0, 1), p * x)
    claim = Discrepancy(("x",), None, 1.0, "planted", Rigor.SAMPLED, "none", _Growing())
    outcome = cross_examine(
        ode,
        initial_set=Box.around({"x": 1.0}, radius={"x": 0.5}),
        horizon_s=1.0,
        learned=claim,
        proved=(),
        method=_EXAMINER,
    )
    assert outcome.witness is not None
    assert outcome.witness.parameters == (1.0,)
    assert outcome.witness.excess == pytest.approx(1e-4 * outcome.witness.distance, rel=0.1)


def test_the_tightest_instant_of_each_state_is_aimed_at() -> None:
    worst = np.full((21, 2), 0.5)
    worst[7, 0], worst[13, 1], worst[0] = 0.9, 0.7, 5.0
    for count in (1, 2, 5):
        aims = _aims(worst, count)
        assert {(0, 7), (1, 13)} <= set(aims)
        assert all(k > 0 for _, k in aims)
        assert len(aims) <= 2 * count
    worst[8, 0] = 0.85
    assert (0, 8) in _aims(worst, 5)
    # One of each half of the time, whatever is tight elsewhere.
    worst[:6, 0] = 0.8
    assert any(k > 10 for i, k in _aims(worst, 4) if i == 0)


def test_starts_point_into_different_orthants() -> None:
    way = np.array([[1.0, 1.0], [0.9, 0.8], [1.0, -1.0], [-1.0, 1.0]])
    pool = Pairs(np.zeros((4, 2)), way, np.empty((4, 0)))
    assert _different(pool, np.array([1.0, 0.99, 0.5, 0.7]), 3) == [0, 3, 2]
    assert _different(pool, np.array([1.0, -0.99, 0.5, 0.7]), 2) == [0, 1]
