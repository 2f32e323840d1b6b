"""Claim: at the desk people are known as late and as unsurely as on the bus, and no less truly."""

from __future__ import annotations

import math
import random

import pytest
from simulated_worlds import rig, scenario

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.runtime import Action, Deciding
from workbench.runtime.onboard.dead_reckoning import Pose
from workbench.runtime.onboard.times import TURN_US
from workbench.runtime.policies import Ground
from workbench.simulation.bus_sensing import Sensors
from workbench.simulation.campaign.survey_drive import undisturbed
from workbench.simulation.desk_people import DeskPeople
from workbench.simulation.rig import Trial
from workbench.simulation.scenarios.scenario import Dropout, Expected, Ghost, Sensing
from workbench.simulation.scene import Scene

WALKS = (20.0, -6.0, 0.5, 1.2)


def looking(sensing: Sensing, seed: int = 1) -> tuple[Scene, DeskPeople, Sensors]:
    scene = rig().scene(Trial(scenario(WALKS, sensing=sensing), "bicycle", seed))
    # Whoever walks here begins at full speed, which nobody's guard allows.
    scene.advance(TURN_US)
    people = DeskPeople(scene, rig().settings.sensors, seed=seed)
    return scene, people, Sensors(sensing, random.Random(seed), 0)


@pytest.mark.parametrize("seed", range(1, 6))
def test_discs_contain_the_person_and_are_wider_than_a_stamp_that_is_known(seed: int) -> None:
    sensing = Sensing(person_m=0.2, delay_s=(0.005, 0.03))
    scene, people, sensors = looking(sensing, seed)
    ages = []
    for _ in range(120):
        people.look(sensors)
        (found,) = people.observed()
        (true,) = scene.people
        guard, limits = found.guard, found.guard.limits
        t = -guard.at_s
        ages.append(t)
        reach = guard.position.radius + min(
            guard.velocity.radius * t + 0.5 * limits.acceleration_mps2 * t * t,
            2.0 * limits.speed_mps * t,
        )
        middle = (
            guard.position.x + guard.velocity.x * t, guard.position.y + guard.velocity.y * t,
        )  # fmt: skip
        away = math.dist(middle, (true.x_m, true.y_m))
        assert away + true.body_radius_m <= reach + 1e-9
        assert guard.position.radius > true.body_radius_m + sensing.person_m
        scene.advance(TURN_US)
    # A set comes up to 30 ms late, and the next one 0.2 s after it.
    assert 0.15 < max(ages) < 0.3


@pytest.mark.parametrize(("delay_s", "turns"), [(0.0, 0), (0.03, 1), (0.07, 3)])
def test_a_set_counts_from_when_it_comes_and_not_from_when_it_was_measured(
    delay_s: float, turns: int
) -> None:
    """The second set is measured at the first turn after 0.2 s of the scene."""
    scene, people, sensors = looking(Sensing(delay_s=(delay_s, delay_s)))
    due_us, places = 200_000, []
    while scene.now_us < 2 * due_us:
        people.look(sensors)
        places.append((scene.now_us, people.observed()[0].guard.position.x))
        scene.advance(TURN_US)
    changed_us = next(at_us for at_us, place in places if place != places[0][1])
    measured_us = next(at_us for at_us, _ in places if at_us >= due_us)
    assert (changed_us - measured_us) // TURN_US == turns


def test_nothing_is_watched_and_nobody_known_before_the_first_set() -> None:
    scene, people, _ = looking(Sensing())
    motion = scene.car.motion
    pose = Pose((motion.x_m,) * 2, (motion.y_m,) * 2, (motion.heading,) * 2)
    assert people.lost
    assert people.observed() == ()
    assert people.watched(pose).radius_m == 0.0


def test_the_watched_disc_shrinks_while_nothing_comes() -> None:
    scene, people, sensors = looking(Sensing(dropouts=(Dropout("people", 0.1, 9.0),)))
    radii, lost = [], []
    motion = scene.car.motion
    pose = Pose((motion.x_m,) * 2, (motion.y_m,) * 2, (motion.heading,) * 2)
    for _ in range(24):
        people.look(sensors)
        radii.append(people.watched(pose).radius_m)
        lost.append(people.lost)
        scene.advance(TURN_US)
    assert radii == sorted(radii, reverse=True)
    unseen_mps = rig().settings.sensors.unseen_speed_mps
    assert radii[0] - radii[-1] >= unseen_mps * 23 * TURN_US / 1e6
    # Too old after 0.6 s, by the earliest instant that the stamp may have.
    first = lost.index(True)
    assert 0.5 < first * TURN_US / 1e6 < 0.66
    assert all(lost[first:])


LOST = Sensing(dropouts=(Dropout("people", 8.0, 10.0),))


def test_a_car_that_is_told_of_nobody_brakes_and_says_why() -> None:
    trial = Trial(scenario(sensing=LOST), "bicycle", 1)
    found = rig().at_desk(trial, rig().monitor(Deciding.BOTH))
    assert [8.3 < at_s < 8.7 for at_s in found.brakes] == [True]
    assert found.grounds == ((Ground.READING,),)
    assert found.is_as(Expected.BRAKES_BLIND)
    assert not found.is_as(Expected.BRAKES)


def test_a_car_that_never_brakes_does_not_brake_for_that_either() -> None:
    driven = undisturbed(rig(), Trial(scenario(sensing=LOST), "bicycle", 1))
    assert driven.stops == 0
    assert set(driven.script.turns) == {Action.TRACK}
    free = undisturbed(rig(), Trial(scenario(), "bicycle", 1))
    assert driven.way_m == pytest.approx(free.way_m, abs=0.2)


def test_a_car_goes_on_after_a_false_detection_has_been_given_up() -> None:
    ghost = Sensing(ghosts=(Ghost(22.0, 4.0, 6.0, 8.0),))
    trial = Trial(scenario(sensing=ghost, duration_s=26.0), "bicycle", 1)
    found = rig().at_desk(trial, rig().monitor(Deciding.FAIL_SAFE))
    assert found.is_as(Expected.BRAKES)
    assert found.passed_s is not None
