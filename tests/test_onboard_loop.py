"""The loop keeps its period and its gaps, drops what may be old, and ends as it is asked to."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator

import can
import pytest
from onboard_world import Notes, World
from onboard_world_fake_core import FRAMES, FakeCore
from onboard_world_inside import Slow, bus_down

from workbench.runtime.onboard.bus import (
    BusSettings,
    PythonCanBus,
)
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.loop import GAP_US, End, Loop, MonotonicClock
from workbench.runtime.onboard.states import Request
from workbench.runtime.onboard.times import TURN_US


class Quiet(Notes):
    """Notes without virtual time."""

    def before(self) -> list[Request]:
        due, self.asked = self.asked, []
        return [request for _, request in due]


def quiet() -> Quiet:
    return Quiet(timeline=None)  # type: ignore[arg-type]


def test_turns_come_every_period_and_frames_keep_their_gap() -> None:
    core = FakeCore()
    world = World(core, sends=True, seed=4).run(3_000_000)
    assert {b - a for a, b in itertools.pairwise(core.turns)} == {TURN_US}
    handed = [at_us for at_us, _, _ in world.port.handed]
    assert min(b - a for a, b in itertools.pairwise(handed)) >= GAP_US
    assert world.loop.counts.late == world.loop.counts.jitter_us == 0
    assert len(handed) == 3 * len(core.turns) == world.loop.counts.sent


def test_frames_are_stamped_when_they_are_read_and_never_early() -> None:
    core = FakeCore()
    world = World(core, sends=False, seed=4).run(3_000_000)
    came = {(e.frame.identifier, e.frame.data): e.at_us for e in world.trace}
    stamps = [at_us for at_us, _, _ in core.received]
    assert stamps == sorted(stamps)
    waits = []
    on_bus = [(e.at_us, e.frame.identifier) for e in world.trace if e.frame.sender != "monitor"]
    for (at_us, identifier, _), (came_us, sent) in zip(core.received, on_bus, strict=False):
        assert identifier == sent
        waits.append(at_us - came_us)
    assert min(waits) >= 0
    assert max(waits) <= 12_000
    assert came


def test_a_hang_drops_what_may_be_old() -> None:
    core = FakeCore()
    world = World(core, sends=True, seed=4, injectors=[Slow(1_000_000, 500_000, hangs=True)])
    world.run(3_000_000)
    assert world.loop.counts.stale > 50
    assert world.loop.counts.late == 1
    on_bus = [e for e in world.trace if e.frame.sender != "monitor"]
    assert len(core.received) + world.loop.counts.stale == pytest.approx(len(on_bus), abs=3)
    over_us = world.injectors[0].condition_us
    assert over_us is not None
    # The turn after it comes at once, and the period is kept from there on.
    after = [at_us for at_us in core.turns if at_us >= over_us]
    assert after[0] == over_us
    assert after[1] - after[0] == TURN_US


def test_an_overrun_is_followed_by_a_turn_at_once() -> None:
    core = FakeCore()
    world = World(core, sends=True, seed=4, injectors=[Slow(1_000_000, 60_000)]).run(2_000_000)
    gaps = [b - a for a, b in itertools.pairwise(core.turns)]
    # The turn is followed by the next once its own frames are out.
    assert sum(gap != TURN_US for gap in gaps) == 1
    assert max(gaps) == pytest.approx(60_000 + 2 * GAP_US, abs=300)
    assert world.loop.counts.late == 1


def test_shadow_hands_nothing_to_the_bus() -> None:
    world = World(FakeCore(), sends=False, seed=4).run(2_000_000)
    assert world.port.handed == []
    assert all(each.frame.sender != "monitor" for each in world.trace)
    world.loop.stop()
    assert world.loop.once() is End.ORDERLY


def test_a_stop_brakes_first_and_a_second_one_lets_go() -> None:
    core = FakeCore(stands_after=5)
    world = World(core, sends=True).run(500_000)
    turns = len(core.turns)
    world.loop.stop()
    ends = [world.loop.once() for _ in range(6)]
    assert ends == [None] * 5 + [End.ORDERLY]
    assert len(core.turns) == turns + 6
    assert not world.port.open

    core = FakeCore(stands_after=10**9)
    world = World(core, sends=True).run(500_000)
    world.loop.stop()
    assert [world.loop.once() for _ in range(3)] == [None] * 3
    world.loop.stop()
    assert world.loop.once() is End.AT_ONCE
    assert [request for _, request in core.requests] == [Request.DISARM] * 2


def test_the_operator_is_heard_until_the_end_is_asked_for() -> None:
    core = FakeCore(stands_after=3)
    world = World(core, sends=True)
    world.notes.asked = [(100_000, Request.ARM), (700_000, Request.REARM)]
    world.run(600_000)
    world.loop.stop()
    world.run(1_000_000)
    assert [request for _, request in core.requests] == [Request.ARM, Request.DISARM]


def test_a_full_queue_keeps_the_bus_and_drops_what_would_be_late() -> None:
    core = FakeCore()
    world = World(core, sends=True, injectors=[bus_down(500_000, for_us=200_000)]).run(1_000_000)
    assert {kind for _, kind in core.errors} == {BusError.SEND}
    assert world.loop.counts.reopened == 0
    assert world.loop.counts.unsent == len(core.errors)
    silent = [at for at, _, _ in world.port.handed if 520_000 <= at < 700_000]
    assert silent == []
    # Nothing made before is sent after.
    assert world.loop.counts.sent + world.loop.counts.unsent == 3 * len(core.turns)


def test_what_takes_too_long_to_send_stays_and_the_core_hears_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    core = FakeCore()
    world = World(core, sends=True)
    send = world.port.send

    def slow(identifier: int, data: bytes) -> None:
        world.timeline.run(world.timeline.now_us + 5_000)
        send(identifier, data)

    monkeypatch.setattr(world.port, "send", slow)
    world.run(1_000_000)
    turns = len(core.turns)
    # Frames at 0 and 5.5 ms after they were made; the third would begin at 11 ms.
    assert (world.loop.counts.sent, world.loop.counts.unsent) == (2 * turns, turns)
    assert [kind for _, kind in core.errors] == [BusError.LATE] * turns


@pytest.mark.parametrize(("takes_us", "late"), [(7_500, False), (9_000, True)])
def test_a_last_frame_that_went_out_late_is_told_too(
    monkeypatch: pytest.MonkeyPatch, takes_us: int, late: bool
) -> None:
    core = FakeCore(frames=FRAMES[:1])
    world = World(core, sends=True)
    send = world.port.send

    def slow(identifier: int, data: bytes) -> None:
        world.timeline.run(world.timeline.now_us + takes_us)
        send(identifier, data)

    monkeypatch.setattr(world.port, "send", slow)
    world.run(1_000_000)
    assert world.loop.counts.sent == len(core.turns)
    assert [kind for _, kind in core.errors] == [BusError.LATE] * (late * len(core.turns))


def test_a_broken_bus_is_opened_again_less_and_less_often() -> None:
    core = FakeCore()
    down = bus_down(500_000, for_us=3_000_000, sending=False)
    world = World(core, sends=True, injectors=[down]).run(6_000_000)
    assert core.errors[0][1] is BusError.RECEIVE
    assert 5 <= world.loop.counts.reopened <= 8
    gaps = {b - a for a, b in itertools.pairwise(core.turns)}
    assert gaps == {TURN_US}, "turns go on without a bus"
    assert core.received[-1][0] > 5_900_000


@contextlib.contextmanager
def virtual_channel(name: str) -> Iterator[can.BusABC]:
    bus = can.Bus(channel=name, interface="virtual")
    try:
        yield bus
    finally:
        bus.shutdown()


def run_for(core: FakeCore, settings: BusSettings, seconds: float, *, sends: bool) -> Loop:
    clock = MonotonicClock()
    loop = Loop(
        core, PythonCanBus(settings), open_bus=lambda: PythonCanBus(settings), sends=sends,
        clock=clock, surroundings=quiet(),
    )  # fmt: skip
    while clock.now_us() < seconds * 1e6:
        loop.once()
    return loop


def test_real_time_on_a_virtual_bus() -> None:
    core = FakeCore()
    with virtual_channel("loop") as other:
        settings = BusSettings("virtual", "loop", listens_only=False)
        other.send(can.Message(arbitration_id=0x6F, data=bytes(8), is_extended_id=False))
        loop = run_for(core, settings, 1.0, sends=True)
        received = []
        while (message := other.recv(0)) is not None:
            received.append(message.arbitration_id)
    assert len(core.turns) == pytest.approx(31, abs=2)
    assert set(received) == {frame.identifier for frame in FRAMES}
    assert len(received) == loop.counts.sent
    assert loop.counts.sent + loop.counts.unsent == 3 * len(core.turns)
