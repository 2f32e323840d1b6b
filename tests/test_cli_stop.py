"""Ctrl-C ends every command with status 130 soon and leaves nothing half-written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from workbench.cli import interruption
from workbench.cli.main import main
from workbench.cli.output import Progress

pytest.importorskip("casadi", reason="needs the optional package casadi")

ROOT = Path(__file__).parent.parent
_FEW_S = 30.0

# Where the interrupt struck code that an extension ran as text, Python ends itself by the signal
# after its own clean-up; a shell shows 130 for both.
STOPPED = (130, -signal.SIGINT)


@pytest.fixture(autouse=True)
def interrupts_arrive() -> Iterator[None]:
    """Undo what a shell does to background jobs: they ignore SIGINT, and hand that on."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def _start(folder: Path, *words: str, program: str = "") -> subprocess.Popen[str]:
    where = ["-c", program] if program else ["-m", "workbench.cli.main", *words]
    return subprocess.Popen(
        [sys.executable, *where],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _wait_for_handler(running: subprocess.Popen[str]) -> None:
    """Return once the process catches SIGALRM, so that slow starting does not count."""
    bit = 1 << (signal.SIGALRM - 1)
    while running.poll() is None:
        status = Path(f"/proc/{running.pid}/status").read_text()
        caught = next(line for line in status.splitlines() if line.startswith("SigCgt"))
        if int(caught.split()[1], 16) & bit:
            time.sleep(0.1)  # SIGINT's own handler follows in the next line
            return
        time.sleep(0.02)


@pytest.mark.parametrize("after_s", [0.0, 0.8, 1.6])
@pytest.mark.parametrize(
    "words",
    [
        ("reach", "--system", "b2", "--step", "0.0005", "--csv", "out/tube.csv"),
        ("demo", "--out", "out/demo"),
    ],
)
def test_an_interrupt_ends_the_command(
    words: tuple[str, ...], after_s: float, tmp_path: Path
) -> None:
    running = _start(tmp_path, *words)
    _wait_for_handler(running)
    time.sleep(after_s)
    assert running.poll() is None
    running.send_signal(signal.SIGINT)
    sent_s = time.monotonic()
    out, err = running.communicate(timeout=60)
    assert running.returncode in STOPPED, err
    assert time.monotonic() - sent_s < _FEW_S
    assert (out, err.splitlines()[-1]) == ("", f"workbench {words[0]}: interrupted")
    assert "Traceback" not in err
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


_CLEARED = """
import argparse, signal, sys, time, types
from workbench.cli.main import main
module = types.ModuleType("workbench.cli.derive")
module.HELP, module.EXAMPLE, module.configure = "Stands in.", "workbench derive", lambda p: None
def run(args):
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        pass
    {then}
module.run = run
sys.modules[module.__name__] = module
sys.exit(main(["derive"]))
"""


@pytest.mark.parametrize(
    "then",
    [
        "time.sleep(30)",
        "return 0",
        "raise RuntimeError('spoilt')",
        "from workbench.cli.output import emit; emit(args, 'spoilt', {})",
    ],
)
def test_an_interrupt_that_was_cleared_comes_back(then: str, tmp_path: Path) -> None:
    running = _start(tmp_path, program=_CLEARED.replace("{then}", then))
    out, err = running.communicate(timeout=20)
    assert running.returncode in STOPPED, err
    assert (out, "Traceback" in err) == ("", False)


_SWALLOWED = """
import signal, sys, time, types, weakref
from workbench.cli.main import main
module = types.ModuleType("workbench.cli.derive")
module.HELP, module.EXAMPLE, module.configure = "Stands in.", "workbench derive", lambda p: None
def run(args):
    thing = type("Thing", (), {})()
    reference = weakref.ref(thing, fail)
    del thing
    time.sleep(30)
def fail(_):
    {fault}
module.run = run
sys.modules[module.__name__] = module
sys.exit(main(["derive"]))
"""


def test_an_interrupt_that_python_swallows_is_not_shown_as_a_defect(tmp_path: Path) -> None:
    """As in the callbacks of the import system: what they raise is printed, and goes no further."""
    interrupt = "signal.raise_signal(signal.SIGINT)"
    running = _start(tmp_path, program=_SWALLOWED.replace("{fault}", interrupt))
    out, err = running.communicate(timeout=20)
    assert running.returncode in STOPPED, err
    assert (out, err.splitlines()[-1]) == ("", "workbench derive: interrupted")
    assert "Traceback" not in err
    assert "ignored" not in err


def test_another_fault_that_python_swallows_is_shown(tmp_path: Path) -> None:
    fault = "raise ValueError('lost')"
    program = _SWALLOWED.replace("{fault}", fault).replace("sleep(30)", "sleep(0.0); return 0")
    _, err = _start(tmp_path, program=program).communicate(timeout=20)
    assert "ValueError: lost" in err


def test_the_second_interrupt_ends_the_process_at_once(tmp_path: Path) -> None:
    again = "[signal.raise_signal(signal.SIGINT), time.sleep(30)]"
    running = _start(tmp_path, program=_CLEARED.replace("{then}", again))
    running.communicate(timeout=20)
    assert running.returncode == -signal.SIGINT


_ENDED = """
import signal, sys, time
from workbench.cli import interruption
from workbench.cli.main import main
import types
signal.signal(signal.SIGINT, {interrupt})
signal.signal(signal.{name}, signal.SIG_DFL)
module = types.ModuleType("workbench.cli.derive")
module.HELP, module.EXAMPLE, module.configure = "Stands in.", "workbench derive", lambda p: None
def run(args):
    with interruption.ended_kindly():
        try:
            signal.raise_signal(signal.{name})
        finally:
            signal.raise_signal(signal.{name})
            time.sleep(0.2)
            print("cleaned up", flush=True)
module.run = run
sys.modules[module.__name__] = module
sys.exit(main(["derive"]))
"""


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
@pytest.mark.parametrize("interrupt", ["signal.default_int_handler", "signal.SIG_IGN"])
def test_a_command_that_starts_others_is_ended_with_them(
    name: str, interrupt: str, tmp_path: Path
) -> None:
    program = _ENDED.replace("{name}", name).replace("{interrupt}", interrupt)
    running = _start(tmp_path, program=program)
    out, err = running.communicate(timeout=20)
    assert (running.returncode, out) == (130, "cleaned up\n"), err
    assert err.endswith("workbench derive: interrupted\n")


def test_cleaning_up_is_not_interrupted_again() -> None:
    steps = []
    with pytest.raises(KeyboardInterrupt), interruption.stoppable():
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            for step in range(4):
                time.sleep(0.06)
                steps.append(step)
    assert steps == [0, 1, 2, 3]


def test_the_signals_are_given_back() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)
    assert main(["--version"]) == 0
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)) == before
    with interruption.stoppable(), Progress("quiet", 2) as bar:
        bar.advance()


def test_an_ignored_interrupt_stays_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interruption.stoppable():
            signal.raise_signal(signal.SIGINT)
            interruption.check()
    finally:
        signal.signal(signal.SIGINT, before)
