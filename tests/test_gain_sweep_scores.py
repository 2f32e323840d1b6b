"""What a sweep scores by agrees with slower ways, and its tubes hold runs of another integrator."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from gain_sweep_cases import kernels, vehicle
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.models.bicycle import PathFrame
from workbench.models.control_view import margins
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.over_speed import disk_margins, frequencies
from workbench.models.gains.responses import simulated
from workbench.models.gains.routh import Reason
from workbench.models.system import Ode
from workbench.runtime.policies.horizon import Timing
from workbench.sets import Box
from workbench.simulation.gain_sweep.gains import as_parameters, with_gains
from workbench.simulation.gain_sweep.kernels import RUN_STEP_S, STEP_S, Array, Tube
from workbench.simulation.gain_sweep.margins import loop_score, speed_margins
from workbench.simulation.gain_sweep.plan import Case, Start
from workbench.simulation.gain_sweep.scores import (
    corners,
    inputs_of,
    score,
    speed_figures,
    start_of,
    stopping_m,
)

GAINS = {"kp": 0.012, "ki": 0.0, "kd": 0.08, "look-ahead": 7.0}
CASE = Case(2.0, (0.04, 0.06), Start("narrow", 0.2, 0.5))


def _tube(gains: dict[str, float], case: Case) -> Tube:
    changed = with_gains(vehicle(), gains, case.speed_mps)
    parameters = as_parameters(gains) | {"reference_speed": case.speed_mps}
    start = start_of(changed, case)
    return kernels().tube.tube(start, parameters, inputs_of(changed, case))


def _disturbed_runs(ode: Ode, start: Box) -> Array:
    """States (instants x n x runs) at the tube's instants, from corners, with inputs at their
    ends."""
    generator, count = np.random.default_rng(3), 60
    box, field = start.reordered(ode.names), ode.function()
    signs = generator.choice([-1.0, 1.0], size=(count, len(ode.names)))
    x = (np.array(box.center) + signs * np.array(box.radius)).T
    ends = np.array([(d.lower, d.upper) for d in ode.disturbances])
    p, h, found = np.array(ode.parameter_values()), 0.01, [x]
    for k in range(300):
        if k % 150 == 0:
            w = np.where(generator.random((count, len(ends))) < 0.5, ends[:, 0], ends[:, 1]).T
        a = np.array(field(x, p, w))
        b = np.array(field(x + h / 2 * a, p, w))
        c = np.array(field(x + h / 2 * b, p, w))
        x = x + h / 6 * (a + 2 * b + 2 * c + np.array(field(x + h * c, p, w)))
        if (k + 1) % 5 == 0:
            found.append(x)
    return np.array(found)


@settings(max_examples=40, deadline=None)
@given(
    speed=st.floats(0.5, 4.0), ahead=st.floats(0.5, 8.0), kp=st.floats(0.01, 1.0),
    ki=st.sampled_from([0.0, 0.001, 0.02]), kd=st.floats(0.02, 2.0),
)  # fmt: skip
def test_margins_are_those_of_python_control(
    speed: float, ahead: float, kp: float, ki: float, kd: float
) -> None:
    loop = LateralLoop(1.75, speed, ahead, kp, ki, kd)
    found = loop_score(loop)
    if not found.stable:
        assert found.reason is not Reason.STABLE
        assert math.isnan(found.phase_deg)
        return
    known = margins(loop.open_loop())
    disk = disk_margins(loop.open_loop(), frequencies(loop.poles()))
    assert found.phase_deg == pytest.approx(known.phase_margin_deg, rel=1e-5)
    assert found.delay_margin_s == pytest.approx(known.delay_margin_s, rel=1e-5)
    assert found.disk == pytest.approx(disk.size, rel=1e-9)
    assert found.decay_per_s == pytest.approx(-loop.poles()[0].real)


@given(kp=st.floats(0.05, 5.0), ki=st.sampled_from([0.0, 0.01, 0.3, 4.0]))
def test_speed_margins_are_those_of_python_control(kp: float, ki: float) -> None:
    known = margins(control.tf([kp, ki], [1, 0, 0]) if ki else control.tf([kp], [1, 0]))
    found = speed_margins(kp, ki)
    assert found.stable
    assert found.phase_deg == pytest.approx(known.phase_margin_deg, rel=1e-6)
    assert found.delay_margin_s == pytest.approx(known.delay_margin_s, rel=1e-6)


@pytest.mark.parametrize(("kp", "ki"), [(0.0, 0.1), (-0.1, 0.0), (0.5, -0.01)])
def test_a_speed_loop_that_is_not_stable_makes_the_point_so(kp: float, ki: float) -> None:
    assert not speed_margins(kp, ki).stable
    assert max(z.real for z in np.roots([1.0, kp, ki])) >= 0.0
    found = score(kernels(), GAINS | {"speed-kp": kp, "speed-ki": ki}, CASE)
    assert found["stable"] is False
    assert found["reason"] == "speed loop"
    assert math.isnan(float(found["speed_phase_deg"]))


def test_speed_gains_are_inputs_of_tube_and_runs() -> None:
    soft, firm = (
        score(kernels(), GAINS | {"speed-kp": kp, "speed-ki": 0.0}, CASE) for kp in (0.3, 1.2)
    )
    assert float(firm["along_3s_m"]) < float(soft["along_3s_m"])
    # Speeds begin 0.1 m/s off (half the file's radius) and fall like exp(- kp t).
    for found, kp in ((soft, 0.3), (firm, 1.2)):
        assert float(found["speed_settling_s"]) == pytest.approx(math.log(2.0) / kp, abs=0.051)
        assert found["speed_overshoot_mps"] == 0.0


def test_overshoot_is_seen_from_where_a_run_begins() -> None:
    speeds = np.array([[2.5, 2.0, 1.7, 1.99], [1.5, 1.9, 2.02, 2.0]])
    found = speed_figures(speeds, 2.0)
    assert found["speed_overshoot_mps"] == pytest.approx(0.3)
    assert found["speed_settling_s"] == pytest.approx(2 * RUN_STEP_S)


def test_without_look_ahead_there_are_no_margins() -> None:
    found = loop_score(LateralLoop(1.75, 2.0, 0.0, 0.1, 0.0, 1.0))
    assert found.reason is Reason.NO_DAMPING
    assert math.isnan(found.delay_margin_s)


@pytest.mark.parametrize("gains", [GAINS, GAINS | {"kd": 0.05, "look-ahead": 9.0, "kp": 0.006}])
def test_the_tube_holds_disturbed_runs(gains: dict[str, float]) -> None:
    changed = with_gains(vehicle(), gains, CASE.speed_mps)
    tube, start = _tube(gains, CASE), start_of(changed, CASE)
    assert tube.whole
    ode = changed.uncertain_loop(changed.track(), PathFrame(*CASE.curvature_per_m)).ode
    found = _disturbed_runs(ode, start)
    assert np.all(found >= tube.lower_at[:, :, None] - 1e-6)
    assert np.all(found <= tube.upper_at[:, :, None] + 1e-6)
    offset = ode.names.index("offset")
    width = (tube.upper_at[-1] - tube.lower_at[-1])[offset]
    assert np.ptp(found[-1, offset]) > 0.3 * width  # the tube is not merely large


def test_gains_are_inputs_of_the_tube() -> None:
    narrow, other = _tube(GAINS, CASE), _tube(GAINS | {"kd": 0.2}, CASE)
    assert np.array_equal(_tube(GAINS, CASE).upper_at, narrow.upper_at)
    assert abs(other.upper_at[20] - narrow.upper_at[20]).max() > 1e-3


def test_runs_are_those_of_the_gain_study() -> None:
    loop = LateralLoop(1.75, 2.0, 7.0, 0.012, 0.0, 0.08)
    known = simulated(vehicle(), loop, {"offset": 0.4}, horizon_s=5.0)
    x0 = np.zeros((1, 7))
    names = kernels().runs.ode.names
    x0[0, names.index("offset")], x0[0, names.index("speed")] = 0.4, 2.0
    parameters = as_parameters(GAINS) | {"reference_speed": 2.0}
    found = kernels().runs.runs(x0, parameters, 0.0)[0, :, names.index("offset")]
    every = round(RUN_STEP_S / 0.01)
    np.testing.assert_allclose(found[:101], known.offset_m[: 100 * every + 1 : every], atol=1e-6)


def test_corners_differ_in_offset_heading_and_speed() -> None:
    start = start_of(with_gains(vehicle(), GAINS, 2.0), CASE)
    names = kernels().runs.ode.names
    found = corners(start, names)
    assert found.shape == (8, 7)
    assert len({tuple(row) for row in found.tolist()}) == 8
    steering = math.atan(1.75 * 0.05)
    np.testing.assert_allclose(found[:, names.index("steering")], steering)


def test_the_stopping_distance_bounds_the_plain_formula() -> None:
    tube = _tube(GAINS, CASE)
    names = kernels().tube.ode.names
    car = with_gains(vehicle(), GAINS, 2.0)
    found = stopping_m(car, tube, names, Timing(period_s=0.12, latency_s=0.1, send_gap_s=0.055))
    fastest = 2.0 + 0.5 * 0.2  # of the initial set
    brake = car.brake
    least = fastest * (0.275 + brake.delay_s + brake.build_up_s)
    least += fastest**2 / (2.0 * brake.deceleration_min_mps2)
    assert least < found < least + 1.0
    late = Timing(period_s=2.0, latency_s=1.5, send_gap_s=0.05)
    assert math.isnan(stopping_m(car, tube, names, late))


def test_a_score_says_what_is_not_reached() -> None:
    wild = score(kernels(), GAINS | {"kd": 1.9, "kp": 0.9}, CASE)
    assert wild["tube_whole"] is False
    assert math.isnan(float(wild["lateral_3s_m"]))
    assert float(wild["proved_until_s"]) < 3.0
    tame = score(kernels(), GAINS, CASE)
    tube = _tube(GAINS, CASE)
    offset = kernels().tube.ode.names.index("offset")
    k = round(2.0 / STEP_S)
    half = (tube.upper_at[k, offset] - tube.lower_at[k, offset]) / 2.0
    assert tame["lateral_2s_m"] == pytest.approx(half)
    assert tame["saturated"] == 0.0
    assert tame["area_3s_m2"] == pytest.approx(
        4.0 * float(tame["along_3s_m"]) * float(tame["lateral_3s_m"])
    )
    assert float(tame["growth"]) > 1.0
