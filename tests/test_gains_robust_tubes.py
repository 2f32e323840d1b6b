"""Runs of late-steering cars, simulated by other means, stay inside the tube of their ranges."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from workbench.claims import Rigor
from workbench.models.gains.ranged_loop import Car, Ranges
from workbench.models.gains.ranged_plant import ranged_plant
from workbench.models.vehicle import Vehicle, gem_e2
from workbench.reach.robustness.runs import delayed_runs
from workbench.reach.robustness.tubes import RangedTube, _half_width, _of_wheels, ranged_tube

Array = NDArray[np.float64]
VEHICLE = gem_e2()
RANGES = Ranges((1.7, 1.8), (0.97, 1.03), (0.0, 0.03))
NAMES = ranged_plant(VEHICLE, RANGES).names
HORIZON_S, STEP_S, FINE_S = 1.0, 0.1, 0.001


def starts() -> Array:
    box = VEHICLE.initial_set.reordered(NAMES)
    ends = [sorted({low, high}) for low, high in zip(box.lower, box.upper, strict=True)]
    return np.array(list(itertools.product(*ends)))


def simulated(vehicle: Vehicle, car: Car, x0: Array) -> tuple[Array, Array]:
    """Times (m,) and states (m x runs x 7), by Heun's method on the equations written down here."""
    pid, speed_pid, limits = vehicle.steering_pid, vehicle.speed_pid, vehicle.limits
    base, ahead = vehicle.geometry.wheelbase_m, pid.look_ahead_m
    kp, ki, kd = (
        pid.proportional_radps_per_m, pid.integral_radps_per_ms, pid.derivative_rad_per_m,
    )  # fmt: skip
    aim = vehicle.operation.reference_speed_mps
    sent: list[Array] = []

    def rates(x: Array, late: Array) -> tuple[Array, Array]:
        _, e, wheel, v, psi, s_int, e_int = x.T
        tangent = np.tan(np.clip(wheel, -limits.steering_rad, limits.steering_rad))
        ahead_e = e + ahead * np.sin(psi)
        ahead_rate = v * np.sin(psi) + ahead * np.cos(psi) * v * tangent / base
        raw = -(kp * ahead_e + ki * e_int + kd * ahead_rate)
        u = np.clip(raw, -limits.steering_rate_radps, limits.steering_rate_radps)
        a_raw = speed_pid.proportional_per_s * (aim - v) + speed_pid.integral_per_s2 * s_int
        a = np.clip(a_raw, limits.accel_min_mps2, limits.accel_max_mps2)
        true = car.speed_scale * v
        rows = [
            true * np.cos(psi), true * np.sin(psi), late, a,
            true * tangent / car.wheelbase_m, aim - v - (a_raw - a), ahead_e + raw - u,
        ]  # fmt: skip
        return np.stack(rows, axis=1), u

    back = round(car.delay_s / FINE_S)
    states = [x0]
    nothing = np.zeros(len(x0))
    for k in range(round(HORIZON_S / FINE_S)):
        x = states[-1]
        sent.append(rates(x, nothing)[1])
        late = sent[k - back] if k >= back else nothing
        first = rates(x, late)[0]
        guess = x + FINE_S * first
        if back == 0:
            following = rates(guess, nothing)[1]
        else:
            following = sent[k + 1 - back] if k + 1 >= back else nothing
        states.append(x + FINE_S / 2.0 * (first + rates(guess, following)[0]))
    return FINE_S * np.arange(len(states)), np.array(states)


@pytest.fixture(scope="module")
def tube() -> RangedTube:
    return ranged_tube(VEHICLE, RANGES, (0.5, HORIZON_S), step_s=STEP_S, seed=1)


def leaves(tube: RangedTube, times: Array, states: Array) -> set[str]:
    """States whose runs are outside a row of the tube; the slack is the simulation's error."""
    found = set()
    row = np.clip((times / STEP_S + 1e-9).astype(int), 0, len(tube.tube.lower) - 1)
    for i, name in enumerate(tube.tube.names):
        low, high = tube.tube.lower[row, i], tube.tube.upper[row, i]
        values = states[:, :, i]
        if (values < low[:, None] - 1e-5).any() or (values > high[:, None] + 1e-5).any():
            found.add(name)
    return found


def test_the_tube_is_proved_to_the_end(tube: RangedTube) -> None:
    assert tube.tube.complete
    assert tube.tube.rigor is Rigor.ENCLOSED
    assert np.all(tube.found <= tube.proved + 1e-9)
    offset = tube.tube.names.index("offset")
    assert tube.proved[-1, offset] < 1.3 * tube.found[-1, offset]


@pytest.mark.parametrize("car", [*RANGES.corners(), Car(1.77, 0.99, 0.013)])
def test_runs_of_the_ranges_stay_inside(tube: RangedTube, car: Car) -> None:
    times, states = simulated(VEHICLE, car, starts())
    assert leaves(tube, times, states) == set()


def test_cars_beyond_the_ranges_leave(tube: RangedTube) -> None:
    fast = simulated(VEHICLE, Car(1.75, 1.2, 0.0), starts())
    assert "station" in leaves(tube, *fast)
    slow = simulated(VEHICLE, Car(1.75, 0.8, 0.0), starts())
    assert "station" in leaves(tube, *slow)
    late = simulated(VEHICLE, Car(1.75, 1.0, 0.6), starts())
    assert leaves(tube, *late)


@pytest.mark.parametrize("car", [Car(1.7, 1.03, 0.0), Car(1.8, 0.97, 0.03), Car(1.72, 1.0, 0.05)])
def test_both_simulations_agree(car: Car) -> None:
    x0 = starts()[:4]
    times, states = simulated(VEHICLE, car, x0)
    shown = [0, 213, 500, 1000]
    found = delayed_runs(VEHICLE, [car], x0, times[shown])[0]
    assert np.allclose(np.swapaxes(found, 0, 1), states[shown], atol=2e-4)


def test_the_nominal_car_has_the_vehicle_s_own_loop() -> None:
    from workbench.models.bicycle import PathFrame
    from workbench.sensitivity.sampling import rollout

    one = ranged_plant(VEHICLE, Ranges((1.75, 1.75), (1.0, 1.0), (0.0, 0.0)))
    own = VEHICLE.closed_loop(VEHICLE.track(), PathFrame(0.0, 0.0))
    x0 = starts()[::5]
    runs = [rollout(each, x0, horizon_s=1.0, step_s=0.02) for each in (one, own)]
    assert np.allclose(*runs, atol=1e-12)


def test_a_longer_delay_makes_a_wider_disturbance() -> None:
    def bound(delay: float) -> float:
        ode = ranged_plant(VEHICLE, Ranges((1.75, 1.75), (1.0, 1.0), (0.0, delay)))
        found = [w.upper for w in ode.disturbances if w.name == "steering_in_flight"]
        return found[0] if found else 0.0

    assert bound(0.0) == 0.0
    assert bound(0.1) == pytest.approx(0.1 * VEHICLE.limits.steering_rate_radps)


def test_beyond_the_proof_only_runs_speak(tube: RangedTube) -> None:
    whole = tube.tube
    short = dataclasses.replace(
        whole, times=whole.times[:5], lower=whole.lower[:4], upper=whole.upper[:4],
        lower_at=whole.lower_at[:5], upper_at=whole.upper_at[:5],
    )  # fmt: skip
    assert np.all(np.isnan(_half_width(short, HORIZON_S)))
    assert np.allclose(_half_width(short, 0.4), whole.half_width_at()[4])
    between = _half_width(short, 0.25)
    assert np.all(between >= 0.5 * (whole.upper[2] - whole.lower[2]) - 1e-12)
    ended = dataclasses.replace(tube, tube=short, proved=np.full_like(tube.proved, np.nan))
    assert all(
        row["proved_half_width"] is None and row["found_by_search_half_width"] is not None
        for row in ended.rows()
    )


def test_wheels_may_be_off_what_was_commanded_by_the_bound(tube: RangedTube) -> None:
    column = tube.tube.names.index("steering")
    wider = _of_wheels(tube.tube, 0.01)
    change = wider.half_width_at()[:, column] - tube.tube.half_width_at()[:, column]
    assert change[0] == 0.0
    assert np.allclose(change[1:], 0.01)
    assert np.allclose(wider.upper[:, column] - tube.tube.upper[:, column], 0.01)
    others = [k for k in range(len(NAMES)) if k != column]
    assert np.array_equal(wider.lower[:, others], tube.tube.lower[:, others])


def test_rows_tell_proved_and_found_apart(tube: RangedTube) -> None:
    rows = tube.rows()
    assert len(rows) == 2 * len(NAMES)
    assert all({"proved_half_width", "found_by_search_half_width"} <= set(row) for row in rows)
