"""What is said of a drive is what happened, and an expectation fails when it should."""

from __future__ import annotations

import dataclasses
import math

import pytest
from simulated_worlds import scenario

from workbench.runtime import Action
from workbench.runtime.policies import Ground
from workbench.simulation.campaign.scripted_judges import plain_decision
from workbench.simulation.drive_outcomes import DriveOutcome, Step
from workbench.simulation.objections import Objections
from workbench.simulation.people import Body
from workbench.simulation.scenarios.scenario import Expected
from workbench.simulation.scene import Contact, Nearness
from workbench.simulation.walkers.pedestrian import CarNow, PersonNow

_TURN_S = 0.0325


def steps(
    speeds: list[float], tracks: list[bool], why: tuple[Ground, ...] = (Ground.PEOPLE,)
) -> list[Step]:
    """One turn each, stations by the speeds; why: it brakes wherever it does."""
    station, found = 0.0, []
    for k, (speed, track) in enumerate(zip(speeds, tracks, strict=True)):
        station += speed * _TURN_S
        before = speeds[max(k - 1, 0)]
        found.append(Step(k * _TURN_S, station, speed, (speed - before) / _TURN_S, track,
                          () if track else why))  # fmt: skip
    return found


def outcome(speeds: list[float], tracks: list[bool], near: Nearness | None = None) -> DriveOutcome:
    return DriveOutcome.of(steps(speeds, tracks), near or Nearness(), scenario())


SMOOTH = ([2.0] * 500, [False] * 10 + [True] * 490)


def test_a_drive_that_passes() -> None:
    found = outcome(*SMOOTH)
    assert found.set_off_s == pytest.approx(10 * _TURN_S)
    assert found.brakes == ()
    assert found.passed_s == pytest.approx(30.0 / 2.0, abs=2 * _TURN_S)
    assert found.is_as(Expected.PASSES)
    assert found.is_as(Expected.ANY)
    assert not any(map(found.is_as, (Expected.BRAKES, Expected.STAYS, Expected.COLLIDES)))
    assert found.stood_s == 0.0
    assert found.hardest_mps2 == 0.0 == found.jerk_mps3


def test_a_brake_counts_while_the_car_moves_and_has_not_passed() -> None:
    stops = [2.0] * 100 + [0.0] * 50 + [2.0] * 500
    found = outcome(stops, [True] * 95 + [False] * 60 + [True] * 495)
    assert len(found.brakes) == 1
    assert found.brakes[0] == pytest.approx(95 * _TURN_S)
    assert found.is_as(Expected.BRAKES)
    assert not found.is_as(Expected.PASSES)
    assert found.stood_s == pytest.approx(50 * _TURN_S)
    assert found.hardest_mps2 == pytest.approx(2.0 / _TURN_S)
    assert found.jerk_mps3 > 0.0
    late = outcome([2.0] * 600, [True] * 550 + [False] * 50)
    assert late.brakes == ()
    standing = outcome([0.0] * 600, [True] * 300 + [False] * 300)
    assert standing.brakes == ()
    assert standing.is_as(Expected.STAYS)


@pytest.mark.parametrize(
    ("why", "expected"),
    [
        ((Ground.PEOPLE,), {Expected.BRAKES}),
        ((Ground.READING,), {Expected.BRAKES_BLIND}),
        ((Ground.TIME,), {Expected.BRAKES_BLIND}),
        ((Ground.MOTION,), {Expected.BRAKES_UNPROVED}),
        ((Ground.REGION,), {Expected.BRAKES_UNPROVED}),
        ((Ground.MOTION, Ground.PEOPLE), {Expected.BRAKES, Expected.BRAKES_UNPROVED}),
        ((Ground.ARITHMETIC,), set()),
        ((), set()),
    ],
)
def test_to_brake_for_another_reason_is_not_what_was_expected(
    why: tuple[Ground, ...], expected: set[Expected]
) -> None:
    stops = [2.0] * 100 + [0.0] * 50 + [2.0] * 500
    sent = [True] * 95 + [False] * 60 + [True] * 495
    found = DriveOutcome.of(steps(stops, sent, why), Nearness(), scenario())
    assert found.grounds == (why,)
    braking = {each for each in Expected if each.value.startswith("brakes") and found.is_as(each)}
    assert braking == expected
    assert found.is_as(Expected.ANY)
    assert not found.is_as(Expected.PASSES)
    assert all(each.value in found.story for each in why)


def test_one_brake_of_several_for_the_reason_is_enough() -> None:
    stops, sent = [2.0] * 600, ([True] * 50 + [False] * 20) * 2 + [True] * 460
    mixed = steps(stops, sent, (Ground.READING,))
    mixed[120:140] = [
        dataclasses.replace(each, grounds=(Ground.PEOPLE,)) for each in mixed[120:140]
    ]
    found = DriveOutcome.of(mixed, Nearness(), scenario())
    assert found.grounds == ((Ground.READING,), (Ground.PEOPLE,))
    assert found.is_as(Expected.BRAKES)
    assert found.is_as(Expected.BRAKES_BLIND)


def test_the_first_objection_since_track_counts() -> None:
    objections = Objections()
    track = plain_decision(Action.TRACK, "")
    brake = dataclasses.replace(plain_decision(Action.BRAKE, ""), grounds=(Ground.MOTION,))
    later = dataclasses.replace(brake, grounds=(Ground.PEOPLE,))
    assert objections.after(track) == ()
    assert objections.after(plain_decision(Action.BRAKE, "")) == ()
    assert objections.after(brake) == (Ground.MOTION,)
    assert objections.after(None, blind=True) == (Ground.READING,)
    assert objections.after(later) == (Ground.MOTION,)
    assert objections.after(None) == (Ground.MOTION,)
    assert objections.after(track) == ()
    assert objections.after(later) == (Ground.PEOPLE,)


def test_who_never_sets_off_neither_passes_nor_brakes() -> None:
    found = outcome([0.0] * 50, [False] * 50)
    assert found.set_off_s is None
    assert found.is_as(Expected.STAYS)
    assert not found.is_as(Expected.PASSES)
    assert not found.is_as(Expected.BRAKES)
    assert found.story == "did not set off"


def test_a_contact_is_expected_or_it_fails_everything() -> None:
    touched = Nearness(-0.1, Contact(3.0, "p", 1.5))
    found = outcome(*SMOOTH, touched)
    assert found.is_as(Expected.COLLIDES)
    assert not any(found.is_as(each) for each in Expected if each is not Expected.COLLIDES)
    assert "touched p at 3.0 s with 1.5 m/s" in found.story


def test_only_a_moving_car_comes_near_anybody() -> None:
    body = Body(0.0, 0.0, 0.0, 2.0, 0.5, 0.9)
    person = PersonNow("p", "ped", 2.5, 0.0, 0.0, 0.0, 0.3)
    far = PersonNow("q", "ped", 40.0, 0.0, 0.0, 0.0, 0.3)
    near = Nearness()
    near.see(0.0, CarNow(body, 0.0, 0.0), [person])
    assert near.moving_m == math.inf
    near.see(1.0, CarNow(body, 1.0, 0.0), [far, person])
    assert near.moving_m == pytest.approx(0.2)
    assert near.contact is None
    closer = PersonNow("p", "ped", 2.1, 0.0, 0.0, 0.0, 0.3)
    near.see(2.0, CarNow(body, 1.0, 0.0), [closer])
    near.see(3.0, CarNow(body, 2.0, 0.0), [closer])
    assert near.contact == Contact(2.0, "p", 1.0)
