"""The shape that is found is the least of its cost, and the cost's slope is its derivative."""

from __future__ import annotations

import math

import numpy as np
import pytest
from guard_walkers import crowd

from workbench.estimation import guard_shape
from workbench.estimation.guard_model import GuardModel, guard_areas, is_inside
from workbench.estimation.guard_motion import MotionRows, motion_rows
from workbench.estimation.guard_shape import _cost, _Part, least_shape
from workbench.runtime import MotionLimits

OUTSIDE = 0.02


@pytest.fixture(scope="module")
def rows() -> list[MotionRows]:
    people = crowd(2, 2, 10, MotionLimits(2.0, 1.5))
    every = [motion_rows(people, people, horizon) for horizon in (0.5, 1.0, 2.0)]
    return [part.take(part.motion.known) for part in every]


def test_the_slope_is_that_of_finite_differences(rows: list[MotionRows]) -> None:
    parts = [_Part.of(part, OUTSIDE) for part in rows]
    rng = np.random.default_rng(3)
    for _ in range(5):
        logs = guard_shape._START + rng.normal(size=13) * 0.4
        slope = _cost(logs, parts)[1]
        for i, step in enumerate(np.eye(13) * 1e-6):
            rise = _cost(logs + step, parts)[0] - _cost(logs - step, parts)[0]
            assert slope[i] == pytest.approx(rise / 2e-6, rel=1e-3, abs=1e-3)


def test_about_the_share_asked_for_is_outside(rows: list[MotionRows]) -> None:
    found = least_shape(rows, outside=OUTSIDE)
    shares = [1.0 - _held(found, part).mean() for part in rows]
    assert 0.2 * OUTSIDE < np.mean(shares) < 3.0 * OUTSIDE


def test_no_other_shape_tried_is_smaller_with_as_many_inside(rows: list[MotionRows]) -> None:
    found = least_shape(rows, outside=OUTSIDE)
    rng = np.random.default_rng(6)
    least = _area(found, rows)
    for _ in range(40):
        numbers = np.array(found.error.numbers()) * np.exp(rng.normal(size=10) * 0.5)
        other = GuardModel(
            found.position_m,
            type(found.error)(*numbers.tolist()),
            found.kept,
            found.limits,
            "other",
        )
        assert _area(other, rows) > 0.93 * least
    plain = GuardModel(
        0.3, type(found.error)(1.0, *[0.0] * 9), 1.0, MotionLimits(0.0, 0.5), "one radius"
    )
    assert _area(plain, rows) > 1.1 * least


def test_it_is_the_same_every_time(rows: list[MotionRows]) -> None:
    assert least_shape(rows, outside=OUTSIDE) == least_shape(rows, outside=OUTSIDE)


def _held(model: GuardModel, rows: MotionRows) -> np.ndarray:
    return is_inside(_free(model), rows)


def _free(model: GuardModel) -> GuardModel:
    limits = MotionLimits(1000.0, model.limits.acceleration_mps2)
    return GuardModel(model.position_m, model.error, model.kept, limits, "any speed")


def _area(model: GuardModel, rows: list[MotionRows]) -> float:
    """Geometric mean of the mean areas at the factor with which enough rows are inside."""
    low, high = 0.05, 20.0
    for _ in range(30):
        factor = math.sqrt(low * high)
        inside = min(float(_held(model.scaled(factor), part).mean()) for part in rows)
        low, high = (low, factor) if inside >= 1.0 - OUTSIDE else (factor, high)
    sized = _free(model.scaled(high))
    return math.exp(np.mean([math.log(guard_areas(sized, part).mean()) for part in rows[1:]]))
