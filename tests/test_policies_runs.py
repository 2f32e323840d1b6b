"""Under FailSafe a moving car touches nobody, in random runs and against a search for a way to."""

from __future__ import annotations

import dataclasses
import random

import pytest
from policy_mutants import MUTANTS
from policy_runs import GENES, POLICIES, World, run, search
from policy_world import (
    ACCEL,
    BRAKE,
    DECELERATION,
    HALF_WIDTH_M,
    REAR_M,
    TOP_MPS,
    Car,
    Question,
    gap_m,
    measured,
    stop_tube,
)

from workbench.runtime.policies import Deciding, Hypothesis

WORLDS = (World(), World(late=0.0, lost=False), World(watched_m=6.0), World(late=0.6, lost=False))
"""All of them keep what the guarantee supposes."""


def _random_runs(count: int, *, seed: int) -> None:
    rng = random.Random(seed)
    records = []
    for k in range(count):
        genes = [rng.random() for _ in range(GENES)]
        deciding = Deciding.BOTH if k % 3 else Deciding.FAIL_SAFE
        policies = dataclasses.replace(POLICIES, deciding=deciding)
        records.append(run(genes, WORLDS[k % len(WORLDS)], policies))
        assert records[-1].clearance_m > 0.0, genes
        assert records[-1].resumed == 0, genes
    # The claim would be empty if the car hardly moved or nobody came near.
    assert sum(record.travelled_m for record in records) > 1.5 * count
    assert sum(record.stops for record in records) > 0.5 * count
    assert min(record.clearance_m for record in records) < 0.25
    names = {v.hypothesis for record in records for v in record.violations}
    assert names >= {Hypothesis.ON_TIME, Hypothesis.AGE, Hypothesis.NOBODY_LOST}
    # These the world keeps, so no cycle may refute them.
    kept = {Hypothesis.STATE, Hypothesis.PEOPLE, Hypothesis.STANDSTILL, Hypothesis.CLOCK}
    assert not names & (kept | {Hypothesis.SENDER, Hypothesis.NOBODY_NEW})


def test_nobody_is_touched_by_a_moving_car_in_random_runs() -> None:
    _random_runs(400, seed=20)


@pytest.mark.campaign
def test_nobody_is_touched_in_many_random_runs() -> None:
    _random_runs(10000, seed=21)


def test_a_search_for_a_counterexample_finds_none() -> None:
    least_m, _ = search(World(), seed=5, starts=50, climbs=100)
    assert least_m > 0.0


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(8))
def test_a_long_search_for_a_counterexample_finds_none(seed: int) -> None:
    least_m, _ = search(WORLDS[seed % len(WORLDS)], seed=seed, starts=300, climbs=3000)
    assert least_m > 0.0


@pytest.mark.parametrize("name", list(MUTANTS))
def test_the_same_search_catches_every_planted_fault(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant, world = MUTANTS[name]
    plant(monkeypatch)
    least_m, _ = search(world, seed=1, starts=60, climbs=150)
    assert least_m < 0.0


@pytest.mark.campaign
@pytest.mark.parametrize("name", list(MUTANTS))
def test_without_the_fault_the_same_search_finds_nothing(name: str) -> None:
    world = dataclasses.replace(MUTANTS[name][1], delay_s=BRAKE.delay_s)
    least_m, _ = search(world, seed=1, starts=60, climbs=150)
    assert least_m > 0.0


def test_the_closed_form_tube_contains_every_drive() -> None:
    rng = random.Random(4)
    for _ in range(150):
        car = Car(rng.uniform(-5, 5), rng.choice((0.0, TOP_MPS, rng.uniform(0, TOP_MPS))), None)
        question = Question((0.16, 0.2), None)
        box = measured(car, rng.uniform(-1, 1), rng.uniform(-1, 1))
        tube = stop_tube(box, question)
        switch_s = rng.choice((0.16, 0.2, rng.uniform(0.16, 0.2)))
        accel = rng.choice((*ACCEL, rng.uniform(*ACCEL)))
        deceleration = rng.choice((*DECELERATION, rng.uniform(*DECELERATION)))
        now_s = 0.0
        while now_s < tube.times_s[-1] - 0.002:
            k = min(int(now_s / 0.1), len(tube.lower) - 1)
            state = (car.station_m, car.speed_mps)
            for low, value, high in zip(tube.lower[k], state, tube.upper[k], strict=True):
                # The drive's own steps of 1 ms err by less than this.
                assert low - 3e-3 <= value <= high + 3e-3
            car.command(track=now_s < switch_s, now_s=now_s)
            car.move(now_s, 0.001, accel=accel, deceleration=deceleration)
            now_s += 0.001


def test_the_gap_is_the_distance_to_the_rectangle() -> None:
    assert gap_m((0.0, 1.0), 0.5, 0.0) == 0.0
    assert gap_m((0.0, 1.0), 0.5, 1.88) == pytest.approx(1.88 - HALF_WIDTH_M)
    assert gap_m((0.0, 1.0), -REAR_M - 3.0, HALF_WIDTH_M + 4.0) == pytest.approx(5.0)
