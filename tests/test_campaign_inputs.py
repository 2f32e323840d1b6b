"""The campaign's loops are varied, and its trajectories keep to their sets and press on them."""

from __future__ import annotations

import itertools
import math

import casadi as ca
import numpy as np
import pytest
from tube_cases import box, disturbed

from workbench.bench.adversary import adversarial_inputs
from workbench.bench.lanes import Accuracy, trajectories
from workbench.bench.pressing import pressing_inputs
from workbench.bench.random_loops import RandomLoop, random_loops
from workbench.bench.taylor import taylor_field
from workbench.controllers import ReferenceZeroBrake, Track, VehicleBrake
from workbench.models import EstimationError, PathBicycle, Ranged

LOOPS = tuple(random_loops(200, seed=1))


def test_the_same_seed_gives_the_same_loops() -> None:
    again = list(itertools.islice(random_loops(200, seed=1), 20))
    assert [loop.system for loop in again] == [loop.system for loop in LOOPS[:20]]
    assert [loop.initial_set for loop in again] == [loop.initial_set for loop in LOOPS[:20]]
    other = next(random_loops(1, seed=2))
    assert other.system != LOOPS[0].system


@pytest.mark.parametrize(
    ("feature", "least"),
    [
        (lambda loop: isinstance(loop.system.mode, Track), 80),
        (lambda loop: isinstance(loop.system.mode, ReferenceZeroBrake), 20),
        (lambda loop: isinstance(loop.system.mode, VehicleBrake), 20),
        (lambda loop: isinstance(loop.system.plant, PathBicycle), 40),
        (lambda loop: loop.system.controller.steering.rate_limit_radps is not None, 80),
        (lambda loop: loop.system.controller.steering.look_ahead_m == 0.0, 20),
        (lambda loop: loop.system.controller.steering.proportional < 0.0, 10),
        (lambda loop: loop.system.controller.speed.proportional < 0.0, 4),
        (lambda loop: loop.system.estimation_error != EstimationError(), 30),
        (lambda loop: loop.system.disturbance.acceleration_mps2 > 0.0, 30),
        (lambda loop: bool(loop.system.parameter_ranges), 40),
        (lambda loop: (loop.horizon_s / 0.05) % 1.0 > 0.01, 80),
        (lambda loop: (loop.horizon_s * 2.0) % 1.0 == 0.0, 20),
        (lambda loop: 1.0 <= loop.horizon_s <= 5.0, 200),
    ],
)
def test_every_feature_is_there(feature, least: int) -> None:
    assert sum(map(feature, LOOPS)) >= least


@pytest.mark.parametrize("index", [1, 10, 14])
def test_trajectories_keep_to_their_sets_and_take_all_corners(index: int) -> None:
    loop = LOOPS[index]
    ode = loop.system.ode
    inputs = pressing_inputs(loop, count=3000, horizon_s=loop.horizon_s, seed=4)
    count = len(inputs.states)
    assert count == 3000
    lower, upper = np.array(loop.initial_set.lower), np.array(loop.initial_set.upper)
    assert ((inputs.states >= lower) & (inputs.states <= upper)).all()
    for values, ranges in (
        (inputs.parameters, ode.parameters),
        (inputs.values.reshape(-1, len(ode.disturbances)), ode.disturbances),
    ):
        for column, ranged in zip(values.T, ranges, strict=True):
            assert column.min() >= ranged.lower
            assert column.max() <= ranged.upper
    wide = np.flatnonzero(upper > lower)
    seen = {tuple(row) for row in (inputs.states[:, wide] == upper[wide]).astype(int)}
    assert seen >= set(itertools.product((0, 1), repeat=len(wide)))
    used = inputs.switches[np.isfinite(inputs.switches)]
    assert (inputs.switches[:, 1:] >= inputs.switches[:, :-1]).all()
    assert ((used >= 0.0) & (used <= loop.horizon_s)).all()


def test_the_adversary_reaches_the_extreme_of_a_pushed_oscillator() -> None:
    """x'' = -x + w, |w| <= 1, from (+-0.1, +-0.2): max x(T) = 0.1 |cos T| + 0.2 |sin T| + the
    integral of |sin|."""
    push = (Ranged.symmetric("push", "", 1.0),)
    ode = disturbed(lambda x, _p, w: [x[1], -x[0] + w], ("x", "v"), disturbances=push)
    horizon_s = 5.0
    start = box(x=(-0.1, 0.1), v=(-0.2, 0.2))
    inputs = adversarial_inputs(ode, start, horizon_s)
    field = taylor_field(ode.function())
    times = np.array([0.0, horizon_s])
    last = trajectories(field, inputs, times, Accuracy(16, 1e-14)).states[1, 0]
    pushed = 2.0 + (1.0 - math.cos(horizon_s - math.pi))
    best = 0.1 * abs(math.cos(horizon_s)) + 0.2 * abs(math.sin(horizon_s)) + pushed
    assert best - 0.01 < last.max() <= best + 1e-12
    assert -best - 1e-12 <= last.min() < -best + 0.01


def test_the_adversary_chooses_parameters_too() -> None:
    rate = (Ranged("rate", "", 1.0, 0.5, 1.5),)
    ode = disturbed(lambda x, p, _w: [-p * x], ("x",), parameters=rate)
    inputs = adversarial_inputs(ode, box(x=(1.0, 2.0)), 1.0)
    pairs = set(zip(inputs.states[:, 0].tolist(), inputs.parameters[:, 0].tolist(), strict=True))
    assert {(2.0, 0.5), (1.0, 1.5)} <= pairs


def test_a_loop_of_any_system_shape_is_accepted() -> None:
    loop = next(loop for loop in LOOPS if "brake_clock" in loop.system.ode.names)
    assert isinstance(loop, RandomLoop)
    assert loop.initial_set.interval("brake_clock") == (0.0, 0.0)
    assert isinstance(loop.system.ode.field, ca.SX)
