"""No bad frame that can be told from a true one is believed, none raises, none moves a command out
of its limits; and turns leave nothing behind in memory."""

from __future__ import annotations

import functools
import gc
import random
import struct
import sys
from collections import Counter
from typing import Any

import pytest
from onboard_campaign_frames import Makes, Sent
from onboard_campaign_oracle import (
    ALL,
    OWN,
    PEOPLE_ID,
    SPEED,
    VEHICLE,
    WHEEL,
    Chain,
    Vehicle,
    illegal,
)
from onboard_core_bench import BEFORE_US, Bench, driven
from onboard_core_cases import DRIVE_BY_WIRE
from test_onboard_campaign import say

from workbench.runtime.onboard.core import State, TurnResult
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.set_streams import SetSeen

LOC = tuple(n for n, m in OWN.items() if m.name.startswith("LOC"))
PERSON = tuple(n for n, m in OWN.items() if m.name.startswith("PERSON"))
ACCEL, GLOBAL, BRAKE, STEERING = (
    next(n for n, m in VEHICLE.items() if m.name == f"{name}_CMD")
    for name in ("ACCEL", "GLOBAL", "BRAKE", "STEERING")
)
_DBW = DRIVE_BY_WIRE
MOST_ACCEL, MOST_BRAKE = 1000 * _DBW.pedals.accelerator_limit, 1000 * _DBW.pedals.brake_limit
MOST_WHEEL, MOST_RATE = (
    1000 * _DBW.steering.wheel_limit_rad,
    1000 * _DBW.steering.wheel_rate_limit_radps,
)
TURNS = 40


class Trial:
    """A car that drives among bad frames; whoever believes one of them is found out."""

    def __init__(self, dice: random.Random, told: Counter[str]) -> None:
        self.bench: Bench = driven()
        self.dice, self.told = dice, told
        self.makes = Makes(dice)
        self.vehicle = Vehicle()
        self.chains = (Chain(LOC[0], LOC[1:]), Chain(PEOPLE_ID, PERSON))
        self.watch: Any = self.bench.core._watch
        for chain, seen in zip(
            self.chains, (self.watch.intake.localisation, self.watch.intake.people), strict=True
        ):
            chain.ahead = seen.value.number, round(1e4 * seen.value.stamp_s)
        for number in (SPEED, WHEEL):
            last = self.watch.intake.reports[VEHICLE[number].name]
            self.vehicle.follow(number, last.data, last.at_us)
        receive = self.bench.core.receive

        def true(number: int, data: bytes, at_us: int) -> None:
            self.makes.hear((number, data))
            self.given(number, data, at_us, receive)

        self.give = receive
        self.bench.core.receive = true  # type: ignore[assignment, method-assign]

    def given(self, number: int, data: bytes, at_us: int, receive: Any) -> bool:
        """One frame, true or bad, and what must hold after it; whether it could be told."""
        intake = self.watch.intake
        before = dict(intake.reports), intake.localisation, intake.people, self._counted()
        bad = self._bad(number, data, at_us)
        for chain in self.chains:
            chain.take(number, data)
        receive(number, data, at_us)
        where = f"0x{number:X} {data.hex()}: {bad}"
        if bad:
            assert dict(intake.reports) == before[0], where
            assert self._counted() != before[3], f"not counted: {where}"
        elif number in VEHICLE and intake.reports[VEHICLE[number].name].data == data:
            self.vehicle.follow(number, data, at_us)
        for seen, was, chain in zip(
            (intake.localisation, intake.people), before[1:3], self.chains, strict=True
        ):
            if isinstance(seen, SetSeen) and seen is not was:
                assert chain.whole, f"a set that is not whole, or an old one: {where}"
                if isinstance(was, SetSeen):
                    assert seen.value.stamp_s > was.value.stamp_s, where
        return bool(bad)

    def _bad(self, number: int, data: bytes, at_us: int) -> str:
        if number not in ALL:
            return "nobody's identifier"
        if ALL[number].sender == "WORKBENCH":
            return "ours alone"
        why = illegal(number, data)
        if not why and number in VEHICLE and self.vehicle.impossible(number, data, at_us):
            why = "impossible"
        return why

    def _counted(self) -> tuple[int, ...]:
        """Everything that is counted of bad frames."""
        intake = self.watch.intake
        sets = (intake.localisation_counts, intake.people_counts)
        tables = (intake.refusals, intake.spoofed, intake.foreign, intake.counter_faults)
        return (
            *(sum(count.total for count in table.values()) for table in tables),
            intake.unknown.total,
            sum(count.total for _, count in self.watch._impossible.values()),
            *(counts.duplicates.total for counts in sets),
            *(sum(count.total for count in counts.faults.values()) for counts in sets),
        )

    def run(self, share: int) -> int:
        """Turns with about so many bad frames each; how many there were."""
        made = 0
        for _ in range(TURNS):
            frames = [self.makes.next() for _ in range(self.dice.randint(0, 2 * share))]
            made += len(frames)
            result = self.bench.step(functools.partial(self._all, frames))
            self.bench.log.clear()
            self._limits(result)
            assert Fault.INTERNAL not in {each.fault for each in result.faults}, result.faults
            self.told[result.state.name] += 1
        return made

    def _all(self, frames: list[tuple[str, Sent]], bench: Bench, at_us: int) -> None:
        for kind, (number, data) in frames:
            told = self.given(number, data, at_us, self.give)
            self.told[f"{kind}: {'told' if told else 'plausible'}"] += 1

    def _limits(self, result: TurnResult) -> None:
        """Independent of the stages that make commands: bytes against the vehicle's limits."""
        pressed = {ACCEL: 0, BRAKE: 0}
        for number, data in result.frames:
            if number in pressed:
                pressed[number] = struct.unpack(">H", data[:2])[0]
            elif number == STEERING:
                angle, rate = struct.unpack(">iI", data)
                assert abs(angle) <= MOST_WHEEL, angle
                assert rate <= MOST_RATE, rate
            elif number == GLOBAL:
                assert data in (bytes(8), b"\1" + bytes(7), b"\2" + bytes(7)), data
            else:
                assert number in OWN, number
        assert pressed[ACCEL] <= MOST_ACCEL
        assert pressed[BRAKE] <= MOST_BRAKE
        assert not (pressed[ACCEL] and pressed[BRAKE])
        if result.state in (State.BRAKING, State.FAULT):
            assert pressed == {ACCEL: 0, BRAKE: round(1000 * _DBW.pedals.brake_profile)}


def bad_frames(most: int) -> Counter[str]:
    told: Counter[str] = Counter()
    made = number = 0
    while made < most:
        dice = random.Random(number)
        made += Trial(dice, told).run(dice.choice((0, 1, 3, 10, 60)))
        number += 1
    say(f"\n{made} bad frames in {number} drives of {TURNS} turns: none believed, none raised")
    for name, count in sorted(told.items()):
        say(f"  {name:24} {count:8}")
    return told


@pytest.mark.campaign
def test_a_million_bad_frames() -> None:
    bad_frames(1_000_000)


def test_twenty_thousand_bad_frames() -> None:
    told = bad_frames(20_000)
    assert told["TRACKING"] > 10


def memory(turns: int, *, warm: int) -> int:
    """Growth in allocated blocks over turns in which the car goes to and fro between states."""
    bench = driven()
    bench.core.receive(0x66, bytes(8), bench.at_us - BEFORE_US)

    def more(count: int) -> None:
        for k in range(count):
            bench.step()
            bench.log.clear()
            if k % 500 == 100:
                bench.silent.add("SHIFT_RPT")
            if k % 500 == 110:
                bench.silent.clear()
            bench.x_m %= 40.0

    more(warm)
    gc.collect()
    before = sys.getallocatedblocks()
    more(turns)
    gc.collect()
    return sys.getallocatedblocks() - before


def check_memory(turns: int, *, warm: int = 6_000) -> None:
    grown = memory(turns, warm=warm)
    say(f"\n{turns} turns: {grown} blocks more")
    assert grown < 500, grown


@pytest.mark.campaign
def test_memory_is_flat_over_many_turns() -> None:
    check_memory(200_000)


def test_memory_is_flat() -> None:
    check_memory(1_000, warm=1_000)
