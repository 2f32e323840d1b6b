"""A car that is pushed while it brakes stands by the time that its bundle's brake says."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.codegen.bundle import brake_bounds
from workbench.models.vehicle import Vehicle, gem_e2
from workbench.models.vehicle_sections import Uncertainty

_FINE_S = 1e-4


def _pushed(push_mps2: float, *, build_up_s: float = 0.1) -> Vehicle:
    vehicle = gem_e2()
    return dataclasses.replace(
        vehicle,
        brake=dataclasses.replace(vehicle.brake, build_up_s=build_up_s),
        uncertainty=Uncertainty(acceleration_mps2=push_mps2),
    )


def _stood_s(vehicle: Vehicle, speed_mps: float, push_mps2: float) -> float:
    """When the weakest brake has the pushed car at rest for good, by small steps."""
    brake = vehicle.brake
    times = np.arange(0.0, 60.0, _FINE_S)
    share = np.clip((times - brake.delay_s) / brake.build_up_s, 0.0, 1.0)
    speeds = speed_mps + np.cumsum(push_mps2 - share * brake.deceleration_min_mps2) * _FINE_S
    return float(times[np.flatnonzero(speeds > 0.0)[-1]])


@pytest.mark.parametrize("push_mps2", [0.05, 0.4, 1.9])
@pytest.mark.parametrize("build_up_s", [0.01, 0.1, 0.5])
def test_no_car_stands_later(push_mps2: float, build_up_s: float) -> None:
    vehicle = _pushed(push_mps2, build_up_s=build_up_s)
    bounds = brake_bounds(vehicle)
    for speed_mps in (0.01, 1.0, 2.8):
        stood_s = _stood_s(vehicle, speed_mps, push_mps2)
        latest_s = bounds.stop_s(speed_mps)
        assert stood_s <= latest_s + _FINE_S
        # Not later than it must be by more than half of what the build-up brakes.
        assert latest_s - stood_s < 2.0 * build_up_s / (2.0 - push_mps2) + 2.0 * _FINE_S


def test_without_a_push_they_are_the_vehicle_files() -> None:
    bounds, brake = brake_bounds(gem_e2()), gem_e2().brake
    assert (bounds.deceleration_min_mps2, bounds.delay_s, bounds.build_up_s) == (
        brake.deceleration_min_mps2, brake.delay_s, brake.build_up_s,
    )  # fmt: skip
