"""People are extrapolated from the past only, and a disc contains whoever keeps to its model."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.simulation.people import (
    Body,
    PeopleModel,
    PersonModel,
    discs,
    extrapolate,
    seen_people,
)
from workbench.simulation.recording import PersonSample, Track

MODEL = PersonModel.pedestrian()
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
    assert extrapolate(track, 0.8 + MODEL.max_age_s - 1e-6, MODEL) is not None
    assert extrapolate(track, 0.8 + MODEL.max_age_s + 1e-6, MODEL) is None


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
    for k, (x, y, radius) in enumerate(discs(person, horizon_s=3.0, step_s=0.5)):
        assert math.hypot(vx * (0.5 + 0.5 * k) - x, y) + MODEL.body_radius_m <= radius


def test_kinds_choose_their_model() -> None:
    models = PeopleModel.assumed()
    assert models.of("ped") == models.of("sitting") == PersonModel.pedestrian()
    assert models.of("cyclist") == models.of("hoverboard") == PersonModel.cyclist()
    tracks = (straight(1.0, 0.0, 3), Track("late", "ped", (PersonSample(9.0, 0.0, 0.0),)))
    assert [person.name for person in seen_people(tracks, 0.2, models)] == ["p"]


@pytest.mark.parametrize("wrong", [-0.1, math.nan, math.inf])
def test_impossible_figures_are_refused(wrong: float) -> None:
    with pytest.raises(ValueError, match="body_radius_m"):
        PersonModel(wrong, 0.1, 0.1, 0.1, 1.0, 0.1, 0.5, 0.5, "test")
    with pytest.raises(ValueError, match="window_s"):
        PersonModel(0.3, 0.1, 0.1, 0.1, 1.0, 0.1, 0.0, 0.5, "test")


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
