"""Claim: recorded people are at their samples, moved and turned as said, on straight lines in
between, and nowhere before and after."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.walker_cases import FAR_AWAY
from workbench.errors import InputError
from workbench.estimation.people_data import PersonTrack
from workbench.simulation.walkers.moving import Who
from workbench.simulation.walkers.pedestrian import PersonNow
from workbench.simulation.walkers.recorded import Placement, Recorded

_TRACK = PersonTrack(
    "square",
    "7",
    "ped",
    np.array([10.0, 10.5, 12.0]),
    np.array([[3.0, 1.0], [4.0, 1.0], [4.0, 4.0]]),
)
_WHO = Who("7", "ped", 0.3)


def _at(person: Recorded, t_s: float) -> PersonNow | None:
    person.advance(0.0, t_s, FAR_AWAY)
    return person.now


def test_places_and_velocities_are_those_of_the_segments() -> None:
    person = Recorded(_WHO, _TRACK)
    assert _at(person, 9.99) is None
    for t_s, place, velocity in (
        (10.0, (3.0, 1.0), (2.0, 0.0)),
        (10.25, (3.5, 1.0), (2.0, 0.0)),
        (10.5, (4.0, 1.0), (0.0, 2.0)),
        (11.5, (4.0, 3.0), (0.0, 2.0)),
        (12.0, (4.0, 4.0), (0.0, 2.0)),
    ):
        now = _at(person, t_s)
        assert now is not None
        assert (now.x_m, now.y_m) == pytest.approx(place)
        assert (now.vx_mps, now.vy_mps) == pytest.approx(velocity)
    assert _at(person, 12.01) is None


def test_a_quarter_turn_to_the_left_about_a_point_that_moves() -> None:
    lies = Placement(about=(3.0, 1.0), to=(20.0, 5.0), turn_rad=math.pi / 2, from_s=10.0)
    moved = lies.apply(_TRACK)
    assert moved.t_s.tolist() == [0.0, 0.5, 2.0]
    assert moved.xy_m == pytest.approx(np.array([[20.0, 5.0], [20.0, 6.0], [17.0, 6.0]]))
    now = Recorded(_WHO, moved).now
    assert now is not None
    assert (now.vx_mps, now.vy_mps) == (pytest.approx(0.0), pytest.approx(2.0))


def test_one_sample_and_infinite_places_are_refused() -> None:
    single = PersonTrack("square", "8", "ped", np.array([1.0]), np.array([[0.0, 0.0]]))
    with pytest.raises(InputError, match="two samples or more"):
        Recorded(_WHO, single)
    with pytest.raises(InputError, match="finite"):
        Placement((0.0, 0.0), (math.nan, 0.0), 0.0, 0.0)
