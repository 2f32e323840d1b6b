"""`workbench-localiser` starts, speaks and ends as said, without any analysis package."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from localiser_cases import core, files
from onboard_world_plant import PACMOD2, framed
from signed_cases import KEY, signed_again, write_files, write_public_key
from test_base_install import BLOCK, ROOT

from workbench.runtime.localiser import journal as journal_module
from workbench.runtime.localiser.journal import Journal
from workbench.runtime.localiser.main import Exit, main
from workbench.runtime.onboard.loop import Counts
from workbench.runtime.onboard.states import State
from workbench.runtime.onboard.turns import TurnResult
from workbench.runtime.protocols.ranges import SentRange, range_frame

BUS = ["--interface=virtual", "--wait=0.1"]

# A standing car and six beacons on the same bus as the program, until it has spoken or time is up.
FEEDER = """
import json, math, os, signal, threading, time
import can
from workbench.runtime.localiser import main as program
from workbench.runtime.protocols import Refusal, decode, load_protocol
from workbench.runtime.protocols.ranges import SentRange, range_frame
reports, beacons = {reports!r}, {beacons!r}
heard = []
def feed():
    bus, own = can.Bus("localiser-test", interface="virtual"), load_protocol("workbench")
    begun, number = time.monotonic(), 0
    while time.monotonic() < begun + 20.0:
        now = time.monotonic() - begun
        for identifier, data in reports:
            bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
        for beacon, range_m in beacons if now > 1.0 else ():
            sent = SentRange(number % 256, beacon, range_m, round(1e4 * (time.monotonic() - begun)))
            identifier, data = range_frame(sent)
            number += 1
            bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
        while (message := bus.recv(0.0)) is not None:
            if message.arbitration_id in own.by_id:
                heard.append((message.arbitration_id, bytes(message.data)))
        # A busy machine may cut a set short: it is not sent late.
        if any(identifier == 0x6C3 for identifier, _ in heard):
            break
        time.sleep(0.03)
    said = [decode(own, *each) for each in heard]
    print(json.dumps([str(each) if isinstance(each, Refusal) else each.message for each in said]))
    os.kill(os.getpid(), signal.SIGTERM)
threading.Thread(target=feed, daemon=True).start()
code = program.main({words!r})
print(json.dumps([code, sorted(name for name in ("numpy", "casadi") if name in sys.modules)]))
"""


def installed(folder: Path) -> list[str]:
    place = write_files(folder / "localiser", signed_again(files()))
    key = write_public_key(folder / "keys" / "key.pub", KEY)
    return [f"--localiser={place}", f"--public-key={key}"]


def test_it_speaks_on_a_bus_without_analysis_packages(tmp_path: Path) -> None:
    speed = {"VEHICLE_SPEED": 0.0, "VEHICLE_SPEED_VALID": 1}
    wheel = {"MANUAL_INPUT": 0.0, "COMMANDED_VALUE": 0.0, "OUTPUT_VALUE": 0.1}
    reports = [
        (PACMOD2.by_name[name].frame_id, framed(name, values))
        for name, values in (("VEHICLE_SPEED_RPT", speed), ("STEERING_RPT_1", wheel))
    ]
    site = json.loads(files()["localiser.json"])["site"]
    beacons = [
        (k, ((b["x_m"] - 12.0) ** 2 + (b["y_m"] - 9.0) ** 2 + (b["height_m"] - 1.9) ** 2) ** 0.5)
        for k, b in enumerate(site["beacons"])
    ]
    log = tmp_path / "log.jsonl"
    words = [*installed(tmp_path), "--interface=virtual", "--channel=localiser-test",
             "--wait=5", "--rate=20", "--level=0.9", f"--log={log}"]  # fmt: skip
    program = BLOCK + FEEDER.format(reports=reports, beacons=beacons, words=words)
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)],
        cwd=ROOT, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    said, (code, loaded) = map(json.loads, done.stdout.splitlines())
    assert (code, loaded) == (0, []), done.stderr
    assert said[-1].startswith("LOC_RADII.HEADING_OBSERVED: the sender calls it invalid")
    assert set(said[:-1]) <= {"LOC_STAMP", "LOC_POSITION", "LOC_MOTION"}
    assert "listening, sets of level 0.9" in done.stderr
    assert "HEADING_INVALID" in done.stderr
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert lines[-1]["unobserved"] >= 1
    assert lines[-1]["ranges"] > 30
    assert {"REPEATED", "LATE"} <= lines[-1]["ranges_refused"].keys()


def test_every_refusal_is_one_sentence_with_its_status(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    usual = [*installed(tmp_path), *BUS, "--channel=nobody"]
    (tmp_path / "there").write_text("")
    cases = [
        ([*usual], Exit.PROTOCOL, "missing reports: ['STEERING_RPT_1', 'VEHICLE_SPEED_RPT']"),
        ([*usual, "--protocol=pacmod3"], Exit.PROTOCOL, "expected pacmod2"),
        ([*usual, "--level=0.5"], Exit.LOCALISER, "level: expected one of 0.9, 0.99, 0.999"),
        ([*usual, f"--localiser={tmp_path}"], Exit.LOCALISER, "it lacks"),
        ([*usual, f"--public-key={tmp_path / 'there'}"], Exit.LOCALISER, "Ed25519 public key"),
        ([*usual, "--interface=socketcan"], Exit.BUS, "the bus cannot be opened"),
    ]
    for words, status, text in cases:
        assert main(words) == status
        said = capfd.readouterr().err.splitlines()
        assert said[-1].startswith("workbench-localiser: refused: ")
        assert text in said[-1], said
    with pytest.raises(SystemExit, match="2"):
        main([*usual, "--rate=100"])
    with pytest.raises(SystemExit, match="2"):
        main([*usual, "--wait=-1"])


def test_the_warning_without_a_key_is_said(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    place = installed(tmp_path)[0]
    assert main([place, *BUS, "--channel=nobody"]) == Exit.PROTOCOL
    assert "signature is not checked" in capfd.readouterr().err


def test_a_log_is_a_new_file_and_its_loss_is_said(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    mine, path = core(), tmp_path / "log.jsonl"
    journal = Journal(mine, path)
    sent = range_frame(SentRange(1, 63, 3.0, 5))
    assert isinstance(sent, tuple)
    mine.receive(*sent, 1)
    for k in range(60):
        journal.turned(_result(k * 50_000), Counts(turns=k))
    journal.turned(_result(3_010_000, ("SOMETHING: new",)), Counts())
    assert "3.010 s: SOMETHING: new" in capfd.readouterr().err
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["at_s"] for line in lines] == [0.0, 1.0, 2.0, 3.01]
    assert lines[0]["ranges_refused"]["UNKNOWN_BEACON"] == 1
    assert list(journal.before()) == []
    monkeypatch.setattr(journal_module.os, "write", _disk_full)
    journal.turned(_result(4_500_000), Counts())
    monkeypatch.undo()
    assert "ALERT: LOG_LOST: No space left" in capfd.readouterr().err
    # It was the last one that is tried.
    journal.turned(_result(9_000_000), Counts())
    journal.close()
    assert len(path.read_text().splitlines()) == 4


def _disk_full(descriptor: int, data: bytes) -> int:
    if descriptor == 2:
        return sys.stderr.buffer.write(data)
    raise OSError(28, "No space left on device")


def _result(at_us: int, events: tuple[str, ...] = ()) -> TurnResult:
    return TurnResult(at_us, (), State.DISARMED, None, None, None, (), events)


def test_a_log_that_is_there_is_not_overwritten(tmp_path: Path) -> None:
    from workbench.errors import InputError

    (tmp_path / "there").write_text("mine")
    with pytest.raises(InputError, match="expected a new file"):
        Journal(core(), tmp_path / "there")
    assert (tmp_path / "there").read_text() == "mine"
