"""Baselines brake where closed forms say so, and are tuned to the least that misses nothing."""

from __future__ import annotations

import functools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.survey_cases import rig, row, straight
from workbench.errors import InputError
from workbench.runtime import Action, Observation, ObservedPerson, Watched
from workbench.runtime.person_guard import Disc, Guard, MotionLimits
from workbench.simulation.campaign.baselines import (
    BASELINES,
    CLEARANCE_M,
    Baseline,
    Look,
    RuleJudge,
    baseline,
    growing_disc,
    time_to_collision,
    within_distance,
)
from workbench.simulation.campaign.contenders import Field, judged_half
from workbench.simulation.campaign.tallies import rate, tallies, upper_bound
from workbench.simulation.campaign.tuning import tune
from workbench.simulation.rig import path_table

REACH_M = 0.5
SHAPE = rig().vehicle.geometry


def seen(place: tuple[float, float], velocity: tuple[float, float], *, assumed: bool = False,
         at_s: float = 0.0) -> ObservedPerson:  # fmt: skip
    guard = Guard(at_s, Disc(*place, REACH_M), Disc(*velocity, 0.2), MotionLimits(2.5, 1.5))
    return ObservedPerson("1", (), guard, assumed=assumed)


def observed(
    *people: ObservedPerson, speed_mps: float = 2.0, watched_m: float = 30.0
) -> Observation:
    def at(value: float) -> tuple[float, float]:
        return value - 0.1, value + 0.1

    return Observation(
        x=at(0.0), y=at(0.0), heading=at(0.0), steering=at(0.0), speed=at(speed_mps),
        speed_integral=(0.0, 0.0), offset_integral=(0.0, 0.0), reference_speed_mps=2.0,
        people=people, stamp_s=0.0, watched=Watched(0.0, 0.0, watched_m),
    )  # fmt: skip


@functools.cache
def table():
    return path_table(straight())


def look(*people: ObservedPerson, speed_mps: float = 2.0) -> Look:
    return Look(observed(*people, speed_mps=speed_mps), rig().vehicle, table())


@given(x_m=st.floats(4.0, 25.0), v_mps=st.floats(-2.0, 1.0), speed_mps=st.floats(1.5, 4.0))
def test_time_to_collision_ahead_is_gap_over_closing_speed(
    x_m: float, v_mps: float, speed_mps: float
) -> None:
    meets_s = (x_m - REACH_M - CLEARANCE_M - SHAPE.front_m) / (speed_mps - v_mps)
    view = look(seen((x_m, 0.0), (v_mps, 0.0)), speed_mps=speed_mps)
    assert time_to_collision(view, 1.01 * meets_s)
    assert not time_to_collision(view, 0.99 * meets_s)


def test_who_walks_off_to_the_side_is_not_met() -> None:
    assert not time_to_collision(look(seen((10.0, 3.0), (0.0, 1.0))), 10.0)
    assert time_to_collision(look(seen((10.0, 4.0), (0.0, -1.0))), 10.0)


@given(x_m=st.floats(4.0, 25.0))
def test_a_growing_disc_ahead_is_met_by_speed_and_growth(x_m: float) -> None:
    meets_s = (x_m - REACH_M - CLEARANCE_M - SHAPE.front_m) / (2.0 + 0.5)
    view = look(seen((x_m, 0.0), (0.0, 0.0)))
    assert growing_disc(view, meets_s + 0.25)
    assert not growing_disc(view, max(meets_s - 0.25, 0.0))


def test_the_corridor_is_as_wide_as_stated() -> None:
    edge_m = SHAPE.half_width_m + 0.5 + REACH_M
    assert within_distance(look(seen((8.0, edge_m - 0.05), (0.0, 0.0))), 8.0)
    assert not within_distance(look(seen((8.0, edge_m + 0.05), (0.0, 0.0))), 8.0)
    assert not within_distance(look(seen((-4.0, 0.0), (0.0, 0.0))), 20.0)


@pytest.mark.parametrize("rule", BASELINES, ids=lambda rule: rule.name)
def test_a_larger_parameter_brakes_no_later(rule: Baseline) -> None:
    view = look(seen((9.0, 0.5), (-0.5, 0.0)))
    answers = [
        rule.blocked(view, rule.least + k * (rule.most - rule.least) / 40) for k in range(41)
    ]
    assert answers == sorted(answers)
    assert answers[-1]
    assert not answers[0]


@pytest.mark.parametrize("rule", BASELINES, ids=lambda rule: rule.name)
def test_who_is_only_assumed_is_not_braked_for(rule: Baseline) -> None:
    assert not rule.blocked(look(seen((6.0, 0.0), (0.0, 0.0), assumed=True)), rule.most)


def test_people_are_moved_on_from_when_they_were_measured() -> None:
    fresh, old = seen((12.0, 0.0), (-2.0, 0.0)), seen((12.0, 0.0), (-2.0, 0.0), at_s=-1.0)
    assert look(old).people[0].guard.at_s == -1.0
    gap_s = (12.0 - REACH_M - CLEARANCE_M - SHAPE.front_m) / 4.0
    assert not time_to_collision(look(fresh), gap_s - 0.1)
    assert time_to_collision(look(old), gap_s - 0.4)


def test_five_clear_decisions_release_the_brake() -> None:
    judge = RuleJudge(lambda view: bool(view.people), rig().vehicle, table())
    person = seen((6.0, 0.0), (0.0, 0.0))
    actions = [judge.step(observed()).action for _ in range(5)]
    assert actions == [Action.BRAKE] * 4 + [Action.TRACK]
    assert judge.turn(0.0).action is Action.TRACK
    assert judge.step(observed(person)).action is Action.BRAKE
    assert judge.step(observed()).action is Action.BRAKE
    assert judge.step(observed(watched_m=0.0)).action is Action.BRAKE


@given(needs=st.lists(st.floats(0.6, 23.0), min_size=1, max_size=12))
def test_tuning_finds_the_least_parameter_that_misses_nothing(needs: list[float]) -> None:
    """Each index is missed below a parameter of its own; only one is known to be dangerous."""
    rule = baseline("fixed distance")
    found = tune(rule, range(len(needs)), [0], lambda p, asked: [k for k in asked if p < needs[k]])
    step = (rule.most - rule.least) / 2**7
    assert found.missed == 0
    assert max(needs) <= found.parameter <= max(needs) + step


def test_what_nothing_helps_against_is_said() -> None:
    rule = baseline("time to collision")
    found = tune(rule, range(4), [], lambda p, asked: [k for k in asked if k == 2 or p < 3.0])
    assert (found.missed, found.training) == (1, 4)
    assert found.parameter == pytest.approx(3.0, abs=0.1)


def test_a_baseline_without_parameter_does_not_drive() -> None:
    with pytest.raises(InputError, match="tune it"):
        Field({3.0: rig()}, {}).contender("time to collision")
    with pytest.raises(InputError, match="expected a baseline"):
        baseline("luck")


def test_rates_are_sums_over_sums_with_intervals_around_them() -> None:
    found = rate([1, 0, 3, 0] * 50, [20.0, 30.0, 10.0, 20.0] * 50)
    assert found.per_km == pytest.approx(4 / 0.08)
    assert found.low < found.per_km < found.high
    few = rate([2, 2], [1000.0, 1000.0])
    assert few.per_km == 2.0
    assert few.low != few.low
    assert rate([0], [0.0]).per_km != rate([0], [0.0]).per_km


def test_no_event_in_n_is_bounded_as_the_rule_of_three_says() -> None:
    assert upper_bound(0, 1000) == pytest.approx(3.0 / 1000, rel=0.01)
    assert upper_bound(5, 5) == 1.0


def test_baselines_count_on_the_judged_half_alone_and_nothing_is_left_out() -> None:
    rows = [row(k, "time to collision", contact=True, avoidable=True) for k in range(5)]
    rows += [row(k, invalid=10, safe=80) for k in range(5)]
    fail_safe, rule = tallies(rows)
    half = sum(map(judged_half, range(5)))
    assert 0 < half < 5
    assert (rule.runs, rule.avoidable, rule.judged, fail_safe.judged) == (half,) * 4
    assert (fail_safe.runs, fail_safe.avoidable, fail_safe.decisions) == (5, 0, 450)
    assert fail_safe.invalid == pytest.approx(10 / 90)
