"""The virtual world is what it says: bus times, arbitration, a car that obeys only when enabled."""

from __future__ import annotations

import pytest
from onboard_world import Injector, World
from onboard_world_bus import BITS_PER_S, Delivered, Frame, Timeline, VirtualBus, frame_us
from onboard_world_fake_core import FakeCore
from onboard_world_injectors import (
    LOCALISATION,
    PEOPLE,
    REPORTS,
    Changed,
    Delayed,
    Doubled,
    Frozen,
    Incomplete,
    Replayed,
    Stopped,
    Swapped,
    flipped,
    identifiers,
    raw_field,
    wrong_unit,
)
from onboard_world_inside import (
    Slow,
    brake_pedal,
    bus_down,
    clock_jump,
    crowd,
    emergency_stop,
    error_frame,
    silent_bus,
    steering_override,
    stuck_wheel,
    weak_brake,
    wrong_echo,
    wrong_gear,
)
from onboard_world_intruders import babbling, flood, other_protocol, spoofed
from onboard_world_plant import Plant, framed
from onboard_world_sensors import Walker

from workbench.runtime.onboard.commands import Frame as Command
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.protocols import (
    LocalisationSet,
    Localised,
    PeopleSeen,
    PersonSet,
    decode,
    load_protocol,
)

OWN = load_protocol("workbench")


def stuffed_bits(data: bytes) -> int:
    """The worst frame, bit by bit: a stuff bit after every fifth equal bit, stuff bits counted."""
    bits, run, added = 34 + 8 * len(data), 0, 0
    for _ in range(bits):
        run += 1
        if run == 5:
            # The stuff bit is the other way round, and the worst frame goes on with its like.
            added, run = added + 1, 1
    return bits + added


@pytest.mark.parametrize("size", range(9))
def test_a_frame_takes_its_bits_with_the_worst_stuffing(size: int) -> None:
    assert frame_us(bytes(size)) == (stuffed_bits(bytes(size)) + 13) * 1_000_000 // BITS_PER_S


def delivered_by(bus: VirtualBus) -> list[Delivered]:
    trace: list[Delivered] = []
    bus.hears.append(trace.append)
    return trace


def test_the_lowest_identifier_goes_first_and_each_frame_takes_its_time() -> None:
    line = Timeline()
    bus = VirtualBus(line)
    trace = delivered_by(bus)
    for sender, identifier in (("a", 0x300), ("b", 0x100), ("c", 0x200), ("a", 0x001)):
        bus.send(Frame(sender, identifier, bytes(8)))
    line.run(10_000)
    # What waits behind its own sender's frame does not compete yet.
    assert [each.frame.identifier for each in trace] == [0x100, 0x200, 0x300, 0x001]
    assert [each.at_us for each in trace] == [270, 540, 810, 1080]


def test_a_babbling_idiot_starves_everybody_else() -> None:
    quiet = World(FakeCore(), sends=True, seed=1).run(1_000_000)
    world = World(FakeCore(), sends=True, seed=1, injectors=[babbling(500_000)]).run(1_000_000)
    late = [each for each in world.trace if each.at_us > 501_000]
    assert {each.frame.sender for each in late} == {"intruder"}
    assert len([e for e in quiet.trace if e.frame.sender == "pacmod" and e.at_us > 501_000]) > 80


def test_a_thousand_frames_a_second_leave_room() -> None:
    world = World(FakeCore(), sends=True, seed=1, injectors=[flood(500_000)]).run(1_000_000)
    assert len([e for e in world.trace if e.frame.sender == "pacmod" and e.at_us > 501_000]) > 80


def test_the_car_obeys_only_between_enable_and_override() -> None:
    plant = Plant()
    now_us = 0

    def tell(enable: int, clear: int = 0, accel: float = 0.0, brake: float = 0.0) -> None:
        nonlocal now_us
        switch = {"PACMOD_ENABLE": enable, "CLEAR_OVERRIDE": clear, "IGNORE_OVERRIDE": 0}
        plant.hear(0x69, framed("GLOBAL_CMD", switch), now_us)
        plant.hear(0x67, framed("ACCEL_CMD", {"ACCEL_CMD": accel}), now_us)
        plant.hear(0x6B, framed("BRAKE_CMD", {"BRAKE_CMD": brake}), now_us)
        for _ in range(33):
            plant.step(now_us)
            now_us += 1_000

    tell(1, accel=0.5)
    assert not plant.enabled, "ENABLE must come after DISABLE"
    tell(0)
    tell(1)
    assert plant.enabled
    for _ in range(60):
        tell(1, accel=0.5)
    assert plant.car.speed_mps == pytest.approx(0.2 * 6.0 * 2.0, rel=0.2)
    plant.driver.turns_wheel = True
    tell(1, accel=0.5)
    plant.driver.turns_wheel = False
    tell(1, accel=0.5)
    assert plant.override
    assert not plant.enabled
    tell(0, clear=1)
    tell(1)
    assert plant.enabled
    assert plant.broken == []


def test_silence_disables_and_the_car_coasts() -> None:
    plant = Plant()
    plant.car.speed_mps = 2.0
    plant.hear(0x69, bytes(8), 0)
    plant.hear(0x6B, framed("BRAKE_CMD", {"BRAKE_CMD": 0.6}), 0)
    plant.hear(0x67, bytes(8), 0)
    plant.hear(0x69, bytes([1]) + bytes(7), 1_000)
    for k in range(1_000):
        plant.step(1_000 * k)
    assert plant.timed_out
    assert not plant.enabled
    # Braked for a tenth of a second, then rolling: silence is no brake.
    assert plant.car.speed_mps > 1.5


def test_rules_of_the_protocol_are_watched() -> None:
    plant = Plant()
    for switch in ((1, 1, 0), (1, 0, 1)):
        names = ("PACMOD_ENABLE", "CLEAR_OVERRIDE", "IGNORE_OVERRIDE")
        plant.hear(0x69, framed("GLOBAL_CMD", dict(zip(names, switch, strict=True))), 0)
    plant.hear(0x6B, b"\xff" * 8, 0)
    assert [text.split(": ", 1)[1][:14] for text in plant.broken] == [
        "CLEAR_OVERRIDE", "IGNORE_OVERRID", "BRAKE_CMD.BRAK"
    ]  # fmt: skip


def test_what_the_sensors_send_holds_the_truth() -> None:
    plant = Plant()
    plant.car.speed_mps, plant.truth.sag_mps2 = 2.0, 0.0
    people = [Walker(7, 20.0, -3.0, 0.0, 1.0)]
    world = World(FakeCore(), sends=False, seed=3, plant=plant, walkers=people).run(3_000_000)
    located, seen = LocalisationSet(), PersonSet()
    poses: dict[int, Localised] = {}
    sets: dict[int, PeopleSeen] = {}
    for each in world.trace:
        said = decode(OWN, each.frame.identifier, each.frame.data)
        located, seen = located.taking(said), seen.taking(said)
        if isinstance(located.outcome, Localised):
            poses[located.outcome.number] = located.outcome
        if isinstance(seen.outcome, PeopleSeen):
            sets[seen.outcome.number] = seen.outcome
    assert len(poses) >= 8
    assert len(sets) >= 14
    for pose in poses.values():
        true_s = (pose.stamp_s - 7.0) / (1.0 + 20e-6)
        assert abs(pose.x_m - 2.0 * true_s) <= pose.x_radius_m + 0.003
    for found in sets.values():
        (person,) = found.people
        true_s = (found.stamp_s - 8.5) / (1.0 - 15e-6)
        assert abs(person.y_m - (-3.0 + true_s)) <= person.position_radius_m - 0.3 + 0.006


def test_the_same_seed_is_the_same_run() -> None:
    runs = [World(FakeCore(), sends=True, seed=5).run(2_000_000).trace for _ in range(2)]
    assert runs[0] == runs[1]
    assert World(FakeCore(), sends=True, seed=6).run(2_000_000).trace != runs[0]


AT_US = 1_234_567
INJECTORS = {
    "stopped": lambda: Stopped(AT_US, stops=identifiers("VEHICLE_SPEED_RPT")),
    "localisation stopped": lambda: Stopped(AT_US, stops=LOCALISATION, budget_us=700_000),
    "frozen": lambda: Frozen(AT_US, name="VEHICLE_SPEED_RPT", signal="VEHICLE_SPEED", off=0.02),
    "sentinel": lambda: Changed(
        AT_US, of=identifiers("VEHICLE_SPEED_RPT"), change=raw_field(0, 0x7FFF)
    ),
    "out of range": lambda: Changed(
        AT_US, of=identifiers("ACCEL_RPT"), change=raw_field(0, 1001), needed=3
    ),
    "short": lambda: Changed(AT_US, of=REPORTS, change=lambda data: data[:-1]),
    "wrong unit": lambda: wrong_unit(AT_US),
    "replayed": lambda: Replayed(AT_US, of=REPORTS, window_us=500_000),
    "replayed sets": lambda: Replayed(AT_US, of=(*LOCALISATION, *PEOPLE), window_us=900_000),
    "doubled": lambda: Doubled(AT_US, of=PEOPLE),
    "swapped": lambda: Swapped(AT_US, of=LOCALISATION),
    "delayed": lambda: Delayed(AT_US, of=LOCALISATION, delay_us=300_000),
    "flipped": lambda: Changed(AT_US, of=PEOPLE, change=flipped(3, 17)),
    "incomplete": lambda: Incomplete(AT_US, lost=LOCALISATION[2], header=LOCALISATION[0]),
    "spoofed": lambda: spoofed(AT_US, "BRAKE_CMD", bytes(8)),
    "other protocol": lambda: other_protocol(AT_US),
    "babbling": lambda: babbling(AT_US),
    "brake pedal": lambda: brake_pedal(AT_US),
    "steering override": lambda: steering_override(AT_US),
    "wrong gear": lambda: wrong_gear(AT_US),
    "emergency stop": lambda: emergency_stop(AT_US),
    "weak brake": lambda: weak_brake(AT_US),
    "stuck wheel": lambda: stuck_wheel(AT_US),
    "wrong echo": lambda: wrong_echo(AT_US),
    "crowd": lambda: crowd(AT_US, 255),
    "clock jump": lambda: clock_jump(AT_US, by_us=2_000_000),
    "error frame": lambda: error_frame(AT_US),
    "send fails": lambda: bus_down(AT_US, for_us=200_000),
    "receive fails": lambda: bus_down(AT_US, for_us=200_000, sending=False),
    "silent bus": lambda: silent_bus(AT_US),
    "late decision": lambda: Slow(AT_US, 80_000),
    "hang": lambda: Slow(AT_US, 400_000, hangs=True),
}


@pytest.mark.parametrize("name", INJECTORS)
def test_every_injector_changes_the_run_and_says_when_it_shows(name: str) -> None:
    made: Injector = INJECTORS[name]()

    def run(*injectors: Injector) -> tuple[World, FakeCore]:
        plant = Plant()
        plant.car.speed_mps, plant.truth.sag_mps2, plant.told_disable = 1.0, 0.5, True
        core = FakeCore(frames=(Command(0x69, bytes([1]) + bytes(7)),))
        return World(core, sends=True, seed=9, plant=plant, injectors=injectors).run(
            3_000_000
        ), core

    (world, core), (other, usual) = run(made), run()
    told = (core.received, core.errors, core.turns, world.port.handed)
    same = told == (usual.received, usual.errors, usual.turns, other.port.handed)
    # Before anybody brakes or steers there is nothing to see of these.
    assert same == (name in ("weak brake", "stuck wheel"))
    assert made.condition_us is not None
    assert AT_US <= made.condition_us <= AT_US + 1_300_000
    before = [each for each in core.received if each[0] < AT_US]
    assert before == [each for each in usual.received if each[0] < AT_US]


@pytest.mark.parametrize("count", [0, 1, 32, 33, 100, 255])
def test_a_crowd_beyond_capacity_is_said_and_not_cut(count: int) -> None:
    world = World(FakeCore(), sends=False, seed=2, injectors=[crowd(100_000, count)])
    world.run(1_500_000)
    header = next(
        e for e in reversed(world.trace) if e.frame.identifier == PEOPLE[0]
    )  # the last one
    said = decode(OWN, header.frame.identifier, header.frame.data)
    assert said.values["MORE"] == (count > 32)  # type: ignore[union-attr]
    assert said.values["COUNT"] == min(count, 32)  # type: ignore[union-attr]


def test_a_delay_keeps_the_order() -> None:
    world = World(
        FakeCore(), sends=False, injectors=[Delayed(0, of=LOCALISATION, delay_us=123_456)]
    ).run(3_000_000)
    order = [e.frame.identifier for e in world.trace if e.frame.identifier in LOCALISATION]
    assert order == list(LOCALISATION) * (len(order) // 4)


def test_bus_errors_reach_the_core_and_the_bus_is_opened_again() -> None:
    core = FakeCore()
    world = World(core, sends=True, injectors=[bus_down(500_000, for_us=700_000, sending=False)])
    world.run(3_000_000)
    assert core.errors[0][1] is BusError.RECEIVE
    assert world.loop.counts.reopened > 1
    assert core.received[-1][0] > 2_900_000
