"""Claim: public benchmarks are proved, and sampled runs stay inside their tubes."""

from __future__ import annotations

import numpy as np
import pytest
import validated_benchmarks as public
from tube_cases import assert_contains, dense_times, march, starts

from workbench.models import Ode
from workbench.reach import ReachTube, TubeStatus, compute_tube
from workbench.reach.validated.tube import ValidatedTube
from workbench.sensitivity.sampling import sample_initial_states
from workbench.sets import Box


def proved(
    system: Ode, start: Box, horizon_s: float, method: ValidatedTube, *, per_row: int = 5
) -> ReachTube:
    """A complete tube that contains sampled runs."""
    tube = compute_tube(system, initial_set=start, horizon_s=horizon_s, method=method)
    assert tube.complete, tube.message
    states = sample_initial_states(start.reordered(system.names), count=60, seed=5)
    times = dense_times(tube, per_row)
    assert_contains(tube, times, march(system, states, times), allowance=1e-7)
    return tube


def laub_loomis(width: float) -> ReachTube:
    start = public.cube(public.LAUB_LOOMIS, public.LAUB_LOOMIS_CENTER, width)
    return proved(public.LAUB_LOOMIS, start, 20.0, ValidatedTube(0.1))


def test_laub_loomis_stays_below_its_limit() -> None:
    tube = laub_loomis(0.05)
    assert tube.upper[:, 3].max() < 4.5
    assert tube.half_width_at()[-1, 3] < 0.02


@pytest.mark.campaign
@pytest.mark.parametrize(("width", "limit", "end"), [(0.01, 4.5, 0.004), (0.1, 5.0, 0.25)])
def test_laub_loomis_in_its_other_sizes(width: float, limit: float, end: float) -> None:
    tube = laub_loomis(width)
    assert tube.upper[:, 3].max() < limit
    assert 2 * tube.half_width_at()[-1, 3] < end


def test_van_der_pol_stays_below_its_limit() -> None:
    start = public.VAN_DER_POL_START
    tube = proved(public.VAN_DER_POL, start, 7.0, ValidatedTube(0.05, 4))
    assert tube.upper[:, 1].max() < 2.75
    assert tube.half_width_at()[-1, 1] < 0.3


def test_the_orbit_of_lotka_and_volterra_closes() -> None:
    start = public.LOTKA_VOLTERRA_START
    tube = proved(public.LOTKA_VOLTERRA, start, 3.64, ValidatedTube(0.05))
    assert np.prod(2 * tube.half_width_at()[-1]) < 1e-4


def test_coupled_van_der_pol_is_contained_as_far_as_it_is_proved() -> None:
    """As one set with b in [1, 3] the proof does not reach the horizon; it says where it ends."""
    system, start = public.COUPLED_VAN_DER_POL, public.COUPLED_START
    tube = compute_tube(system, initial_set=start, horizon_s=2.0, method=ValidatedTube(0.1, 3))
    assert tube.status in (TubeStatus.COMPLETE, TubeStatus.ENCLOSURE_FAILED)
    assert tube.times[-1] >= 1.5
    times = dense_times(tube, 5)
    states = starts(start.reordered(system.names), 3)
    for b in (1.0, 1.7, 3.0):
        assert_contains(tube, times, march(system, states, times, parameters=np.array([[b]])))


@pytest.mark.campaign
@pytest.mark.parametrize("half_width", [0.1, 0.4])
def test_the_quadrotor_climbs_and_settles(half_width: float) -> None:
    start = public.quadrotor_start(half_width)
    tube = proved(public.QUADROTOR, start, 5.0, ValidatedTube(0.1), per_row=20)
    height_low, height_high = tube.lower[:, 2], tube.upper[:, 2]
    assert height_high.max() < 1.4
    assert height_low[tube.times[:-1] >= 1.0].min() > 0.9
    assert 0.98 <= tube.lower_at[-1, 2] <= tube.upper_at[-1, 2] <= 1.02


@pytest.mark.campaign
def test_robertson_keeps_its_sum() -> None:
    system = public.robertson(1e2, 1e3)
    tube = compute_tube(
        system, initial_set=public.ROBERTSON_START, horizon_s=40.0, method=ValidatedTube(0.1)
    )
    assert tube.complete
    low, high = tube.lower_at.sum(axis=1), tube.upper_at.sum(axis=1)
    assert np.all((low <= 1.0) & (high >= 1.0))
    assert high[-1] - low[-1] < 1e-8
