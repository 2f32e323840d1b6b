"""The programs of a vehicle as processes of their own, on buses that are lines of the system."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import workbench
from workbench.errors import InputError
from workbench.runtime.onboard.control import ask
from workbench.runtime.onboard.states import State

LOCALISER_LOG: Final = "localiser.jsonl"
_MONITOR: Final = "workbench.runtime.onboard.main"
_LOCALISER: Final = "workbench.runtime.localiser.main"
_LISTENING: Final = "listening"
_ASKED_EVERY_S: Final = 0.25


@final
@dataclass(frozen=True, slots=True)
class Installed:
    """What stands on a vehicle's disk: the folder of a signed bundle with the scenario's path, the
    public key that it is checked with, and the folder of a localiser that the same key signed, None
    where there is none."""

    bundle: Path
    public_key: Path
    localiser: Path | None = None


@final
@dataclass(frozen=True, slots=True)
class Ended:
    """A process that has ended: its exit status, and what it wrote on standard error."""

    status: int
    said: str


@final
class Program:
    """A process of the vehicle, and what it says."""

    def __init__(self, name: str, module: str, words: Sequence[str]) -> None:
        root = str(Path(workbench.__file__).resolve().parents[1])
        self.name, self.said = name, ""
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", module, *words],
            stderr=subprocess.PIPE, env={**os.environ, "PYTHONPATH": root},
        )  # fmt: skip
        self._over = threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def listens(self) -> bool:
        """Whether it has said that it does."""
        return _LISTENING in self.said

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self._process.poll() is None

    def require_alive(self) -> None:
        """InputError with its last words where it has ended."""
        if not self.runs:
            words = self.said.strip().splitlines() or ["no message"]
            raise InputError(f"expected {self.name} to run, it ended: {words[-1]}")

    def terminate(self) -> None:
        """Tell it to end (SIGTERM)."""
        self._process.send_signal(signal.SIGTERM)

    def ended(self) -> Ended:
        """How it ended; it has."""
        self._reader.join()
        return Ended(int(self._process.wait()), self.said)

    def close(self) -> None:
        """It is gone, and nobody listens to it any more."""
        if self.runs:
            self._process.kill()
        self._process.wait()
        self._over.set()
        self._reader.join()
        assert self._process.stderr is not None, "a pipe was asked for"
        self._process.stderr.close()

    def _read(self) -> None:
        stream = self._process.stderr
        assert stream is not None, "a pipe was asked for"
        while not self._over.is_set():
            if select.select((stream,), (), (), 0.1)[0]:
                text = os.read(stream.fileno(), 4096)
                if not text:
                    return
                self.said += text.decode(errors="replace")


@final
class Operator:
    """Who asks the monitor for its state, arms it, and arms it again after a fault; a car that was
    yielded with a latched fault is disarmed first, as REARM has no effect then."""

    def __init__(self, control: Path) -> None:
        self._control, self.state = control, ""
        self._over, self._arms = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._operate, daemon=True)
        self._thread.start()

    def may_arm(self) -> None:
        """From now on."""
        self._arms.set()

    def close(self) -> None:
        """Nobody asks any more."""
        self._over.set()
        self._thread.join()

    def _operate(self) -> None:
        rearmed = False
        while not self._over.wait(_ASKED_EVERY_S):
            with contextlib.suppress(InputError, OSError):
                found = ask(self._control, "status", wait_s=0.5)
                self.state = str(found.get("state", ""))
                word, yielded = _WORDS.get(self.state), self.state == State.YIELDED.name
                if yielded and rearmed:
                    word = "disarm"
                if word is not None and self._arms.is_set():
                    rearmed = yielded and not rearmed
                    ask(self._control, word.format(code=found.get("code")), wait_s=0.5)
                    self._over.wait(1.0)


_WORDS: Final[Mapping[str, str]] = {
    State.DISARMED.name: "arm {code}",
    State.FAULT.name: "disarm",
    State.YIELDED.name: "rearm {code}",
}


@contextlib.contextmanager
def monitor_on(
    channel: str, installed: Installed, log: Path, *, wait_s: float
) -> Iterator[tuple[Program, Operator]]:
    """`workbench-monitor` with all that drive mode needs, and its operator; gone after the block.

    channel: of `slcan`; wait_s: how long it waits for reports.
    """
    with contextlib.ExitStack() as open_things:
        # Only its owner may enter it, as the monitor asks.
        folder = open_things.enter_context(tempfile.TemporaryDirectory(prefix="workbench-"))
        control = Path(folder)
        monitor = Program("workbench-monitor", _MONITOR, [
            f"--bundle={installed.bundle}", f"--public-key={installed.public_key}",
            "--interface=slcan", f"--channel={channel}", "--mode=drive", f"--control={control}",
            f"--log={log}", f"--wait={wait_s}",
        ])  # fmt: skip
        open_things.callback(monitor.close)
        operator = Operator(control)
        open_things.callback(operator.close)
        yield monitor, operator


@contextlib.contextmanager
def localiser_on(
    channel: str, installed: Installed, log: Path, *, wait_s: float
) -> Iterator[Program]:
    """`workbench-localiser`; gone after the block. log: folder for `LOCALISER_LOG`."""
    log.mkdir(parents=True, exist_ok=True)
    localiser = Program("workbench-localiser", _LOCALISER, [
        f"--localiser={installed.localiser}", f"--public-key={installed.public_key}",
        "--interface=slcan", f"--channel={channel}", f"--log={log / LOCALISER_LOG}",
        f"--wait={wait_s}",
    ])  # fmt: skip
    try:
        yield localiser
    finally:
        localiser.close()
