"""A scenario in real time: the real `workbench-monitor` drives, as a process of its own.

The same world as in virtual time, with its frames on a serial line of the system (`slcan`). The
process loads a signed bundle, is armed over its control socket, and writes its own log. What it
decided is read from that log, by a core that is given all frames again at the same microseconds.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import workbench
from workbench.errors import InputError
from workbench.runtime import load_bundle
from workbench.runtime.onboard.control import ask
from workbench.runtime.onboard.playback import Compared, compare
from workbench.runtime.onboard.playback_logs import MCAP_SUFFIX, open_log
from workbench.runtime.onboard.playback_settings import core_again
from workbench.runtime.onboard.states import State
from workbench.runtime.protocols import Refusal, decode, load_protocol
from workbench.simulation.bus_drive import BusDrive, Recorded
from workbench.simulation.bus_world import BusWorld
from workbench.simulation.live_story import LiveStory, PlayedAgain
from workbench.simulation.measures import Progress
from workbench.simulation.serial_line import SerialLine

_MODULE: Final = "workbench.runtime.onboard.main"
_OWN: Final = load_protocol("workbench")
_NEVER_US: Final = 10**12
_READY_S: Final = 40.0
_ENDS_S: Final = 20.0
_PACE_S: Final = 0.002
_SOON_US: Final = 200_000
_ASKED_EVERY_S: Final = 0.25


@final
@dataclass(frozen=True, slots=True)
class Installed:
    """What stands on a vehicle's disk: the folder of a signed bundle with the scenario's path, and
    the public key that it is checked with."""

    bundle: Path
    public_key: Path


@final
@dataclass(frozen=True, slots=True)
class LiveDrive:
    """driven: as in virtual time; log: of the monitor; compared: the log against what was decided
    again; ready_s: from the process's start until it could be armed; behind_s: most that the world
    was late; lost: frames that the line did not take; status: of the process at its end; said: what
    it wrote on standard error."""

    driven: BusDrive
    log: Path
    compared: Compared
    ready_s: float
    behind_s: float
    lost: int
    status: int
    said: str


def drive_live(
    world: BusWorld, installed: Installed, log: Path, recorded: Recorded, *,
    progress: Progress | None = None,
) -> LiveDrive:  # fmt: skip
    """Let the monitor drive until the scenario is over, then let it end.

    log: folder of its log, which must not hold one. Takes the scenario's duration and some seconds.
    Raises InputError, with the monitor's last words, where it refuses to start or cannot be armed.
    """
    world.begin(_NEVER_US)
    story = LiveStory(world, recorded)
    with contextlib.ExitStack() as open_things:
        line = SerialLine()
        open_things.callback(line.close)
        monitor = open_things.enter_context(_started(installed, line, log))
        live = _Live(world, line, story)
        ready_s = live.until_ready(monitor)
        live.until_over(monitor, progress)
        status = live.until_ended(monitor)
    file = next(iter(sorted(log.glob(f"*{MCAP_SUFFIX}"))), log / "no log")
    driven, compared = _again(installed.bundle, file, story)
    return LiveDrive(
        driven, file, compared, ready_s, live.behind_s, line.lost, status, monitor.said
    )


@final
class _Monitor:
    """The process, its words, and an operator who arms it and arms it again after a fault."""

    def __init__(self, process: subprocess.Popen[bytes], control: Path) -> None:
        self.process, self._control = process, control
        self.said, self.state = "", ""
        self._over = threading.Event()
        self._arms = threading.Event()
        self._threads = [threading.Thread(target=each, daemon=True)
                         for each in (self._read, self._operate)]  # fmt: skip
        for thread in self._threads:
            thread.start()

    def may_arm(self) -> None:
        """The operator may arm from now on."""
        self._arms.set()

    def require_alive(self) -> None:
        """InputError with its last words where it has ended."""
        if self.process.poll() is not None:
            words = self.said.strip().splitlines() or ["no message"]
            raise InputError(f"expected workbench-monitor to run, it ended: {words[-1]}")

    def close(self) -> None:
        """Nobody asks and nobody listens any more."""
        self._over.set()
        for thread in self._threads:
            thread.join()

    def _read(self) -> None:
        stream = self.process.stderr
        assert stream is not None, "a pipe was asked for"
        while not self._over.is_set():
            if select.select((stream,), (), (), 0.1)[0]:
                text = os.read(stream.fileno(), 4096)
                if not text:
                    return
                self.said += text.decode(errors="replace")

    def _operate(self) -> None:
        while not self._over.wait(_ASKED_EVERY_S):
            with contextlib.suppress(InputError, OSError):
                found = ask(self._control, "status", wait_s=0.5)
                self.state = str(found.get("state", ""))
                word = _WORDS.get(self.state)
                if word is not None and self._arms.is_set():
                    ask(self._control, word.format(code=found.get("code")), wait_s=0.5)
                    self._over.wait(1.0)


_WORDS: Final[Mapping[str, str]] = {
    State.DISARMED.name: "arm {code}",
    State.FAULT.name: "disarm",
    State.YIELDED.name: "rearm {code}",
}


@contextlib.contextmanager
def _started(installed: Installed, line: SerialLine, log: Path) -> Iterator[_Monitor]:
    """The program with all that drive mode needs; it is gone after the block."""
    # Only its owner may enter it, as the monitor asks.
    folder = tempfile.TemporaryDirectory(prefix="workbench-")
    control = Path(folder.name)
    root = str(Path(workbench.__file__).resolve().parents[1])
    process = subprocess.Popen(
        [
            sys.executable, "-P", "-m", _MODULE, f"--bundle={installed.bundle}",
            f"--public-key={installed.public_key}", "--interface=slcan", f"--channel={line.name}",
            "--mode=drive", f"--control={control}", f"--log={log}", f"--wait={_READY_S}",
        ],
        stderr=subprocess.PIPE, env={**os.environ, "PYTHONPATH": root},
    )  # fmt: skip
    monitor = _Monitor(process, control)
    try:
        yield monitor
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        monitor.close()
        assert process.stderr is not None, "a pipe was asked for"
        process.stderr.close()
        folder.cleanup()


@final
class _Live:
    """The world, kept to the clock on the wall."""

    def __init__(self, world: BusWorld, line: SerialLine, story: LiveStory) -> None:
        self._world, self._line, self._story = world, line, story
        self._begun_s = time.monotonic()
        self.behind_s = 0.0

    def _elapsed_s(self) -> float:
        return time.monotonic() - self._begun_s

    def step(self) -> None:
        """What has come goes in, what is due goes out."""
        world = self._world
        for identifier, data in self._line.receive(_PACE_S):
            world.hear(identifier, data)
            said = decode(_OWN, identifier, data)
            if not isinstance(said, Refusal) and said.message == "HEARTBEAT":
                self._story.beat(data, State(int(said.values["STATE"])))
        now_us = round(1e6 * self._elapsed_s())
        if world.scenario_s > 0.0:
            self.behind_s = max(self.behind_s, (now_us - world.now_us) / 1e6)
        for sent in world.until(now_us):
            self._line.send((sent.identifier, sent.data))

    def until_ready(self, monitor: _Monitor) -> float:
        """The car stands, until the monitor waits to be armed; how long that took, s."""
        while monitor.state != State.DISARMED.name:
            self.step()
            monitor.require_alive()
            if self._elapsed_s() > _READY_S:
                raise InputError(
                    f"expected workbench-monitor to be ready within {_READY_S:g} s, it said: "
                    f"{monitor.said.strip()[-300:] or 'nothing'}"
                )
        self._world.begin(self._world.now_us + _SOON_US)
        return self._elapsed_s()

    def until_over(self, monitor: _Monitor, progress: Progress | None) -> None:
        """The scenario."""
        duration_s, done = self._world.scene.scenario.duration_s, 0
        monitor.may_arm()
        while self._world.scenario_s < duration_s:
            self.step()
            monitor.require_alive()
            if progress is not None and done < int(self._world.scenario_s):
                done = int(self._world.scenario_s)
                progress(done, max(done, int(duration_s)))

    def until_ended(self, monitor: _Monitor) -> int:
        """It is told to end, brakes to standstill and leaves; its exit status."""
        self._story.ends()
        monitor.process.send_signal(signal.SIGTERM)
        since_s = self._elapsed_s()
        while monitor.process.poll() is None and self._elapsed_s() - since_s < _ENDS_S:
            self.step()
        if monitor.process.poll() is None:
            raise InputError(
                f"expected workbench-monitor to end within {_ENDS_S:g} s of SIGTERM, it goes on"
            )
        return int(monitor.process.returncode)


def _again(folder: Path, file: Path, story: LiveStory) -> tuple[BusDrive, Compared]:
    """The drive with every decision that the log holds."""
    log = open_log(file)
    assert log.header is not None, "the monitor writes one"
    played = PlayedAgain(core_again(load_bundle(folder), log.header))
    compared = compare(played, log.events, exact=log.exact)
    return story.told(played.results), compared
