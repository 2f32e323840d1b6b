"""Across processes: a dead or hanging monitor is silent at once, a stopped one ends in order."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from workbench.runtime.onboard.bus import (
    BusFaultError,
    BusSettings,
    PythonCanBus,
)
from workbench.runtime.onboard.loop import End
from workbench.runtime.onboard.times import TURN_US

HERE = Path(__file__).parent
ROOT = HERE.parent
PERIOD_S = TURN_US / 1e6


def started(*arguments: str, prefix: tuple[str, ...] = ()) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": f"{HERE}{os.pathsep}{ROOT}"}
    process = subprocess.Popen(
        [*prefix, sys.executable, str(HERE / "onboard_loop_process.py"), *arguments],
        stdout=subprocess.PIPE, text=True, env=environment,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


class Line:
    """The other end of a serial line: python-can's slcan writes text lines to it."""

    def __init__(self) -> None:
        self.ours, theirs = pty.openpty()
        tty.setraw(self.ours, termios.TCSANOW)
        tty.setraw(theirs, termios.TCSANOW)
        self.name = os.ttyname(theirs)
        self.theirs = theirs

    def frames(self, seconds: float) -> list[tuple[float, bytes]]:
        """(monotonic instant, line) of what comes within so long."""
        end, found, rest = time.monotonic() + seconds, [], b""
        while (left := end - time.monotonic()) > 0.0:
            if select.select((self.ours,), (), (), left)[0]:
                rest += os.read(self.ours, 4096)
                *lines, rest = rest.split(b"\r")
                found += [(time.monotonic(), line) for line in lines if line[:1] == b"t"]
        return found

    def close(self) -> None:
        os.close(self.ours)
        os.close(self.theirs)


@pytest.fixture
def line() -> Iterator[Line]:
    pytest.importorskip("serial", reason="needs the optional package pyserial")
    made = Line()
    yield made
    made.close()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_dead_or_hanging_monitor_is_silent_at_once(line: Line, number: signal.Signals) -> None:
    """Nothing else sends for it: the last frame comes within two periods of the signal."""
    process = started("slcan", line.name, "drive", "20")
    try:
        assert len(line.frames(0.5)) > 6
        process.send_signal(number)
        struck = time.monotonic()
        after = line.frames(1.0)
        assert all(at < struck + 2 * PERIOD_S for at, _ in after)
    finally:
        process.send_signal(signal.SIGCONT)
        process.kill()
        process.wait()


def test_sigterm_over_slcan_ends_in_order_and_garbled_lines_do_no_harm(line: Line) -> None:
    process = started("slcan", line.name, "drive", "20")
    try:
        # Half a frame, letters, and what is no text, which opens the line again and empties it.
        for text in (b"t06F8000\r", b"tzzz8\r", b"\xff\xfe\r"):
            os.write(line.ours, text)
        assert len(line.frames(0.5)) > 6
        os.write(line.ours, b"t06F80118010000000000\r")
        assert len(line.frames(0.3)) > 3
        process.terminate()
        found = line.frames(0.5)
        output, _ = process.communicate(timeout=5)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == End.ORDERLY.value
    assert "received=1" in output
    assert "bus_errors=0" not in output
    assert found


def test_shadow_over_slcan_opens_to_listen_and_writes_no_frame(line: Line) -> None:
    process = started("slcan", line.name, "shadow", "20")
    try:
        opened = os.read(line.ours, 100)
        assert b"L\r" in opened
        assert b"O\r" not in opened
        assert line.frames(0.5) == []
        process.terminate()
        assert process.wait(timeout=5) == 0
    finally:
        process.kill()
        process.wait()


_IN_NAMESPACE = """
ip link set lo up && ip route add 239.0.0.0/8 dev lo || exit 77
exec "$0" "$@"
"""


def _namespace() -> tuple[str, ...]:
    """How to run in a network of its own that has nothing but loopback; skips where it may not."""
    prefix = ("unshare", "--net", "--map-root-user", "--user", "sh", "-c", _IN_NAMESPACE)
    with contextlib.suppress(OSError):
        if subprocess.run([*prefix, "true"], capture_output=True).returncode == 0:
            return prefix
    pytest.skip("needs a private network namespace (unshare, ip)")


def test_two_processes_over_udp_within_a_private_network() -> None:
    pytest.importorskip("msgpack", reason="needs the optional package msgpack")
    both = f"""
import sys, time, can, subprocess
other = can.Bus(channel="239.74.163.2", interface="udp_multicast")
process = subprocess.Popen([sys.executable, {str(HERE / "onboard_loop_process.py")!r},
    "udp_multicast", "239.74.163.2", "shadow", "10"], stdout=subprocess.PIPE, text=True)
process.stdout.readline()
for _ in range(20):
    other.send(can.Message(arbitration_id=0x6F, data=bytes(8), is_extended_id=False))
    time.sleep(0.02)
process.terminate()
text, _ = process.communicate(timeout=5)
heard = set()
while (message := other.recv(0)) is not None:
    heard.add(message.arbitration_id)
other.shutdown()
counts = dict(each.split("=") for each in text.strip()[7:-1].split(", "))
print(process.returncode, int(counts["received"]) + int(counts["stale"]), heard == {{0x6F}})
"""
    environment = {**os.environ, "PYTHONPATH": f"{HERE}{os.pathsep}{ROOT}"}
    done = subprocess.run(
        [*_namespace(), sys.executable, "-c", both],
        capture_output=True, text=True, timeout=20, env=environment,
    )  # fmt: skip
    assert done.stdout == "0 20 True\n", done.stdout + done.stderr


def test_what_returns_our_own_frames_is_only_listened_to() -> None:
    with pytest.raises(BusFaultError, match="second sender"):
        PythonCanBus(BusSettings("udp_multicast", "239.74.163.2", listens_only=False))
