"""People are extrapolated from the past only, and a disc contains whoever keeps to its model."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.estimation.people_data import PersonTrack
from workbench.estimation.people_guards import with_body
from workbench.runtime import Guard, MotionLimits, ObservedPerson
from workbench.runtime.person_guard import guard_disc
from workbench.runtime.person_tubes import RadiusBetween, timed_discs
from workbench.runtime.policies import Relation, SeenPerson, Watched
from workbench.runtime.policies.guards import Scene, people_violations, remembered
from workbench.simulation.drawn_people import as_frame, discs
from workbench.simulation.people import (
    Body,
    PeopleModel,
    PersonModel,
    extrapolate,
    guard_at,
    seen_people,
)
from workbench.simulation.recording import PersonSample, Track

MODEL = PersonModel.pedestrian()
LIMITS = MotionLimits(2.5, 1.5)
small = st.floats(-3.0, 3.0)


def straight(vx: float, vy: float, count: int, *, x: float = 0.0, y: float = 0.0) -> Track:
    return Track(
        "p",
        "ped",
        tuple(PersonSample(0.1 * k, x + vx * 0.1 * k, y + vy * 0.1 * k) for k in range(count)),
    )


@given(small, small, st.integers(2, 12))
def test_straight_motion_gives_its_velocity_exactly(vx: float, vy: float, count: int) -> None:
    person = extrapolate(straight(vx, vy, count), 0.1 * (count - 1), MODEL)
    assert person is not None
    assert (person.vx_mps, person.vy_mps) == pytest.approx((vx, vy), abs=1e-9)


@given(st.integers(1, 8), small, small)
def test_the_future_does_not_matter(cut: int, x: float, y: float) -> None:
    track = straight(1.0, 0.5, 9)
    other = tuple(PersonSample(s.t_s, x, y) for s in track.samples[cut:])
    changed = Track("p", "ped", track.samples[:cut] + other)
    t_s = track.samples[cut - 1].t_s + 0.05
    assert extrapolate(changed, t_s, MODEL) == extrapolate(track, t_s, MODEL)


def test_unseen_and_long_lost_people_are_not_there() -> None:
    track = Track("p", "ped", straight(1.0, 0.0, 9).samples[3:])
    assert extrapolate(track, 0.29, MODEL) is None
    assert extrapolate(track, 0.8 + MODEL.gone_age_s - 1e-6, MODEL) is not None
    assert extrapolate(track, 0.8 + MODEL.gone_age_s + 1e-6, MODEL) is None


def test_who_is_not_seen_is_assumed_to_be_there_before_they_are_taken_to_have_left() -> None:
    models, track = PeopleModel.assumed(), straight(1.0, 0.0, 9)
    ages = [0.0, MODEL.max_age_s - 1e-6, MODEL.max_age_s + 1e-6, MODEL.gone_age_s - 1e-6]
    seen = [seen_people((track,), 0.8 + age, models, LIMITS)[0] for age in ages]
    assert [person.assumed for person in seen] == [False, False, True, True]
    for person, age in zip(seen, ages, strict=True):
        grown = seen[0].guard.position.radius + seen[0].guard.velocity.radius * age
        assert person.guard.position.x == pytest.approx(0.8 + age)
        assert person.guard.position.radius == pytest.approx(grown + 0.75 * age**2, abs=3e-3)
        assert person.guard.at_s == 0.0
    assert seen[1].guard.velocity.radius == pytest.approx(
        seen[0].guard.velocity.radius + 0.75, abs=2e-3
    )
    assert min(p.guard.velocity.radius for p in seen[2:]) >= LIMITS.speed_mps + 1.0
    assert seen_people((track,), 0.8 + MODEL.gone_age_s + 1e-6, models, LIMITS) == ()


@given(small, small, st.integers(1, 9), st.floats(-1e5, 1e5))
def test_a_track_that_ends_loses_nobody(vx: float, vy: float, count: int, x_m: float) -> None:
    """Cycle by cycle, as FailSafe compares them: who is no longer seen is covered, then gone."""
    models, track = PeopleModel.assumed(), straight(vx / 2.0, vy / 2.0, count, x=x_m)
    scene, assumed = None, 0
    for k in range(25):
        stamp_s = 0.1 * k
        people = tuple(
            SeenPerson(p.name, dataclasses.replace(p.guard, at_s=stamp_s + p.guard.at_s), p.assumed)
            for p in seen_people((track,), stamp_s, models, LIMITS)
        )
        now = Scene(stamp_s, people, Watched(x_m, 0.0, 30.0))
        if scene is not None:
            assert (
                people_violations(
                    scene, now, required=Relation.OVERLAPS, unseen_speed_mps=LIMITS.speed_mps
                )
                == ()
            )
            now = remembered(scene, now)
        scene, assumed = now, assumed + sum(p.assumed for p in people)
    assert 4 <= assumed <= 6
    assert scene is not None
    assert scene.people == ()


def test_a_person_seen_once_may_go_anywhere() -> None:
    person = extrapolate(straight(2.0, 0.0, 1), 0.0, MODEL)
    assert person is not None
    assert (person.vx_mps, person.vy_mps, person.growth_mps) == (0.0, 0.0, MODEL.unseen_speed_mps)


def test_more_history_narrows_the_growth() -> None:
    growth = []
    for count in range(1, 7):
        person = extrapolate(straight(1.0, 0.0, count), 0.1 * (count - 1), MODEL)
        assert person is not None
        growth.append(person.growth_mps)
    assert growth == sorted(growth, reverse=True)


def test_growth_of_two_samples_in_closed_form() -> None:
    """Two samples 0.1 s apart, each off by jitter j: their slope is off by 2 j / 0.1."""
    person = extrapolate(straight(1.0, 0.0, 2), 0.1, MODEL)
    assert person is not None
    expected = MODEL.speed_error_mps + MODEL.jitter_m * 20.0 + MODEL.acceleration_mps2 * 0.05
    assert person.growth_mps == pytest.approx(expected)


@given(st.floats(0.0, 0.5), st.floats(0.0, 3.0))
def test_age_is_spent_like_future_time(age_s: float, tau_s: float) -> None:
    track = straight(1.0, -0.5, 6)
    now, later = extrapolate(track, 0.5, MODEL), extrapolate(track, 0.5 + age_s, MODEL)
    assert now is not None
    assert later is not None
    for name in ("x", "y"):
        velocity = getattr(now, f"v{name}_mps")
        expected = getattr(now, f"{name}_m") + velocity * (age_s + tau_s)
        got = getattr(later, f"{name}_m") + getattr(later, f"v{name}_mps") * tau_s
        assert got == pytest.approx(expected, abs=1e-9)
    total = age_s + tau_s
    expected = now.radius_m + now.growth_mps * total + now.growth_mps2 * total**2 / 2
    got = later.radius_m + later.growth_mps * tau_s + later.growth_mps2 * tau_s**2 / 2
    assert got == pytest.approx(expected, abs=1e-9)


@given(st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6), small)
def test_the_disc_contains_a_straight_walker_measured_with_jitter(
    signs: list[float], vx: float
) -> None:
    samples = tuple(
        PersonSample(0.1 * k, vx * 0.1 * k + MODEL.jitter_m * sign, 0.0)
        for k, sign in enumerate(signs)
    )
    person = extrapolate(Track("p", "ped", samples), 0.5, MODEL)
    assert person is not None
    for k, (x, y, radius) in enumerate(discs(person.intent, horizon_s=3.0, step_s=0.5)):
        assert math.hypot(vx * (0.5 + 0.5 * k) - x, y) + MODEL.body_radius_m <= radius


def test_kinds_choose_their_model() -> None:
    models = PeopleModel.assumed()
    assert models.of("ped") == models.of("sitting") == PersonModel.pedestrian()
    assert models.of("cyclist") == models.of("hoverboard") == PersonModel.cyclist()
    tracks = (straight(1.0, 0.0, 3), Track("late", "ped", (PersonSample(9.0, 0.0, 0.0),)))
    seen = seen_people(tracks, 0.2, models, LIMITS)
    assert [person.name for person in seen] == ["p"]
    extrapolated = extrapolate(tracks[0], 0.2, MODEL)
    assert extrapolated is not None
    assert seen[0].intent == (extrapolated.intent,)
    assert seen[0].guard == guard_at(tracks[0], 0.2, MODEL, LIMITS)


def _random_walk(
    pushes: list[tuple[float, float]], gaps: list[int], *, step_s: float = 0.01
) -> tuple[list[tuple[float, float, float, float]], list[int]]:
    """A motion within LIMITS every step_s, and the steps at which it is sampled."""
    x = y = vx = vy = 0.0
    states = []
    for ax, ay in pushes:
        for _ in range(10):
            size = max(math.hypot(ax, ay) / LIMITS.acceleration_mps2, 1.0)
            vx, vy = vx + ax / size * step_s, vy + ay / size * step_s
            # Slower and in the same direction is a smaller change of velocity than none at all.
            fast = max(math.hypot(vx, vy) / LIMITS.speed_mps, 1.0)
            vx, vy = vx / fast, vy / fast
            x, y = x + vx * step_s, y + vy * step_s
            states.append((x, y, vx, vy))
    sampled = [0]
    for gap in gaps:
        sampled.append(sampled[-1] + gap)
    return states, [k for k in sampled if k < len(states)]


push = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))


@given(
    st.lists(push, min_size=8, max_size=8),
    st.lists(st.integers(2, 25), min_size=3, max_size=8),
    st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=9, max_size=9),
    st.integers(0, 20),
)
def test_the_guard_holds_position_and_velocity_of_whoever_keeps_to_the_limits(
    pushes: list[tuple[float, float]],
    gaps: list[int],
    noise: list[tuple[float, float]],
    wait: int,
) -> None:
    """Sampled at any times, with jitter; also later, when the last sample is old."""
    states, sampled = _random_walk(pushes, gaps)
    samples = []
    for k, (ex, ey) in zip(sampled, noise, strict=False):
        size = max(math.hypot(ex, ey), 1.0) / MODEL.jitter_m
        samples.append(PersonSample(0.01 * k, states[k][0] + ex / size, states[k][1] + ey / size))
    now = min(sampled[: len(samples)][-1] + wait, len(states) - 1)
    guard = guard_at(Track("p", "ped", tuple(samples)), 0.01 * now, MODEL, LIMITS)
    assert guard is not None
    x, y, vx, vy = states[now]
    p, w = guard.position, guard.velocity
    assert math.hypot(x - p.x, y - p.y) + MODEL.body_radius_m <= p.radius
    assert math.hypot(vx - w.x, vy - w.y) <= w.radius + 1e-9
    tube = guard_disc(guard, from_s=0.0, until_s=9.0)
    for later in range(now, len(states), 7):
        tau = 0.01 * (later - now)
        for bound in tube.bounds:
            piece = bound[-1]
            s = tau - piece.from_s
            away = math.hypot(
                states[later][0] - piece.x_m - piece.vx_mps * s,
                states[later][1] - piece.y_m - piece.vy_mps * s,
            )
            radius = piece.radius_m + piece.growth_mps * s + piece.growth2_mps2 * s * s / 2.0
            assert away + MODEL.body_radius_m <= radius + 1e-9


@given(st.lists(st.floats(0.05, 0.4), min_size=1, max_size=6), st.sampled_from(["ped", "cyclist"]))
def test_the_guards_of_an_estimator_are_those_of_the_samples(gaps: list[float], kind: str) -> None:
    """Two ways to the same: by the past of a track, and by kind from the models' figures."""
    times = np.cumsum([0.0, *gaps])
    samples = tuple(PersonSample(float(t), float(t), float(t) ** 2) for t in times)
    models = PeopleModel.assumed()
    expected = guard_at(Track("p", kind, samples), samples[-1].t_s, models.of(kind), LIMITS)
    law = models.guards(LIMITS).of(kind)
    history = PersonTrack("", "p", kind, times, np.stack([times, times**2], axis=1))
    found = with_body(law.guard(history, law.limits), models.of(kind).body_radius_m)
    assert _figures(dataclasses.replace(found, at_s=0.0)) == pytest.approx(_figures(expected))


def _figures(guard: Guard) -> list[float]:
    disc, velocity = guard.position, guard.velocity
    limits = dataclasses.astuple(guard.limits)
    return [
        guard.at_s,
        *(disc.x, disc.y, disc.radius),
        *(velocity.x, velocity.y, velocity.radius),
        *limits,
    ]


def test_without_the_lag_of_the_fit_a_guard_would_be_wrong() -> None:
    """Who starts to run is faster now than the mean of the last half second."""
    samples = [PersonSample(0.1 * k, 0.75 * (0.1 * k) ** 2, 0.0) for k in range(6)]
    guard = guard_at(Track("p", "ped", tuple(samples)), 0.5, MODEL, LIMITS)
    assert guard is not None
    missed = 1.5 * 0.5 - guard.velocity.x
    assert missed == pytest.approx(1.5 * 0.25)
    rest = guard.velocity.radius - missed
    assert rest == pytest.approx(MODEL.speed_error_mps + MODEL.jitter_m * 0.9 / 0.175)


def test_a_guard_of_somebody_seen_once_or_on_wheels_has_every_speed_of_theirs() -> None:
    once = guard_at(straight(2.0, 0.0, 1), 0.0, MODEL, LIMITS)
    assert once is not None
    assert (once.velocity.x, once.velocity.radius) == (0.0, LIMITS.speed_mps)
    rider = guard_at(straight(6.0, 0.0, 6), 0.5, PersonModel.cyclist(), LIMITS)
    assert rider is not None
    assert rider.limits == MotionLimits(7.0, 1.5)
    assert guard_at(straight(1.0, 0.0, 3), 9.0, MODEL, LIMITS) is None


def test_a_picture_has_the_smallest_disc_of_a_guard_and_all_that_was_intended() -> None:
    guard = guard_at(straight(1.0, 0.0, 6), 0.5, MODEL, LIMITS)
    assert guard is not None
    turning = timed_discs(
        (0.0, 1.0), (0.5, 9.0), (0.0, 9.0), (0.4, 0.4), between=RadiusBetween.LINE
    )
    frame = as_frame(ObservedPerson("p", (turning,), guard), horizon_s=3.0, step_s=0.5)
    assert [x for x, _, _ in frame.predicted] == pytest.approx([0.5, 4.75, 9.0])
    later = frame.guarded[-1]
    q, r = guard.velocity.radius, guard.position.radius
    assert later[2] == pytest.approx(min(r + 2.0 * q + 0.75 * 4.0, r + 2.5 * 2.0))
    assert (frame.x_m, frame.y_m) == pytest.approx((0.5, 0.0))
    nobody_knows = as_frame(ObservedPerson("p", (), guard), horizon_s=3.0, step_s=0.5)
    assert (nobody_knows.x_m, nobody_knows.predicted) == (pytest.approx(0.5), ())


@pytest.mark.parametrize("wrong", [-0.1, math.nan, math.inf])
def test_impossible_figures_are_refused(wrong: float) -> None:
    with pytest.raises(ValueError, match="body_radius_m"):
        PersonModel(wrong, 0.1, 0.1, 0.1, 1.0, 0.1, 0.5, 0.5, 1.0, "test")
    with pytest.raises(ValueError, match="window_s"):
        PersonModel(0.3, 0.1, 0.1, 0.1, 1.0, 0.1, 0.0, 0.5, 1.0, "test")
    with pytest.raises(ValueError, match="gone_age_s"):
        PersonModel(0.3, 0.1, 0.1, 0.1, 1.0, 0.1, 0.5, 0.5, 0.4, "test")


@given(small, small, small, st.floats(-4.0, 4.0), st.floats(0.0, 1.0), st.floats(-1.0, 1.0))
def test_body_distance_is_the_least_over_the_rectangle(
    px: float, py: float, heading: float, x: float, along: float, across: float
) -> None:
    body = Body(x, 0.5, heading, 2.0, 1.0, 0.5)
    a, b = -1.0 + 3.0 * along, 0.5 * across
    corner = (
        x + a * math.cos(heading) - b * math.sin(heading),
        0.5 + a * math.sin(heading) + b * math.cos(heading),
    )
    assert body.distance(px, py) <= math.dist(corner, (px, py)) + 1e-9
    assert body.distance(*corner) <= 1e-9


def test_body_distance_ahead_behind_and_beside() -> None:
    body = Body(1.0, 1.0, math.pi / 2, 2.0, 1.0, 0.5)
    assert body.distance(1.0, 6.0) == pytest.approx(3.0)
    assert body.distance(1.0, -3.0) == pytest.approx(3.0)
    assert body.distance(-2.5, 1.0) == pytest.approx(3.0)
    assert body.distance(4.5, 6.0) == pytest.approx(math.hypot(3.0, 3.0))
