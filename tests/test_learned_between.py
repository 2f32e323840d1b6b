"""Between instants the extended bound holds for exact solutions, where the bare one does not."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import Ode, system_from_casadi
from workbench.sensitivity import Discrepancy, LearnedExponential, between_instants
from workbench.sensitivity.sampling import rollout, uniform_states
from workbench.sets.box import Box

_SET = Box.around({"angle": 0.4, "rate": 0.0}, radius={"angle": 0.2, "rate": 0.1})
_REGION = Box.from_intervals({"angle": (-1.5, 1.5), "rate": (-5.0, 5.0)})
_STEP_S = 0.5


def _pendulum() -> Ode:
    x = ca.SX.sym("x", 2)
    field = ca.vertcat(x[1], -9.0 * ca.sin(x[0]) - 0.3 * x[1])
    return system_from_casadi(x, field, ("angle", "rate"))


class _AtInstants:
    """What two given runs were apart at whole steps, and nothing in between."""

    def __init__(self, distances: dict[int, tuple[float, ...]]) -> None:
        self._distances = distances

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        return self._distances[round(t_s / _STEP_S)]


def _learned(growth: _AtInstants) -> Discrepancy:
    return Discrepancy(
        names=("angle", "rate"),
        region=_SET,
        horizon_s=3.0,
        norm="made up",
        rigor=Rigor.SAMPLED,
        condition="made up",
        growth=growth,
    )


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**31))
def test_runs_stay_inside_between_instants(seed: int) -> None:
    runs = rollout(
        _pendulum(),
        uniform_states(_SET, 2, np.random.default_rng(seed)),
        horizon_s=3.0,
        step_s=0.01,
    )
    assert np.all(np.abs(runs[:, :, 0]) < 1.5)
    distances = np.abs(runs[1] - runs[0])
    bound = between_instants(
        _learned(_AtInstants({k: tuple(distances[50 * k].tolist()) for k in range(7)})),
        system=_pendulum(),
        region=_REGION,
        step_s=_STEP_S,
        cells=1,
    )
    for k in range(0, 301, 7):
        widths = np.array(bound.radius((0.4, 0.2), 0.01 * k))
        assert np.all(distances[k] <= widths * (1.0 + 1e-6) + 1e-9)


def test_a_swing_that_the_instants_miss_is_covered() -> None:
    # Both runs turn back before the next instant: the straight line between them misses it.
    x = ca.SX.sym("x", 2)
    system = system_from_casadi(x, 2.0 * math.pi * ca.vertcat(x[1], -x[0]), ("place", "pace"))
    box = Box.around({"place": 0.0, "pace": 0.0}, radius={"place": 0.1, "pace": 1.0})
    # One turn per second, seen once per turn: nothing seems to move.
    turning = _AtInstants(dict.fromkeys(range(7), (0.0, 1.0)))
    learned = Discrepancy(
        names=("place", "pace"),
        region=box,
        horizon_s=3.0,
        norm="",
        rigor=Rigor.SAMPLED,
        condition="",
        growth=turning,
    )
    bound = between_instants(
        learned,
        system=system,
        region=Box.from_intervals({"place": (-2.0, 2.0), "pace": (-2.0, 2.0)}),
        step_s=0.5,
        cells=1,
    )
    assert bound.radius((0.0, 1.0), 0.5)[0] == 0.0
    assert bound.radius((0.0, 1.0), 0.75)[0] >= 1.0


def test_it_is_the_learned_bound_at_instants_and_says_what_it_assumes() -> None:
    method = LearnedExponential(pairs=200, seed=1, step_s=_STEP_S, delta=1e-3)
    learned = method.learn(_pendulum(), initial_set=_SET, horizon_s=3.0)
    bound = between_instants(learned, system=_pendulum(), region=_REGION, step_s=_STEP_S, cells=1)
    for k in range(7):
        assert bound.radius(_SET.radius, 0.5 * k) == learned.radius(_SET.radius, 0.5 * k)
    after = bound.radius(_SET.radius, 0.5 + 1e-6)
    assert np.all(np.array(after) >= learned.radius(_SET.radius, 0.5))
    assert bound.rigor is Rigor.SAMPLED
    assert "stay in the region" in str(bound.statements[0])
    assert "nothing is claimed between" not in str(bound.statements[0])
    assert bound.statements[0].epsilon == learned.statements[0].epsilon


def test_other_states_and_steps_are_refused() -> None:
    learned = _learned(_AtInstants({}))
    x = ca.SX.sym("x")
    other = system_from_casadi(x, -x, ("x",))
    region = Box.from_intervals({"x": (0.0, 1.0)})
    with pytest.raises(InputError, match="expected a bound over"):
        between_instants(learned, system=other, region=region, step_s=0.5, cells=1)
    for step_s in (0.0, 4.0, math.nan):
        with pytest.raises(InputError, match="spacing of the instants"):
            between_instants(learned, system=_pendulum(), region=_REGION, step_s=step_s, cells=1)
