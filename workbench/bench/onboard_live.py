"""A program: the real loop in real time on python-can's `virtual` bus, with a car at its other end.

Like `onboard_feed` it runs as a file of its own. The car is a thread of the same process, because
that bus does not leave one: what it takes of the interpreter counts against the loop, but not the
5 ms for which one thread of CPython may keep another waiting.
"""

from __future__ import annotations

import gc
import json
import sys
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, final

from workbench.runtime.bundle import load_bundle
from workbench.runtime.onboard.bus import BusSettings, Heard, PythonCanBus
from workbench.runtime.onboard.core import Core
from workbench.runtime.onboard.loop import Clock, Counts, Loop, MonotonicClock
from workbench.runtime.onboard.sensors_file import settings_from
from workbench.runtime.onboard.states import Mode, Request
from workbench.runtime.onboard.turns import TurnResult
from workbench.runtime.protocols import load_protocol
from workbench.simulation.onboard_car import Crowd, OnboardCar, straight_road
from workbench.simulation.onboard_operator import Operator

CHANNEL: Final = "workbench-bench"
_ROAD_M: Final = (-20.0, 4_000.0)
_LAST_OF_SET: Final = load_protocol("pacmod2").by_name["GLOBAL_CMD"].frame_id
_CAR_S: Final = 0.002
_SWITCH_S: Final = 0.0002


@final
class Watched:
    """A bus that notes when the last set of commands was whole on it, None: not since asked."""

    def __init__(self, bus: PythonCanBus, clock: Clock) -> None:
        self._bus, self._clock = bus, clock
        self._set_us: int | None = None

    def set_us(self) -> int | None:
        """When, if since the last call."""
        found, self._set_us = self._set_us, None
        return found

    def receive(self, wait_us: int) -> Heard | None:
        """As `Bus.receive`."""
        return self._bus.receive(wait_us)

    def send(self, identifier: int, data: bytes) -> None:
        """As `Bus.send`."""
        self._bus.send(identifier, data)
        if identifier == _LAST_OF_SET:
            self._set_us = self._clock.now_us()

    def close(self) -> None:
        """As `Bus.close`."""
        self._bus.close()


@final
class Beside:
    """`Surroundings` of the loop: the operator, and a line per turn.

    turns: what `onboard_period.TurnSeen` holds, in its order.
    """

    def __init__(self, clock: Clock, bus: Watched) -> None:
        self._clock, self._bus, self._operator = clock, bus, Operator()
        self._last: TurnResult | None = None
        self.turns: list[tuple[int, int | None, int, int | None, int, str, list[str]]] = []

    def before(self) -> Iterable[Request]:
        """As `Surroundings.before`."""
        asked = self._operator.asks(self._last)
        return () if asked is None else (asked,)

    def turned(self, result: TurnResult, counts: Counts) -> None:
        """As `Surroundings.turned`."""
        faults = [found.fault.name for found in result.faults]
        ended_us = self._clock.now_us()
        self._last = result
        self.turns.append((
            result.at_us, result.decided_us, ended_us, self._bus.set_us(), counts.unsent,
            result.state.name, faults,
        ))  # fmt: skip


def _drive_car(car: OnboardCar, bus: Any, clock: Clock, over: threading.Event) -> None:
    """The car's thread: frames go out when they are due, commands are taken as they come."""
    from can import Message

    while not over.wait(_CAR_S):
        while (heard := bus.recv(0)) is not None:
            car.hear(heard.arbitration_id, bytes(heard.data))
        for each in car.until(clock.now_us()):
            bus.send(Message(arbitration_id=each.identifier, data=each.data, is_extended_id=False))


def main(folder: str, seconds: float, out: str) -> None:
    """Drive the bundle in `folder` for so long, and write into the folder `out`."""
    import can

    bundle = load_bundle(folder)
    settings = settings_from(bundle.manifest, signed=True, tag=0)
    core = Core(bundle, straight_road(*_ROAD_M), settings, mode=Mode.DRIVE)
    where = BusSettings("virtual", CHANNEL, listens_only=False)
    clock, over = MonotonicClock(), threading.Event()
    bus = Watched(PythonCanBus(where), clock)
    beside = Beside(clock, bus)
    other = can.Bus(interface="virtual", channel=CHANNEL)
    car = threading.Thread(
        target=_drive_car, args=(OnboardCar(settings, Crowd()), other, clock, over), daemon=True
    )
    loop = Loop(core, bus, open_bus=lambda: bus, sends=True, clock=clock, surroundings=beside)
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(_SWITCH_S)
    car.start()
    while clock.now_us() < seconds * 1e6:
        loop.once()
    over.set()
    car.join()
    other.shutdown()
    bus.close()
    told = {
        "turns": beside.turns, "stale": loop.counts.stale,
        "allowed_s": [settings.timing.send_gap_s, settings.timing.latency_s],
        "modules": sorted(sys.modules),
    }  # fmt: skip
    (Path(out) / "told.json").write_text(json.dumps(told))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), sys.argv[3])
