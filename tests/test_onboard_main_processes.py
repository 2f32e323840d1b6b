"""`workbench-monitor` as a process on a serial line: it listens, is armed by code, and ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from onboard_main_cases import installed, usual_frames
from test_onboard_loop_processes import PERIOD_S, ROOT, Line, line

from workbench.errors import InputError
from workbench.runtime.onboard.control import ask
from workbench.runtime.onboard.main import Exit

__all__ = ["line"]


def started(line: Line, *arguments: str) -> subprocess.Popen[str]:
    words = (*arguments, "--interface=slcan", f"--channel={line.name}", "--wait=5")
    return subprocess.Popen(
        [sys.executable, "-m", "workbench.runtime.onboard.main", *words],
        stderr=subprocess.PIPE, text=True, cwd=ROOT,
    )  # fmt: skip


class Car:
    """Plays the frames of a standing car onto the line, and reads what the monitor writes."""

    def __init__(self, line: Line) -> None:
        self.heard: list[tuple[float, bytes]] = []
        self._line, self._over = line, threading.Event()
        self._threads = [threading.Thread(target=each) for each in (self._play, self._read)]

    def __enter__(self) -> Car:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join()

    def _play(self) -> None:
        begun = time.monotonic()
        for at_us, identifier, data in usual_frames():
            while (left := begun + at_us / 1e6 - time.monotonic()) > 0.0:
                if self._over.wait(min(left, 0.05)):
                    return
            os.write(self._line.ours, f"t{identifier:03X}{len(data)}{data.hex()}\r".encode())

    def _read(self) -> None:
        while not self._over.is_set():
            self.heard += self._line.frames(0.05)


def until(holds: Callable[[], bool], seconds: float = 6.0) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if holds():
            return True
        time.sleep(0.01)
    return False


def status(folder: Path) -> dict[str, object]:
    try:
        return dict(ask(folder, "status", wait_s=0.5))
    except (InputError, OSError):
        return {}


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    try:
        _, text = process.communicate(timeout=10)
    finally:
        process.kill()
        process.wait()
    return process.returncode, text


def test_shadow_listens_logs_and_ends_without_a_frame(line: Line, tmp_path: Path) -> None:
    control = tmp_path / "control"
    words = [*installed(tmp_path), f"--control={control}", f"--log={tmp_path / 'log'}"]
    process = started(line, *words)
    with Car(line) as car:
        try:
            assert until(lambda: int(str(status(control).get("received", 0))) > 100)
            found = status(control)
            assert (found["state"], found["sent"]) == ("DISARMED", 0)
        finally:
            process.terminate()
            code, text = ended(process)
    assert code == Exit.ORDERLY, text
    assert "listening in mode shadow" in text
    assert car.heard == []
    assert (tmp_path / "log" / "run.json").is_file()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_armed_by_its_code_it_sends_until_it_is_killed_or_told_to_end(
    line: Line, tmp_path: Path, number: signal.Signals
) -> None:
    control = tmp_path / "control"
    process = started(line, *installed(tmp_path), f"--control={control}", "--mode=drive")
    with Car(line) as car:
        try:
            assert until(lambda: status(control).get("state") == "DISARMED")
            assert until(lambda: len(car.heard) > 3)
            # Before it is armed it only says that it lives.
            assert {text[:4] for _, text in car.heard} <= {b"t6D0", b"t6D1"}

            def arms() -> bool:
                ask(control, f"arm {status(control).get('code')}")
                return status(control).get("state") == "ARMED"

            assert until(arms), (status(control), ended(process))
            assert until(lambda: any(text[:4] == b"t069" for _, text in car.heard))
            process.send_signal(number)
            struck = time.monotonic()
            code, text = ended(process)
            time.sleep(3 * PERIOD_S)
        finally:
            process.kill()
            process.wait()
    after = [at for at, _ in car.heard if at > struck]
    if number == signal.SIGKILL:
        assert all(at < struck + 2 * PERIOD_S for at in after)
        assert code == -signal.SIGKILL
    else:
        assert code == Exit.ORDERLY, text
        last = [text for _, text in car.heard if text[:4] == b"t069"][-1]
        # ENABLE is 0, and IGNORE_OVERRIDE.
        assert int(last[5:7], 16) & 0b101 == 0
