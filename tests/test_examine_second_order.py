"""Second-order steps climb to the maximum of a pair's distance, wherever in the box it lies."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.models.system import Ode, system_from_casadi
from workbench.sensitivity.ascent import Goals, Pairs, ascend
from workbench.sensitivity.sampling import Flow
from workbench.sensitivity.second_order import second_order_steps
from workbench.sensitivity.vectorised import Array, Index
from workbench.sets import Box

_BOX = Box.around({"a": 1.0, "b": -1.0, "c": 0.0}, radius={"a": 0.5, "b": 2.0, "c": 0.0})
_UP = Goals(np.array([2]), np.array([4]), np.array([1.0]))


def _lifted(height: ca.SX, x: ca.SX) -> Ode:
    """a and b stay, c grows at the rate `height`: after 1 s it has grown by the height."""
    return system_from_casadi(x, ca.vertcat(0.0, 0.0, height), ("a", "b", "c"))


def _start(a: float, b: float) -> Pairs:
    centre = np.array([_BOX.center])
    return Pairs(centre, np.array([[a, b, 0.0]]), np.empty((1, 0)))


def _grown(pair: Pairs, flow: Flow) -> float:
    return float(_UP.values(pair.differences(flow))[0])


def test_a_curved_ridge_that_stops_gradient_steps_is_climbed() -> None:
    x = ca.SX.sym("x", 3)
    # Rosenbrock's valley upside down, in shares of the box; its summit is at (1.215, -0.2604).
    p, q = (x[0] - 1.0) / 0.5, (x[1] + 1.0) / 2.0
    system = _lifted(-((0.43 - p) ** 2) - 40.0 * (q - 2.0 * p**2) ** 2, x)
    flow = Flow(system, 1.0, 0.25)
    options = {"goals": _UP, "start": _start(0.75, 0.0), "rounds": 20, "move_first": False}
    by_gradient = ascend(flow, _BOX, **options)  # type: ignore[arg-type]
    by_curvature = second_order_steps(flow, _BOX, **options)  # type: ignore[arg-type]
    summit = _grown(_start(1.215, -0.2604), flow)
    assert _grown(by_curvature, flow) == pytest.approx(summit, abs=1e-6)
    assert _grown(by_gradient, flow) < 0.99 * summit
    np.testing.assert_allclose(by_curvature.second[0, :2], [1.215, -0.2604], atol=1e-3)


@dataclass(frozen=True)
class _Quadratic:
    """After one step c is g . z + z . H z / 2 in shares z of the box."""

    gradient: Array
    curvature: Array

    def _shares(self, states: Array) -> Array:
        return (states[:, :2] - np.array(_BOX.center)[:2]) / np.array(_BOX.radius)[:2]

    def runs(self, initial_states: Array, parameters: Array) -> Array:
        z = self._shares(initial_states)
        value = z @ self.gradient + 0.5 * np.einsum("ni,ij,nj->n", z, self.curvature, z)
        later = initial_states.copy()
        later[:, 2] = value
        return np.stack([initial_states, later], axis=1)

    def slopes(
        self, initial_states: Array, parameters: Array, coordinate: Index, instant: Index
    ) -> Array:
        z = self._shares(initial_states)
        found = np.zeros_like(initial_states)
        found[:, :2] = (self.gradient + z @ self.curvature) / np.array(_BOX.radius)[:2]
        return found


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5),
    st.booleans(),
    st.integers(0, 10_000),
)
def test_one_step_solves_what_brute_force_solves(
    numbers: list[float], paired: bool, seed: int
) -> None:
    g1, g2, h11, h12, h22 = numbers
    # Concave, so that there is one summit.
    rough = np.array([[h11, h12], [h12, h22]])
    flow = _Quadratic(np.array([g1, g2]), -(rough @ rough.T) - 0.05 * np.eye(2))
    goals = Goals(np.array([2]), np.array([1]), np.array([1.0]))
    rng = np.random.default_rng(seed)
    centre, half = np.array([_BOX.center]), np.array(_BOX.radius)
    start = Pairs(centre, centre + half * rng.uniform(-1, 1, (1, 3)), np.empty((1, 0)))
    found = second_order_steps(flow, _BOX, goals=goals, start=start, rounds=4, move_first=paired)
    reached = goals.values(found.differences(flow))[0]
    assert reached >= goals.values(start.differences(flow))[0]
    if not paired:  # two ends that part may stay at a local optimum
        ends = np.linspace(-1.0, 1.0, 41)
        grid = np.stack(np.meshgrid(ends, ends), axis=-1).reshape(-1, 2)
        value = grid @ flow.gradient + 0.5 * np.einsum("ni,ij,nj->n", grid, flow.curvature, grid)
        assert reached >= value.max() - 1e-9
    assert _BOX.contains(tuple(found.second[0].tolist()))
    assert np.all(np.abs(found.second - found.first) <= half * (1.0 + 1e-12))


def test_the_two_ends_part_along_a_constraint_that_joins_them() -> None:
    # The height falls with b^3: runs part most at one end of the box, half widths from each other.
    x = ca.SX.sym("x", 3)
    flow = Flow(_lifted(((x[1] + 1.0) / 2.0) ** 3, x), 1.0, 0.25)
    start = Pairs(np.array([[1.0, -1.0, 0.0]]), np.array([[1.0, 0.2, 0.0]]), np.empty((1, 0)))
    found = second_order_steps(flow, _BOX, goals=_UP, start=start, rounds=8, move_first=True)
    # From share 0 to 1 or from -1 to 0: both are 1 apart in height.
    assert _grown(found, flow) == pytest.approx(1.0, abs=1e-6)


def test_a_set_without_width_is_left_as_it_is() -> None:
    x = ca.SX.sym("x", 3)
    flow = Flow(_lifted(x[0], x), 1.0, 0.25)
    point = Box.around({"a": 1.0, "b": -1.0, "c": 0.0}, radius={})
    start = Pairs(np.array([[1.0, -1.0, 0.0]]), np.array([[1.0, -1.0, 0.0]]), np.empty((1, 0)))
    found = second_order_steps(flow, point, goals=_UP, start=start, rounds=2, move_first=True)
    np.testing.assert_array_equal(found.second, start.second)
