"""What goes on beside the loop is told once, waits for nobody, and changes no decision."""

from __future__ import annotations

import os
from collections import deque
from dataclasses import dataclass
from typing import Any

import pytest
from onboard_world_bus import Timeline, VirtualClock
from onboard_world_fake_core import FakeResult

from workbench.runtime.onboard import attending
from workbench.runtime.onboard.attending import Attendant, memory_mib, open_files, say
from workbench.runtime.onboard.bus import BusFaultError, Heard
from workbench.runtime.onboard.control import Word
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.loop import Counts
from workbench.runtime.onboard.recorder import RecorderState
from workbench.runtime.onboard.states import Request, State

CLOCK = VirtualClock(Timeline())


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tests' own process is larger than a vehicle's."""
    monkeypatch.setattr(attending, "memory_mib", lambda: 45.0)
    monkeypatch.setattr(attending, "open_files", lambda: 12)


class Control:
    def __init__(self) -> None:
        self.situations: list[dict[str, object]] = []

    def heard(self, situation: dict[str, object]) -> tuple[Word, ...]:
        self.situations.append(situation)
        return (Word.REARM, Word.DISARM)


@dataclass
class Recorder:
    found: RecorderState
    details_of: int = 0

    def details(self, result: object) -> None:
        self.details_of += 1

    def state(self) -> RecorderState:
        return self.found


class Upstream:
    def __init__(self, *frames: Heard, fails: BusFaultError | None = None) -> None:
        self.frames, self.fails, self.closed = deque(frames), fails, False

    def receive(self, wait_us: int) -> Heard | None:
        assert wait_us == 0
        if self.fails is not None:
            raise self.fails
        return self.frames.popleft() if self.frames else None

    def close(self) -> None:
        self.closed = True


def turned(attendant: Attendant, turns: int, *events: str) -> None:
    for _ in range(turns):
        attendant.turned(FakeResult(1_500_000, (), State.ARMED, events=events), Counts())  # type: ignore[arg-type]


def test_the_operator_hears_the_state_and_is_heard() -> None:
    control: Any = Control()
    attendant = Attendant(clock=CLOCK, control=control, said=lambda text: None)
    assert attendant.before() == [Request.REARM, Request.DISARM]
    turned(attendant, 1)
    attendant.before()
    assert control.situations[0]["state"] == "DISARMED"
    assert control.situations[1]["state"] == "ARMED"
    assert control.situations[1]["late"] == 0


def test_events_are_said_with_their_instant() -> None:
    said: list[str] = []
    turned(Attendant(clock=CLOCK, said=said.append), 1, "DISARMED -> ARMED")
    assert said == ["1.500 s: DISARMED -> ARMED"]


@pytest.mark.parametrize(
    ("state", "told"),
    [
        (RecorderState(10, 0, 0, "", True), False),
        (RecorderState(10, 3, 0, "", True), True),
        (RecorderState(10, 0, 2, "No space left on device", True), True),
        (RecorderState(10, 0, 0, "", False), True),
    ],
)
def test_a_log_with_gaps_is_one_alert(state: RecorderState, told: bool) -> None:
    said: list[str] = []
    recorder: Any = Recorder(state)
    control: Any = Control()
    attendant = Attendant(clock=CLOCK, control=control, recorder=recorder, said=said.append)
    turned(attendant, 90)
    assert recorder.details_of == 90
    assert [text[:15] for text in said] == ["ALERT: LOG_LOST"] * told
    attendant.before()
    assert len(control.situations[-1]["alerts"]) == told


def test_a_leak_is_one_alert(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    attendant = Attendant(clock=CLOCK, said=said.append)
    turned(attendant, 60)
    assert said == []
    monkeypatch.setattr(attending, "open_files", lambda: 500)
    turned(attendant, 60)
    assert [text[:11] for text in said] == ["ALERT: LEAK"]


def test_the_gauges_read_this_process() -> None:
    assert 5.0 < memory_mib() < 10_000.0
    before = open_files()
    with open(os.devnull):
        assert open_files() == before + 1


def test_upstream_frames_are_taken_before_the_turn_and_errors_are_not() -> None:
    taken: list[tuple[int, bytes, int]] = []
    frames = [Heard(k, bytes([k])) for k in range(100)]
    frames.insert(3, Heard(0, b"", BusError.ERROR_FRAME))
    bus: Any = Upstream(*frames)
    attendant = Attendant(
        clock=CLOCK, upstream=(bus, lambda *frame: taken.append(frame)), said=lambda text: None
    )
    assert list(attendant.before()) == []
    assert [each[0] for each in taken] == list(range(63))
    attendant.before()
    assert [each[0] for each in taken] == list(range(100))


@pytest.mark.parametrize("broken", [False, True])
def test_a_lost_upstream_bus_is_one_alert(broken: bool) -> None:
    said: list[str] = []
    bus: Any = Upstream(fails=BusFaultError(BusError.RECEIVE, "gone", broken=broken))
    attendant = Attendant(clock=CLOCK, upstream=(bus, lambda *_: None), said=said.append)
    for _ in range(5):
        attendant.before()
    assert said == ["ALERT: UPSTREAM_BUS: gone"]
    assert bus.closed is broken


def test_nobody_who_does_not_read_holds_up_a_line() -> None:
    reader, writer = os.pipe()
    kept = os.dup(2)
    try:
        os.dup2(writer, 2)
        for _ in range(1_000):
            say("x" * 1_000)
        os.dup2(kept, 2)
        os.set_blocking(reader, False)
        # What the pipe holds was said, and the rest was dropped instead of waited for.
        assert 0 < len(os.read(reader, 1_000_000)) < 400_000
    finally:
        os.dup2(kept, 2)
        for number in (reader, writer, kept):
            os.close(number)
