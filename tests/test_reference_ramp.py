"""A tube whose reference speed is ramped holds the car while the reference keeps to the ramp, early
or late within its slack, upwards and downwards; it does not hold one that is brought up later."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.stopping import REFERENCE_CHANGE
from workbench.models.system import Ode
from workbench.models.vehicle import gem_e2, load_vehicle
from workbench.reach.ranged_parameters import with_ranged_parameters_as_disturbances
from workbench.runtime import Bundle
from workbench.runtime.measuring import STATES
from workbench.runtime.onboard.times import DECIDE_EVERY, TURN_US, seconds
from workbench.sensitivity.sampling import rollout
from workbench.sets import Box
from workbench.simulation.onboard_car import straight_road
from workbench.simulation.paper.replayed import Asked
from workbench.simulation.paper.tubes import (
    KernelTubes,
    PathRows,
    paper_bundle,
    paper_spec,
    ramp_of,
)
from workbench.simulation.simulated import simulated_path

Array = NDArray[np.float64]

SPEC = paper_spec(load_vehicle(simulated_path()), 3.0, ramps=True)
PERIOD_S = DECIDE_EVERY * seconds(TURN_US)
PERIODS = 30
WANTED_MPS = SPEC.vehicle.operation.reference_speed_mps
ROAD = straight_road(-20.0, 60.0)


@functools.cache
def bundle() -> Bundle:
    return paper_bundle(SPEC)


@functools.cache
def loop() -> Ode:
    ode = SPEC.vehicle.uncertain_loop(SPEC.vehicle.track(), PathFrame(-0.5, 0.5)).ode
    return with_ranged_parameters_as_disturbances(ode)


def start(speed_mps: float, radius: float) -> Box:
    """Around the middle of the road, at a speed."""
    middle = dict.fromkeys(STATES, 0.0) | {"speed": speed_mps}
    return Box.from_intervals({
        name: (value - radius, value + radius) for name, value in middle.items()
    })  # fmt: skip


def tube(box: Box, reference_mps: float) -> PathRows:
    tubes = KernelTubes(bundle(), SPEC.vehicle, unsure=False, title="")
    return tubes.rows(ROAD, Asked(0, (box,) * 3, reference_mps), 0)


def ramped(count: int, steps: Array, reference_mps: float) -> Array:
    """(count, PERIODS) changes of the reference, so many steps of the ramp after each period."""
    pace_mps2, _, _ = ramp_of(SPEC.vehicle)
    change_mps = WANTED_MPS - reference_mps
    gone = pace_mps2 * PERIOD_S * np.maximum(np.broadcast_to(steps, (count, PERIODS)), 0.0)
    return np.sign(change_mps) * np.minimum(gone, abs(change_mps))


def places(box: Box, reference_mps: float, changes: Array) -> Array:
    """(N, PERIODS, 2): station and offset at the end of each period, from anywhere in the box."""
    ode, chance = loop(), np.random.default_rng(3)
    low, high = np.array([box.interval(name) for name in ode.names]).T
    shape = len(changes), len(low)
    x = np.where(
        chance.random(shape) < 0.5, chance.uniform(low, high, shape),
        np.where(chance.random(shape) < 0.5, low, high),
    )  # fmt: skip
    p = [
        reference_mps if each.name == "reference_speed" else each.nominal for each in ode.parameters
    ]
    w = np.tile([each.nominal for each in ode.disturbances], (len(x), 1))
    at = [each.name for each in ode.disturbances].index(REFERENCE_CHANGE)
    where = [ode.names.index(name) for name in ("station", "offset")]
    found = []
    for k in range(PERIODS):
        w[:, at] = changes[:, k]
        runs = rollout(ode, x, horizon_s=PERIOD_S, step_s=PERIOD_S / 4, parameters=p,
                       disturbances=w)  # fmt: skip
        x = runs[:, -1]
        found.append(x[:, where])
    return np.array(found).transpose(1, 0, 2)


def held(rows: PathRows, found: Array) -> NDArray[np.bool_]:
    """(N, PERIODS): inside of the row of that instant?"""
    at = np.floor(PERIOD_S * np.arange(1, PERIODS + 1) / rows.step_s).astype(int)
    assert len(rows.lower) > at[-1], "the tube ended early"
    inside = (found >= rows.lower[at] - 1e-6) & (found <= rows.upper[at] + 1e-6)
    return np.asarray(inside.all(axis=2))


@pytest.mark.parametrize(("speed_mps", "reference_mps"), [(0.0, 0.0), (1.2, 1.0), (3.0, 3.0)])
def test_cars_whose_reference_keeps_to_the_ramp_stay_inside(
    speed_mps: float, reference_mps: float
) -> None:
    """The reference comes in steps, one per period: within a period early by two steps, late by
    one, or anything between."""
    box = start(speed_mps, 0.05)
    k = np.arange(PERIODS, dtype=float)
    chance = np.random.default_rng(5)
    patterns = [ramped(1, k + late, reference_mps) for late in (-1.0, 0.0, 1.0, 2.0)]
    patterns.append(ramped(60, k + chance.uniform(-1.0, 2.0, (60, PERIODS)), reference_mps))
    changes = np.concatenate([np.repeat(each, 30, axis=0) for each in patterns])
    assert held(tube(box, reference_mps), places(box, reference_mps, changes)).all()


@pytest.mark.parametrize("late", [-12.0, 12.0])
@pytest.mark.parametrize("reference_mps", [0.0, 3.9])
def test_a_reference_that_comes_a_second_early_or_late_is_another_ramp(
    reference_mps: float, late: float
) -> None:
    box = start(reference_mps, 0.001)
    k = np.arange(PERIODS, dtype=float)
    changes = ramped(10, k - late, reference_mps)
    assert not held(tube(box, reference_mps), places(box, reference_mps, changes))[:, -1].any()


def test_a_kernel_that_is_not_told_a_pace_holds_any() -> None:
    box = start(0.0, 0.001)
    tubes = KernelTubes(bundle(), SPEC.vehicle, unsure=False, title="")
    query = tubes.query(ROAD, Asked(0, (box,) * 3, 0.5), 0)
    del query["reference_ramp"]
    result = bundle().call(query)
    count = int(result.scalar("track_rows"))
    lower, upper = (
        np.array(result.rows(f"track_{end}", width=len(STATES), count=count).numbers).reshape(
            count, -1
        )[:, :2]
        for end in ("lower", "upper")
    )
    rows = PathRows(lower, upper, 0.05)
    for change_mps in (0.0, WANTED_MPS - 0.5):
        changes = np.full((4, PERIODS), change_mps)
        assert held(rows, places(box, 0.5, changes)).all()


@pytest.mark.parametrize(
    "ramp", [(-0.1, 0.5, 0.1), (0.6, 0.5, 0.1), (0.1, 0.5, -0.1), (np.nan, 0.5, 0.1)]
)
def test_a_ramp_that_is_none_is_not_judged(ramp: tuple[float, float, float]) -> None:
    tubes = KernelTubes(bundle(), SPEC.vehicle, unsure=False, title="")
    query = tubes.query(ROAD, Asked(0, (start(0.5, 0.01),) * 3, 0.5), 0)
    result = bundle().call({**query, "reference_ramp": ramp})
    assert result.scalar("status") == 4.0
    assert result.scalar("track_rows") == 0.0


@pytest.mark.parametrize(("end", "change_mps"), [("lower", 0.3), ("upper", -0.3)])
def test_a_ramp_begins_at_the_reference_of_the_decision(end: str, change_mps: float) -> None:
    tubes = KernelTubes(bundle(), SPEC.vehicle, unsure=False, title="")
    query = tubes.query(ROAD, Asked(0, (start(0.5, 0.01),) * 3, 0.5), 0)
    at = [each.name for each in loop().disturbances].index(REFERENCE_CHANGE)
    ends = {
        f"disturbance_{each}": list(query[f"disturbance_{each}"]) for each in ("lower", "upper")
    }
    ends["disturbance_lower"][at], ends["disturbance_upper"][at] = sorted(
        (change_mps, 2 * change_mps)
    )
    assert bundle().call({**query, **ends}).scalar("status") == 4.0
    ends[f"disturbance_{end}"][at] = 0.0
    assert bundle().call({**query, **ends}).scalar("status") == 0.0


def test_a_vehicle_that_no_commands_are_known_of_has_no_ramp() -> None:
    with pytest.raises(InputError, match="drive_by_wire"):
        ramp_of(dataclasses.replace(gem_e2(), drive_by_wire=None))
