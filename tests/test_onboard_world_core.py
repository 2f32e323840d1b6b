"""The real core under the real loop in virtual time: it decides, it drives, to the same bits."""

from __future__ import annotations

import itertools
from collections import Counter

import pytest
from onboard_core_cases import core
from onboard_world import Injector, World
from onboard_world_inside import bus_down
from onboard_world_plant import Plant
from onboard_world_sensors import Walker

from workbench.runtime import Action
from workbench.runtime.onboard.recorder_entries import turn_record
from workbench.runtime.onboard.states import Mode, Request, State


def shadow(seed: int, until_us: int = 20_000_000) -> World:
    plant = Plant()
    plant.car.speed_mps, plant.truth.sag_mps2 = 2.0, 0.0
    people = [Walker(3, 45.0, 6.0, -0.5, 0.0)]
    world = World(core(Mode.SHADOW), sends=False, seed=seed, plant=plant, walkers=people)
    return world.run(until_us)


def bits(world: World) -> list[str]:
    """Every turn in words that show every bit of its numbers; how long it took is no part of it."""
    told = []
    for turn in world.notes.turns:
        record = {name: value for name, value in turn_record(turn).items() if name != "elapsed_s"}
        told.append(repr((turn.at_us, turn.frames, record)))
    return told


def test_twenty_seconds_of_shadow_decide_to_the_same_bits_twice() -> None:
    first, second = shadow(3), shadow(3)
    decided = [turn.decision for turn in first.notes.turns if turn.decision is not None]
    assert len(decided) >= 195
    assert first.port.handed == []
    assert Counter(decision.action for decision in decided)[Action.TRACK] >= 150
    assert first.loop.counts.late == 0
    assert bits(first) == bits(second)
    assert bits(shadow(4, 2_000_000)) != bits(first)[:61]


def driving(until_us: int, *injectors: Injector) -> World:
    world = World(core(Mode.DRIVE), sends=True, seed=3, injectors=injectors)
    world.notes.asked = [(2_500_000, Request.ARM)]
    return world.run(until_us)


def test_armed_it_drives_along_the_path_and_told_to_end_it_brakes_and_lets_go() -> None:
    world = driving(9_000_000)
    assert world.notes.turns[-1].state is State.TRACKING
    assert world.plant.car.speed_mps == pytest.approx(2.8, abs=0.5)
    assert abs(world.plant.car.y_m) < 0.3
    handed = [at_us for at_us, _, _ in world.port.handed]
    assert min(b - a for a, b in itertools.pairwise(handed)) >= 500
    # Between two frames of one set the car may hold the old value of the later one.
    assert world.plant.broken == []
    world.loop.stop()
    world.run(16_000_000)
    assert world.timeline.now_us < 14_000_000, "it ended"
    assert world.plant.car.speed_mps < 0.05
    world.timeline.run(world.timeline.now_us + 10_000)
    assert not world.plant.enabled
    states = [turn.state for turn in world.notes.turns]
    assert states[-1] is State.DISARMED
    assert State.BRAKING in states


@pytest.mark.parametrize("sending", [True, False])
def test_after_the_bus_has_failed_nothing_enables_again_by_itself(sending: bool) -> None:
    world = driving(8_000_000, bus_down(6_000_000, for_us=300_000, sending=sending))
    assert world.plant.timed_out
    assert not world.plant.enabled
    assert world.notes.turns[-1].state in (State.YIELDED, State.FAULT, State.DISARMED)
    # ENABLE 0 may be lost with the bus; what follows is silence, which disables as well.
    assert world.of_monitor("GLOBAL_CMD")[-1][0] < 6_700_000


def test_killed_on_the_way_it_is_silent_and_the_car_coasts() -> None:
    """What silence does: by-wire control is disabled after the time-out, and nothing brakes."""
    world = driving(7_000_000)
    died_us, speed_mps = world.timeline.now_us, world.plant.car.speed_mps
    world.timeline.run(died_us + 2_000_000)
    last_us = world.of_monitor()[-1][0]
    assert last_us <= died_us + 2_000
    assert world.plant.timed_out
    assert not world.plant.enabled
    assert world.plant.car.speed_mps > 0.8 * speed_mps > 1.0
