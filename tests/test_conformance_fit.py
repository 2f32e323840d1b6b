"""Claim: the fit finds planted disturbances within a stated factor, and larger ones escape."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from conformance_runs import planted_run, soft_vehicle

from workbench.errors import InputError
from workbench.models.vehicle_sections import Uncertainty
from workbench.simulation.conformance.enclosing import enclose
from workbench.simulation.conformance.first_order import first_order
from workbench.simulation.conformance.fit import Fit, fit, linear_fit, rounded_up
from workbench.simulation.conformance.traces import traces
from workbench.simulation.conformance.track_loop import RunErrors, RunWindows, TrackLoop
from workbench.simulation.conformance.windows import Measured, instants

W = ("acceleration_mps2", "steering_rate_radps", "wheelbase_m")
PLANTED = Uncertainty(acceleration_mps2=0.15, steering_rate_radps=0.02)
LARGER = Uncertainty(acceleration_mps2=0.3, steering_rate_radps=0.02)


def model() -> TrackLoop:
    return TrackLoop(soft_vehicle(), W)


def measured(planted: Uncertainty, *, seeds: tuple[int, ...]) -> Measured:
    runs = tuple(planted_run(f"run {seed}", planted, seed=seed) for seed in seeds)
    return RunWindows(instants(2.0, 0.2), RunErrors()).of(runs, model())


@functools.cache
def fitted() -> Fit:
    return fit(model(), measured(PLANTED, seeds=(0, 1, 2)), outliers=0, most={})


def test_planted_bounds_are_found_within_a_factor_of_two_and_never_much_above() -> None:
    found = fitted().uncertainty
    assert 0.5 * 0.15 <= found.acceleration_mps2 <= 1.05 * 0.15
    assert 0.5 * 0.02 <= found.steering_rate_radps <= 1.1 * 0.02
    assert found.lateral_m == found.heading_rad == found.speed_mps == 0.0


def test_real_tubes_contain_every_training_window() -> None:
    assert fitted().contained
    assert fitted().enclosed.whole.all()


def test_without_the_bounds_the_training_windows_are_not_contained() -> None:
    bare = enclose(model(), Uncertainty(), measured(PLANTED, seeds=(0, 1, 2)))
    assert not bare.whole.all()


def test_a_larger_disturbance_in_another_run_escapes() -> None:
    other = enclose(model(), fitted().uncertainty, measured(LARGER, seeds=(7,)))
    assert not other.whole.all()
    late = np.flatnonzero(~other.inside.all(axis=0))
    assert late.min() > 0  # the first instant is inside by construction


def test_pointwise_bounds_find_what_was_planted() -> None:
    points = traces(measured(PLANTED, seeds=(0, 1, 2)))
    assert points.acceleration_mps2 == pytest.approx(0.15, rel=0.02)
    # Where the bend begins within a step, its curvature is known to the step's ends only.
    assert points.steering_rate_radps is not None
    assert 0.98 * 0.02 <= points.steering_rate_radps <= 1.3 * 0.02
    assert points.sideways_mps is not None
    assert points.sideways_mps < 0.01


def test_half_widths_to_first_order_are_those_of_a_small_real_tube() -> None:
    windows = measured(PLANTED, seeds=(0,))
    linear = first_order(model(), windows)
    small = Uncertainty(acceleration_mps2=0.02, steering_rate_radps=0.002, wheelbase_m=0.01)
    real = enclose(model(), small, windows).half_width
    ratio = real / linear.half_widths(np.array([0.02, 0.002, 0.01]))
    assert ratio.min() > 0.95
    assert np.median(ratio) < 1.2


def test_an_outlier_budget_leaves_out_the_window_that_costs_most() -> None:
    mixed = Measured(
        instants(2.0, 0.2),
        (*measured(PLANTED, seeds=(0, 1)).windows, measured(LARGER, seeds=(7,)).windows[0]),
    )
    free = linear_fit(model(), mixed, outliers=0, most={})
    spared = linear_fit(model(), mixed, outliers=1, most={})
    assert len(spared.left_out) == 1
    assert set(spared.left_out) <= set(spared.deciding)
    assert spared.bounds[0] < free.bounds[0]
    assert mixed.windows[spared.left_out[0]].recording == "run 7"


def test_windows_lie_in_track_throughout() -> None:
    run = planted_run("run 0", PLANTED, seed=0)
    times = run.column("t")
    braked = dataclasses.replace(run, tracking=(times < 3.0) | (times > 5.0))
    cut = RunWindows(instants(2.0, 0.2), RunErrors()).of((braked,), model())
    starts = [window.start_s for window in cut.windows]
    assert starts[0] == 0.0
    assert all(start + 2.0 < 3.0 or start > 5.0 for start in starts)
    assert len(starts) == 4


def test_windows_lie_in_no_gap_of_the_run() -> None:
    run = planted_run("run 0", PLANTED, seed=0)
    times = run.column("t")
    kept = (times <= 3.0) | (times >= 3.5)
    holed = dataclasses.replace(run, table=run.table[kept], tracking=run.tracking[kept])
    cut = RunWindows(instants(2.0, 0.2), RunErrors()).of((holed,), model())
    starts = [window.start_s for window in cut.windows]
    assert len(starts) == 5
    assert all(start + 2.0 <= 3.0 or start >= 3.5 for start in starts)


def test_times_that_do_not_increase_are_told_as_numbers() -> None:
    run = planted_run("run 0", PLANTED, seed=0, duration_s=1.0)
    with pytest.raises(InputError, match=r"got 0\.0 after 0\.05"):
        dataclasses.replace(run, table=run.table[[1, 0]], tracking=run.tracking[:2])


def test_pointwise_figures_do_not_depend_on_what_is_fitted() -> None:
    every = TrackLoop(model().vehicle, ("lateral_m", "heading_rad", "speed_mps", *W))
    run = planted_run("run 0", PLANTED, seed=0)
    cuts = [RunWindows(instants(2.0, 0.2), RunErrors()).of((run,), m) for m in (model(), every)]
    one, other = (np.concatenate([w.gaps for w in cut.windows]) for cut in cuts)
    assert np.abs(one - other).max() < 2e-3
    assert 0.01 < np.abs(one[:, 0]).max() < 1.0


def test_a_run_beyond_its_paths_end_is_refused() -> None:
    run = planted_run("run 0", PLANTED, seed=0)
    short = dataclasses.replace(run, waypoints=run.waypoints[:20])
    with pytest.raises(InputError, match="add waypoints"):
        RunWindows(instants(2.0, 0.2), RunErrors()).of((short,), model())


def test_limits_that_no_motion_keeps_to_are_named() -> None:
    with pytest.raises(InputError, match=r"acceleration_mps2 <= 0.01"):
        linear_fit(
            model(), measured(PLANTED, seeds=(0,)), outliers=0,
            most={"acceleration_mps2": 0.01, "steering_rate_radps": 0.001, "wheelbase_m": 0.01},
        )  # fmt: skip


@pytest.mark.parametrize("outliers", [-1, 1000])
def test_impossible_outlier_budgets_are_refused(outliers: int) -> None:
    with pytest.raises(InputError, match="--outliers"):
        linear_fit(model(), measured(PLANTED, seeds=(0,)), outliers=outliers, most={})


def test_figures_are_rounded_up() -> None:
    assert rounded_up(0.10001) == 0.101
    assert rounded_up(0.0) == 0.0
    for value in (0.123456, 12.3456, 1.0, 0.00999):
        assert value <= rounded_up(value) <= 1.011 * value
