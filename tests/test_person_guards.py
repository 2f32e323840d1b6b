"""No lawful motion leaves a guard, and the guards of its members are nested in it."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from person_cases import Array, disc_at, exact_disc, holds

from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_contains, guard_disc
from workbench.runtime.person_tubes import (
    PersonTube,
    TrackedPerson,
    fault_in_person,
)


def lawful_motion(rng: np.random.Generator, guard: Guard, times: Array) -> tuple[Array, Array]:
    """Positions and velocities at `times` from a member of the discs: |a| <= A, |v| <= V.

    The velocity walks straight towards a target in the disc of speeds at the rate A, which is
    often on its rim; positions are exact integrals.
    """
    top, most = guard.limits.speed_mps, guard.limits.acceleration_mps2

    def member(disc: Disc) -> Array:
        way, far = rng.uniform(-np.pi, np.pi), disc.radius * rng.choice([1.0, rng.random()])
        return np.array([disc.x + far * np.cos(way), disc.y + far * np.sin(way)])

    x, v = member(guard.position), member(guard.velocity)
    v *= min(1.0, top / max(float(np.hypot(*v)), 1e-12))
    places, velocities, target = [x], [v], v
    for dt in np.diff(times):
        if rng.random() < 0.3:
            target = member(Disc(0.0, 0.0, top))
        to, reach = target - v, most * dt
        full = float(np.hypot(*to))
        if full > reach:
            after = v + to * (reach / full)
            x = x + 0.5 * (v + after) * dt
        else:
            after, used = target, full / most
            x = x + 0.5 * (v + after) * used + after * (dt - used)
        v = after
        places.append(x)
        velocities.append(v)
    return np.array(places), np.array(velocities)


def random_guard(rng: np.random.Generator) -> Guard:
    w = rng.uniform(-1.5, 1.5, 2)
    # With the centre's speed within the limit, cutting a velocity to it stays in the disc.
    limits = MotionLimits(float(np.hypot(*w)) + rng.uniform(0.01, 1.5), rng.uniform(0.3, 4.0))
    place = Disc(*rng.uniform(-9.0, 9.0, 2), rng.uniform(0.0, 1.0))
    return Guard(rng.uniform(-1.0, 1.0), place, Disc(*w, rng.uniform(0.0, 0.5)), limits)


def within(tube: PersonTube, place: Array, tau: float) -> bool:
    discs = [disc_at(bound, tau) for bound in tube.bounds]
    return all(d and math.hypot(place[0] - d[0], place[1] - d[1]) <= d[2] + 1e-9 for d in discs)


def lawful_escapes(count: int = 150, **changes: float) -> int:
    """Lawful motions that leave the guard, forward or backward in time."""
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(count):
        guard = random_guard(rng)
        back = rng.uniform(0.1, 1.0)
        times = np.linspace(0.0, 3.0, 61)
        places, _ = lawful_motion(rng, guard, times)
        limits = dataclasses.replace(guard.limits, **changes)
        tube = guard_disc(
            dataclasses.replace(guard, limits=limits), from_s=guard.at_s - back, until_s=9.0
        )
        found += any(
            not within(tube, x, guard.at_s + t) for x, t in zip(places, times, strict=True)
        )
        # The mirrored motion runs into the member instead of out of it.
        mirror = dataclasses.replace(
            guard, velocity=dataclasses.replace(guard.velocity, x=-guard.velocity.x,
                                                y=-guard.velocity.y),
        )  # fmt: skip
        times = np.linspace(0.0, back, 21)
        places, _ = lawful_motion(rng, mirror, times)
        found += any(
            not within(tube, x, guard.at_s - t) for x, t in zip(places, times, strict=True)
        )
    return found


def test_no_lawful_motion_leaves_the_guard() -> None:
    assert lawful_escapes() == 0


@pytest.mark.parametrize("change", ["speed_mps", "acceleration_mps2"])
def test_a_limit_that_is_too_small_is_noticed(change: str) -> None:
    assert lawful_escapes(**{change: 0.3}) > 0


def nested(inner: PersonTube, outer: PersonTube, tau: float) -> bool:
    pairs = zip(inner.bounds, outer.bounds, strict=True)
    discs = [(disc_at(a, tau), disc_at(b, tau)) for a, b in pairs]
    return all(
        a and b and math.hypot(a[0] - b[0], a[1] - b[1]) + a[2] <= b[2] + 1e-9 for a, b in discs
    )


def test_the_guard_of_a_member_lies_inside_the_guard() -> None:
    rng = np.random.default_rng(4)
    for _ in range(150):
        guard = random_guard(rng)
        tube = guard_disc(guard, from_s=guard.at_s, until_s=99.0)
        times = np.linspace(0.0, 3.0, 31)
        places, velocities = lawful_motion(rng, guard, times)
        k = int(rng.integers(len(times)))
        later = Guard(
            guard.at_s + times[k], Disc(*places[k], 0.0), Disc(*velocities[k], 0.0), guard.limits
        )
        inner = guard_disc(later, from_s=later.at_s, until_s=99.0)
        assert all(nested(inner, tube, later.at_s + s) for s in (0.0, 0.1, 0.5, 2.0, 30.0))


def test_a_guard_that_is_said_to_be_inside_is() -> None:
    rng = np.random.default_rng(6)
    answers = []
    for _ in range(400):
        early = random_guard(rng)
        d = rng.uniform(0.0, 1.0)
        p, w, far = early.position, early.velocity, rng.uniform(0.0, 0.6, 4)
        top = early.limits.speed_mps * rng.choice([1.0, 1.1])
        late = Guard(
            early.at_s + d,
            Disc(p.x + w.x * d + far[0], p.y + w.y * d - far[1], p.radius * rng.random()),
            Disc(w.x - far[2], w.y + far[3], w.radius * rng.random()),
            MotionLimits(top, early.limits.acceleration_mps2),
        )  # fmt: skip
        answers.append(guard_contains(early, late))
        outer = guard_disc(early, from_s=early.at_s, until_s=99.0)
        inner = guard_disc(late, from_s=late.at_s, until_s=99.0)
        inside = all(nested(inner, outer, late.at_s + s) for s in (0.0, 0.1, 1.0, 10.0, 80.0))
        assert inside or not answers[-1]
    assert 20 < sum(answers) < 380


@pytest.mark.parametrize("field", ["at_s", "position", "velocity", "limits"])
def test_numbers_that_are_none_are_never_inside(field: str) -> None:
    wide = Guard(0.0, Disc(0.0, 0.0, 2.0), Disc(0.0, 0.0, 1.0), MotionLimits(2.0, 2.0))
    thin = Guard(0.5, Disc(0.0, 0.0, 0.5), Disc(0.0, 0.0, 0.5), MotionLimits(2.0, 2.0))
    assert guard_contains(wide, thin)
    assert not guard_contains(thin, wide)
    broken = {
        "at_s": math.nan, "position": Disc(0.0, math.nan, 0.5),
        "velocity": Disc(0.0, 0.0, math.nan), "limits": MotionLimits(math.nan, 2.0),
    }[field]  # fmt: skip
    bad = dataclasses.replace(thin, **{field: broken})
    assert not guard_contains(wide, bad)
    assert not guard_contains(bad, bad)
    tube = guard_disc(bad, from_s=-1.0, until_s=3.0)
    assert fault_in_person(TrackedPerson("p", (tube,))) is not None


@settings(max_examples=100, deadline=None)
@given(st.floats(-1e4, 1e4), st.floats(-90.0, 90.0), st.floats(0.01, 5.0), st.fractions(0, 1))
def test_the_backward_pieces_hold_exactly(
    x: float, vx: float, back: float, share: Fraction
) -> None:
    guard = Guard(0.3, Disc(x, -x / 3, 0.2), Disc(vx, 1.1, 0.1), MotionLimits(2.5, 1.3))
    tube = guard_disc(guard, from_s=0.3 - back, until_s=3.0)
    first = tube.bounds[0][0]
    sigma = (Fraction(guard.at_s) - Fraction(first.from_s)) * share
    p, w = guard.position, guard.velocity
    top, most = map(Fraction, (guard.limits.speed_mps, guard.limits.acceleration_mps2))
    accelerated = (
        Fraction(p.x) - Fraction(w.x) * sigma, Fraction(p.y) - Fraction(w.y) * sigma,
        Fraction(p.radius) + Fraction(w.radius) * sigma + most * sigma * sigma / 2,
    )  # fmt: skip
    fast = (Fraction(p.x), Fraction(p.y), Fraction(p.radius) + top * sigma)
    for bound, true in zip(tube.bounds, (accelerated, fast), strict=True):
        assert holds(exact_disc(bound[0], Fraction(guard.at_s) - sigma), true)


def test_a_disc_around_a_box_holds_its_corners() -> None:
    disc = Disc.around((0.1, 0.7), (-3.3, 1.1))
    for x in (0.1, 0.7):
        for y in (-3.3, 1.1):
            assert (Fraction(x) - Fraction(disc.x)) ** 2 + (
                Fraction(y) - Fraction(disc.y)
            ) ** 2 <= Fraction(disc.radius) ** 2
