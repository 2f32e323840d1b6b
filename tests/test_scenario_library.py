"""Claim: the library has the scenes it is said to have, every one of them can be run, nobody in it
breaks the guard unless its story says so, and the documents list it as it is."""

from __future__ import annotations

import functools
import math
from pathlib import Path

import pytest

from workbench.cli.main import main
from workbench.errors import InputError
from workbench.simulation.people import Body
from workbench.simulation.scenarios.listing import library_table
from workbench.simulation.scenarios.scenario import Expected, Scenario
from workbench.simulation.scenarios.scenario_file import LIBRARY, POLICIES
from workbench.simulation.scenarios.shipped import library, named
from workbench.simulation.walkers.moving import GUARD
from workbench.simulation.walkers.pedestrian import CarNow

_STEP_S = 0.05
_WHEELS_MPS, _WHEELS_MPS2 = 7.0, 3.0
_BREAKS = "no proof covers"
"""What stories say of scenes in which somebody breaks the guard."""
_DOCS = Path(__file__).parents[1] / "docs" / "scenarios.md"
_PAPER = (
    "paper_alongside_simulation", "paper_alongside_vehicle", "paper_crossing_simulation",
    "paper_crossing_vehicle",
)  # fmt: skip


@functools.cache
def _scenario(name: str) -> Scenario:
    return named(name)


def _undisturbed(scenario: Scenario) -> tuple[float, float, float]:
    """Smallest gap (m) to a car that drives without looking, and the largest speed (m/s) and
    acceleration (m/s^2) on foot; on wheels as shares of their limits, in the same units."""
    path, t_s, station_m, speed = scenario.path, 0.0, 0.0, 0.0
    people = scenario.cast.people(0, path)
    gap, fastest, hardest = math.inf, 0.0, 0.0
    while station_m < path.length_m and t_s < scenario.duration_s:
        (x, y), heading = path.position(station_m), float(path.heading(station_m))
        car = CarNow(Body(float(x), float(y), heading, 2.26, 0.47, 0.88), speed, station_m)
        for person in people:
            before = person.now
            person.advance(t_s, t_s + _STEP_S, car)
            now = person.now
            if now is None or before is None:
                continue
            on_foot = now.kind in ("ped", "sitting")
            scale = 1.0 if on_foot else GUARD.speed_mps / _WHEELS_MPS
            push_scale = 1.0 if on_foot else GUARD.acceleration_mps2 / _WHEELS_MPS2
            turned = math.hypot(now.vx_mps - before.vx_mps, now.vy_mps - before.vy_mps)
            fastest = max(fastest, scale * math.hypot(now.vx_mps, now.vy_mps))
            hardest = max(hardest, push_scale * turned / _STEP_S)
            gap = min(gap, car.body.distance(now.x_m, now.y_m) - now.body_radius_m)
        speed = min(2.8, speed + 0.8 * _STEP_S)
        station_m, t_s = station_m + speed * _STEP_S, t_s + _STEP_S
    return gap, fastest, hardest


def test_the_papers_four_and_many_more_are_there() -> None:
    assert set(_PAPER) <= set(library())
    assert len(library()) >= 36
    assert library() == tuple(sorted(file.stem for file in LIBRARY.iterdir()))


@pytest.mark.parametrize("name", library())
def test_every_scene_says_something_of_every_policy(name: str) -> None:
    scenario = _scenario(name)
    assert set(scenario.expected) == set(POLICIES)
    assert 30.0 <= scenario.path.length_m <= 61.0
    stations = [scenario.path.length_m * k / 200 for k in range(201)]
    assert abs(scenario.path.curvature(stations)).max() < 1.0 / 12.0
    # At 2 m/s the car gets behind what the scenario is about.
    assert scenario.passed_m / 2.0 < scenario.duration_s


@pytest.mark.parametrize("name", library())
def test_nobody_breaks_the_guard_without_saying_so(name: str) -> None:
    scenario = _scenario(name)
    gap, fastest, hardest = _undisturbed(scenario)
    breaks = _BREAKS in scenario.story
    assert breaks or (fastest <= GUARD.speed_mps and hardest <= GUARD.acceleration_mps2 + 1e-9)
    # Who promises to pass does so without braking: an undisturbed car must touch nobody.
    assert Expected.PASSES not in scenario.expected.values() or gap > 0.0


def test_few_scenes_break_the_guard() -> None:
    breaking = {name for name in library() if _BREAKS in _scenario(name).story}
    assert breaking == {"child_too_fast", "wall_child_unseen"}


@pytest.mark.parametrize("name", library())
def test_a_proof_is_never_expected_to_fail(name: str) -> None:
    scenario = _scenario(name)
    safe = {scenario.expected["FailSafe"], scenario.expected["both"]}
    assert Expected.COLLIDES not in safe or _BREAKS in scenario.story


@pytest.mark.parametrize("name", library())
def test_both_brake_where_either_does(name: str) -> None:
    expected = _scenario(name).expected
    each = {expected["LookAhead"], expected["FailSafe"]}
    if expected["both"] is Expected.PASSES:
        assert each == {Expected.PASSES}
    if Expected.STAYS in each:
        assert expected["both"] is Expected.STAYS


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("paper", "or paper_crossing_simulation or paper_crossing_vehicle?"),
        ("nobody_s_bent", "did you mean nobody_s_bend"),
        ("zzz", "got 'zzz'"),
    ],
)
def test_unknown_names_are_refused_with_those_that_may_be_meant(name: str, meant: str) -> None:
    with pytest.raises(InputError) as refused:
        named(name)
    assert "`workbench simulate --list` has all" in str(refused.value)
    assert str(refused.value).endswith(f"got {name!r}" if name == "zzz" else "?")
    assert meant in str(refused.value)


@pytest.mark.parametrize(
    "command", [["simulate"], ["drives"], ["reproduce", "paper", "--quick", "--scenario"]]
)
def test_every_command_answers_a_misspelt_name_alike(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command, "crosing_group", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "expected the name of a scenario" in said
    assert "; did you mean crossing_group" in said
    assert not (tmp_path / "out").exists()


def test_the_documents_list_the_library_as_it_is() -> None:
    begin, end = "<!-- library begins -->\n", "<!-- library ends -->"
    listed = _DOCS.read_text(encoding="utf-8").split(begin)[1].split(end)[0]
    assert listed.strip() == library_table().strip()
