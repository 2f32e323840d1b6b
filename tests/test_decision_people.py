"""Nobody who stays in the predicted disc comes closer to the car than the clearance reported."""

from __future__ import annotations

import numpy as np
import pytest
from decision_crowd import intent_distance, somebody
from decision_fixture import BODY, SAFE, STARTS, STEP_S, UNPROVED, kernel, query
from decision_paths import exact_runs, paths

_REQUIRED_M = 0.2
_SCENES = [("straight", "initial set"), ("left", "rate limit"), ("S", "point")]


@pytest.mark.parametrize(("where", "start"), _SCENES)
def test_no_disc_comes_closer_than_the_clearance(where: str, start: str) -> None:
    answered, fine = exact_runs(where, start)
    chance = np.random.default_rng(23)
    table, box = paths()[where].table, STARTS[start]
    gaps, verdicts = [], []
    for _ in range(60):
        person = somebody(chance, where)
        answer = kernel()(query(table, box, [person], clearance_required_m=[_REQUIRED_M])).track
        assert answer.steps == answered.steps
        nearest = float(intent_distance(fine, where, person).min())
        gaps.append(nearest - answer.intent.clearance_m)
        verdicts.append(answer.verdict)
        if answer.verdict == SAFE:
            assert answer.intent.clearance_m >= _REQUIRED_M
            assert nearest > 0.0
    assert min(gaps) >= -1e-9
    # A bound of nothing would pass the line above.
    assert float(np.median(gaps)) < 1.0

    if answered.verdict == SAFE:
        assert min(verdicts.count(SAFE), verdicts.count(UNPROVED)) >= 10
    else:
        assert set(verdicts) == {UNPROVED}


@pytest.mark.parametrize(("where", "start"), [("straight", "initial set"), ("S", "point")])
def test_the_clearance_of_many_is_the_smallest_of_each(where: str, start: str) -> None:
    chance = np.random.default_rng(29)
    table, box = paths()[where].table, STARTS[start]
    for count in (2, 5, 32):
        people = [somebody(chance, where) for _ in range(count)]
        alone = [kernel()(query(table, box, [person])).track for person in people]
        clearances = [answer.intent.clearance_m for answer in alone]
        nearest = int(np.argmin(clearances))
        together = kernel()(query(table, box, people)).track
        assert together.intent.clearance_m == clearances[nearest]
        assert together.intent.person == nearest
        assert together.intent.time_s == alone[nearest].intent.time_s


def test_an_empty_road_is_safe_and_names_nobody() -> None:
    answer = kernel()(query(paths()["straight"].table, STARTS["point"])).track
    assert answer.verdict == SAFE
    assert answer.intent.clearance_m == 1e300
    assert answer.intent.person == -1.0


@pytest.mark.parametrize("required", [0.0, 0.5, 2.0])
def test_safe_means_at_least_the_required_clearance(required: float) -> None:
    table, start = paths()["straight"].table, STARTS["point"]
    aside = [5.0, 3.0, 0.0, 0.0, 0.3, 0.0, 0.0]
    answer = kernel()(query(table, start, [aside], clearance_required_m=[required])).track
    clearance = answer.intent.clearance_m
    # Standing still beside a straight road: 3 m less half the car's width and the radius.
    assert 3.0 - BODY[2] - 0.3 - 3e-5 < clearance <= 3.0 - BODY[2] - 0.3
    assert answer.verdict == (SAFE if clearance >= required else UNPROVED)
    exactly = kernel()(query(table, start, [aside], clearance_required_m=[clearance])).track
    above = kernel()(
        query(table, start, [aside], clearance_required_m=[np.nextafter(clearance, 9)])
    ).track
    assert (exactly.verdict, above.verdict) == (SAFE, UNPROVED)


@pytest.mark.parametrize(("growth", "growth2"), [(0.0, 0.0), (0.2, 0.1)])
def test_somebody_who_closes_in_beside_the_car_is_judged_at_the_horizon(
    growth: float, growth2: float
) -> None:
    """Walking at the car's own speed towards its side: the gap after 3 s in closed form."""
    beside = [0.9, 5.0, 2.8, -0.5, 0.3, growth, growth2]
    answer = kernel()(query(paths()["straight"].table, STARTS["point"], [beside])).track
    gap = 5.0 - 0.5 * 3.0 - BODY[2] - 0.3 - growth * 3.0 - growth2 / 2 * 9.0
    # The person is taken to be anywhere within half a step's way from the middle of the step.
    half_step_m = 0.5 * STEP_S * float(np.hypot(2.8, 0.5))
    assert gap - half_step_m < answer.intent.clearance_m <= gap + 1e-9
    assert answer.intent.time_s == pytest.approx(3.0 - STEP_S)
