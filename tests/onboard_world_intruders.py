"""Somebody else on the bus: spoofed commands, floods, another protocol's reports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from onboard_world import World
from onboard_world_injectors import Counted, identifiers

from workbench.runtime.protocols import load_protocol


@dataclass
class Intruder(Counted):
    """Somebody else sends: command identifiers, a flood, another protocol's reports.

    frames: what, in turn; period_us between two of them; keep: how many wait in its controller at
    most (a babbling idiot keeps one ready at all times).
    """

    frames: Sequence[tuple[int, bytes]] = field(kw_only=True)
    period_us: int = field(kw_only=True)
    keep: int = field(default=1, kw_only=True)
    most: int = field(default=10**9, kw_only=True)
    sent: int = field(default=0, init=False)

    def begin(self, world: World) -> None:
        def send() -> None:
            if self.sent >= self.most:
                return
            world.timeline.at(world.timeline.now_us + self.period_us, send)
            if world.bus.waiting("intruder") < self.keep:
                identifier, data = self.frames[self.sent % len(self.frames)]
                self.sent += 1
                world.send("intruder", identifier, data, by=self)

        world.timeline.at(self.start_us, send)


def babbling(start_us: int, *, period_us: int = 100) -> Intruder:
    """Identifier 0 without a pause: nobody else gets through."""
    return Intruder(start_us, frames=[(0, bytes(8))], period_us=period_us)


def flood(start_us: int, *, per_s: int = 1_000) -> Intruder:
    """Identifier 0 so many times a second."""
    return Intruder(start_us, frames=[(0, bytes(8))], period_us=1_000_000 // per_s)


def spoofed(start_us: int, name: str, data: bytes) -> Intruder:
    """One frame of an identifier that only the monitor sends."""
    return Intruder(start_us, frames=[(identifiers(name)[0], data)], period_us=33_333, most=1)


def other_protocol(start_us: int) -> Intruder:
    """Reports of PACMod 3 beside PACMod 2's."""
    three = load_protocol("pacmod3").by_name
    frames = [(three[n].frame_id, bytes(three[n].length)) for n in
              ("GLOBAL_RPT", "BRAKE_RPT", "STEERING_RPT", "VEHICLE_SPEED_RPT")]  # fmt: skip
    return Intruder(start_us, frames=frames, period_us=8_000)
