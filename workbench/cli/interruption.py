"""Ctrl-C that arrives: CasADi's type checks clear a KeyboardInterrupt raised inside them. Other
signals that end a command as Ctrl-C does."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Final

# Raised again this often until it leaves the command; one try can be cleared, not all of them.
_AGAIN_S: Final = 0.05
_SAID: Final = b"\nstopping; Ctrl-C again stops at once\n"

_ENDING: Final = (signal.SIGTERM, signal.SIGHUP)

_asked = threading.Event()


@contextlib.contextmanager
def stoppable() -> Iterator[None]:
    """Within the block the first Ctrl-C ends in KeyboardInterrupt, the second ends the process.

    Leaves the signals alone where somebody else handles or ignores them, and outside the main
    thread. Files stay whole: commands write them beside their place and move them there.
    """
    _asked.clear()
    ours = threading.current_thread() is threading.main_thread() and (
        signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if not ours:
        yield
        return
    alarm = signal.signal(signal.SIGALRM, _raise_again)
    signal.signal(signal.SIGINT, _stop)
    shown = sys.unraisablehook

    def show(swallowed: sys.UnraisableHookArgs) -> None:
        # A callback that Python calls, of a weak reference say, cannot raise: it comes again.
        if not (_asked.is_set() and issubclass(swallowed.exc_type, KeyboardInterrupt)):
            shown(swallowed)

    sys.unraisablehook = show
    try:
        yield
    finally:
        sys.unraisablehook = shown
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGALRM, alarm)


@contextlib.contextmanager
def ended_kindly() -> Iterator[None]:
    """Within the block the first SIGTERM or SIGHUP ends in KeyboardInterrupt, so that whatever was
    started ends too; the next ones do nothing.

    Leaves alone what somebody else handles or ignores, and all of it outside the main thread.
    """
    ours: list[signal.Signals] = []
    if threading.current_thread() is threading.main_thread():
        ours = [each for each in _ENDING if signal.getsignal(each) is signal.SIG_DFL]
    for each in ours:
        signal.signal(each, _end)
    try:
        yield
    finally:
        for each in ours:
            signal.signal(each, signal.SIG_DFL)


def _end(number: int, frame: FrameType | None) -> None:
    if _asked.is_set():
        return
    if signal.getsignal(signal.SIGALRM) is _raise_again:
        _stop(number, frame)
    _asked.set()
    raise KeyboardInterrupt


def check() -> None:
    """Raise KeyboardInterrupt when a stop was asked for and has been cleared on its way."""
    if _asked.is_set():
        raise KeyboardInterrupt


def _stop(_signal: int, _frame: FrameType | None) -> None:
    _asked.set()
    # The system's own answer, because a handler in Python waits for compiled code to return.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, _AGAIN_S, _AGAIN_S)
    with contextlib.suppress(OSError):
        os.write(2, _SAID)
    raise KeyboardInterrupt


def _raise_again(_signal: int, _frame: FrameType | None) -> None:
    handled = sys.exception()
    while handled is not None:
        if isinstance(handled, KeyboardInterrupt):
            return  # it is on its way out, and what cleans up must not be torn
        handled = handled.__context__
    check()
