"""The core drives simulated cars as it would real ones: it knows no more and is told no lies."""

from __future__ import annotations

import math
from typing import Any

import pytest
from simulated_worlds import rig, scenario

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.runtime import Deciding, Observation
from workbench.runtime.onboard.states import State
from workbench.simulation.bus_drive import BusDrive, BusLoop, Recorded
from workbench.simulation.campaign.scripted_judges import NeverBrakes
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.plants.make import PLANTS
from workbench.simulation.rig import Trial, outcome_on_bus
from workbench.simulation.scenarios.scenario import Dropout, Expected, Ghost, Sensing

_TWO_PI = 2.0 * math.pi


def _watched(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Motion, Any]]:
    """The truth at the begin of every turn beside what the turn resulted in."""
    seen: list[tuple[Motion, Any]] = []
    turn = BusLoop.turn

    def noted(loop: BusLoop) -> Any:
        result = turn(loop)
        seen.append((loop._world.scene.car.motion, result))
        return result

    monkeypatch.setattr(BusLoop, "turn", noted)
    return seen


def _outside(motion: Motion, seen: Observation) -> list[str]:
    """Names of what the truth lies outside of."""
    truth = {
        "x": motion.x_m, "y": motion.y_m, "steering": motion.road_wheel_rad,
        "speed": motion.speed_mps,
    }  # fmt: skip
    wrong = [
        name for name, value in truth.items()
        if not getattr(seen, name)[0] <= value <= getattr(seen, name)[1]
    ]  # fmt: skip
    middle, half = (
        0.5 * (seen.heading[0] + seen.heading[1]),
        0.5 * (seen.heading[1] - seen.heading[0]),
    )
    if abs(math.remainder(motion.heading - middle, _TWO_PI)) > half:
        wrong.append("heading")
    return wrong


@pytest.mark.parametrize("plant", PLANTS)
def test_what_the_monitor_is_told_contains_the_truth(
    plant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of every plant and over frames, delays, losses, dead reckoning and braking."""
    pytest.importorskip("vehiclemodels", reason="needs the extra commonroad")
    seen = _watched(monkeypatch)
    sensing = Sensing(position_m=0.1, heading_rad=0.02, dropped=0.05, delay_s=(0.005, 0.04))
    trial = Trial(scenario((26.0, -9.0, 0.0, 1.3, 9.0), sensing=sensing), plant, 5)
    driven = rig().on_bus(trial, deciding=Deciding.FAIL_SAFE, recorded=Recorded(pages=False))
    checked = [(m, r.observation) for m, r in seen if r.observation is not None]
    assert len(checked) > 100
    assert [_outside(*each) for each in checked if _outside(*each)] == []
    assert max(i.motion.speed_mps for i in driven.instants) > 1.8
    assert any(i.state is State.BRAKING and i.motion.speed_mps > 1.0 for i in driven.instants)


def _braked(driven: BusDrive, trial: Trial) -> tuple[bool, bool]:
    outcome = outcome_on_bus(driven, trial.scenario)
    return bool(outcome.brakes), outcome.contact is not None


CROSSES = (22.0, -7.0, 0.0, 1.3, 10.5)
"""In the way of a car that nobody stops."""


@pytest.mark.parametrize("deciding", Deciding)
def test_a_car_stops_for_who_crosses_and_without_a_monitor_it_does_not(deciding: Deciding) -> None:
    trial = Trial(scenario(CROSSES), "single-track", 1)
    unstopped = rig().at_desk(trial, lambda path, clock: NeverBrakes())
    assert unstopped.contact is not None
    assert unstopped.is_as(Expected.COLLIDES)
    assert not unstopped.is_as(Expected.ANY)
    driven = rig().on_bus(trial, deciding=deciding)
    assert _braked(driven, trial) == (True, False)
    assert driven.entries[-1].frame.people[0].name == "0"
    assert any(entry.frame.sent == "BRAKE" for entry in driven.entries)
    at_desk = rig().at_desk(trial, rig().monitor(deciding))
    assert at_desk.brakes
    assert at_desk.contact is None


def test_nobody_near_nothing_to_brake_for() -> None:
    trial = Trial(scenario(duration_s=22.0), "single-track", 2)
    for outcome in (
        rig().at_desk(trial, rig().monitor(Deciding.BOTH)),
        outcome_on_bus(
            rig().on_bus(trial, deciding=Deciding.BOTH, recorded=Recorded(pages=False)),
            trial.scenario,
        ),
    ):
        assert outcome.is_as(Expected.PASSES), outcome.story
        assert not outcome.is_as(Expected.BRAKES)
        assert not outcome.is_as(Expected.STAYS)
        assert outcome.fastest_mps == pytest.approx(2.1, abs=0.25)
        assert outcome.hardest_mps2 < 1.0


def test_the_same_trial_gives_the_same_drive() -> None:
    trial = Trial(scenario(CROSSES, duration_s=5.0), "single-track", 3)
    one, other = (rig().on_bus(trial, deciding=Deciding.BOTH) for _ in range(2))
    assert one.instants == other.instants
    frames = [[entry.frame for entry in driven.entries] for driven in (one, other)]
    assert frames[0] == frames[1]
    another = rig().on_bus(Trial(trial.scenario, "single-track", 4), deciding=Deciding.BOTH)
    assert another.instants != one.instants
    first, second = (rig().at_desk(trial, rig().monitor(Deciding.BOTH)) for _ in range(2))
    assert first == second


def test_a_car_that_does_not_know_where_it_is_brakes() -> None:
    lost = Sensing(dropouts=(Dropout("localisation", 8.0, 10.0),))
    trial = Trial(scenario(sensing=lost), "bicycle", 1)
    driven = rig().on_bus(trial, deciding=Deciding.BOTH, recorded=Recorded(pages=False))
    faults = {fault for i in driven.instants for fault in i.faults if i.t_s > 8.0}
    assert faults & {"LOCALISATION_LOST", "COARSE_READING"}
    braking = [i.t_s for i in driven.instants if i.t_s > 8.0 and i.state is State.BRAKING]
    assert braking
    assert 8.0 < braking[0] < 9.1
    at_desk = rig().at_desk(trial, rig().monitor(Deciding.BOTH))
    assert [8.0 < at_s < 9.1 for at_s in at_desk.brakes] == [True]


def test_a_car_whose_readings_the_proof_does_not_grant_stays_where_it_is() -> None:
    coarse = Sensing(heading_rad=0.2)
    trial = Trial(scenario(sensing=coarse, duration_s=6.0), "bicycle", 1)
    assert rig().at_desk(trial, rig().monitor(Deciding.FAIL_SAFE)).is_as(Expected.STAYS)
    driven = rig().on_bus(trial, deciding=Deciding.FAIL_SAFE, recorded=Recorded(pages=False))
    assert outcome_on_bus(driven, trial.scenario).is_as(Expected.STAYS)


def test_people_who_are_not_there_stop_it_while_they_are_reported() -> None:
    ghost = Sensing(ghosts=(Ghost(20.0, 0.0, 6.0, 9.0),))
    trial = Trial(scenario(sensing=ghost), "bicycle", 1)
    driven = rig().on_bus(trial, deciding=Deciding.BOTH, recorded=Recorded(pages=False))
    outcome = outcome_on_bus(driven, trial.scenario)
    assert outcome.brakes
    assert outcome.nearest_m == math.inf
