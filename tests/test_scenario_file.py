"""Claim: a scenario file can say all that a scenario can be, and what it says is what is read."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario_cases import ALL, EXPECTED, HEAD, load
from tests.walker_cases import FAR_AWAY
from workbench.estimation.goals import Goal
from workbench.estimation.potential_field import Repulsion
from workbench.runtime import MotionLimits
from workbench.simulation.scenarios.company import (
    ByChance,
    Chasing,
    Company,
    FromRecording,
    InField,
    Told,
)
from workbench.simulation.scenarios.scenario import (
    Dropout,
    Expected,
    Ghost,
    Occluder,
    Sensing,
)
from workbench.simulation.walkers.cues import AtTime, CarPassed, CarWithin
from workbench.simulation.walkers.moving import GUARD, Who
from workbench.simulation.walkers.pursuing import Chase
from workbench.simulation.walkers.scripted import Leg, Script


def test_every_key_comes_to_lie_where_it_belongs(tmp_path: Path) -> None:
    scenario = load(tmp_path, ALL)
    assert (scenario.name, scenario.title) == ("scene", "A title")
    assert scenario.story == "A story of two lines."
    assert scenario.waypoints == ((0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (30.0, 0.0))
    assert (scenario.duration_s, scenario.passed_m) == (20.0, 25.0)
    assert scenario.expected == {
        "LookAhead": Expected.PASSES,
        "FailSafe": Expected.BRAKES,
        "both": Expected.ANY,
    }
    assert scenario.sensing == Sensing(
        0.07, 0.01, 0.06, 0.1, 0.5, 0.3, (0.02, 0.05), 25.0,
        (Dropout("localisation", 3.0, 4.5),), (Ghost(12.0, 1.0, 2.0, 3.0),),
        (Occluder(10.0, 2.0, 14.0, 4.0),), False,
    )  # fmt: skip
    assert scenario.goals == (Goal("door", 12.0, 8.0, 1.5),)


def test_every_kind_of_people_is_as_written(tmp_path: Path) -> None:
    company = load(tmp_path, ALL).cast
    assert isinstance(company, Company)
    told, standing, group, field, chasing, chance, recorded = company.parts
    assert told == Told(
        Who("one", "cyclist", 0.8),
        Script(
            (1.0, 5.0),
            (
                Leg((3.0, 5.0), 1.5),
                Leg((3.0, -5.0), 1.4, AtTime(2.0)),
                Leg((4.0, 5.0), 1.3, CarWithin(6.0), 0.5),
                Leg((5.0, 5.0), 1.2, CarPassed(9.0)),
                Leg((6.0, 5.0), 1.1, None, 2.0),
            ),
            1.0,
            0.9,
            (0.0, 12.0),
        ),
    )
    assert isinstance(standing, Told)
    assert standing.who == Who("two", "ped", 0.3)
    assert standing.script.begin == pytest.approx((12.0, -3.0))
    assert standing.script.there_s == (1.0, 2.0)
    assert isinstance(group, Told)
    assert group.offsets == ((0.0, 0.0), (1.0, 0.5))
    assert group.script == Script((5.0, 5.0))
    assert isinstance(field, InField)
    assert field.ground.obstacles[0] == pytest.approx((6.0, 6.0, 1.0))
    assert (field.ground.heeds_car, field.ground.noise_mps2) == (False, 0.3)
    assert field.ground.limits == MotionLimits(2.0, 1.0)
    forces = field.ground.field
    assert (forces.relaxation_s, forces.softening_m) == (0.5, 1.0)
    assert (forces.obstacle, forces.vehicle) == (Repulsion(2.0, 0.4), Repulsion(1.0, 0.8))
    errand = field.errands[0]
    assert errand.who.name == "four"
    assert errand.begin == pytest.approx((2.0, 3.0))
    assert errand.velocity == pytest.approx((1.0, 0.0))
    assert errand.goals[0] == pytest.approx((9.0, 3.0))
    assert errand.speed_mps == 1.2
    assert chasing == Chasing(
        Who("five", "ped", 0.3),
        Chase(
            (20.0, 6.0), (0.0, -1.0), CarWithin(9.0), MotionLimits(2.2, 1.1),
            ahead_m=2.0, standoff_m=0.5, gives_up_s=8.0,
        ),
    )  # fmt: skip
    six = Who("six", "ped", 0.3)
    start = ((15.0, 7.0), (0.5, 0.0))
    assert chance == ByChance(six, start, MotionLimits(2.0, 1.5), (0.5, 1.5))
    assert isinstance(recorded, FromRecording)
    assert recorded.radius_m == 0.4
    assert [track.agent for track in recorded.tracks] == ["7"]


def test_each_run_gets_new_people(tmp_path: Path) -> None:
    scenario = load(tmp_path, ALL)
    first, second = (scenario.cast.people(1, scenario.path) for _ in range(2))
    assert len(first) == 8
    for person in first:
        person.advance(0.0, 1.0, FAR_AWAY)
    assert [each.now for each in second] != [each.now for each in first]
    for person in second:
        person.advance(0.0, 1.0, FAR_AWAY)
    assert [each.now for each in second] == [each.now for each in first]


def test_what_can_be_left_out_has_the_defaults_of_the_classes(tmp_path: Path) -> None:
    people = """
[[people]]
walker = "adversary"
name = "a"
begin = [20.0, 6.0]
at_s = 3.0

[[people]]
walker = "recorded"
folder = "records"
recording = "square"
from_s = 0.0
"""
    scenario = load(tmp_path, HEAD + EXPECTED + people)
    assert scenario.sensing == Sensing()
    assert scenario.goals == ()
    assert isinstance(scenario.cast, Company)
    chasing, recorded = scenario.cast.parts
    assert isinstance(chasing, Chasing)
    assert chasing.chase == Chase((20.0, 6.0), (0.0, 0.0), AtTime(3.0), GUARD)
    assert isinstance(recorded, FromRecording)
    assert [track.agent for track in recorded.tracks] == ["7", "8"]


def test_a_frame_of_the_path_turns_places_offsets_and_velocities(tmp_path: Path) -> None:
    up = HEAD.replace("[[0, 0], [10, 0], [20, 0], [30, 0]]", "[[0, 0], [0, 10], [0, 20], [0, 30]]")
    people = """
[[people]]
walker = "group"
name = "g"
frame = "path"
begin = [12.0, 3.0]
offsets = [[1.0, 0.5]]

[[people]]
walker = "random"
name = "r"
frame = "path"
begin = [5.0, -2.0]
velocity = [1.0, 0.25]
hold_s = [1.0, 1.0]
"""
    scenario = load(tmp_path, up + EXPECTED + people)
    group, wanderer = scenario.cast.people(0, scenario.path)
    assert group.now is not None
    assert wanderer.now is not None
    assert (group.now.x_m, group.now.y_m) == (pytest.approx(-3.5), pytest.approx(13.0))
    assert (wanderer.now.x_m, wanderer.now.y_m) == (pytest.approx(2.0), pytest.approx(5.0))
    velocity = (wanderer.now.vx_mps, wanderer.now.vy_mps)
    assert velocity == (pytest.approx(-0.25), pytest.approx(1.0))
