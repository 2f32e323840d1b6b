"""Claim: recorded drives become windows of their own, and bounds fitted to them contain them."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.cli.main import main
from workbench.models.vehicle_sections import Uncertainty
from workbench.simulation.conformance.discs import Disc, Prediction, containing, of_area
from workbench.simulation.conformance.enclosing import enclose
from workbench.simulation.conformance.first_order import first_order
from workbench.simulation.conformance.fit import fit, linear_fit
from workbench.simulation.conformance.held_bicycle import DriveErrors, DriveWindows, HeldBicycle
from workbench.simulation.conformance.windows import Measured, instants
from workbench.simulation.recording import Recording, Shape, VehicleSample

MODEL = HeldBicycle(2.7, 0.3, 3.5)
SHAPE = Shape(3.5, 1.3, 0.9, 2.7)
DATA = os.environ.get("WORKBENCH_DATA")


def circle(name: str, *, braking_mps2: float = 0.0, turn_rad: float = 0.0) -> Recording:
    """A left bend of 20 m radius from 4 m/s, exactly as the bicycle drives, turned by an angle."""
    samples = []
    for t_s in np.arange(0.0, 6.05, 0.1):
        speed = max(4.0 - braking_mps2 * t_s, 0.0)
        until = min(float(t_s), 4.0 / braking_mps2 if braking_mps2 else math.inf)
        angle = (4.0 * until - 0.5 * braking_mps2 * until**2) / 20.0
        heading = angle + turn_rad
        rear = 20.0 * np.array([math.sin(heading), -math.cos(heading)])
        x, y = rear + 0.3 * np.array([math.cos(heading), math.sin(heading)])
        samples.append(
            VehicleSample(
                float(t_s), x, y, heading, speed, 0.0, -braking_mps2 if speed else 0.0, speed / 20.0
            )
        )
    return Recording(name, "ego", "car", SHAPE, tuple(samples), ())


def windows(*recordings: Recording, holds: bool = True) -> Measured:
    cut = DriveWindows(instants(2.0, 0.2), 8.0, DriveErrors(), holds)
    return cut.of(recordings)


@settings(max_examples=10, deadline=None)
@given(st.floats(-3.0, 3.0))
def test_a_bicycle_on_a_circle_needs_no_disturbance_whichever_way_it_faces(turn: float) -> None:
    measured = windows(circle("a", turn_rad=turn))
    assert len(measured.windows) == 3
    assert not linear_fit(MODEL, measured, outliers=0, most={}).bounds.any()
    assert first_order(MODEL, measured).deviation.max() < 0.02


def test_a_braking_that_is_not_held_needs_just_that_much() -> None:
    measured = windows(circle("a", braking_mps2=0.8), holds=False)
    found = fit(MODEL, measured, outliers=0, most={})
    assert found.contained
    assert 0.4 < found.uncertainty.acceleration_mps2 < 0.9


def test_windows_faster_than_asked_are_left_out() -> None:
    cut = DriveWindows(instants(2.0, 0.2), 3.9, DriveErrors(), True)
    assert not cut.of((circle("a"),)).windows


def test_discs_of_equal_area_have_it_and_containing_ones_contain() -> None:
    measured = windows(circle("a", braking_mps2=1.0))
    times = measured.times_s
    for prediction in Prediction:
        disc = of_area(prediction, measured, error_m=0.3, mean_area_m2=20.0)
        assert disc.area_m2(times) == pytest.approx(20.0)
        least = containing(prediction, measured, error_m=0.3)
        assert least.enclosed(measured).whole.all()
        smaller = Disc(prediction, 0.3, 0.99 * least.growth_mps2)
        assert not smaller.enclosed(measured).whole.all()


def test_a_tube_without_bounds_does_not_contain_a_driver_who_brakes() -> None:
    braked = windows(circle("a", braking_mps2=1.0), holds=False)
    assert not enclose(MODEL, Uncertainty(), braked).whole.all()


@pytest.mark.skipif(not DATA, reason="needs recordings: set WORKBENCH_DATA to their folder")
def test_bounds_fitted_to_half_of_the_recordings_hold_on_the_others(tmp_path: Path) -> None:
    source = str(Path(str(DATA)) / "kitti")
    assert main(["conform", source, "--outliers", "1", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "vehicle.toml").is_file()
