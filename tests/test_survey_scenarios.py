"""The same index is the same scenario, whole or in parts, and every point can be driven."""

from __future__ import annotations

import math

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.simulation.campaign.sampled import (
    DIMENSIONS,
    DURATION_S,
    SampledScenario,
    sampled,
    sobol_points,
)
from workbench.simulation.people import Body
from workbench.simulation.rig import path_table
from workbench.simulation.walkers.moving import GUARD
from workbench.simulation.walkers.pedestrian import CarNow

WHOLE = sampled(range(64), 1)


def test_parts_of_the_sequence_are_the_whole() -> None:
    assert sampled(range(17, 23), 1) == WHOLE[17:23]
    assert sampled(range(17, 23), 2) != WHOLE[17:23]


def test_an_index_keeps_its_scenario() -> None:
    """Pinned; where this fails on purpose, `FAMILY` has to go up."""
    assert DIMENSIONS == 44
    assert [round(u, 6) for u in WHOLE[5].point[:4]] == PINNED
    scenario = WHOLE[5].scenario("a")
    people = scenario.cast.people(WHOLE[5].seed, scenario.path)
    assert [each.now and (round(each.now.x_m, 4), round(each.now.y_m, 4)) for each in people] == (
        PLACES
    )
    assert scenario == WHOLE[5].scenario("a")


PINNED = [0.976594, 0.897216, 0.727871, 0.194594]
PLACES = [(13.6609, 10.791), (8.5124, 3.2434)]


def test_points_fill_the_cube_evenly() -> None:
    """64 points of a Sobol sequence: in each coordinate, one in every 64th."""
    points = np.array([each.point for each in WHOLE])
    for column in points.T:
        assert sorted((column * 64).astype(int)) == list(range(64))


def test_paths_bend_no_tighter_than_25_m() -> None:
    for each in WHOLE:
        table = path_table(each.scenario("a"))
        tightest = max(map(abs, (*table.curvature_lower, *table.curvature_upper)))
        assert tightest <= 1.0 / 25.0


@pytest.mark.parametrize("corner", [0.0, math.nextafter(1.0, 0.0)])
def test_the_cubes_corners_are_scenarios(corner: float) -> None:
    scenario = SampledScenario((corner,) * DIMENSIONS, 1).scenario("corner")
    people = scenario.cast.people(1, scenario.path)
    assert len(people) == (0 if corner == 0.0 else 3) + (corner == 0.0)


def test_people_on_foot_keep_to_the_guard() -> None:
    body = Body(0.0, 0.0, 0.0, 2.26, 0.47, 0.88)
    for each in WHOLE[:24]:
        scenario = each.scenario("a")
        walking = scenario.cast.people(each.seed, scenario.path)
        before: dict[str, tuple[float, float]] = {}
        step_s, end = 0.1, int(DURATION_S / 0.1)
        for k in range(end):
            car = CarNow(body, 1.0, 0.1 * k)
            for person in walking:
                now = person.now
                assert now is not None
                if now.kind == "ped":
                    assert math.hypot(now.vx_mps, now.vy_mps) <= GUARD.speed_mps
                    was = before.get(now.name, (now.vx_mps, now.vy_mps))
                    change = math.dist(was, (now.vx_mps, now.vy_mps))
                    assert change <= GUARD.acceleration_mps2 * step_s + 1e-9
                    before[now.name] = (now.vx_mps, now.vy_mps)
                person.advance(step_s * k, step_s * (k + 1), car)


def test_a_point_outside_of_the_cube_is_refused() -> None:
    (point,) = sobol_points(range(3, 4), 1)
    with pytest.raises(InputError, match=r"expected 44 numbers in \[0, 1\)"):
        SampledScenario((*point[:-1], 1.0), 1)
    with pytest.raises(InputError, match="got 43"):
        SampledScenario(point[:-1], 1)
    with pytest.raises(InputError, match="seed"):
        SampledScenario(point, 0)
