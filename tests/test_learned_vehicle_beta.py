"""The beta for a vehicle's path is learned from runs of its own loop, wherever in the region they
start, and holds for further pairs as often as it says."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.system import Ode
from workbench.models.vehicle import gem_e2
from workbench.reach.learned.shared_middles import about_shared_middles
from workbench.reach.learned.vehicle_beta import learn_vehicle_beta
from workbench.sensitivity import Discrepancy, LearnedExponential
from workbench.sensitivity.sampling import rollout
from workbench.sets import Box

VEHICLE = gem_e2()
REGION = VEHICLE.operation.region
MOST = VEHICLE.operation.curvature_per_m
PAIRS, STEP_S, HORIZON_S = 1000, 0.05, 2.0


def loop() -> Ode:
    return VEHICLE.closed_loop(VEHICLE.track(), PathFrame(-MOST, MOST)).ode


def inner(name: str) -> tuple[float, float]:
    low, high = REGION.interval(name)
    middle, half = 0.5 * (low + high), 0.25 * (high - low)
    return (min(0.0, middle - half) if name == "speed" else middle - half), middle + half


@functools.cache
def learned() -> Discrepancy:
    method = LearnedExponential(pairs=PAIRS, seed=1, step_s=STEP_S, delta=1e-6)
    return learn_vehicle_beta(VEHICLE, horizon_s=HORIZON_S, method=method)


def test_runs_about_a_middle_are_the_loops_own() -> None:
    """x = c + z, on a road of curvature k, at another reference speed."""
    ode = loop()
    middles = Box.from_intervals(dict.fromkeys(ode.names, (-1.0, 1.0)))
    shifted = about_shared_middles(
        ode, middles, ranges={"curvature": (-MOST, MOST), "reference_speed": (0.0, 4.0)}
    )
    rng = np.random.default_rng(2)
    center, apart = rng.uniform(-0.3, 0.3, (2, 8, len(ode.names)))
    bend, speed = rng.uniform(-MOST, MOST, 8), rng.uniform(0.0, 4.0, 8)
    own = np.tile(ode.parameter_values(), (8, 1))
    own[:, [p.name for p in ode.parameters].index("reference_speed")] = speed
    given = np.hstack([own, bend[:, None], center])
    assert [p.name for p in shifted.parameters][-8:-7] == ["curvature"]
    times = {"horizon_s": HORIZON_S, "step_s": STEP_S}
    found = rollout(shifted, apart, parameters=given, **times)  # type: ignore[arg-type]
    expected = rollout(
        ode,
        center + apart,
        parameters=own,
        disturbances=bend[:, None],
        **times,  # type: ignore[arg-type]
    )
    assert np.allclose(found + center[:, None], expected, atol=1e-9)
    assert not np.allclose(found - center[:, None], expected, atol=1e-3)


def test_further_pairs_leave_it_no_more_often_than_stated() -> None:
    """Drawn here without the shifted loop: middle in the region, both ends in one box about it."""
    bound, ode, count = learned(), loop(), 600
    rng = np.random.default_rng(77)
    radius = np.array([VEHICLE.initial_set.reordered(ode.names).radius]).ravel()
    sides = [(0.0, 0.0) if name == "station" else inner(name) for name in ode.names]
    middle = np.array([rng.uniform(low, high, count) for low, high in sides]).T
    ends = [middle + radius * rng.uniform(-1.0, 1.0, middle.shape) for _ in range(2)]
    own = np.tile(ode.parameter_values(), (count, 1))
    column = [p.name for p in ode.parameters].index("reference_speed")
    own[:, column] = rng.uniform(0.0, REGION.interval("speed")[1], count)
    bend = rng.uniform(-MOST, MOST, (count, 1))
    first, second = (
        rollout(ode, x, horizon_s=HORIZON_S, step_s=STEP_S, parameters=own, disturbances=bend)
        for x in ends
    )
    times = np.linspace(0.0, HORIZON_S, first.shape[1])
    apart = np.abs(first - second)
    half = np.array([[bound.radius(pair[0].tolist(), t) for t in times] for pair in apart])
    left = (apart > half * (1.0 + 1e-9) + 1e-12).any(axis=(1, 2)).mean()
    (statement,) = bound.statements
    assert 0.0 < statement.epsilon < 0.1
    assert left <= statement.epsilon
    assert (apart > 0.7 * half + 1e-9).any(axis=(1, 2)).mean() > statement.epsilon


def test_it_says_where_it_was_learned() -> None:
    bound = learned()
    assert bound.rigor is Rigor.SAMPLED
    assert bound.region is not None
    assert "station" not in bound.region.names
    radius = dict(zip(VEHICLE.initial_set.names, VEHICLE.initial_set.radius, strict=True))
    for name in REGION.names:
        low, high = inner(name)
        side = (low - radius[name], high + radius[name])
        assert bound.region.interval(name) == pytest.approx(side)
    assert "shared middle" in bound.condition
    assert "vertices" in bound.condition


def test_other_names_are_refused() -> None:
    ode = loop()
    middles = Box.from_intervals(dict.fromkeys(ode.names, (0.0, 0.0)))
    with pytest.raises(InputError, match="wind"):
        about_shared_middles(ode, middles, ranges={"wind": (0.0, 1.0)})
    short = Box.from_intervals({"station": (0.0, 0.0)})
    with pytest.raises(InputError, match="expected middles"):
        about_shared_middles(ode, short, ranges={})
