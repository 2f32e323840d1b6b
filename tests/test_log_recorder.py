"""Whatever happens to recorder, disk or loop: the loop never waits, and the log is whole up to the
last flush, with every entry that it lacks counted."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from log_cases import EchoCore, drive, header
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from workbench.errors import InputError
from workbench.runtime.onboard.mcap_reader import BrokenOff, McapMessage, read_mcap
from workbench.runtime.onboard.recorder import RecordedCore, Recorder, RecorderSettings
from workbench.runtime.onboard.recorder_can import read_can
from workbench.runtime.onboard.recorder_entries import LoggedFrame, Mark

ROOT = Path(__file__).parent.parent
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (ROOT, ROOT / "tests")))}
FLUSH_S = 0.1
FORMS = (".asc", ".blf", ".log")
LONGEST_CALL_S = 0.02
"""What a call may take on a machine that does other things as well; the usual is microseconds."""


def start(folder: Path, suffix: str = ".asc", *, waiting_bytes: int = 1 << 20) -> Recorder:
    return Recorder.start(
        header(), RecorderSettings(folder, suffix, flush_s=FLUSH_S, waiting_bytes=waiting_bytes)
    )


def raw(folder: Path, suffix: str = ".asc") -> list[LoggedFrame]:
    entries = [entry for _, entry in read_can(folder / f"can{suffix}")]
    frames = [entry for entry in entries if isinstance(entry, LoggedFrame)]
    assert len(frames) == len(entries)
    return frames


def in_mcap(folder: Path) -> list[Any]:
    return list(read_mcap(folder / "monitor.mcap"))


def numbers(frames: list[LoggedFrame]) -> list[int]:
    """Of the frames that `send` sent."""
    return [int.from_bytes(f.data, "big") for f in frames if f.identifier == 0x123 and not f.made]


def send(recorder: Recorder, first: int, count: int) -> float:
    """Frames with numbers; the longest time that a call took, in s."""
    longest = 0.0
    for k in range(first, first + count):
        begun = time.perf_counter()
        recorder.received(0x123, k.to_bytes(8, "big"), k * 10)
        longest = max(longest, time.perf_counter() - begun)
    return longest


def until(condition: Any, *, seconds: float = 5.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.01)


def gaps(frames: list[LoggedFrame]) -> int:
    """Entries that the log itself calls lost."""
    meant = [frame.meant for frame in frames]
    return sum(each[1] for each in meant if each is not None and each[0] is Mark.LOST)


@pytest.mark.parametrize("suffix", FORMS)
def test_everything_is_in_both_files_in_order(suffix: str, tmp_path: Path) -> None:
    recorder = start(tmp_path / "log", suffix)
    drive(RecordedCore(EchoCore(), recorder), turns=30, details=recorder.details)
    state = recorder.close()
    assert state.alive
    assert (state.lost, state.failed) == (0, 0)
    frames = raw(tmp_path / "log", suffix)
    assert len(frames) == 1 + 30 * 5 + 30 * 2 + 10
    messages = in_mcap(tmp_path / "log")
    assert not any(isinstance(each, BrokenOff) for each in messages)
    with (tmp_path / "log" / "monitor.mcap").open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None
    topics = {summary.channels[c].topic: n for c, n in
              summary.statistics.channel_message_counts.items()}  # type: ignore[union-attr]  # fmt: skip
    assert topics["/can"] == len(frames)
    assert topics["/decision"] == 10
    assert topics["/scene"] == 11


@pytest.mark.parametrize("suffix", FORMS[:2])
def test_a_killed_recorder_leaves_all_that_it_reported_and_ends_nothing_else(
    suffix: str, tmp_path: Path
) -> None:
    recorder = start(tmp_path / "log", suffix)
    send(recorder, 0, 2000)
    # START and the frames, in both files.
    until(lambda: recorder.state().written >= 2 * 2001)
    send(recorder, 2000, 100)
    os.kill(recorder._process.pid, signal.SIGKILL)
    recorder._process.wait()
    assert send(recorder, 2100, 1000) < LONGEST_CALL_S
    state = recorder.close()
    assert not state.alive
    assert not state.in_order
    assert state.lost >= 1000
    kept = numbers(raw(tmp_path / "log", suffix))
    assert len(kept) >= 2000
    assert kept == list(range(len(kept)))
    assert isinstance(in_mcap(tmp_path / "log")[-1], BrokenOff)
    assert (
        sum(isinstance(m, McapMessage) and m.topic == "/can" for m in in_mcap(tmp_path / "log"))
        > 2000
    )


def test_frames_are_on_disk_one_flush_interval_later(tmp_path: Path) -> None:
    recorder = start(tmp_path / "log")
    send(recorder, 0, 10)
    time.sleep(2 * FLUSH_S + 0.3)
    os.kill(recorder._process.pid, signal.SIGKILL)
    recorder.close()
    assert numbers(raw(tmp_path / "log")) == list(range(10))


PRODUCER = """
import os, signal, sys
from pathlib import Path
from log_cases import header
from workbench.runtime.onboard.recorder import Recorder, RecorderSettings
recorder = Recorder.start(header(), RecorderSettings(Path(sys.argv[1]), flush_s=30.0))
for k in range(5000):
    recorder.received(0x123, k.to_bytes(8, "big"), k)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_loop_loses_nothing_of_what_it_handed_over(tmp_path: Path) -> None:
    folder = tmp_path / "log"
    done = subprocess.run(
        [sys.executable, "-c", PRODUCER, str(folder)], env=ENVIRONMENT, cwd=ROOT, timeout=30,
        check=False,
    )  # fmt: skip
    assert done.returncode == -signal.SIGKILL

    def closed() -> bool:
        ending = (folder / "can.asc").read_bytes()[-40:]
        return b"End TriggerBlock" in ending

    until(closed)
    assert numbers(raw(folder)) == list(range(5000))
    until(lambda: not any(isinstance(each, BrokenOff) for each in in_mcap(folder)))


def test_a_stopped_recorder_costs_microseconds_and_what_is_lost_is_counted(tmp_path: Path) -> None:
    recorder = start(tmp_path / "log", waiting_bytes=200_000)
    os.kill(recorder._process.pid, signal.SIGSTOP)
    longest = send(recorder, 0, 60_000)
    stopped = recorder.state()
    assert stopped.alive
    assert stopped.lost > 10_000
    assert recorder._outbox.waiting_bytes <= 200_000
    os.kill(recorder._process.pid, signal.SIGCONT)
    until(lambda: recorder.state().alive and recorder._outbox.waiting_bytes == 0)
    longest = max(longest, send(recorder, 60_000, 100))
    state = recorder.close()
    assert longest < LONGEST_CALL_S
    frames = raw(tmp_path / "log")
    kept = numbers(frames)
    assert kept == sorted(kept)
    assert len(kept) == 60_100 - state.lost
    assert gaps(frames) == state.lost
    assert state.failed == 0


@pytest.mark.parametrize("suffix", FORMS[:2])
def test_a_disk_that_fills_and_empties_costs_what_is_counted(suffix: str, tmp_path: Path) -> None:
    recorder = start(tmp_path / "log", suffix)
    pid = recorder._process.pid
    send(recorder, 0, 500)
    until(lambda: recorder.state().written >= 2 * 501)
    size = max(
        (tmp_path / "log" / name).stat().st_size for name in (f"can{suffix}", "monitor.mcap")
    )
    _, most = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (min(size, 2000), most))
    send(recorder, 500, 700)
    until(lambda: recorder.state().failed >= 2 * 700)
    assert recorder.state().error == "File too large"
    assert recorder.state().alive
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (most, most))
    send(recorder, 1200, 300)
    state = recorder.close()
    assert state.alive
    assert state.failed == 2 * 700
    assert state.lost == 0
    expected = [*range(500), *range(1200, 1500)]
    assert numbers(raw(tmp_path / "log", suffix)) == expected
    messages = in_mcap(tmp_path / "log")
    assert not any(isinstance(each, BrokenOff) for each in messages)
    said = [m.data for m in messages if isinstance(m, McapMessage) and m.topic == "/diagnostics"]
    assert any(b"entries of this log are lost: MCAP: File too large" in each for each in said)
    with (tmp_path / "log" / "monitor.mcap").open("rb") as file:
        assert sum(1 for _ in StreamReader(file, validate_crcs=True).records) > 800


IN_SMALL_DISK = """
import os, sys, time
from pathlib import Path
from test_log_recorder import in_mcap, numbers, raw, send, start, until
folder = Path(sys.argv[1]) / "log"
recorder = start(folder)
send(recorder, 0, 200)
until(lambda: recorder.state().written >= 2 * 201)
longest = send(recorder, 200, 20000)
until(lambda: recorder.state().error == "No space left on device")
state = recorder.close()
assert state.alive and state.failed > 0, state
kept = numbers(raw(folder))
assert kept[:200] == list(range(200)) and kept == sorted(kept), kept[:300]
assert len(in_mcap(folder)) > 200
# Who waited for the disk would wait until somebody makes room.
assert longest < 1.0, longest
print("held")
"""


def test_a_real_full_disk(tmp_path: Path) -> None:
    script = f"mount -t tmpfs -o size=256k none {tmp_path} && exec {sys.executable} - {tmp_path}"
    done = subprocess.run(
        ["unshare", "--mount", "--map-root-user", "sh", "-c", script],
        input=IN_SMALL_DISK, text=True, capture_output=True, timeout=60, check=False, cwd=ROOT,
        env=ENVIRONMENT,
    )  # fmt: skip
    if "unshare" in done.stderr or "mount" in done.stderr:
        pytest.skip(f"no file system of its own may be mounted here: {done.stderr.strip()}")
    assert done.stdout.strip() == "held", done.stderr


def test_a_folder_that_cannot_be_used_is_refused_before_the_loop_starts(tmp_path: Path) -> None:
    start(tmp_path / "log").close()
    with pytest.raises(InputError, match="folder for a new log"):
        start(tmp_path / "log")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "monitor.mcap").write_bytes(b"")
    with pytest.raises(InputError, match="did not start"):
        start(tmp_path / "other")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="folder for a new log"):
        start(tmp_path / "file")


def test_entries_that_cannot_be_told_are_counted_and_end_nothing(tmp_path: Path) -> None:
    recorder = start(tmp_path / "log")
    recorder.turn(None, None)  # type: ignore[arg-type]
    recorder.details(None)  # type: ignore[arg-type]
    send(recorder, 0, 3)
    state = recorder.close()
    assert state.lost == 2
    frames = raw(tmp_path / "log")
    assert gaps(frames) == 2
    assert numbers(frames) == [0, 1, 2]


@pytest.mark.parametrize(
    "wrong", [{"can_suffix": ".txt"}, {"flush_s": 0.0}, {"flush_s": 100.0}, {"waiting_bytes": -1}]
)
def test_settings_are_checked(wrong: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        RecorderSettings(tmp_path, **wrong)
