"""The board of plants measures the bicycle as no different from itself, and others as different."""

from __future__ import annotations

import dataclasses

import pytest

from workbench.bench import plant_cost
from workbench.errors import InputError
from workbench.models.vehicle import gem_e2, gem_e2_drive_path, load_vehicle

VEHICLE = load_vehicle(gem_e2_drive_path())


def test_the_bicycle_is_no_different_from_itself() -> None:
    found = dataclasses.astuple(plant_cost.mismatch("bicycle", VEHICLE))
    assert found[1:] == pytest.approx((0.0,) * 7, abs=1e-9)


def test_the_single_track_car_differs_by_what_it_cannot_do_at_once() -> None:
    found = plant_cost.mismatch("single-track", VEHICLE)
    # Rolling resistance of 0.04 m/s^2 for 3 s at least; no more than tenths of a metre in all.
    assert 0.03 < found.acceleration_mps2 < 0.3
    assert 0.1 < found.ahead_m < 1.0
    assert 0.01 < found.aside_m < 0.5
    assert 0.1 < found.speed_mps < 0.5


def test_the_manoeuvre_ends_at_rest_with_wheels_straight() -> None:
    end = plant_cost.driven(plant_cost._started("bicycle", VEHICLE), plant_cost.inputs())[-1]
    assert end.speed_mps == 0.0
    assert end.road_wheel_rad == pytest.approx(0.0, abs=1e-9)


def test_costs_are_measured_and_written_as_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plant_cost, "_ROUNDS", 1)
    cost = plant_cost.plant_cost("bicycle", VEHICLE)
    assert 0.0 < cost.step_us < 1e4
    text = plant_cost.plant_text([cost], [plant_cost.mismatch("bicycle", VEHICLE)])
    assert [line.split()[0] for line in text.splitlines() if line] == [
        "plant", "bicycle", "most", "bicycle",
    ]  # fmt: skip
    with pytest.raises(InputError, match="drive_by_wire"):
        plant_cost.plant_cost("bicycle", gem_e2())
