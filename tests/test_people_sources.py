"""A run tells its monitor of people what its source says: straight on by default, or estimated from
samples that have come by then; what people want and break is on record."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from tests.replay_fixture import LIMITS, Scripted, drive, standing
from workbench.estimation.goals import Goal
from workbench.estimation.intent_cloud import FilterSettings, NumpyUpdate
from workbench.estimation.motion_parameters import shipped_motion
from workbench.estimation.people_estimator import (
    UNKNOWN,
    Bodies,
    EstimatorSettings,
    PeopleEstimator,
)
from workbench.estimation.person_intents import EveryIntent
from workbench.models.vehicle import gem_e2
from workbench.report.scene import Detail, scene_json
from workbench.report.timeline import decision_table
from workbench.simulation.clock import SetClock
from workbench.simulation.crossing import Crossing
from workbench.simulation.obeying import simulate
from workbench.simulation.people import PeopleModel
from workbench.simulation.people_sources import EstimatedPeople, StraightPeople
from workbench.simulation.recording import PersonSample, Recording, Track
from workbench.simulation.replay import ReplayResult, ReplaySettings, replay
from workbench.simulation.runlog import read_log, write_log

SETTINGS = ReplaySettings.instrumented_car(LIMITS)
GOALS = (Goal("door", 12.0, 6.0, 1.0), Goal("gate", -4.0, -6.0, 1.0))
MODELS = PeopleModel.assumed()
NOTES = ("as estimated", "nobody to do more than was assumed")


def estimated(tracks: tuple[Track, ...], goals: tuple[Goal, ...] = GOALS) -> EstimatedPeople:
    motion = shipped_motion()
    intents = dataclasses.replace(FilterSettings.chosen(), particles=30)
    rules = EstimatorSettings(
        goals, intents, NumpyUpdate(), motion.numbers, EveryIntent(motion, 0.26, 0.9, 3.5),
        MODELS.guards(LIMITS), Bodies(0.3, 0.9, 0.1), 0.5, 1.0, 1.2, 1,
    )  # fmt: skip
    return EstimatedPeople(tracks, PeopleEstimator(rules), notes=NOTES)


def replayed(recording: Recording, monitor: Scripted) -> ReplayResult:
    source = estimated(recording.people)
    return replay(recording, monitor, clock=SetClock(), settings=SETTINGS, people=source)


def jumper() -> Track:
    """Stands, and 2 s later somewhere else."""
    places = [(9.0, -5.0) if k < 20 else (9.0, 3.0) for k in range(41)]
    return Track("jumper", "ped", tuple(PersonSample(0.1 * k, *at) for k, at in enumerate(places)))


def test_straight_on_is_what_runs_tell_where_nothing_is_chosen() -> None:
    recording = drive(people=(standing("p", 8.0, -3.0),))
    told = []
    for people in (None, StraightPeople(recording.people, SETTINGS.people, SETTINGS.limits)):
        monitor = Scripted()
        replay(recording, monitor, clock=SetClock(), settings=SETTINGS, people=people)
        told.append(monitor.seen)
    assert told[0] == told[1]
    scene = dataclasses.replace(
        Crossing.standard(gem_e2(), start_speed_mps=2.8, seed=1), duration_s=1.0
    )
    tracks = tuple(walker.track(scene.duration_s) for walker in scene.walkers)
    told = []
    for people in (None, StraightPeople(tracks, scene.models, scene.limits)):
        monitor = Scripted()
        simulate(scene, monitor, clock=SetClock(), people=people)
        told.append(monitor.seen)
    assert told[0] == told[1]


def test_what_is_estimated_does_not_depend_on_the_future() -> None:
    people = (standing("late", 9.0, 1.0, first_s=2.0), standing("early", 3.0, 8.0))
    whole, cut = Scripted(), Scripted()
    recording = drive(people=people)
    replayed(recording, whole)
    shorter = dataclasses.replace(people[1], samples=people[1].samples[:15])
    replayed(dataclasses.replace(recording, vehicle=recording.vehicle[:15], people=(shorter,)), cut)
    assert whole.seen[:15] == cut.seen
    assert {person.name for person in whole.seen[25].people} == {"late", "early"}


def test_frames_name_who_broke_the_limits_and_say_what_people_want(tmp_path: Path) -> None:
    result = replayed(drive(people=(jumper(), standing("p", 3.0, 8.0))), Scripted())
    named = [(e.frame.t_s, text) for e in result.entries for text in e.frame.violations]
    assert named
    assert all(text.startswith("LIMITS: jumper at 2.") for _, text in named)
    assert named[0][0] == pytest.approx(2.0)
    assert dict(result.measures.violations)["LIMITS"] == len({t_s for t_s, _ in named})
    assert [note in result.notes[1] + result.notes[2] for note in NOTES] == [True, True]
    frame = result.entries[-1].frame
    for person in frame.people:
        chances = [chance for _, chance in person.wanted]
        assert {goal for goal, _ in person.wanted} == {"door", "gate", UNKNOWN}
        assert chances == sorted(chances, reverse=True)
        assert math.fsum(chances) == pytest.approx(1.0)
    log = read_log(write_log(tmp_path / "log.jsonl", {}, result.entries))
    for found, made in zip(log.entries, result.entries, strict=True):
        assert found.frame.violations == made.frame.violations
        for read, seen in zip(found.frame.people, made.frame.people, strict=True):
            assert [goal for goal, _ in read.wanted] == [goal for goal, _ in seen.wanted]
    drawn = scene_json([frame], Detail(frames=2, rectangles=2, discs=2, people=5))
    assert '"door"' in drawn
    table = decision_table([entry.frame for entry in result.entries])
    assert any("LIMITS: jumper" in str(cell) for row in table.rows for cell in row)


def test_what_is_broken_at_samples_that_are_not_judged_is_named_at_the_next_one() -> None:
    recording = drive(people=(jumper(),))
    fast = tuple(
        dataclasses.replace(s, speed_mps=9.0) if 1.9 < s.t_s < 2.5 else s for s in recording.vehicle
    )
    result = replayed(dataclasses.replace(recording, vehicle=fast), Scripted())
    named = [(e.frame.t_s, text) for e in result.entries for text in e.frame.violations]
    assert named[0][0] == pytest.approx(2.5)
    assert "jumper at 2.000 s" in named[0][1]
