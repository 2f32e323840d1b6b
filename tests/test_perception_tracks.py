"""Association makes the most and likeliest pairs (by brute force), never one that the limits
forbid, whatever the order; tracks keep people who cross, hold place and velocity, begin and end."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from workbench.errors import InputError
from workbench.perception.tracks import (
    Sighting,
    Track,
    TrackLimits,
    Tracks,
    associated,
    velocity_between,
)
from workbench.runtime.person_guard import Disc, MotionLimits
from workbench.runtime.policies.guards import Relation, relation_to
from workbench.runtime.protocols.people import PersonKind

FOOT, WHEELS = MotionLimits(2.5, 2.0), MotionLimits(7.0, 3.0)
LIMITS = TrackLimits(FOOT, WHEELS, forget_s=1.0, memory_s=1.5)
STEP_S = 0.2


def sighting(
    x: float, y: float, radius: float = 0.2, kind: PersonKind = PersonKind.ON_FOOT
) -> Sighting:
    return Sighting(kind, Disc(x, y, radius))


def drawn_tracks(rng: np.random.Generator, count: int) -> tuple[Track, ...]:
    tracks = Tracks(LIMITS)
    places = rng.uniform(-1.5, 1.5, (count, 2))
    moved = places + rng.uniform(-0.2, 0.2, (count, 2))
    tracks = tracks.after([sighting(*place) for place in places], at_s=0.0)
    return tracks.after([sighting(*place) for place in moved], at_s=STEP_S).people


def allowed(track: Track, seen: Sighting, at_s: float) -> bool:
    """The gate written out: two discs in which the person can be by now, at_s after the track."""
    t = at_s - track.guard.at_s
    p, w, limits = track.guard.position, track.guard.velocity, track.guard.limits
    both = p.radius + seen.place.radius
    at_pace = math.hypot(seen.place.x - p.x - w.x * t, seen.place.y - p.y - w.y * t)
    away = math.hypot(seen.place.x - p.x, seen.place.y - p.y)
    grown = both + w.radius * t + 0.5 * limits.acceleration_mps2 * t * t
    return at_pace <= grown and away <= both + limits.speed_mps * t


def best_by_brute_force(
    tracks: tuple[Track, ...], seen: list[Sighting], at_s: float
) -> tuple[int, float]:
    """(pairs, sum of minus log densities) of the best choice, by trying all."""
    best = (0, 0.0)
    padded = [*range(len(seen)), *[None] * len(tracks)]
    for choice in set(itertools.permutations(padded, len(tracks))):
        pairs = [(t, seen[k]) for t, k in zip(tracks, choice, strict=True) if k is not None]
        if all(allowed(track, each, at_s) for track, each in pairs):
            total = sum(surprise(track, each, at_s) for track, each in pairs)
            best = min(best, (-len(pairs), total))
    return -best[0], best[1]


def surprise(track: Track, seen: Sighting, at_s: float) -> float:
    """Minus the log density of the step from the place at constant velocity to the sighting, the
    difference of two normal places with half their discs' radii as standard deviations."""
    t = at_s - track.guard.at_s
    p, w, limits = track.guard.position, track.guard.velocity, track.guard.limits
    by_now = min(
        p.radius + w.radius * t + 0.5 * limits.acceleration_mps2 * t**2,
        p.radius + limits.speed_mps * t,
    )
    spread = math.hypot(0.5 * by_now, 0.5 * seen.place.radius)
    step = (seen.place.x - p.x - w.x * t, seen.place.y - p.y - w.y * t)
    return -sum(float(norm.logpdf(each, scale=spread)) for each in step)


@given(st.integers(0, 2**32 - 1), st.integers(0, 3), st.integers(0, 3))
def test_association_is_the_best_of_all(seed: int, count: int, sightings: int) -> None:
    rng = np.random.default_rng(seed)
    tracks, at_s = drawn_tracks(rng, count), 2.0 * STEP_S
    places, radii = rng.uniform(-2.0, 2.0, (sightings, 2)), rng.uniform(0.05, 1.5, sightings)
    seen = [sighting(*place, radius) for place, radius in zip(places, radii, strict=True)]
    pairs = associated(tracks, seen, at_s=at_s)
    assert len(set(pairs.values())) == len(pairs)
    assert all(allowed(tracks[k], seen[j], at_s) for k, j in pairs.items())
    total = sum(surprise(tracks[k], seen[j], at_s) for k, j in pairs.items())
    most, least = best_by_brute_force(tracks, seen, at_s)
    assert len(pairs) == most
    assert total == pytest.approx(least, abs=1e-9)


@given(st.integers(0, 2**32 - 1), st.permutations(range(5)), st.permutations(range(6)))
def test_the_order_of_tracks_and_sightings_does_not_matter(
    seed: int, rows: list[int], columns: list[int]
) -> None:
    rng = np.random.default_rng(seed)
    tracks = drawn_tracks(rng, 5)
    seen = [sighting(*place) for place in rng.uniform(-2.0, 2.0, (6, 2))]
    plain = associated(tracks, seen, at_s=0.4)
    mixed = associated([tracks[k] for k in rows], [seen[k] for k in columns], at_s=0.4)
    assert {rows[k]: columns[j] for k, j in mixed.items()} == plain


def walk(people: list[tuple[complex, complex]], frames: int, radius: float = 0.1) -> list[Tracks]:
    """Tracks after each frame of people at position + velocity t, listed in turning order."""
    tracks, found = Tracks(LIMITS), []
    for k in range(frames):
        at = [place + velocity * k * STEP_S for place, velocity in people]
        at = at[k % len(at) :] + at[: k % len(at)]
        tracks = tracks.after([sighting(z.real, z.imag, radius) for z in at], at_s=k * STEP_S)
        found.append(tracks)
    return found


def test_people_who_cross_keep_their_numbers() -> None:
    """Two cross at an angle, and at one frame stand half a metre apart."""
    people = [(complex(-3, 0), complex(1.2, 0.0)), (complex(0.25, -3), complex(0.0, 1.2))]
    found = walk(people, 26)
    for k, tracks in enumerate(found):
        assert [track.number for track in tracks.people] == [1, 2]
        for track, (place, velocity) in zip(tracks.people, people, strict=True):
            true = place + velocity * k * STEP_S
            assert track.seen == k + 1
            assert (track.guard.position.x, track.guard.position.y) == pytest.approx(
                (true.real, true.imag)
            )


def test_people_who_pass_each_other_are_told_apart_by_their_velocity() -> None:
    """From frame to frame each comes to where the other has just been."""
    tracks = Tracks(LIMITS)
    for k in range(-5, 6):
        x = 0.24 * (2 * k + 1)
        tracks = tracks.after([sighting(-x, 0.1, 0.05), sighting(x, 0.0, 0.05)], at_s=3.0 + 0.4 * k)
        by_number = {track.number: track.guard.position for track in tracks.people}
        assert (by_number[1].x, by_number[1].y) == (-x, 0.1)
        assert (by_number[2].x, by_number[2].y) == (x, 0.0)


def test_the_velocity_disc_holds_the_velocity_and_shrinks() -> None:
    found = walk([(complex(0, 0), complex(1.0, -0.5))], 9)
    for tracks in found:
        velocity = tracks.people[0].guard.velocity
        assert math.hypot(velocity.x - 1.0, velocity.y + 0.5) <= velocity.radius
    assert found[0].people[0].guard.velocity == Disc(0.0, 0.0, FOOT.speed_mps)
    # sqrt(2 A (r + r')) at the best of all baselines, here a little above it.
    assert found[-1].people[0].guard.velocity.radius <= 1.1 * math.sqrt(2.0 * 2.0 * 0.2)


@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.05, 1.5),
    st.floats(0.0, 0.5),
    st.floats(0.0, 0.5),
)
def test_the_velocity_now_is_in_its_disc(seed: int, d: float, r: float, r1: float) -> None:
    """Of motions with bounded acceleration in 40 pieces, with the extreme ones among them."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0.0, 2.0 * np.pi, 40 if rng.uniform() < 0.5 else 1)
    a = FOOT.acceleration_mps2 * np.exp(1j * np.broadcast_to(turn, 40))
    h, z, v = d / 40, 0j, complex(*rng.uniform(-1, 1, 2))
    then = z
    for each in a:
        z, v = z + v * h + 0.5 * each * h * h, v + each * h
    then += r * np.exp(1j * rng.uniform(0, 7))
    now = z + r1 * np.exp(1j * rng.uniform(0, 7))
    first, second = Disc(then.real, then.imag, r), Disc(now.real, now.imag, r1)
    found = velocity_between(3.0, first, 3.0 + d, second, limits=FOOT)
    assert abs(v - complex(found.x, found.y)) <= found.radius + 1e-9


def test_a_true_track_never_refutes_the_guard_before() -> None:
    """What the monitor asks of people from set to set holds of tracks of one who keeps to the
    limits, seen with an error within the disc."""
    rng = np.random.default_rng(3)
    z, v, tracks = 0j, 1.0 + 0j, Tracks(LIMITS)
    before: Track | None = None
    for k in range(60):
        noise = 0.2 * rng.uniform() * np.exp(1j * rng.uniform(0, 7))
        tracks = tracks.after([sighting((z + noise).real, (z + noise).imag)], at_s=k * STEP_S)
        (track,) = tracks.people
        guard = track.guard
        assert track.number == 1
        assert abs(z - complex(guard.position.x, guard.position.y)) <= guard.position.radius + 1e-12
        assert abs(v - complex(guard.velocity.x, guard.velocity.y)) <= guard.velocity.radius + 1e-9
        if before is not None:
            assert relation_to(before.guard, guard) is not Relation.OUTSIDE
        before = track
        a = 2.0 * np.exp(1j * rng.uniform(0, 7))
        if abs(v + a * STEP_S) > 2.5:
            a = -v / abs(v)
        z, v = z + v * STEP_S + 0.5 * a * STEP_S**2, v + a * STEP_S


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 3.0))
def test_who_is_not_seen_stays_in_the_growing_discs(seed: int, later: float) -> None:
    """Two sightings of a motion within the limits, then none: place and velocity are held."""
    rng = np.random.default_rng(seed)
    z, v = complex(*rng.uniform(-3, 3, 2)), 1.5 * np.exp(1j * rng.uniform(0, 7))
    tracks = Tracks(LIMITS)
    for k in range(2):
        at = z + v * k * STEP_S + 0.1 * rng.uniform() * np.exp(1j * rng.uniform(0, 7))
        tracks = tracks.after([sighting(at.real, at.imag, 0.1)], at_s=k * STEP_S)
    (track,) = tracks.people
    z += v * STEP_S
    for _ in range(20):
        h = later / 20
        a = 2.0 * np.exp(1j * rng.choice([0.0, rng.uniform(0, 7)]))
        if abs(v + a * h) > 2.5:
            a = 0j
        z, v = z + v * h + 0.5 * a * h * h, v + a * h
    place, velocity = track.place_at(STEP_S + later), track.velocity_at(STEP_S + later)
    assert abs(z - complex(place.x, place.y)) <= place.radius + 1e-9
    assert abs(v - complex(velocity.x, velocity.y)) <= velocity.radius + 1e-9
    assert place.radius <= 0.1 + 2.5 * later + 1e-9


def test_a_vague_sighting_is_of_the_one_who_is_known_better() -> None:
    """One person walked out of sight long ago, the other was there a moment ago."""
    tracks = Tracks(LIMITS).after([sighting(0, 0)], at_s=0.0)
    tracks = tracks.after([sighting(3.0, 0.0)], at_s=0.8)
    tracks = tracks.after([sighting(1.4, 0.0, 2.5)], at_s=1.0)
    assert [(track.number, track.seen) for track in tracks.people] == [(1, 1), (2, 2)]
    assert tracks.numbers == (2,)


@given(st.integers(0, 2**32 - 1))
def test_numbers_say_which_track_each_sighting_belongs_to(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks = Tracks(LIMITS)
    for k in range(4):
        count = rng.integers(0, 5)
        seen = [sighting(*place) for place in rng.uniform(-2.0, 2.0, (count, 2))]
        tracks = tracks.after(seen, at_s=0.4 * k)
        guards = {track.number: track.guard for track in tracks.people}
        assert len(set(tracks.numbers)) == len(tracks.numbers) == count
        for number, each in zip(tracks.numbers, seen, strict=True):
            assert guards[number].position is each.place
            assert guards[number].at_s == 0.4 * k


def test_births_and_deaths() -> None:
    tracks = Tracks(LIMITS).after([sighting(0, 0)], at_s=0.0)
    tracks = tracks.after([sighting(0.1, 0), sighting(5, 5)], at_s=0.2)
    assert [track.number for track in tracks.people] == [1, 2]
    for k in range(4):
        tracks = tracks.after([sighting(0.1, 0)], at_s=0.4 + 0.2 * k)
        assert [track.number for track in tracks.people] == [1, 2]
        assert tracks.people[1].guard.at_s == 0.2
        assert tracks.lost == ()
    tracks = tracks.after([sighting(0.1, 0)], at_s=1.4)
    assert [track.number for track in tracks.people] == [1]
    assert [track.number for track in tracks.lost] == [2]
    tracks = tracks.after([sighting(5, 5)], at_s=1.6)
    assert tracks.lost == ()
    assert [track.number for track in tracks.people] == [1, 3]


def test_who_was_missed_for_a_moment_keeps_the_number() -> None:
    tracks = Tracks(LIMITS)
    for k in (0, 1, 2, 5, 6):
        tracks = tracks.after([sighting(1.5 * k * STEP_S, 0)], at_s=k * STEP_S)
    assert [track.number for track in tracks.people] == [1]


def test_a_jump_is_somebody_new() -> None:
    """Two centimetres more than position errors and the speed limit allow, and two less."""
    for less, numbers in ((0.02, [1]), (-0.02, [1, 2])):
        tracks = Tracks(LIMITS).after([sighting(0, 0)], at_s=0.0)
        tracks = tracks.after([sighting(0.4 + 2.5 * STEP_S - less, 0)], at_s=STEP_S)
        assert [track.number for track in tracks.people] == numbers


def test_once_on_wheels_always_on_wheels() -> None:
    tracks = Tracks(LIMITS).after([sighting(0, 0)], at_s=0.0)
    tracks = tracks.after([sighting(0, 0, kind=PersonKind.ON_WHEELS)], at_s=0.2)
    tracks = tracks.after([sighting(0, 0)], at_s=0.4)
    (track,) = tracks.people
    assert track.kind is PersonKind.ON_WHEELS
    assert track.guard.limits == WHEELS


def test_frames_that_go_back_are_refused() -> None:
    tracks = Tracks(LIMITS).after([sighting(0, 0)], at_s=1.0)
    with pytest.raises(InputError, match="order of time"):
        tracks.after([], at_s=1.0)
    with pytest.raises(InputError, match="forget_s"):
        TrackLimits(FOOT, WHEELS, forget_s=0.0, memory_s=1.0)
