"""Brute force finds a contact avoidable exactly where braking in time would have avoided it."""

from __future__ import annotations

import dataclasses
import math

import pytest

from tests.survey_cases import RADIUS_M, crossing, rig, standing, straight
from workbench.runtime import Action
from workbench.simulation.campaign.contenders import Field
from workbench.simulation.campaign.rows import drive_all
from workbench.simulation.campaign.scripted_judges import Repeating, Script
from workbench.simulation.campaign.survey_drive import avoidable, drive, undisturbed
from workbench.simulation.plants.actuators import Actuators, DriveByWireCar
from workbench.simulation.plants.make import chassis
from workbench.simulation.rig import Rig, Trial, path_table
from workbench.simulation.scene import Scene, Setting


def test_who_never_brakes_has_an_avoidable_contact() -> None:
    trial = Trial(straight(standing(12.0, 0.0)), "bicycle", 1)
    driven = undisturbed(rig(), trial)
    assert driven.contact is not None
    assert driven.contact.speed_mps > 1.0
    assert avoidable(rig(), trial, driven)


def test_a_drive_ends_at_its_contact() -> None:
    driven = undisturbed(rig(), Trial(straight(standing(12.0, 0.0)), "bicycle", 1))
    assert driven.contact is not None
    assert driven.contact.t_s == pytest.approx(driven.time_s, abs=0.06)
    front_m = rig().vehicle.geometry.front_m
    assert driven.way_m == pytest.approx(12.0 - RADIUS_M - front_m, abs=0.2)


def test_who_drives_by_has_nothing_to_avoid() -> None:
    trial = Trial(straight(standing(12.0, 3.0), duration_s=18.0), "bicycle", 1)
    driven = undisturbed(rig(), trial)
    assert driven.contact is None
    assert driven.passed
    assert not avoidable(rig(), trial, driven)
    aside_m = 3.0 - RADIUS_M - rig().vehicle.geometry.half_width_m
    assert driven.nearest_m == pytest.approx(aside_m, abs=0.3)


SPEED_MPS = 2.5


def moving_scene(rig: Rig, trial: Trial) -> Scene:
    """As `Rig.scene`, but the car comes with 2.5 m/s: nothing it does stops it at once."""
    path = path_table(trial.scenario)
    wire = rig.settings.drive_by_wire
    body = chassis(trial.plant, rig.vehicle, x_m=0.0, y_m=0.0, heading=0.0, speed_mps=SPEED_MPS)
    car = DriveByWireCar(body, wire, Actuators.middle(wire))
    return Scene(Setting(trial.scenario, rig.vehicle, path), car, seed=trial.seed)


@pytest.mark.parametrize(("spare_m", "possible"), [(-0.6, False), (1.0, True)])
def test_it_is_unavoidable_within_the_stopping_distance(
    spare_m: float, possible: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stops in v t + v^2 / 2 b: t of at most 0.2 s of delays and one period, b about 2.5 m/s^2."""
    monkeypatch.setattr(Rig, "scene", moving_scene)
    stops_m = 0.25 * SPEED_MPS + SPEED_MPS**2 / (2.0 * 2.5)
    x_m = rig().vehicle.geometry.front_m + RADIUS_M + stops_m + spare_m
    trial = Trial(straight(standing(x_m, 0.0)), "bicycle", 1)
    driven = undisturbed(rig(), trial)
    assert driven.contact is not None
    assert avoidable(rig(), trial, driven) is possible


def test_what_was_sent_drives_the_same_again() -> None:
    trial = Trial(straight(crossing(14.0, 8.0), duration_s=10.0), "bicycle", 3)
    first = drive(rig(), trial, rig().monitor("FailSafe"))  # type: ignore[arg-type]
    assert {Action.TRACK, Action.BRAKE} == set(first.script.turns)
    again = drive(
        rig(), trial, lambda _path, _clock: Repeating(first.script, len(first.script.turns))
    )
    # Who repeats judges nothing.
    bare = [
        dataclasses.replace(driven, verdicts={}, violations={}, alerts=0)
        for driven in (again, first)
    ]
    assert bare[0] == bare[1]


def test_it_brakes_for_good_from_the_turn_it_is_told() -> None:
    judge = Repeating(Script([Action.BRAKE] * 2), 4)
    sent = [judge.turn(0.055 * k).action for k in range(8)]
    assert sent == [Action.BRAKE] * 2 + [Action.TRACK] * 2 + [Action.BRAKE] * 4


def test_every_decision_of_the_monitor_is_counted() -> None:
    trial = Trial(straight(crossing(14.0, 8.0), duration_s=6.0), "bicycle", 3)
    driven = drive(rig(), trial, rig().monitor("both"))  # type: ignore[arg-type]
    assert sum(driven.verdicts.values()) == math.ceil(len(driven.script.turns) / 3)
    assert len(driven.script.decisions) == sum(driven.verdicts.values())


@pytest.mark.parametrize(("y_m", "needless"), [(1.8, True), (1.2, False)])
def test_a_stop_is_needless_where_a_car_that_never_brakes_keeps_clear(
    y_m: float, needless: bool
) -> None:
    """The rule brakes for both; body and person are 0.62 m apart, or 0.02 m."""
    field = Field({3.0: rig()}, {"fixed distance": 8.0})
    trial = Trial(straight(standing(18.0, y_m), duration_s=18.0), "bicycle", 1)
    (row,) = drive_all(0, trial, ("fixed distance",), field)
    assert row.stops > 0
    assert row.needless_stops == (row.stops if needless else 0)
    assert not row.contact
