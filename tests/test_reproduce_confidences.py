"""The nested sets of `reproduce paper` are as small as other drives allow, and no smaller."""

from __future__ import annotations

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.runtime.path import PathTable
from workbench.sets import Box
from workbench.simulation.paper.confidences import TRIED, fitted
from workbench.simulation.paper.replayed import Asked, ReplayedRun

ROAD = PathTable(0.0, 100.0, (0.0, 100.0), (0.0, 0.0), (0.0, 0.0), (0.0,), (0.0,))


def run_of(*errors: tuple[float, float]) -> ReplayedRun:
    """One decision per error (m) of station and offset, each about a set of radii 1 m and 0.5 m."""
    places = np.array([(10.0 + station, offset) for station, offset in errors]).reshape(-1, 2)
    asked = tuple(Asked(k, tuple(_box(share) for share in TRIED), 2.0) for k in range(len(errors)))
    ones = np.ones(len(errors))
    return ReplayedRun("a run", "bicycle", ROAD, places, places, ones, ones > 0.0, asked, 0)


def _box(share: float) -> Box:
    return Box(("station", "offset"), (10.0 - share, -0.5 * share), (10.0 + share, 0.5 * share))


def test_the_smallest_share_that_held_in_every_run_is_low_and_the_middle_is_medium() -> None:
    high, medium, low = fitted([run_of((0.1, 0.0), (-0.33, 0.2)), run_of((0.0, -0.36))])
    assert high == 1.0
    assert low == pytest.approx(0.72)
    assert medium == pytest.approx(0.86)


@pytest.mark.parametrize("worse", [(0.97, 0.0), (-0.97, 0.0), (0.0, 0.485), (0.0, -0.485)])
def test_one_decision_on_any_side_decides(worse: tuple[float, float]) -> None:
    assert fitted([run_of((0.1, 0.0)), run_of((0.2, 0.1), worse)])[2] == pytest.approx(0.98)


def test_no_share_below_those_tried_is_chosen() -> None:
    assert fitted([run_of((0.0, 0.0))])[2] == TRIED[-1]


def test_a_set_that_did_not_hold_the_car_is_no_ground_for_smaller_ones() -> None:
    with pytest.raises(InputError, match="whole measured set"):
        fitted([run_of((1.01, 0.0))])
    with pytest.raises(InputError, match="got none"):
        fitted([run_of()])
