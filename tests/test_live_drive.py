"""In real time the very program drives the simulated car, as a process of its own on a serial line.

Only what does not hang on the machine's pace is asserted: a machine under load makes the monitor
brake, which is right.
"""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("casadi", reason="needs the extra analysis")
pytest.importorskip("nacl", reason="needs the package for signatures")
pytest.importorskip("serial", reason="needs the optional package pyserial")

from cli_fixture import invoke
from simulated_worlds import rig, scenario

from workbench.errors import InputError
from workbench.runtime.onboard.states import COMMANDING, State
from workbench.simulation.bus_drive import Recorded
from workbench.simulation.bus_world import BEGUN_US, BusSetting, BusWorld
from workbench.simulation.live_drive import drive_live
from workbench.simulation.live_processes import Installed
from workbench.simulation.rig import Trial
from workbench.simulation.runlog import read_log
from workbench.simulation.serial_line import SerialLine, frame_line, line_frame

FRAMES = st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8))
SCENARIO = """
title = "A short way"
story = "Somebody stands far beside it."
waypoints = [[0, 0], [10, 0], [20, 0], [30, 0], [40, 0]]
duration_s = 5.0
passed_m = 30.0
[expected]
LookAhead = "any"
FailSafe = "any"
both = "any"
[[people]]
walker = "standing"
name = "stands"
begin = [20.0, 9.0]
"""


def world(duration_s: float = 5.0) -> BusWorld:
    trial = Trial(scenario((20.0, 9.0, 0.0, 0.0), duration_s=duration_s), "bicycle", 0)
    return BusWorld(rig().scene(trial), BusSetting(rig().settings.maker), seed=0)


@given(FRAMES)
def test_a_frame_survives_the_line(frame: tuple[int, bytes]) -> None:
    text = frame_line(frame)
    assert text.endswith(b"\r")
    assert line_frame(text[:-1]) == frame


@given(st.binary(max_size=30))
def test_whatever_else_is_on_the_line_is_no_frame_or_one_that_is_whole(line: bytes) -> None:
    found = line_frame(line)
    if found is not None:
        assert frame_line(found)[:-1].lower()[:5] == line.lower()[:5]
        assert len(found[1]) == int(line[4:5])


def test_python_can_hears_the_line_and_is_heard_on_it() -> None:
    import can

    line = SerialLine()
    try:
        with can.Bus(interface="slcan", channel=line.name, sleep_after_open=0) as bus:
            line.receive(0.2)
            line.send((0x123, b"\x01\x02"))
            heard = bus.recv(1.0)
            assert heard is not None
            assert (heard.arbitration_id, bytes(heard.data)) == (0x123, b"\x01\x02")
            bus.send(can.Message(arbitration_id=0x6F, data=b"\xff", is_extended_id=False))
            assert (0x6F, b"\xff") in line.receive(1.0)
    finally:
        line.close()


def test_what_nobody_reads_is_lost_and_counted() -> None:
    line = SerialLine()
    try:
        for _ in range(3_000):
            line.send((1, bytes(8)))
        assert line.lost > 0
    finally:
        line.close()


def test_a_scenario_begins_when_it_is_told_to_and_not_twice() -> None:
    late = world()
    late.begin(3 * BEGUN_US)
    list(late.until(2 * BEGUN_US))
    assert (late.scenario_s, late.scene.now_us) == (-BEGUN_US / 1e6, 0)
    with pytest.raises(ValueError, match="to come"):
        late.begin(BEGUN_US)
    list(late.until(4 * BEGUN_US))
    assert late.scenario_s == late.scene.now_s == BEGUN_US / 1e6
    with pytest.raises(ValueError, match="before the scenario"):
        late.begin(5 * BEGUN_US)


def test_a_monitor_that_refuses_is_heard_and_leaves_no_process(tmp_path: Path) -> None:
    nothing = Installed(tmp_path / "no bundle", tmp_path / "no.pub")
    with pytest.raises(InputError, match=r"it ended: workbench-monitor: refused"):
        drive_live(world(), nothing, tmp_path / "log", Recorded())


@pytest.fixture
def place() -> Iterator[Path]:
    """For temporary files, with a name that is short enough for sockets."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def test_a_drive_that_is_told_to_end_leaves_no_process_no_key_and_no_folder(
    tmp_path: Path, place: Path
) -> None:
    file = tmp_path / "short.toml"
    file.write_text(SCENARIO, encoding="utf-8")
    words = ["simulate", str(file), "--real-time", "--plant", "bicycle", "--out", "out"]
    running = subprocess.Popen(
        [sys.executable, "-m", "workbench.cli.main", *words], cwd=tmp_path, text=True,
        env={**os.environ, "TMPDIR": str(place)}, stderr=subprocess.PIPE,
    )  # fmt: skip
    while not list(place.glob("workbench-*/monitor.socket")):
        assert running.poll() is None, running.communicate()
        time.sleep(0.05)
    assert list(place.glob("workbench-*/drive.key.pub"))
    # Nobody can sign with it any more while the car drives.
    assert not list(place.glob("workbench-*/drive.key"))
    monitors = Path(f"/proc/{running.pid}/task/{running.pid}/children").read_text().split()
    running.send_signal(signal.SIGTERM)
    _, err = running.communicate(timeout=30)
    assert running.returncode == 130, err
    assert err.endswith("interrupted\n")
    assert [*place.iterdir()] == []
    assert not (tmp_path / "out").exists()
    assert len(monitors) == 1
    assert not Path(f"/proc/{monitors[0]}").exists()


def test_the_process_is_armed_drives_and_its_log_makes_the_same_decisions(tmp_path: Path) -> None:
    file, out = tmp_path / "short.toml", tmp_path / "out"
    file.write_text(SCENARIO, encoding="utf-8")
    words = ("simulate", file, "--real-time", "--plant", "bicycle", "--out", out)
    found = invoke(*words, "--json")
    assert found.status == 0, found.err
    about = found.data["notes"][0]
    assert "exit status 0" in about
    assert "decisions made again are those of the log" in about
    assert found.data["took_s"] > 5.0
    rows = (out / "turns.csv").read_text(encoding="utf-8").splitlines()[1:]
    modes = [State[row.split(",")[8]] for row in rows]
    times = [float(row.split(",")[0]) for row in rows]
    assert set(modes) & COMMANDING
    assert times[-1] == pytest.approx(5.0, abs=0.5)
    assert all(before <= after for before, after in itertools.pairwise(times))
    assert len(rows) > 60
    # Decided by the process, every third turn or, after one that was held back, the next.
    assert 10 < len(read_log(out / "run.jsonl").entries) < len(rows)
    replayed = invoke("replay", *(out / "log").glob("*.mcap"), "--bundle", out / "bundle")
    assert replayed.status == 0, replayed.out + replayed.err
    again = invoke(*words)
    assert again.status == 2
    assert "without bundle, localiser and log" in again.err
