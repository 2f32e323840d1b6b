"""What goes on beside the loop, a little on every turn: operator, log, upstream bus, gauges."""

from __future__ import annotations

import os
import select
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Final, final

from workbench.runtime.onboard.bus import Bus, BusFaultError
from workbench.runtime.onboard.control import ControlSocket
from workbench.runtime.onboard.loop import Clock, Counts
from workbench.runtime.onboard.states import Request

if TYPE_CHECKING:
    from workbench.runtime.onboard.core import TurnResult
    from workbench.runtime.onboard.recorder import Recorder

_GAUGE_TURNS: Final = 30
_UPSTREAM_MOST: Final = 64
_LINE_BYTES: Final = 480
_MEMORY_MIB, _FILES = 60, 64
"""More than this is a leak: the program holds 45 MiB and a dozen files."""


def say(text: str) -> None:
    """A line for whoever watches stderr, or nothing where writing might wait."""
    line = text.encode("utf-8", "replace")[:_LINE_BYTES] + b"\n"
    try:
        if select.select((), (2,), (), 0)[1]:
            os.write(2, line)
    except (OSError, ValueError):
        # Nobody reads it; the log has it.
        return


def memory_mib() -> float:
    """Resident memory of this process, 0 where the system does not tell."""
    try:
        with open("/proc/self/statm", "rb") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
    except (OSError, ValueError, IndexError):
        return 0.0


def open_files() -> int:
    """Open files of this process, 0 where the system does not tell."""
    try:
        return len(os.listdir("/proc/self/fd"))
    except OSError:
        return 0


@final
class Attendant:
    """`Surroundings` of the loop on a vehicle.

    control: None where nobody may arm; recorder: None without a log; upstream: bus of the upstream
    controller and what takes its frames, None but in GATE. What goes wrong here is an ALERT on
    stderr and in `status`, once each, and changes no decision: LOG_LOST, LEAK, a lost upstream bus
    (which the core answers by UPSTREAM_LOST).
    """

    def __init__(
        self,
        *,
        clock: Clock,
        control: ControlSocket | None = None,
        recorder: Recorder | None = None,
        upstream: tuple[Bus, Callable[[int, bytes, int], None]] | None = None,
        said: Callable[[str], None] = say,
    ) -> None:
        self._clock, self._control, self._recorder = clock, control, recorder
        self._upstream, self._said = upstream, said
        self._alerts: dict[str, str] = {}
        self._situation: dict[str, object] = {"state": "DISARMED", "faults": []}
        self._turns = 0

    def before(self) -> Sequence[Request]:
        """As `Surroundings.before`."""
        self._take_upstream()
        if self._control is None:
            return ()
        words = self._control.heard({**self._situation, "alerts": [*self._alerts.values()]})
        return [Request(word.value) for word in words]

    def turned(self, result: TurnResult, counts: Counts) -> None:
        """As `Surroundings.turned`."""
        for event in result.events:
            self._said(f"{result.at_us / 1e6:.3f} s: {event}")
        if self._recorder is not None:
            self._recorder.details(result)
        self._turns += 1
        if self._control is not None:
            self._situation = {
                "state": result.state.name,
                "faults": [str(fault) for fault in result.faults],
                **asdict(counts),
            }
        if self._turns % _GAUGE_TURNS == 0:
            self._gauge()

    def _gauge(self) -> None:
        memory, files = memory_mib(), open_files()
        if memory > _MEMORY_MIB or files > _FILES:
            self._alert("LEAK", f"{memory:.0f} MiB and {files} open files; plan a restart")
        if self._recorder is not None:
            state = self._recorder.state()
            if not state.in_order:
                lost = f"{state.lost + state.failed} entries are missing; {state.error}"
                self._alert("LOG_LOST", lost)

    def _alert(self, name: str, detail: str) -> None:
        if name not in self._alerts:
            self._said(f"ALERT: {name}: {detail}")
        self._alerts[name] = f"{name}: {detail}"

    def _take_upstream(self) -> None:
        """Whatever has come since the last turn; a flood is cut off, and read on the next one."""
        if self._upstream is None:
            return
        bus, take = self._upstream
        try:
            for _ in range(_UPSTREAM_MOST):
                heard = bus.receive(0)
                if heard is None:
                    return
                if heard.error is None:
                    take(heard.identifier, heard.data, self._clock.now_us())
        except BusFaultError as fault:
            self._alert("UPSTREAM_BUS", str(fault))
            if fault.broken:
                bus.close()
                self._upstream = None
