"""Generated people who change their mind keep to what FailSafe relies on, meet every car that
nobody stops, and are measured within the stated error; who leads when is counted right."""

from __future__ import annotations

import functools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.replay_fixture import Scripted
from workbench.errors import InputError
from workbench.models.vehicle import gem_e2
from workbench.simulation.changing_minds import (
    ROAD,
    Change,
    Mind,
    Turned,
    Way,
    leads_after_s,
    measured,
    mind,
)
from workbench.simulation.clock import SetClock
from workbench.simulation.crossing import Crossing, Localisation
from workbench.simulation.mind_outcomes import Outcome, unwatched_m
from workbench.simulation.obeying import simulate
from workbench.simulation.people import PeopleModel

VEHICLE = gem_e2()
BODY_M = 0.3
changes = st.sampled_from(list(Change))
seeds = st.integers(0, 2**31)


@functools.cache
def way() -> Way:
    return Way.of(VEHICLE)


@settings(max_examples=60, deadline=None)
@given(changes, seeds)
def test_people_keep_to_the_limits_and_off_the_road_until_they_change(
    change: Change, seed: int
) -> None:
    walker = mind(change, VEHICLE, way(), seed).walker
    assert walker.changed_s > 0.0
    step_s = 1e-3
    for t_s in (walker.changed_s + k * 0.05 for k in range(-20, 80)):
        a, b, c = (walker.at(t_s + k * step_s) for k in (-1, 0, 1))
        speed = math.dist(a, c) / (2.0 * step_s)
        bend = math.hypot(*(p - 2.0 * q + r for p, q, r in zip(a, b, c, strict=True)))
        assert speed <= 1.6 + 1e-6
        assert bend / step_s**2 <= 1.2 + 1e-3
        if t_s <= walker.changed_s:
            assert 1.6 <= abs(b[1]) <= 3.0


@settings(max_examples=60, deadline=None)
@given(changes, seeds)
def test_a_car_that_nobody_stops_meets_those_who_turn_across_and_nobody_else(
    change: Change, seed: int
) -> None:
    scene = mind(change, VEHICLE, way(), seed)
    nearest_m = unwatched_m(VEHICLE, way(), scene, body_m=BODY_M)
    if change is Change.STAYS:
        assert scene.met_s is None
        assert nearest_m >= 1.6 - VEHICLE.geometry.half_width_m - BODY_M - 1e-9
    else:
        assert scene.met_s is not None
        assert nearest_m < 0.0


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_who_turns_across_comes_to_the_goal_of_the_set_or_not_near_any(seed: int) -> None:
    scene = mind(Change.ACROSS, VEHICLE, way(), seed)
    across = scene.goals[-1]
    assert scene.right == ("across",) == (across.name,)
    times = [scene.walker.changed_s + 0.05 * k for k in range(400)]
    nearest = min(math.dist(scene.walker.at(t), (across.x_m, across.y_m)) for t in times)
    assert nearest < 0.05
    unknown = mind(Change.ELSEWHERE, VEHICLE, way(), seed)
    assert unknown.right == ()
    side = math.copysign(1.0, unknown.walker.y_m)
    assert all(side * goal.y_m > 0.0 for goal in unknown.goals)


def test_the_way_while_turning_is_the_integral_of_the_velocity() -> None:
    walker = Turned("w", 1.0, 2.0, (1.2, 0.0), (0.3, -1.0), 0.5, 1.2)
    x, y = walker.at(-1.0)
    for k in range(4000):
        t_s = -1.0 + 1e-3 * (k + 0.5)
        share = min(max((t_s - 0.5) / walker.turning_s, 0.0), 1.0)
        x += 1e-3 * (1.2 + share * (0.3 - 1.2))
        y += 1e-3 * share * -1.0
    assert walker.at(3.0) == pytest.approx((x, y), abs=1e-5)
    aside_s = walker.aside_s(0.2)
    assert walker.at(0.5 + aside_s)[1] == pytest.approx(2.0 - 0.2)
    assert walker.at(0.5 + walker.aside_s(2.0))[1] == pytest.approx(0.0)


@given(seeds, st.floats(0.01, 0.5))
def test_measurements_are_within_the_stated_error_and_repeat(seed: int, noise_m: float) -> None:
    track = Turned("w", 0.0, 2.0, (1.2, 0.0), (0.0, 0.0), 1.0, 1.2).track(2.0)
    seen = measured(track, noise_m=noise_m, seed=seed)
    assert seen == measured(track, noise_m=noise_m, seed=seed)
    assert [s.t_s for s in seen.samples] == [s.t_s for s in track.samples]
    off = [
        math.dist((a.x_m, a.y_m), (b.x_m, b.y_m))
        for a, b in zip(seen.samples, track.samples, strict=True)
    ]
    assert max(off) <= noise_m + 1e-9
    assert max(off) > 0.5 * noise_m


def test_a_wait_ends_with_the_last_wrong_leader_between_the_change_and_the_end() -> None:
    scene = mind(Change.ACROSS, VEHICLE, way(), 3)
    t0 = scene.walker.changed_s
    leaders = [(t0 - 1.0, "across"), (t0 + 0.2, "ahead"), (t0 + 0.4, "unknown"), (t0 + 0.6, "back"),
               (t0 + 0.8, "across"), (t0 + 1.0, "unknown")]  # fmt: skip
    assert leads_after_s(leaders, scene, unknown="unknown") == pytest.approx(0.8)
    late = [*leaders, (scene.until_s + 0.1, "ahead")]
    assert leads_after_s(late, scene, unknown="unknown") == pytest.approx(0.8)
    wrong = [*leaders, (scene.until_s - 0.1, "ahead")]
    assert leads_after_s(wrong, scene, unknown="unknown") == math.inf


def driven(scene: Mind, *, brakes_s: tuple[float, float]) -> Outcome:
    """A car that tracks but for these times, and is told that people go straight on."""
    low, high = brakes_s
    monitor = Scripted(lambda seen: low < seen.stamp_s < high)
    crossing = Crossing(
        VEHICLE, ROAD, (scene.walker,), Localisation.assumed(), PeopleModel.assumed(), 80.0, 0.0,
        scene.duration_s, None,
    )  # fmt: skip
    result = simulate(crossing, monitor, clock=SetClock())
    return Outcome.of(result, scene, body_m=BODY_M, clear_m=0.2)


def test_a_stop_is_needless_where_nobody_would_have_been_met() -> None:
    stays, across = (mind(change, VEHICLE, way(), 2) for change in (Change.STAYS, Change.ACROSS))
    assert across.met_s is not None
    idle = driven(stays, brakes_s=(3.0, 4.05))
    assert (idle.stops, idle.needless, idle.wait_s) == (1, 1, None)
    assert idle.braked_s == pytest.approx(1.0)
    needed = driven(across, brakes_s=(across.met_s - 2.5, 99.0))
    assert (needed.stops, needed.needless) == (1, 0)
    assert needed.nearest_m > 0.0
    nobody = driven(across, brakes_s=(98.0, 99.0))
    assert (nobody.stops, nobody.needless, nobody.braked_s) == (0, 0, 0.0)
    assert nobody.nearest_m < 0.0
    assert nobody.way_m > needed.way_m > 3.0


def test_the_same_seed_gives_the_same_scene_and_another_one_another() -> None:
    first, again, other = (mind(Change.STAYS, VEHICLE, way(), seed) for seed in (5, 5, 6))
    assert first == again
    assert first != other
    with pytest.raises(InputError, match="seed"):
        mind(Change.STAYS, VEHICLE, way(), -1)
