"""A plant as a black box drives the loop's law: near the model, alike for one seed, on any road."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from hypothesis import given
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.vehicle import Vehicle, gem_e2, load_vehicle
from workbench.sensitivity.sampling import rollout
from workbench.simulation.plant_simulator import PlantSimulator, Road
from workbench.simulation.simulated import simulated_path

TIMES = np.linspace(0.0, 1.5, 16)
START = np.array([[0.0, 0.1, 0.0, 2.0, 0.0, 0.0, 0.0], [0.1, -0.1, 0.02, 2.1, 0.03, 0.0, 0.1]])


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load_vehicle(simulated_path())


@given(
    st.sampled_from([0.0, 0.1, -0.1, 0.02]), st.floats(-20.0, 60.0), st.floats(-4.0, 4.0),
    st.floats(-3.0, 3.0),
)  # fmt: skip
def test_places_on_a_road_are_found_again(
    bent: float, station: float, offset: float, off: float
) -> None:
    road = Road(bent)
    x_m, y_m, tangent = road.place(station, offset)
    assert road.found(x_m, y_m, near_m=station + off) == pytest.approx((station, offset), abs=1e-9)
    assert tangent == bent * station
    ahead = np.array(road.place(station + 1e-4, offset)[:2]) - [x_m, y_m]
    direction = [np.cos(tangent), np.sin(tangent)]
    assert np.allclose(ahead / np.linalg.norm(ahead), direction, atol=1e-4)


@pytest.mark.parametrize("bent", [0.0, 0.05, -0.05])
@pytest.mark.parametrize("plant", ["bicycle", "single-track"])
def test_runs_are_near_those_of_the_model(plant: str, bent: float, vehicle: Vehicle) -> None:
    try:
        simulator = PlantSimulator(plant, vehicle, bent, TIMES)
        runs = simulator.runs(START, np.array([3, 3], dtype=np.uint64))
    except InputError as error:
        pytest.skip(str(error))
    assert np.array_equal(runs[:, 0], START)
    loop = vehicle.closed_loop(vehicle.track(), PathFrame(bent, bent))
    model = rollout(loop, START, horizon_s=1.5, step_s=0.1)
    names = simulator.names
    assert names == loop.ode.names
    most = {"station": 0.15, "offset": 0.06, "steering": 0.03, "speed": 0.15,
            "heading_error": 0.05, "speed_integral": 0.15, "offset_integral": 0.1}  # fmt: skip
    for i, name in enumerate(names):
        assert np.abs(runs[:, :, i] - model[:, :, i]).max() < most[name], name
    if bent:
        # The road bends the wheels: with the wrong side they would turn the other way.
        assert np.all(np.sign(runs[:, -1, 2]) == np.sign(bent))
        assert np.abs(runs[:, -1, 2]).min() > 0.02


def test_the_seed_is_the_car_and_a_run_is_the_same_alone(vehicle: Vehicle) -> None:
    simulator = PlantSimulator("bicycle", vehicle, 0.0, TIMES)
    seeds = np.array([3, 4], dtype=np.uint64)
    same_start = np.array([START[0], START[0]])
    runs = simulator.runs(same_start, seeds)
    assert not np.array_equal(runs[0], runs[1]), "another seed is another car"
    assert np.array_equal(simulator.runs(same_start[1:], seeds[1:])[0], runs[1])
    assert np.array_equal(simulator.runs(same_start, seeds[[0, 0]])[1], runs[0])


def test_instants_do_not_move_the_turns(vehicle: Vehicle) -> None:
    coarse = PlantSimulator("bicycle", vehicle, 0.0, np.array([0.0, 0.5, 1.0]))
    fine = PlantSimulator("bicycle", vehicle, 0.0, np.linspace(0.0, 1.0, 21))
    seeds = np.array([3], dtype=np.uint64)
    a, b = coarse.runs(START[:1], seeds)[0], fine.runs(START[:1], seeds)[0, ::10]
    assert np.abs(a - b).max() < 2e-3


def test_a_vehicle_without_drive_by_wire_is_refused() -> None:
    with pytest.raises(InputError, match=r"expected a vehicle with \[drive_by_wire\]"):
        PlantSimulator("bicycle", gem_e2(), 0.0, TIMES)
