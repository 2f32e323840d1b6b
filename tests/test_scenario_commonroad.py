"""Claim: of a CommonRoad file the way ahead and the people come out as they stand in it, and what
is not supported, or could do harm, is refused or named."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from tests.commonroad_cases import (
    CAR,
    CIRCLE,
    LANES,
    PROBLEM,
    WALK,
    lanelet,
    obstacle,
    scene,
    state,
    written,
)
from tests.walker_cases import FAR_AWAY
from workbench.errors import InputError
from workbench.simulation.scenarios.commonroad import from_commonroad
from workbench.simulation.scenarios.company import Company, FromRecording


def _people(file: Path, **given: bool) -> tuple[FromRecording, ...]:
    company = from_commonroad(file, **given).scenario.cast  # type: ignore[arg-type]
    assert isinstance(company, Company)
    return tuple(part for part in company.parts if isinstance(part, FromRecording))


@pytest.mark.parametrize("version", ["2018b", "2020a"])
@pytest.mark.parametrize("packed", [False, True])
def test_both_versions_give_the_people_that_were_written(
    tmp_path: Path, version: str, packed: bool
) -> None:
    walker, rider = _people(written(tmp_path, scene(version), packed=packed))
    (track,) = walker.tracks
    assert (track.agent, track.kind) == ("ped 7", "ped")
    assert track.t_s == pytest.approx(0.2 * np.arange(30))
    assert track.xy_m == pytest.approx(np.array(WALK))
    assert rider.tracks[0].kind == "cyclist"
    assert walker.radius_m == 0.35
    assert rider.radius_m == pytest.approx(0.5 * np.hypot(1.8, 0.6))


def test_people_move_as_the_file_says(tmp_path: Path) -> None:
    scenario = from_commonroad(written(tmp_path, scene())).scenario
    walker = scenario.cast.people(0, scenario.path)[0]
    walker.advance(0.0, 1.1, FAR_AWAY)
    now = walker.now
    assert now is not None
    assert (now.x_m, now.y_m) == (pytest.approx(10.55), pytest.approx(3.0))
    assert (now.vx_mps, now.vy_mps) == (pytest.approx(0.5), pytest.approx(0.0))
    walker.advance(1.1, 6.0, FAR_AWAY)
    assert walker.now is None


def test_the_way_goes_straight_on_from_the_nearest_place_of_the_lane(tmp_path: Path) -> None:
    scenario = from_commonroad(written(tmp_path, scene()), length_m=40.0).scenario
    assert scenario.waypoints[0] == pytest.approx((4.0, 0.0))
    assert scenario.waypoints[3] == pytest.approx((16.0, 0.0))
    assert scenario.waypoints[-1][1] == pytest.approx(1.0, abs=0.3)
    assert scenario.path.length_m == pytest.approx(40.0, abs=0.1)
    assert (scenario.name, scenario.title) == ("t-1", "CommonRoad T-1")
    assert scenario.passed_m < scenario.path.length_m
    assert not scenario.expected


def test_where_nothing_follows_the_way_ends(tmp_path: Path) -> None:
    scenario = from_commonroad(written(tmp_path, scene()), length_m=500.0).scenario
    assert scenario.waypoints[-1] == pytest.approx((60.0, 1.0))


def test_a_lane_the_other_way_is_not_taken(tmp_path: Path) -> None:
    back = PROBLEM.replace("0.1</exact>", "3.1</exact>")
    scenario = from_commonroad(written(tmp_path, scene(problem=back).replace("<x>4.0", "<x>50.0")))
    assert scenario.scenario.waypoints[0] == pytest.approx((50.0, 0.8))
    assert scenario.scenario.waypoints[-1] == pytest.approx((0.0, 0.8))


def test_cars_are_named_or_taken_as_discs(tmp_path: Path) -> None:
    file = written(tmp_path, scene())
    notes = from_commonroad(file).notes
    assert "left out: car 9" in notes
    assert any("0.50 m from the file's place" in note for note in notes)
    car = _people(file, with_vehicles=True)[2]
    assert (car.tracks[0].kind, car.radius_m) == ("car", 2.5)
    assert not any("car 9" in note for note in from_commonroad(file, with_vehicles=True).notes)


def test_what_breaks_the_guard_and_what_stands_is_named(tmp_path: Path) -> None:
    fast = obstacle(7, "pedestrian", CIRCLE, [(0.6 * k, 3.0) for k in range(9)])
    parked = '<staticObstacle id="5"><type>parkedVehicle</type></staticObstacle>'
    notes = from_commonroad(written(tmp_path, scene(obstacles=fast + parked))).notes
    assert "pedestrian ped 7 moves at up to 3.0 m/s" in notes
    assert "left out: 1 static obstacles" in notes


_EVIL = """<?xml version="1.0"?><!DOCTYPE commonRoad [<!ENTITY a "aaaaaaaaaa">
<!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c SYSTEM "file:///etc/hostname">]>"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (scene(top=_EVIL), "DOCTYPE"),
        (scene(top="<!DOCTYPE commonRoad SYSTEM 'http://example.org/a.dtd'>"), "DOCTYPE"),
        (scene().replace("</commonRoad>", ""), "expected XML"),
        ("", "expected XML"),
        ("<other/>", "expected <commonRoad> of version 2018b or 2020a, got <other>"),
        (scene("2017a"), "got <commonRoad> of version 2017a"),
        (scene().replace('timeStepSize="0.2"', 'timeStepSize="0"'), "timeStepSize: expected"),
        (scene().replace("<x>10.0</x><y>3.0</y>", "<x>nan</x><y>3.0</y>"), "a finite number"),
        (scene().replace("<x>10.0</x><y>3.0</y>", "<y>3.0</y>"), "expected one <x>, got 0"),
        (scene(problem=""), "expected a <planningProblem>, got none"),
        (scene(problem=PROBLEM + PROBLEM.replace("100", "101")), "101, got no choice; keep"),
        (scene(lanes=""), "a lanelet within 5 m"),
        (scene(problem=PROBLEM.replace("0.5</y>", "50</y>")), "a lanelet within 5 m"),
        (scene(lanes=lanelet(1, [(0.0, 0.0), (9.0, 0.0)])), "16 m of lanelets ahead, got 5.0 m"),
        (scene(lanes=LANES.replace('ref="3"', 'ref="33"')), "successors of this file, got '33'"),
        (scene(lanes=LANES.replace("<point><x>0.0</x><y>2.0</y></point>", "", 1)), "got 2 and 3"),
        (scene(obstacles=obstacle(7, "pedestrian", "<box/>", WALK)), "got <box>"),
        (scene(obstacles=obstacle(7, "pedestrian", "", WALK)), "polygon, got nothing"),
        (scene().replace("trajectory>", "occupancySet>"), "occupancies are not imported"),
        (
            scene().replace("<exact>6</exact>", "<intervalStart>6</intervalStart>"),
            "expected <exact>, got an interval",
        ),
        (
            scene(problem=PROBLEM.replace("point>", "rectangle>")),
            "expected <point>, got an area",
        ),
        (scene().replace("<time><exact>7<", "<time><exact>6<"), "expected a time after"),
    ],
)  # fmt: skip
def test_what_is_not_supported_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        from_commonroad(written(tmp_path, text))
    assert "T-1.xml" in str(refused.value)


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"can be read, got: No such file or directory$"):
        from_commonroad(tmp_path / "nothing.xml")
    (tmp_path / "broken.xml.gz").write_bytes(b"no gzip")
    with pytest.raises(InputError, match=r"can be read"):
        from_commonroad(tmp_path / "broken.xml.gz")


def test_a_bomb_of_zeros_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path, " " * (64 * 2**20 + 1), packed=True)
    with pytest.raises(InputError, match="64 MiB"):
        from_commonroad(file)


def test_one_of_several_planning_problems_can_be_chosen(tmp_path: Path) -> None:
    other = PROBLEM.replace("100", "101").replace("<x>4.0", "<x>8.0")
    file = written(tmp_path, scene(problem=PROBLEM + other))
    assert from_commonroad(file, problem="101").scenario.waypoints[0] == pytest.approx((8.0, 0.0))


def test_shapes_off_their_centre_and_polygons_are_contained(tmp_path: Path) -> None:
    moved = CAR.replace("</width>", "</width><center><x>3</x><y>4</y></center>")
    corners = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in ((1, 0), (0, 2), (-3, 0)))
    for shape, radius_m in ((moved, 7.5), (f"<polygon>{corners}</polygon>", 3.0)):
        people = _people(written(tmp_path, scene(obstacles=obstacle(7, "pedestrian", shape, WALK))))
        assert people[0].radius_m == pytest.approx(radius_m)


@pytest.mark.skipif("WORKBENCH_DATA" not in os.environ, reason="needs WORKBENCH_DATA")
def test_a_scenario_of_the_collection_is_read() -> None:
    file = Path(os.environ["WORKBENCH_DATA"]) / "traf22" / "BEL_Putte-4_2_T-1.xml.gz"
    imported = from_commonroad(file, with_vehicles=True)
    assert imported.scenario.path.length_m == pytest.approx(60.0, abs=0.1)
    assert len(imported.scenario.cast.people(0, imported.scenario.path)) == 6


def test_states_are_told_apart_by_their_times(tmp_path: Path) -> None:
    late = PROBLEM.replace(
        state("initialState", 5, 4.0, 0.5, "<orientation><exact>0.1</exact></orientation>"),
        state("initialState", 9, 4.0, 0.5, "<orientation><exact>0.1</exact></orientation>"),
    )
    walker = _people(written(tmp_path, scene(problem=late)))[0]
    assert walker.tracks[0].t_s[0] == pytest.approx(-0.8)
