"""Wrong use of an analysis command is refused in words, before anything is computed or written."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from cli_fixture import SHORT, changed_vehicle, invoke

BROKEN_FILE = "<broken>"
WRONG_USE: list[tuple[str, str]] = [
    ("{c} --vehicle nowhere.toml", "nowhere.toml: no such vehicle file; copy the shipped one"),
    ("{c} --vehicle " + BROKEN_FILE, "expected a TOML file, but: "),
    ("{c} --horizon -1", "--horizon: expected a finite number > 0, got '-1'"),
    ("{c} --horizon nan", "--horizon: expected a finite number > 0, got 'nan'"),
    ("{c} --horizon 1e9", "--horizon: expected at most 60 s, got 1e+09"),
    ("{c} --step 0", "--step: expected a finite number > 0, got '0'"),
    ("{c} --step 1e-9", "expected at most 20000 steps, got --horizon 3 / --step 1e-09"),
    ("{c} --step 5", "expected --step <= --horizon, got 5 s and 3 s"),
]
COMMANDS = ("derive", "learn", "examine --out {tmp}", "reach", "gains")


@pytest.mark.parametrize(
    ("line", "said"),
    [(line.replace("{c}", command), said) for line, said in WRONG_USE for command in COMMANDS]
    + [
        ("reach --plot /dev/null/x.html", "a part of its path is a file, not a folder"),
        ("reach --csv /dev/null/x/y.csv", "--csv: expected a file that can be written"),
        ("reach --csv {tmp}", "(it is a folder); name one in another folder"),
        ("derive --plot /dev/null/x.html", "--plot: expected a file that can be written"),
        ("learn --save /dev/null/x.json", "--save: expected a file that can be written"),
        ("examine --out /dev/null/x", "choose another with --out DIR"),
        ("reach --parts height=2", "unknown state 'height'; the states are station, offset"),
        ("reach --parts offset", "expected STATE=N,... with each state once"),
        ("reach --parts offset=0", "N from 1 to 9999, got 'offset=0'"),
        ("reach --parts offset=2,offset=2", "with each state once"),
        ("reach --parts speed_integral=2", "speed_integral is exactly 0 there; leave it out"),
        ("reach --parts offset=999,speed=999", "expected at most 4096 cells in all, got 998001"),
        ("reach --curvature 0.2 0.1", "expected LOW <= HIGH, got 0.2 0.1; swap"),
        ("reach --curvature nan 1", "--curvature: expected a finite number, got 'nan'"),
        ("reach --system b9", "--system: invalid choice: 'b9'"),
        ("reach --csv {tmp}/a --plot {tmp}/b/../a", "different files for --csv and --plot"),
        ("derive --plot {tmp}/a --certificate {tmp}/a", "different files for --plot and"),
        ("derive --method local-blocks --certificate {tmp}/a", "methods over the region"),
        ("derive --cells 1000000000000", "--cells: expected at most 100000"),
        ("bench --board cold-start --bundle {tmp}/none", "--bundle: expected a bundle folder"),
        ("reach --system b1 --curvature 0 0", "expected --system or --curvature, got both"),
        ("reach --system b1 --unsure", "--unsure: expected the vehicle's continuous loop"),
        ("reach --sampled --unsure", "--unsure: expected the vehicle's continuous loop, got --sam"),
        ("derive --system b1 --vehicle x", "expected --system or --vehicle, got both"),
        ("derive --system b1 --over operation", "has no operating region; use --over tube"),
        ("derive --method nothing", "invalid choice: 'nothing'"),
        ("derive --certificate /dev/null/x", "--certificate: expected a file that can be written"),
        ("derive --cells 0", "--cells: expected a whole number >= 1, got '0'"),
        ("learn --pairs 1.5", "--pairs: expected a whole number >= 1, got '1.5'"),
        ("learn --delta 1", "--delta: expected a number between 0 and 1, got '1'"),
        ("learn --epsilon 1e-9", "expected at most 2000000 pairs"),
        ("learn --seed -3", "--seed: expected a whole number >= 0, got '-3'"),
        ("learn --pairs 5 --epsilon 0.1", "not allowed with argument"),
        ("learn --from nowhere", "FILE.py:FUNCTION, got 'nowhere', which is no folder"),
        ("learn --from {tmp}", "expected runs.csv (`workbench drives` writes it) or vehicles.csv"),
        ("learn --from none.py:f", "--start: expected the states of the function"),
        ("learn --from none.py:f --start x 0 1", "expected a Python file that can be read, got no"),
        ("learn --from none.py:f --start x 1 0", "none.py"),
        ("learn --start x 0 1", "--start: expected --from FILE.py:FUNCTION, got --from model"),
        ("learn --radius x 1", "--radius: expected --from with a folder of runs, got --from mod"),
        ("learn --from single-track --system b1", "--system: expected --from model, got --from si"),
        ("learn --from bicycle --curvature 0 1", "--curvature: expected one curvature for --from"),
        ("learn --jobs 0", "--jobs: expected a whole number >= 1, got 0"),
        ("learn --pieces 3", "--pieces: expected --form piecewise or matrix, got --form set"),
        ("learn --published --form matrix", "expected --published or --form, got both"),
        ("learn --published --resume {tmp}/a", "simulator to start ten runs of, got --resume"),
        ("learn --resume {tmp}", "expected a folder of drawn pairs or an empty one, got other fil"),
        ("learn --system b1 --step 0.7", "whole steps, got --horizon 3 and --step 0.7; give"),
        ("examine --out {tmp} --step 0.7", "whole steps, got --horizon 3 and --step 0.7; give"),
        ("reach --plot {tmp}/new/a.html --parts height=2", "unknown state 'height'"),
        ("examine --out {tmp} --learned none.json", "none.json: no such file"),
        ("examine --out {tmp} --learned " + BROKEN_FILE, "but it is not JSON"),
        ("examine --replay none.json", "none.json: no such file"),
    ],
)
def test_wrong_use_is_refused_in_words(line: str, said: str, tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    broken.write_text("[vehicle\nname = ", encoding="utf-8")
    words = line.replace("{tmp}", str(tmp_path)).replace(BROKEN_FILE, str(broken)).split()
    found = invoke(*words)
    assert found.status == 2
    assert said in found.err
    assert len(found.err.splitlines()) == 1
    assert found.out == ""
    assert sorted(tmp_path.iterdir()) == [broken]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("wheelbase_m = 1.75", "wheelbase_m = -1.75", "wheelbase_m: expected a number > 0, got -1"),
        ("wheelbase_m = 1.75", "wheel_m = 1.75", "unknown key 'wheel_m' in [geometry]"),
        ("look_ahead_m = 2.0", "look_ahead_m = nan", "look_ahead_m: expected a finite number"),
    ],
)
def test_a_wrong_vehicle_file_is_refused_in_words(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    file = changed_vehicle(tmp_path, old, new)
    for command in ("derive", "gains"):
        found = invoke(command, "--vehicle", file)
        assert found.status == 2
        assert f"{file}: " in found.err
        assert said in found.err


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"amplitude": [1.0]}, "expected 7 numbers per list, one per state"),
        ({"amplitude": [float("nan")] * 7}, "expected finite numbers"),
        ({"horizon_s": "soon"}, "could not convert string to float"),
        ({"horizon_s": 0.1}, "pass --horizon 0.1 or learn again"),
        ({"statements": None}, "expected the file as it was written"),
        ({"format": "another"}, 'without "format": "learned discrepancy 2"'),
        ({"format": "learned discrepancy 1"}, "got one of an earlier version of workbench; learn"),
        ({"source": "multi-body"}, "expected a bound learned from model, got one learned from mu"),
        ({"form": "other"}, "expected a form, one of exponential, set, piecewise, matrix"),
        ({"loop": {}}, "expected a file made with the loop of B1-small, got another"),
    ],
)
def test_a_spoilt_learned_file_is_refused_in_words(
    change: dict[str, object], said: str, tmp_path: Path
) -> None:
    saved = tmp_path / "learned.json"
    invoke("learn", *SHORT, "--pairs", "5", "--save", saved)
    saved.write_text(json.dumps(json.loads(saved.read_text()) | change))
    found = invoke("examine", *SHORT, "--learned", saved, "--out", tmp_path / "out")
    assert found.status == 2
    assert said in found.err


def test_a_folder_as_vehicle_is_named_with_a_mend(tmp_path: Path) -> None:
    result = invoke("gains", "--vehicle", tmp_path)
    assert result.status == 2
    assert f"{tmp_path}: expected a vehicle file that can be read, but: Is a dir" in result.err
    assert "name a TOML file, as " in result.err


def test_a_missing_learned_bound_says_what_writes_one(tmp_path: Path) -> None:
    for file in (tmp_path / "nope", tmp_path):
        result = invoke("examine", *SHORT, "--learned", file, "--out", tmp_path / "out")
        assert result.status == 2
        assert "expected a learned bound, written by `workbench learn --save FILE`" in result.err


@pytest.mark.parametrize(("pairs", "promised"), [(1, "nothing"), (40, "almost nothing")])
def test_too_few_pairs_are_warned_about(pairs: int, promised: str) -> None:
    result = invoke("learn", *SHORT, "--pairs", pairs)
    assert result.status == 0
    needed = re.search(rf"--pairs {pairs} promises {promised}: .* give --pairs (\d+)", result.err)
    assert needed, result.err
    enough = invoke("learn", *SHORT, "--pairs", needed[1], "--json")
    assert "promise" not in enough.err
    assert enough.data["statement"]["epsilon"] <= 0.05
    fewer = invoke("learn", *SHORT, "--pairs", int(needed[1]) - 1, "--json")
    assert fewer.data["statement"]["epsilon"] > 0.05
