"""A monitor process with a fake core, for tests with real buses: its arguments are interface,
channel, mode, and how many seconds it lives at most."""

from __future__ import annotations

import signal
import sys

from onboard_world import Notes
from onboard_world_fake_core import FakeCore

from workbench.runtime.onboard.bus import BusSettings, PythonCanBus
from workbench.runtime.onboard.loop import Loop, MonotonicClock


def main(interface: str, channel: str, mode: str, seconds: str) -> int:
    sends = mode != "shadow"
    settings = BusSettings(interface, channel, listens_only=not sends)
    clock = MonotonicClock()
    notes = Notes(timeline=None)  # type: ignore[arg-type]
    loop = Loop(
        FakeCore(stands_after=3), PythonCanBus(settings),
        open_bus=lambda: PythonCanBus(settings), sends=sends, clock=clock, surroundings=notes,
    )  # fmt: skip
    signal.signal(signal.SIGTERM, lambda *_: loop.stop())
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    end = None
    while end is None and clock.now_us() < float(seconds) * 1e6:
        end = loop.once()
    sys.stdout.write(f"{loop.counts}\n")
    return 99 if end is None else end.value


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
