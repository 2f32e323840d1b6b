"""A core that decides nothing: it notes what the loop tells it and sends one command a turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from workbench.runtime.onboard.commands import Frame
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.states import Request, State


@dataclass(frozen=True)
class FakeResult:
    at_us: int
    frames: tuple[Frame, ...]
    state: State
    decided_us: int | None = None
    decision: Any = None
    observation: Any = None
    faults: tuple[Any, ...] = ()
    events: tuple[str, ...] = ()


FRAMES = (Frame(0x6B, bytes(8)), Frame(0x67, bytes(8)), Frame(0x69, bytes([1]) + bytes(7)))


@dataclass
class FakeCore:
    """stands_after: turns after DISARM until it lets go of the car."""

    frames: tuple[Frame, ...] = FRAMES
    state: State = State.TRACKING
    stands_after: int = 0
    decides_every: int = 3
    received: list[tuple[int, int, bytes]] = field(default_factory=list)
    errors: list[tuple[int, BusError]] = field(default_factory=list)
    requests: list[tuple[int, Request]] = field(default_factory=list)
    turns: list[int] = field(default_factory=list)

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        self.received.append((at_us, identifier, data))

    def bus_error(self, kind: BusError, at_us: int) -> None:
        self.errors.append((at_us, kind))

    def request(self, request: Request, at_us: int) -> None:
        self.requests.append((at_us, request))

    def turn(self, at_us: int, clock: Callable[[], int]) -> Any:
        self.turns.append(at_us)
        disarms = [asked for _, asked in self.requests if asked is Request.DISARM]
        if len(disarms) > 1 or (disarms and self.stands_after <= 0):
            self.state = State.DISARMED
        elif disarms:
            self.state, self.stands_after = State.BRAKING, self.stands_after - 1
        decides = len(self.turns) % self.decides_every == 1
        return FakeResult(at_us, self.frames, self.state, clock() if decides else None)
