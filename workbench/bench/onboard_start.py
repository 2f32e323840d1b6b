"""`workbench-monitor` as it is started on a vehicle: how soon it turns, and how much it holds."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import select
import signal
import statistics
import subprocess
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Final, final

from workbench.bench.onboard_programs import ANALYSIS, environment
from workbench.errors import InputError
from workbench.runtime.bundle import Bundle
from workbench.runtime.onboard.listening import LISTENED_US
from workbench.runtime.onboard.sensors_file import settings_from
from workbench.runtime.protocols import load_protocol
from workbench.simulation.onboard_car import Crowd, OnboardCar

LISTENED_S: Final = LISTENED_US / 1e6
_MODULE: Final = "workbench.runtime.onboard.main"
_LONGEST_S: Final = 20.0
_INTO_PATH: Final = 40
_HEARTBEAT: Final = b"t%03X" % load_protocol("workbench").by_name["HEARTBEAT"].frame_id
# Events carry the time of their turn; the first turn has faults to tell.
_TURNED: Final = re.compile(rb"(?m)^\d+\.\d{3} s: ")


@final
@dataclass(frozen=True, slots=True)
class ColdStart:
    """Median of fresh processes of `workbench-monitor`, s.

    kind: what was started; first_s: from the start of the process until its first turn was made
    (or, where it sends, its first heartbeat came out of the line), without the LISTENED_S for which
    it listens before it may turn; slowest_s: the largest of them; opened_s: until it opened the
    bus; processor_s: processor time of it and its children until then, of which other programs take
    nothing.
    """

    kind: str
    processes: int
    first_s: float
    slowest_s: float
    opened_s: float
    processor_s: float


@final
@dataclass(frozen=True, slots=True)
class Resident:
    """Memory of `workbench-monitor` (10^6 bytes) so long after its first turn."""

    after_s: float
    now_mb: float
    peak_mb: float


@final
@dataclass(frozen=True, slots=True)
class Started:
    """What a process is started with: words of the command, whether it sends, what stands before
    the command."""

    kind: str
    words: Sequence[str]
    sends: bool = False
    prefix: Sequence[str] = ()


def can_start() -> bool:
    """Whether python-can can talk to a serial line here."""
    return find_spec("serial") is not None


def cold_start(
    bundle: Bundle, started: Started, *, processes: int, advance: Callable[[], None]
) -> ColdStart:
    """Start it again and again; InputError where it refuses."""
    firsts, opens, taken = [], [], []
    for _ in range(processes):
        with _running(bundle, started) as one:
            firsts.append(one.first_s - LISTENED_S)
            opens.append(one.opened_s)
            taken.append(one.processor_s)
        advance()
    return ColdStart(
        started.kind, processes, statistics.median(firsts), max(firsts), statistics.median(opens),
        statistics.median(taken),
    )  # fmt: skip


def resident(bundle: Bundle, started: Started, *, after_s: float) -> Resident:
    """Let it run, and look at its memory.

    Raises InputError where it ends early, or where a library of an analysis package is in its
    memory.
    """
    with _running(bundle, started) as one:
        time.sleep(after_s)
        one.require_alive()
        place = Path("/proc") / str(one.process.pid)
        there = [name for name in ANALYSIS if f"/{name}/" in (place / "maps").read_text()]
        if there:
            raise InputError(f"expected {_MODULE} without analysis packages, got {there}")
        sizes = dict(re.findall(r"(?m)^(VmRSS|VmHWM):\s+(\d+) kB", (place / "status").read_text()))
    return Resident(after_s, int(sizes["VmRSS"]) * 1.024e-3, int(sizes["VmHWM"]) * 1.024e-3)


@final
class _Line:
    """A serial line whose other end is the monitor's bus; a car that stands sends on it."""

    def __init__(self, bundle: Bundle) -> None:
        self._ours, self._theirs = pty.openpty()
        for end in (self._ours, self._theirs):
            tty.setraw(end, termios.TCSANOW)
        self.name = os.ttyname(self._theirs)
        path = bundle.manifest.path
        assert path is not None, "require_driving has looked"
        node = min(_INTO_PATH, len(path.x) - 1)
        self._car = OnboardCar(
            settings_from(bundle.manifest, signed=True, tag=0), Crowd(),
            x_m=path.x[node], y_m=path.y[node], heading=path.heading[node],
        )  # fmt: skip
        self._over = threading.Event()
        self._sender = threading.Thread(target=self._send, daemon=True)
        self._sender.start()

    def _send(self) -> None:
        begun_s = time.monotonic()
        while not self._over.wait(0.003):
            now_us = round(1e6 * (time.monotonic() - begun_s))
            for each in self._car.until(now_us):
                text = f"t{each.identifier:03X}{len(each.data)}{each.data.hex()}\r"
                # Nobody reads before the monitor is there; what does not fit is lost, as on a bus.
                if select.select((), (self._ours,), (), 0)[1]:
                    os.write(self._ours, text.encode())

    def read(self) -> bytes:
        """What the monitor has written since the last call."""
        return os.read(self._ours, 4096) if select.select((self._ours,), (), (), 0)[0] else b""

    def close(self) -> None:
        """No more frames."""
        self._over.set()
        self._sender.join()
        os.close(self._ours)
        os.close(self._theirs)


@final
class _Monitor:
    """A process, and when (s after its start) it opened the bus and made its first turn."""

    def __init__(self, line: _Line, started: Started) -> None:
        words = [*started.words, "--interface=slcan", f"--channel={line.name}"]
        self._begun_s = time.monotonic()
        self.process = subprocess.Popen(
            [*started.prefix, sys.executable, "-P", "-m", _MODULE, *words],
            stderr=subprocess.PIPE, env=environment(),
        )  # fmt: skip
        self._line, self._said, self._heard = line, b"", b""
        self.opened_s = self.first_s = self.processor_s = 0.0
        while not self.first_s:
            self._look()
            wanted = _HEARTBEAT in self._heard if started.sends else _TURNED.search(self._said)
            if not self.opened_s and re.search(rb"[LO]\r", self._heard):
                self.opened_s, self.processor_s = self._elapsed_s(), self._processor_s()
            if wanted:
                self.first_s = self._elapsed_s()

    def _elapsed_s(self) -> float:
        return time.monotonic() - self._begun_s

    def _processor_s(self) -> float:
        """Of the process and the children it has waited for."""
        fields = (Path("/proc") / str(self.process.pid) / "stat").read_text().rpartition(")")[2]
        return sum(map(int, fields.split()[11:15])) / os.sysconf("SC_CLK_TCK")

    def _look(self) -> None:
        assert self.process.stderr is not None, "a pipe was asked for"
        time.sleep(0.001)
        self._heard += self._line.read()
        if select.select((self.process.stderr,), (), (), 0)[0]:
            self._said += os.read(self.process.stderr.fileno(), 4096)
        self.require_alive()
        if self._elapsed_s() > _LONGEST_S:
            raise InputError(
                f"expected a first turn within {_LONGEST_S:g} s; it said {self._said!r}"
            )

    def require_alive(self) -> None:
        """InputError with its last words where it has ended."""
        if self.process.poll() is not None:
            words = self._said.decode(errors="replace").strip().splitlines() or ["no message"]
            raise InputError(f"expected {_MODULE} to run, it ended: {words[-1]}")


@contextlib.contextmanager
def _running(bundle: Bundle, started: Started) -> Iterator[_Monitor]:
    line = _Line(bundle)
    monitor: _Monitor | None = None
    try:
        monitor = _Monitor(line, started)
        yield monitor
    finally:
        if monitor is not None:
            _end(monitor.process)
        line.close()


def _end(process: subprocess.Popen[bytes]) -> None:
    """It ends in order where it can; its last words are not waited for."""
    process.send_signal(signal.SIGTERM)
    try:
        process.communicate(timeout=5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
