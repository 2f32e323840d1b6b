"""The command line answers every failure in one sentence and never leaves half a file."""

from __future__ import annotations

import argparse
import enum
import io
import json
import math
import os
import subprocess
import sys
import types
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.cli.common import replacing, writable_folder, write_text
from workbench.cli.main import COMMANDS, load_command, main
from workbench.cli.output import Progress, emit, plain
from workbench.errors import InputError

ROOT = Path(__file__).parent.parent


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    """A module in the place of `workbench derive`; a test sets its `run`."""
    module = types.ModuleType("workbench.cli.derive")
    module.HELP, module.EXAMPLE = "Stands in.", "workbench derive"
    module.configure = lambda parser: None
    monkeypatch.setitem(sys.modules, module.__name__, module)
    return module


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_shows_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name, "--help"]) == 0
    shown = capsys.readouterr().out
    assert f"example:\n  workbench {name}" in shown
    assert "--json" in shown
    assert load_command(name).help[-1] == "."


def test_help_and_version_load_the_standard_library_only() -> None:
    program = (
        "import sys; before = set(sys.modules); from workbench.cli.main import main; "
        "main(['--help']); main(['--version']); "
        "roots = {n.partition('.')[0] for n in set(sys.modules) - before}; "
        "print(sorted(roots - sys.stdlib_module_names), file=sys.stderr)"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert result.stderr.strip() == "['workbench']"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["derve"], "did you mean 'derive'?"),
        (["zzz"], "unknown command 'zzz'; the commands are derive"),
        ([], "expected a command, got none"),
    ],
)
def test_an_unknown_command_is_wrong_use(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (InputError("expected a, got b; do c"), 2, "workbench derive: expected a, got b; do c\n"),
        (FileNotFoundError(2, "No such file", "car.toml"), 2, "derive: car.toml: No such file\n"),
        (KeyboardInterrupt(), 130, "workbench derive: interrupted\n"),
        (
            ModuleNotFoundError("no", name="casadi.tools"),
            2,
            "`workbench derive` needs the analysis extra (casadi is missing): "
            "pip install 'reach-workbench[analysis]'\n",
        ),
        (ModuleNotFoundError("no", name="optuna"), 2, "pip install 'reach-workbench[study]'\n"),
        (ZeroDivisionError(), 70, "a defect of workbench"),
        (ModuleNotFoundError("no", name="workbench.gone"), 70, "a defect of workbench"),
    ],
)
def test_failures_become_one_sentence(
    error: BaseException,
    status: int,
    said: str,
    stand_in: types.ModuleType,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def run(args: argparse.Namespace) -> int:
        raise error

    stand_in.run = run
    assert main(["derive"]) == status
    shown = capsys.readouterr()
    assert said in shown.err
    assert ("Traceback" in shown.err) == (status == 70)
    assert shown.out == ""


def test_a_missing_module_leaves_the_others_working(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(COMMANDS, "absent", "not there")
    assert main(["absent"]) == 2
    assert "this installation lacks it" in capsys.readouterr().err
    assert main(["new", "--help"]) == 0


def test_a_failing_claim_is_status_1(stand_in: types.ModuleType) -> None:
    stand_in.run = lambda args: 1
    assert main(["derive"]) == 1
    assert main(["derive", "--no-such-option"]) == 2


def test_a_reader_that_goes_away_is_no_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "workbench.cli.main", "--help"]
    result = subprocess.run(command, cwd=ROOT, stdout=writer, stderr=subprocess.PIPE, check=False)
    os.close(writer)
    assert (result.returncode, result.stderr) == (141, b"")


class Colour(enum.IntEnum):
    RED = 1


@dataclass(frozen=True)
class Holder:
    values: np.ndarray
    colour: Colour


def test_json_names_members_and_opens_arrays(capsys: pytest.CaptureFixture[str]) -> None:
    data = {
        "h": Holder(np.array([1.0, math.nan]), Colour.RED),
        Colour.RED: Path("a"),
        "n": np.int64(3),
    }
    emit(argparse.Namespace(json=True), "text", data)
    expected = {"h": {"values": [1.0, None], "colour": "RED"}, "RED": "a", "n": 3}
    assert json.loads(capsys.readouterr().out) == expected
    emit(argparse.Namespace(json=False), "text", data)
    assert capsys.readouterr().out == "text\n"


@given(st.recursive(st.floats() | st.text() | st.none(), st.lists, max_leaves=20))
def test_json_is_always_strict_json(data: object) -> None:
    json.dumps(plain(data), allow_nan=False)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_json_keeps_finite_numbers_exactly(number: float) -> None:
    assert json.loads(json.dumps(plain(np.float64(number)))) == number


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_ends_at_its_end() -> None:
    terminal, file = Terminal(), io.StringIO()
    for stream in (terminal, file):
        with Progress("sampling", 4, stream=stream) as progress:
            progress.advance(3)
    assert terminal.getvalue().endswith("100%    0.0 s\n")
    assert "\r" in terminal.getvalue()
    assert file.getvalue() == "sampling: 100%    0.0 s\n"


def test_progress_does_not_claim_the_end_after_an_error() -> None:
    file = io.StringIO()
    with pytest.raises(ValueError, match="stop"), Progress("sampling", 4, stream=file) as progress:
        progress.advance(2)
        raise ValueError("stop")
    assert " 50%" in file.getvalue()
    with pytest.raises(ValueError, match="at least 1"):
        Progress("nothing", 0)


@pytest.mark.parametrize("parent", ["a file", "/proc"])
def test_a_folder_that_cannot_be_written_is_refused_up_front(tmp_path: Path, parent: str) -> None:
    occupied = tmp_path / "a file"
    occupied.write_text("")
    with pytest.raises(InputError, match="choose another with --out"):
        writable_folder(tmp_path / parent / "out")


def test_a_folder_that_can_be_written_is_created_and_left_empty(tmp_path: Path) -> None:
    folder = writable_folder(tmp_path / "a" / "b")
    assert list(folder.iterdir()) == []


def test_nothing_half_written_stays(tmp_path: Path) -> None:
    target = tmp_path / "report.html"
    write_text(target, "whole")
    with pytest.raises(ValueError, match="midway"), replacing(target) as temporary:
        temporary.write_text("ha")
        raise ValueError("midway")
    assert target.read_text() == "whole"
    write_text(target, "new")
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["build", "--horizn", "3"], "--horizn: did you mean --horizon?"),
        (["build", "--horizn=3"], "--horizn: did you mean --horizon?"),
        (["replay", "x", "--recordng", "y"], "--recordng: did you mean --recording?"),
    ],
)
def test_a_misspelt_option_gets_a_hint(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    assert said in capsys.readouterr().err
    assert main(["build", "--qqqq"]) == 2
    assert "did you mean" not in capsys.readouterr().err


def test_a_task_too_large_for_memory_is_wrong_use(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def too_large(_name: str) -> None:
        raise MemoryError("Unable to allocate 6.04 PiB")

    monkeypatch.setattr("workbench.cli.main.load_command", too_large)
    assert main(["campaign"]) == 2
    said = capsys.readouterr().err
    assert "a task that fits in memory (Unable to allocate 6.04 PiB); ask for less" in said
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize("kind", ["model", "study"])
def test_a_new_example_runs(kind: str, tmp_path: Path) -> None:
    assert main(["new", kind, "first_try", "--out", str(tmp_path)]) == 0
    file = tmp_path / "first_try.py"
    assert "example_" not in file.read_text()
    ran = subprocess.run(
        [sys.executable, str(file)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert ran.returncode == 0, ran.stderr
    assert "ENCLOSED" in ran.stdout or "NUMERICAL" in ran.stdout


def test_a_new_vehicle_loads_under_its_name(tmp_path: Path) -> None:
    from workbench.models.vehicle import load_vehicle

    assert main(["new", "vehicle", "shuttle_7", "--out", str(tmp_path)]) == 0
    assert load_vehicle(tmp_path / "shuttle_7.toml").name == "shuttle_7"


def test_new_never_overwrites_unasked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mine.py"
    file.write_text("precious")
    assert main(["new", "model", "mine", "--out", str(tmp_path)]) == 2
    assert "--force" in capsys.readouterr().err
    assert file.read_text() == "precious"
    assert main(["new", "model", "mine", "--out", str(tmp_path), "--force"]) == 0
    assert file.read_text() != "precious"


@pytest.mark.parametrize("name", ["", "Upper", "7th", "a/b", "../up", "a b"])
def test_new_refuses_a_name_that_is_no_name(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", "model", name, "--out", str(tmp_path)]) == 2
    assert "for example my_model" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
