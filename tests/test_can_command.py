"""`workbench can decode` ends with 0 for frames that are all taken, 1 for others, 2 for misuse."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import can
import pytest
from can_cases import start_of
from cli_fixture import invoke
from test_base_install import BLOCK

from workbench.runtime.protocols import (
    Localised,
    PersonKind,
    Refusal,
    SentPerson,
    load_protocol,
    localisation_frames,
    people_frames,
    worst_rounding,
)

ROOT = Path(__file__).parent.parent
SPEED = (0x6F, bytes.fromhex("0118010000000000"))
PERSON = SentPerson(7, PersonKind.ON_FOOT, 1.0, 2.0, 0.5, 0.0, 0.0, 0.1, 0.0)
DECODE = ("can", "decode", "--protocol")


def written(file: Path, frames: Sequence[tuple[int, bytes]]) -> Path:
    """A log with a frame every 10 ms, in the form that the file's name asks for."""
    with can.Logger(file) as log:
        for k, (frame_id, data) in enumerate(frames):
            message = can.Message(
                timestamp=1e9 + k / 100,
                arbitration_id=frame_id,
                data=data,
                is_extended_id=frame_id > 0x7FF,
                channel=0,
            )
            log(message)
    return file


def of_people(number: int) -> list[tuple[int, bytes]]:
    frames = people_frames((PERSON,), number=number, stamp_s=number / 5, watched_radius_m=30)
    assert not isinstance(frames, Refusal)
    return list(frames)


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".csv", ".trc"])
def test_every_form_of_log_is_read(suffix: str, tmp_path: Path) -> None:
    result = invoke(*DECODE, "pacmod2", written(tmp_path / f"drive{suffix}", [SPEED] * 3))
    assert result.status == 0, result.err
    assert "VEHICLE_SPEED 2.8 m/s, VEHICLE_SPEED_VALID 1" in result.out
    assert "3 frames, 0 refused" in result.out
    assert "VEHICLE_SPEED_RPT.VEHICLE_SPEED: Disputed by a factor 2.237" in result.out


def test_refused_frames_are_named_and_end_with_1(tmp_path: Path) -> None:
    frames = [
        SPEED,
        (0x6F, bytes(8)),
        (0x6B, bytes.fromhex("05DC000000000000")),
        (0x123, b""),
        (0x1234567, bytes(8)),
        (0x66, bytes([3, 4, 3, 0, 0, 0, 0, 0])),
    ]
    file = written(tmp_path / "drive.log", frames)
    result = invoke(*DECODE, "pacmod2", file)
    assert result.status == 1
    assert "refused: VEHICLE_SPEED_RPT.VEHICLE_SPEED_VALID: the sender calls it inval" in result.out
    assert "refused: BRAKE_CMD.BRAKE_CMD: out of range (1.5, expected 0 to 1)" in result.out
    assert "refused: unknown identifier (0x123)" in result.out
    assert "(extended identifier)" in result.out
    assert "MANUAL_INPUT FORWARD, COMMANDED_VALUE HIGH, OUTPUT_VALUE FORWARD" in result.out
    data = invoke(*DECODE, "pacmod2", file, "--json").data
    assert (data["frames"], data["refused"]) == (6, 4)
    assert [row["refused"] for row in data["rows"]] == [
        None, "SAID_INVALID", "OUT_OF_RANGE", "UNKNOWN_ID", "NOT_A_DATA_FRAME", None,
    ]  # fmt: skip
    assert data["rows"][0]["values"] == {"VEHICLE_SPEED": 2.8, "VEHICLE_SPEED_VALID": 1}
    assert data["messages"]["VEHICLE_SPEED_RPT"] == {"frames": 2, "refused": 1}
    assert data["protocols"] == {"pacmod2": load_protocol("pacmod2").dbc_sha256}
    assert data["sets"] == {}
    only = invoke(*DECODE, "pacmod2", file, "--refused", "--json").data
    assert len(only["rows"]) == 4
    few = invoke(*DECODE, "pacmod2", file, "--most", 1)
    assert "5 more frames not shown" in few.out
    none = invoke(*DECODE, "pacmod2", file, "--most", 0, "--json").data
    assert (none["rows"], none["left_out"], none["frames"]) == ([], 6, 6)


def test_a_log_without_remarks_ends_with_its_counts(tmp_path: Path) -> None:
    file = written(tmp_path / "drive.log", [(0x6B, bytes(8))])
    assert invoke(*DECODE, "pacmod2", file, "--most", 0).out.splitlines() == [
        "1 more frames not shown; --most N shows more",
        "",
        "message    frames  refused",
        "BRAKE_CMD       1        0",
        "",
        "1 frames, 0 refused",
    ]


def test_whole_and_broken_sets_are_counted(tmp_path: Path) -> None:
    place = localisation_frames(Localised(1, 1.0, 0, 0, 0, 0, 0.1, 0.1, 0.1, 0.1))
    assert not isinstance(place, Refusal)
    good = [*place, SPEED, *of_people(1), *of_people(2)]
    both = ("--protocol", "workbench", *DECODE[2:])
    result = invoke("can", "decode", *both, "pacmod2", written(tmp_path / "good.log", good))
    assert result.status == 0, result.out
    assert "localisation: 1 whole sets, 0 unfinished ones, 0 frames twice" in result.out
    assert "people: 2 whole sets, 0 unfinished ones, 0 frames twice" in result.out
    holed = [*of_people(1)[:2], *of_people(2)[:2], *of_people(2)[3:], *of_people(1)]
    file = written(tmp_path / "holed.log", holed)
    result = invoke(*DECODE, "workbench", file)
    assert result.status == 1
    assert "people: 0 whole sets, 2 unfinished ones" in result.out
    assert "1 times people: a part is missing, out of order, or of another set" in result.out
    assert "1 times people: the set's counter or stamp goes backwards" in result.out
    cut = written(tmp_path / "cut.log", [*of_people(1)[:2], *of_people(2)])
    data = invoke(*DECODE, "workbench", cut, "--json").data
    assert data["sets"]["people"] == {"whole": 1, "unfinished": 1, "frames_twice": 0}
    assert invoke(*DECODE, "workbench", cut).status == 1


# The reader of .blf files leaves its file open when it refuses it.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.log", "", "without any"),
        ("a.log", "# no frames\n", "cannot be read"),
        ("a.csv", "a,b\n1,2\n", "cannot be read"),
        ("a.blf", "LOGG", "cannot be read"),
        ("a.txt", "(0.0) can0 06F#00\n", "cannot be read"),
    ],
)
def test_what_is_no_log_is_named_in_one_line(
    name: str, content: str, said: str, tmp_path: Path
) -> None:
    file = tmp_path / name
    file.write_text(content, encoding="utf-8")
    result = invoke(*DECODE, "pacmod2", file)
    assert result.status == 2
    assert said in result.err
    assert len(result.err.splitlines()) == 1
    assert result.out == ""


def test_wrong_use_ends_with_2(tmp_path: Path) -> None:
    file = written(tmp_path / "drive.log", [SPEED])
    assert invoke("can", "decode", file).status == 2
    assert invoke("can", "encode", "--protocol", "pacmod2", file).status == 2
    assert invoke(*DECODE, "pacmod4", file).status == 2
    assert "expected a number of frames" in invoke(*DECODE, "pacmod2", file, "--most", "-1").err
    absent = invoke(*DECODE, "pacmod2", tmp_path / "absent.log")
    assert absent.status == 2
    assert "No such file" in absent.err
    two = invoke(*DECODE, "pacmod2", "--protocol", "pacmod3", file)
    assert two.status == 2
    assert "which both use identifier 0x80; choose one" in two.err
    assert invoke(*DECODE, "pacmod2", "--protocol", "pacmod2", file).status == 0


def test_the_command_needs_no_analysis_package(tmp_path: Path) -> None:
    file = written(tmp_path / "drive.log", [SPEED])
    words = [*DECODE, "pacmod2", str(file)]
    program = f"{BLOCK}\nfrom workbench.cli.main import main\nsys.exit(main({words!r}))"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "1 frames, 0 refused" in done.stdout


def test_the_bits_of_the_documents_are_those_of_the_tables() -> None:
    text = (ROOT / "docs" / "can-protocols.md").read_text(encoding="utf-8")
    rounding = worst_rounding()
    rows = [line for line in text.splitlines() if line.endswith(" |") and "| exact |" in line]
    rows += [line for line in text.splitlines() if line.count("|") == 8 and line not in rows]
    expected = set()
    for message in load_protocol("workbench").by_id.values():
        assert f"{message.name} 0x{message.frame_id:X}" in text.replace("\n", " ")
        for signal in message.signals:
            bound = rounding.get((message.name, signal.name))
            shown = "exact" if bound is None else f"{bound:.3g}"
            ends = (signal.value_of(signal.raw_min), signal.value_of(signal.raw_max))
            choices = ", ".join(f"{raw} {text}" for raw, text in signal.choices.items())
            span = choices or f"{ends[0]:.12g} to {ends[1]:.12g}"
            place = f"{start_of(message, signal)} | {signal.length}"
            unit = signal.unit or "–"
            expected.add(
                f"| {message.name} | {signal.name} | {shown} | {unit} | {place} | {span} |"
            )
    assert expected <= set(rows)
