"""Margins over speed are where the loop really loses stability, and agree with python-control."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.models.gains.lateral import LateralLoop, Schedule
from workbench.models.gains.over_speed import (
    disk_margins,
    frequencies,
    gain_range,
    over_speed,
)
from workbench.models.gains.responses import responses, simulated, step_response
from workbench.models.gains.routh import Reason, conditions
from workbench.models.gains.three_routes import Checked, growth_rate
from workbench.models.vehicle import gem_e2

VEHICLE = gem_e2()
LOOP = LateralLoop.of(VEHICLE)
SPEEDS = st.floats(0.3, 6.0)


def scaled(loop: LateralLoop, factor: float) -> LateralLoop:
    return loop.at({name: factor * loop.value(name) for name in ("kp", "ki", "kd")})


@settings(max_examples=30, deadline=None)
@given(SPEEDS)
def test_gain_range_ends_where_exact_conditions_fail(speed: float) -> None:
    loop = LOOP.at({"speed": speed})
    low, high = gain_range(loop.open_loop())
    assert 0.0 < low < 1.0
    assert math.isinf(high)
    assert conditions(scaled(loop, low * 1.001)).reason() is Reason.STABLE
    assert conditions(scaled(loop, low * 0.999)).reason() is not Reason.STABLE


@settings(max_examples=20, deadline=None)
@given(SPEEDS)
def test_disk_margins_are_python_controls(speed: float) -> None:
    if not hasattr(control, "disk_margins"):
        pytest.skip("this python-control has no disk_margins")
    loop = LOOP.at({"speed": speed})
    grid = frequencies(loop.poles())
    found = disk_margins(loop.open_loop(), grid)
    size, gain_db, phase = control.disk_margins(loop.open_loop(), grid)
    assert found.size == pytest.approx(float(size), rel=1e-6)
    assert 20 * math.log10(found.gain_high) == pytest.approx(float(gain_db), rel=1e-6)
    assert found.phase_deg == pytest.approx(float(phase), rel=1e-6)


@settings(max_examples=30, deadline=None)
@given(SPEEDS, st.floats(-math.pi, math.pi), st.floats(0.0, 0.999))
def test_no_disturbance_inside_the_disk_destabilises(
    speed: float, angle: float, share: float
) -> None:
    # Every real factor of the disk, and the phases at its edge: Nyquist's curve keeps off -1.
    loop = LOOP.at({"speed": speed})
    grid = frequencies(loop.poles())
    found = disk_margins(loop.open_loop(), grid)
    for factor in (found.gain_low * 1.001, found.gain_high * 0.999):
        assert conditions(scaled(loop, factor)).reason() is Reason.STABLE
    delta = share * found.size * np.exp(1j * angle) / 2.0
    values = np.asarray(loop.open_loop()(1j * grid)) * (1 + delta) / (1 - delta)
    assert np.abs(1.0 + values).min() > 1e-4


def test_the_delay_margin_is_where_the_delayed_loop_crosses() -> None:
    point = over_speed(LOOP, 2.8, 3.0, points=2).of(Schedule.FIXED)[0]
    loop = LOOP.open_loop()
    at = 1j * point.crossover_radps
    assert abs(complex(loop(at)) * np.exp(-at * point.delay_s) + 1.0) < 1e-5
    early = complex(loop(at)) * np.exp(-at * 0.5 * point.delay_s)
    assert abs(early + 1.0) > 0.1


def test_schedules_keep_what_they_promise_over_speed() -> None:
    found = over_speed(LOOP, 0.5, 6.0, points=7)
    here = over_speed(LOOP, 2.8, 3.0, points=2).of(Schedule.FIXED)[0]
    for schedule in (Schedule.DISTANCE, Schedule.TIME):
        for point in found.of(schedule):
            assert point.phase_deg == pytest.approx(here.phase_deg, rel=1e-6)
            assert point.damping == pytest.approx(here.damping, rel=1e-6)
            assert point.disk == pytest.approx(here.disk, rel=1e-3)
    times = [point.delay_s for point in found.of(Schedule.TIME)]
    assert times == pytest.approx([here.delay_s] * 7, rel=1e-6)
    distances = [p.delay_s * p.speed_mps for p in found.of(Schedule.DISTANCE)]
    assert distances == pytest.approx([here.delay_s * 2.8] * 7, rel=1e-6)
    fixed = [point.phase_deg for point in found.of(Schedule.FIXED)]
    assert fixed == sorted(fixed)


def test_unstable_points_have_no_margins_and_branches_do_not_jump() -> None:
    found = over_speed(LOOP, 0.05, 6.0, points=40)
    first = found.of(Schedule.FIXED)[0]
    assert not first.stable
    assert math.isnan(first.phase_deg)
    steps = np.abs(np.diff(found.poles, axis=0)).max(axis=1)
    assert steps.max() < 0.5
    assert len(found.rows()) == 3 * 40


def test_small_steps_of_the_full_loop_are_the_linear_ones() -> None:
    small = step_response(VEHICLE, LOOP, 1e-3, horizon_s=10.0)
    assert np.abs(small.linear_m - small.nonlinear_m).max() < 1e-9
    assert small.saturated == 0.0
    large = step_response(VEHICLE, LOOP, 1.2, horizon_s=10.0)
    assert large.saturated > 0.02
    assert np.abs(large.linear_m - large.nonlinear_m).max() > 1e-2


def test_steps_settle_when_they_say_so() -> None:
    found = responses(VEHICLE, LOOP, [1.0, 2.8], horizon_s=40.0)
    for step in found.steps:
        for offsets, settled in zip(
            (step.linear_m, step.nonlinear_m), step.settling_s, strict=True
        ):
            after = step.times_s > settled + 1e-9
            assert np.abs(offsets[after]).max() <= 0.05 * step.start_m
            assert np.abs(offsets[~after]).max() > 0.05 * step.start_m
    short = step_response(VEHICLE, LOOP, 0.3, horizon_s=3.0)
    assert math.isnan(short.settling_s[0])


def test_nyquist_and_locus_are_those_of_the_polynomial() -> None:
    found = responses(VEHICLE, LOOP, [2.8], horizon_s=1.0)
    curve, locus = found.frequency[0], found.loci[0]
    s = 1j * curve.radps
    expected = (0.6 + 0.05 / s + s) * (2.8**2 + 2 * 2.8 * s) / (1.75 * s**3)
    np.testing.assert_allclose(curve.values, expected, rtol=1e-9)
    for k in (30, 60, 120):
        poles = scaled(LOOP, float(locus.factors[k])).poles()
        for pole in poles:
            assert np.abs(locus.poles[k] - pole).min() < 1e-6


@pytest.mark.parametrize(("kd", "grows"), [(1.0, False), (0.2, True), (-0.2, True)])
def test_the_full_loop_grows_as_its_poles_say(kd: float, grows: bool) -> None:
    loop = LOOP.at({"kd": kd})
    expected = loop.poles()[0].real
    assert (expected > 0.0) is grows
    assert growth_rate(VEHICLE, loop, abs(expected)) == pytest.approx(expected, rel=0.1)


def test_three_routes_that_differ_are_said_to() -> None:
    right = Checked("x", Reason.STABLE, -1.0, -0.9)
    assert right.agree
    for stable, abscissa, run in (
        (Reason.DRIFT, -1.0, -1.0), (Reason.STABLE, 1.0, 1.0), (Reason.STABLE, -1.0, 1.0),
        (Reason.DRIFT, 1.0, -1.0), (Reason.DRIFT, -1.0, 1.0),
    ):  # fmt: skip
        assert not Checked("x", stable, abscissa, run).agree
    assert Checked("x", Reason.DRIFT, 1.0, 1.0).agree


def test_a_run_of_the_vehicle_starts_as_asked() -> None:
    run = simulated(VEHICLE, LOOP.at({"speed": 1.5}), {"offset": 0.2}, horizon_s=0.1)
    assert run.offset_m[0] == 0.2
    assert run.states[run.names.index("speed"), -1] == pytest.approx(1.5)
    assert run.raw_rate_radps[0] == pytest.approx(-0.6 * 0.2)


def test_speeds_that_cannot_be_are_refused() -> None:
    for low, high in ((0.0, 1.0), (2.0, 1.0), (-1.0, 1.0)):
        with pytest.raises(InputError, match="0 < LOW < HIGH"):
            over_speed(LOOP, low, high, points=3)
    with pytest.raises(InputError, match="speed > 0"):
        over_speed(LOOP.at({"speed": -1.0}), 1.0, 2.0, points=3)
