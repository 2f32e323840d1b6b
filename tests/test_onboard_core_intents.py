"""LookAhead decides by the ways that are sent, losing them alerts and never brakes by itself, and a
log of them is replayed bit for bit."""

from __future__ import annotations

import random
from typing import Any

import pytest
from log_cases import Kept
from onboard_core_bench import (
    BEFORE_US,
    OFFSET_US,
    PEOPLE_EVERY,
    Bench,
    bench,
    driven,
    faults,
    framed,
    person,
)
from onboard_core_cases import PATH, SETTINGS, bundle
from onboard_intakes import INTEGRALS
from onboard_sensors import OWN, PACMOD2
from test_log_real_core import TOLD, again, header
from ways_cases import sent

from workbench.claims import Verdict
from workbench.runtime.observation import Observation
from workbench.runtime.onboard.core import Core, Mode, Request, State
from workbench.runtime.onboard.faults import Fault, Reaction
from workbench.runtime.onboard.found_in_intents import found_in_intents
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.mcap_scene import turn_scene
from workbench.runtime.onboard.observing import observe
from workbench.runtime.onboard.recorder import RecordedCore
from workbench.runtime.onboard.recorder_entries import LoggedFrame, turn_record
from workbench.runtime.protocols import PeopleSeen, Way
from workbench.simulation.onboard_car import Crowd, OnboardCar, Sent

S = 1_000_000


def with_ways(ways: dict[int, list[Way]]) -> Any:
    """Sends them after every set of people of a bench."""

    def send(b: Bench, at_us: int) -> None:
        if b.turns % PEOPLE_EVERY or b.at_us <= BEFORE_US:
            return
        stamp_s = (at_us - 1_000 - b.delay_us + OFFSET_US + b.jump_us) / 1e6
        seen = PeopleSeen(b.turns // PEOPLE_EVERY % 256, stamp_s, 60.0, tuple(b.people))
        chosen = {track: each for track, each in ways.items() if any(
            track == person.track for person in b.people
        )}  # fmt: skip
        for number, data in sent(seen, chosen).frames:
            b.receive(number, data, at_us)

    return send


def ahead(b: Bench, ways: dict[int, list[Way]] | None) -> Verdict:
    """What LookAhead says once all that is sent has come."""
    send = None if ways is None else with_ways(ways)
    verdict = None
    for _ in range(12):
        result = b.step(send)
        if result.decision is not None:
            verdict = result.decision.look_ahead.verdict
    assert verdict is not None
    return verdict


def test_look_ahead_decides_by_the_ways() -> None:
    """Somebody stands 7 m beside the road, 3 m ahead of the car."""
    verdicts = []
    aside = [(0.0, 7.0, 0.5)] * 8
    for ways in (None, {1: [aside]}, {1: [aside, _crossing(7.0)]}, {1: [_crossing(7.0)]}):
        b = bench(Mode.SHADOW)
        b.run(12)
        b.people = [person(1, 3.0, 7.0)]
        shifted = None if ways is None else {
            track: [tuple((x + 3.0, y, r) for x, y, r in way) for way in each]
            for track, each in ways.items()
        }  # fmt: skip
        verdicts.append(ahead(b, shifted))
    safe, no = Verdict.SAFE, Verdict.UNPROVED
    assert verdicts == [safe, safe, no, no]


def _crossing(y_m: float) -> list[tuple[float, float, float]]:
    return [(0.0, y_m - 1.2 * j, 0.5) for j in range(8)]


def test_intents_that_are_lost_alert_and_the_car_goes_on() -> None:
    b = driven()
    b.people = [person(1, 20.0, 25.0)]
    stays = with_ways({1: [tuple((20.0, 25.0, 0.6) for _ in range(4))]})
    for _ in range(12):
        result = b.step(stays)
    assert Fault.INTENTS_LOST not in faults(result)
    lost_at = None
    for turn in range(40):
        result = b.step()
        if Fault.INTENTS_LOST in faults(result) and lost_at is None:
            lost_at = turn
            assert any(event.startswith("INTENTS_LOST: ") for event in result.events)
        assert result.state is State.TRACKING
    assert lost_at is not None
    for _ in range(12):
        result = b.step(stays)
    assert Fault.INTENTS_LOST not in faults(result)
    assert Fault.INTENTS_LOST.reaction is Reaction.ALERT


def test_any_number_of_broken_intents_does_not_brake() -> None:
    b = driven()
    part = framed(
        "PERSON_WAY",
        {"SET": 1, "INDEX": 0, "INTENT": 0, "KNOT": 0, "X": 0.0, "Y": 0.0, "RADIUS": 0.5},
    )
    dice = random.Random(1)

    def broken(b: Bench, at_us: int) -> None:
        header = {"SET": dice.randrange(256), "COUNT": 3, "MORE": 1, "STAMP": 3.0}
        b.receive(*framed("INTENTS", header | {"KNOT_PERIOD": 0.5}), at_us)
        for _ in range(3):
            b.receive(*part, at_us)
            b.receive(part[0], part[1][:-1] + bytes([part[1][-1] ^ 1]), at_us)

    for _ in range(60):
        result = b.step(broken)
        assert result.state is State.TRACKING
    assert faults(result) <= {Fault.INTENTS_LOST, Fault.OUT_OF_ORDER}
    assert len(faults(result)) == 2


def test_the_drawing_of_a_turn_shows_every_way() -> None:
    b = bench(Mode.SHADOW)
    b.run(12)
    b.people = [person(1, 20.0, 9.0)]
    way = tuple((20.0 + 0.5 * j, 9.0, 0.6) for j in range(8))
    send = with_ways({1: [way, way]})
    decided = [result for result in (b.step(send) for _ in range(12)) if result.decision]
    drawn = turn_scene(turn_record(decided[-1]), header(Mode.SHADOW), {"sec": 0, "nsec": 0})
    (entity,) = [each for each in drawn["entities"] if each["id"] == "person 1"]
    xs = [round(each["pose"]["position"]["x"], 1) for each in entity["cylinders"]]
    # At 0.5 to 2 s; the ways began at most 0.4 s before, or will by the time that nobody knows.
    assert len(xs) == 1 + 4 + 2 * 4
    assert xs[5:9] == xs[9:]
    assert all(0.5 * k + 20.0 <= x <= 0.5 * k + 20.5 for k, x in enumerate(xs[5:9], start=1))


def _recorded(seed: int) -> list[Any]:
    """The log of a drive past people who have ways, some of which fail."""
    kept, dice = Kept(), random.Random(seed)
    core = RecordedCore(Core(bundle(), PATH, TOLD, mode=Mode.DRIVE), kept)  # type: ignore[arg-type]
    b = Bench(core)  # type: ignore[arg-type]
    b.people = [person(1, 20.0, 9.0), person(2, 22.0, -8.0)]
    for turn in range(120):
        if turn == 12:
            b.request(Request.ARM)
        stays = tuple((20.0, 9.0, 0.6 + dice.uniform(0.0, 0.1)) for _ in range(4))
        comes = tuple((22.0, -8.0 + 0.5 * j, 0.6) for j in range(4))
        ways = {1: [stays], 2: [comes, stays]} if dice.random() < 0.9 else {2: [comes]}
        if dice.random() < 0.1:
            b.silent = {dice.choice(["PEOPLE", "INTENTS", "PERSON_WAY"])}
        kept.details(b.step(with_ways(ways)))
        b.silent = set()
    return kept.lines


@pytest.mark.parametrize("seed", range(2))
def test_a_drive_with_ways_is_replayed_bit_for_bit(seed: int) -> None:
    lines = _recorded(seed)
    compared = again(lines, Mode.DRIVE)
    assert compared.mismatches == ()
    assert compared.compared == compared.decisions > 20


def test_a_log_whose_ways_differ_is_noticed() -> None:
    lines = _recorded(0)
    changed = []
    for line in lines:
        if isinstance(line, LoggedFrame) and line.identifier == 0x6CC and not line.made:
            continue
        changed.append(line)
    assert len(changed) < len(lines)
    assert again(changed, Mode.DRIVE).mismatches


def test_the_car_of_the_trials_sends_ways_that_hold_those_who_walk_on() -> None:
    car = OnboardCar(SETTINGS, Crowd(), sends_ways=True)
    came: list[Sent] = [*car.until(3 * S)]
    found = Intake(PACMOD2, OWN, stamps=SETTINGS.sensors.stamps)
    for each in came:
        found.receive(each.identifier, each.data, each.at_us)
    counts = found.ways.counts
    assert (counts.whole, counts.incomplete.total, dict(counts.faults)) == (15, 0, {})
    seen = observed_of(found)
    assert list(found_in_intents(found, seen, SETTINGS, 3 * S)) == []
    tubes = {each.name: each.intent for each in seen.people}
    walkers = [name for name, each in tubes.items() if len(each) == 2]
    assert walkers
    assert sum(len(each) for each in tubes.values()) == len(tubes) + len(walkers)
    assert not any(each.identifier == 0x6CC for each in OnboardCar(SETTINGS, Crowd()).until(S))


def observed_of(found: Intake) -> Observation:
    seen = observe(found, now_us=3 * S, integrals=INTEGRALS, settings=SETTINGS.sensors)
    assert isinstance(seen, Observation), seen
    return seen
