"""Claim: what is wrong in a scenario file is refused: what was expected, what came, and where."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario_cases import ALL, load
from workbench.errors import InputError
from workbench.simulation.scenarios.scenario_file import load_scenario


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('title = "A title"', "", "the file lacks the key title"),
        ("duration_s = 20", "duration = 20", "unknown key 'duration' in the file"),
        ("duration_s = 20", "duration_s = 0", "duration_s: expected 0.1 to 3600 s, got 0"),
        ("duration_s = 20", "duration_s = 0.001", "expected 0.1 to 3600 s, got 0.001"),
        ("duration_s = 20", "duration_s = 3601", "expected 0.1 to 3600 s, got 3601"),
        ("duration_s = 20", "duration_s = true", "duration_s: expected a finite number, got True"),
        ("passed_m = 25.0", "passed_m = 40.0", "between 0 and 30.0 m"),
        ("passed_m = 25.0", "passed_m = nan", "passed_m: expected a finite number"),
        ("[30, 0]]", "[30, 0, 1]]", "waypoints: expected 2 numbers each"),
        ("[30, 0]]", "[30, 'a']]", "waypoints: expected a finite number, got 'a'"),
        ("[20, 0], [30, 0]]", "[10, 0]]", "expected distinct neighbours"),
        ("waypoints = [[", "waypoints = 3 # [[", "waypoints: expected a list of lists"),
        ('both = "any"', "", r"\[expected\] lacks the key both"),
        ('both = "any"', 'both = "stops"', "expected one of passes, brakes, brakes_blind"),
        ('both = "any"', "both = 1", r"\[expected\] both: expected one of"),
        ('both = "any"', 'both = "any"\nTogether = "any"', "unknown key 'Together'"),
        ("position_m = 0.07", "position_m = -0.07", "position_m: expected a number of at least 0"),
        ("dropped = 0.1", "dropped = 1.0", "a number of at least 0, below 1, got 1"),
        ("watched_m = 25.0", "watched_m = 0.0", "watched_m: expected a number above 0, got 0"),
        ("delay_s = [0.02, 0.05]", "delay_s = [0.05, 0.02]", "lowest <= highest"),
        ("delay_s = [0.02, 0.05]", "delay_s = [-0.02, 0.05]", "delay_s: expected 0 s or more"),
        ("assumes_unseen = false", "assumes_unseen = 0", "expected true or false, got 0"),
        ("heading_rad = 0.01", "heading = 0.01", r"unknown key 'heading' in \[sensing\]"),
        ('what = "localisation"', 'what = "camera"', "expected one of localisation, people"),
        ("until_s = 4.5", "until_s = 3.0", "expected from_s < until_s, got 3 and 3"),
        ("until_s = 4.5", "", r"\[\[sensing.dropouts\]\] number 1 lacks the key until_s"),
        ("x_m = 12.0\ny_m = 1.0", "x_m = 12.0", r"ghosts\]\] number 1 lacks the key y_m"),
        ("x_max_m = 14.0", "x_max_m = 9.0", "expected a box with min < max"),
        ("spread_m = 1.5", "spread_m = 0.0", "a spread above zero"),
        ('walker = "standing"', 'walker = "sleeping"', "walker: expected one of scr"),
        ('walker = "standing"', "", r"\[\[people\]\] number 2 lacks the key walker"),
        ('name = "two"', 'name = "one"', "person 'one' stands twice"),
        ('name = "two"', 'name = "three 1"', "person 'three 1' stands twice"),
        ('name = "two"', 'name = ""', r"number 2 name: expected a text"),
        ('frame = "path"\nbegin = [12', 'frame = "road"\nbegin = [12', "'plane' or 'path'"),
        ('name = "two"', 'name = "two"\nkind = "dragon"', "kind: expected one of ped, sitting, "),
        ("begin = [12.0, -3.0]", "begin = [1e308, -3.0]", "within 1000 m of the path, whose st"),
        ("begin = [12.0, -3.0]", "begin = [12.0, -1e6]", r"got \[12, -1e\+06\]"),
        ("begin = [12.0, -3.0]", "begin = [12.0]", "number 2 begin: expected two numbers"),
        ("body_radius_m = 0.8", "body_radius_m = 0.0", "expected a body radius above 0 m"),
        ("speed_mps = 1.5 }", "speed_mps = 0.0 }", "leg 1: leg: expected finite"),
        ("at_s = 2.0", "at_s = 2.0, car_within_m = 1.0", "leg 2: expected one of at_s"),
        ("at_s = 2.0", "when_s = 2.0", "unknown key 'when_s' in .* leg 2"),
        ("there_s = [0.0, 12.0]", "there_s = [12.0, 0.0]", "lowest <= highest"),
        ("offsets = [[0.0, 0.0], [1.0, 0.5]]", "offsets = []", "expected at least one"),
        ("legs = [\n", "legs = [3,\n", "expected a list of tables"),
        ("car_within_m = 9.0\n", "", "number 5: expected one of at_s"),
        ("velocity = [0.0, -1.0]", "velocity = [0.0, -3.0]", "a velocity of at most 2.2 m/s"),
        ("limits = [2.2, 1.1]", "limits = [2.2]", "limits: expected two numbers"),
        ("gives_up_s = 8.0", "gives_up_s = -8.0", "gives_up_s: expected a number >= 0"),
        ("hold_s = [0.5, 1.5]", "hold_s = [0.0, 1.5]", "hold_s: expected"),
        ("noise_mps2 = 0.3", "noise_mps2 = -0.3", "noise_mps2: expected a number >= 0"),
        ("goals = [[9.0, 3.0]]", "goals = []", "at least one goal"),
        ("obstacle = [2.0, 0.4]", "obstacle = [2.0, 0.0]", "reach > 0"),
        ('recording = "square"', 'recording = "circle"', "people of recording 'circle'"),
        ('agents = ["7"]', 'agents = ["6"]', "no '6' in this recording, which has 7, 8"),
        ('agents = ["7"]', "agents = [7]", "agents: expected a list of texts"),
        ('folder = "records"', 'folder = "tapes"', "tapes"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_and_said(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in ALL
    with pytest.raises(InputError, match=said) as refused:
        load(tmp_path, ALL.replace(old, new, 1))
    assert "scene.toml" in str(refused.value)


def test_names_missing_files_and_broken_ones_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="rename the file"):
        load(tmp_path, ALL, name="My Scene")
    with pytest.raises(InputError, match="no such scenario file"):
        load_scenario(tmp_path / "nothing.toml")
    with pytest.raises(InputError, match="expected a TOML file"):
        load(tmp_path, "title = ")


def test_an_infinite_number_is_no_number(tmp_path: Path) -> None:
    for word in ("inf", "-inf", "nan"):
        with pytest.raises(InputError, match="finite"):
            load(tmp_path, ALL.replace("speed_mps = 1.5 }", f"speed_mps = {word} }}", 1))
