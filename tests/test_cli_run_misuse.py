"""`build`, `replay` and `demo` answer bad input in one sentence and leave nothing half-written."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

from cli_fixture import changed_vehicle
from decision_fixture import real_files, write_real_bundle
from recordings_fixture import write_recordings

from workbench.cli.main import main
from workbench.codegen import MonitorSpec
from workbench.errors import InputError
from workbench.models.vehicle import gem_e2
from workbench.runtime.manifest import CHECKSUM_FILE, MANIFEST_FILE, checksums_text


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    return write_recordings(tmp_path / "recordings")


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a command that must end with exit status 2 and one sentence; returns the sentence."""

    def run(*words: str | Path) -> str:
        assert main([str(word) for word in words]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert "Traceback" not in err
        said = [line for line in err.splitlines() if not line.startswith(f"{words[0]}: ")]
        assert said, err
        assert said[0].startswith(f"workbench {words[0]}: ")
        return "\n".join(said)

    return run


def _names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.parametrize("command", ["build", "replay", "demo"])
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[geometry]", "[geometry", "TOML"),
        ("look_ahead_m", "look_ahed_m", "'look_ahead_m'"),
        (
            "wheelbase_m = 1.75",
            "wheelbase_m = -1.75",
            "wheelbase_m: expected a number > 0, got -1.75",
        ),
        ("wheelbase_m = 1.75", "wheelbase_m = nan", "wheelbase_m: expected a finite number"),
        ("wheelbase_m = 1.75", 'wheelbase_m = "long"', "expected a finite number, got 'long'"),
        ("[speed_pid]", "[speed_pids]", "speed_pid"),
    ],
)
def test_a_vehicle_file_that_cannot_be_is_named(  # noqa: PLR0913
    command: str,
    old: str,
    new: str,
    said: str,
    tmp_path: Path,
    recordings: Path,
    refused: Callable[..., str],
) -> None:
    path, out = changed_vehicle(tmp_path, old, new), tmp_path / "out"
    words = [recordings, "--recording", "peopled"] if command == "replay" else []
    message = refused(command, *words, "--vehicle", path, "--out", out)
    assert said in message
    assert not out.exists()


def test_a_missing_vehicle_file_says_where_one_is(
    tmp_path: Path, refused: Callable[..., str]
) -> None:
    message = refused("build", "--vehicle", tmp_path / "none.toml", "--out", tmp_path / "out")
    assert "no such vehicle file; copy the shipped one" in message
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ["build", "replay"])
@pytest.mark.parametrize(
    ("grid", "said"),
    [
        (["--step", "0.07"], "--step 0.07 = 42.8571 steps; give --horizon 3.01"),
        (["--step", "4"], "expected --step <= --horizon, got 4 s and 3 s; shorten the step"),
        (["--horizon", "1e5"], "--horizon: expected at most 60 s, got 100000"),
        (["--horizon", "60"], "expected at most 350 steps, got --horizon 60 / --step 0.025"),
    ],
)
def test_an_impossible_grid_is_refused(
    command: str,
    grid: list[str],
    said: str,
    tmp_path: Path,
    recordings: Path,
    refused: Callable[..., str],
) -> None:
    words = [recordings, "--recording", "peopled"] if command == "replay" else []
    assert said in refused(command, *words, *grid, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ["build", "replay"])
@pytest.mark.parametrize(("option", "value"), [("--horizon", "-3"), ("--step", "nan")])
def test_an_impossible_number_is_refused_with_its_option(
    command: str, option: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(tmp_path), "--recording", "a"] if command == "replay" else []
    assert main([command, *words, option, value, "--out", str(tmp_path / "out")]) == 2
    assert f"{option}: expected a finite number > 0, got '{value}'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("horizon_s", "step_s"), [(1e5, 0.025), (61.0, 1.0), (60.0, 0.025), (math.nan, 0.1)]
)
def test_a_bundle_too_large_to_compile_is_refused_in_the_library_too(
    horizon_s: float, step_s: float
) -> None:
    with pytest.raises(InputError, match="give"):
        MonitorSpec(gem_e2(), horizon_s, step_s)
    assert MonitorSpec(gem_e2(), 8.75, 0.025).steps == 350


@pytest.mark.parametrize(
    ("command", "option", "known"),
    [
        ("build", "--deciding", ("both", "LookAhead", "FailSafe")),
        ("build", "--deciding-level", ("whole", "two thirds", "one third")),
    ],
)
def test_who_decides_must_exist(
    command: str, option: str, known: tuple[str, ...], tmp_path: Path, capsys: Any
) -> None:
    assert main([command, option, "neither", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert all(name in said for name in ("'neither'", *known))


def test_a_failed_compilation_leaves_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Callable[..., str]
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    refused("build", "--horizon", "0.1", "--step", "0.05", "--out", tmp_path / "a" / "b")
    assert not _names(tmp_path)


@pytest.mark.parametrize(
    ("stem", "change", "said"),
    [
        ("vehicles", lambda text: "", "is empty; expected a header row"),
        ("vehicles", lambda text: text.splitlines()[0] + "\n", "has no vehicle"),
        ("vehicles", lambda text: text.replace("2.500", "nan", 1), "line 2, column 'v'"),
        ("peds", lambda text: text.replace("6.0", "NaN", 1), "line 2, column 'x'"),
        ("peds", lambda text: "", "is empty; expected a header row"),
        ("peds", lambda text: text.replace("recording,agent", "agent", 1), "recording"),
        ("shapes", lambda text: text.replace("1.75", "-1.75"), "expected metres above zero"),
        ("shapes", lambda text: text.splitlines()[0] + "\n", "no row for recording 'peopled'"),
        ("vehicles", None, "expected vehicles.csv.gz or vehicles.csv"),
    ],
)
def test_a_recording_that_cannot_be_read_is_named(
    stem: str,
    change: Callable[[str], str] | None,
    said: str,
    recordings: Path,
    tmp_path: Path,
    refused: Callable[..., str],
) -> None:
    path, out = recordings / f"{stem}.csv", tmp_path / "out"
    if change is None:
        path.unlink()
    else:
        path.write_text(change(path.read_text()))
    message = refused("replay", recordings, "--recording", "peopled", "--out", out)
    assert said in message
    assert stem in message
    assert not out.exists()


def test_unknown_recordings_and_folders_are_named(
    recordings: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    out = tmp_path / "out"
    message = refused("replay", recordings, "--recording", "peoplde", "--out", out)
    assert "no recording 'peoplde'" in message
    assert "nearest first: peopled, empty" in message
    message = refused("replay", tmp_path / "away", "--recording", "peopled", "--out", out)
    assert "expected a folder of recordings" in message
    message = refused(
        "replay", recordings, "--recording", "peopled", "--agent", "bus", "--out", out
    )
    assert "no vehicle 'bus'; it has ego" in message
    assert not out.exists()


def _flip(bundle: Path, name: str) -> None:
    content = bytearray((bundle / name).read_bytes())
    content[len(content) // 2] ^= 1
    (bundle / name).write_bytes(content)


def _rehashed(bundle: Path, **changed: bytes) -> None:
    files = {name: content for name, content in real_files().items() if name != CHECKSUM_FILE}
    for name, content in changed.items():
        files[name.replace("_", ".")] = content
    for name, content in (files | {CHECKSUM_FILE: checksums_text(files).encode()}).items():
        (bundle / name).write_bytes(content)


def _other_machine(bundle: Path) -> None:
    manifest = real_files()[MANIFEST_FILE].replace(platform.machine().encode(), b"riscv32")
    _rehashed(bundle, manifest_json=manifest)


def _other_elf(bundle: Path) -> None:
    library = bytearray(real_files()["kernel.so"])
    library[18] ^= 0x40
    _rehashed(bundle, kernel_so=bytes(library))


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        *((lambda b, n=name: _flip(b, n), name) for name in sorted(real_files())),
        (_other_machine, "built for riscv32, this machine is"),
        (_other_elf, "ELF header of kernel.so"),
        (lambda bundle: (bundle / CHECKSUM_FILE).unlink(), "not a complete bundle"),
    ],
)
def test_a_bundle_that_cannot_be_trusted_is_refused(
    harm: Callable[[Path], Any],
    said: str,
    recordings: Path,
    tmp_path: Path,
    refused: Callable[..., str],
) -> None:
    bundle, out = write_real_bundle(tmp_path / "bundle"), tmp_path / "out"
    harm(bundle)
    words = ["replay", recordings, "--recording", "peopled", "--bundle", bundle, "--out", out]
    message = refused(*words)
    assert said in message
    assert "workbench build" in message
    assert not out.exists()


def test_a_bundle_for_another_vehicle_is_refused(
    recordings: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    bundle, out = write_real_bundle(tmp_path / "bundle"), tmp_path / "out"
    shapes = recordings / "shapes.csv"
    shapes.write_text(shapes.read_text().replace("1.75", "1.70"))
    words = ["replay", recordings, "--recording", "peopled", "--bundle", bundle, "--out", out]
    message = refused(*words)
    assert "is for GEM e2 with wheelbase_m = 1.75, the recorded car has 1.7" in message
    assert "leave --bundle out" in message
    assert not out.exists()


@pytest.mark.parametrize("command", ["build", "replay", "demo"])
def test_an_output_folder_that_cannot_be_written_is_refused(
    command: str, recordings: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    words = [recordings, "--recording", "peopled"] if command == "replay" else []
    blocked = tmp_path / "file"
    blocked.write_text("kept")
    targets = [blocked, blocked / "below"]
    if os.geteuid():
        locked = tmp_path / "locked"
        locked.mkdir(mode=0o555)
        targets.append(locked / "below")
    for out in targets:
        message = refused(command, *words, "--out", out)
        assert str(out) in message
        assert "choose another" in message or "choose a folder" in message
    assert blocked.read_text() == "kept"
    assert not any(name.startswith(".") for name in _names(tmp_path))


def test_build_leaves_a_folder_alone_that_is_no_bundle(
    tmp_path: Path, refused: Callable[..., str]
) -> None:
    papers = tmp_path / "papers"
    papers.mkdir()
    (papers / "thesis.txt").write_text("years of work")
    assert "choose another folder" in refused("build", "--out", papers)
    assert _names(papers) == {"thesis.txt"}
