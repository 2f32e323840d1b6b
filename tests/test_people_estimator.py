"""Several people's intents and guards depend on what was measured of each by then and on nothing
else; whoever keeps to the limits is in their guard, whoever breaks them is named and has wider
ones."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.people_cases import (
    BODY_M,
    LAW,
    LIMITS,
    MOTION,
    NO_GOALS,
    NOISE_M,
    SETTINGS,
    SQUARE,
    fed,
    person,
    walk,
)
from workbench.errors import InputError
from workbench.estimation.guard_shipped import shipped_guards
from workbench.estimation.intent_filter import Intents, follow
from workbench.estimation.motion_filter import estimate
from workbench.estimation.people_data import PersonTrack
from workbench.estimation.people_estimator import (
    UNKNOWN,
    PeopleEstimator,
    Sighting,
)
from workbench.estimation.people_guards import FittedGuards
from workbench.estimation.person_intents import EveryIntent, MostLikelyIntent
from workbench.estimation.prediction import PreferredVelocity
from workbench.runtime import MotionLimits, Watched
from workbench.runtime.person_guard import guard_disc
from workbench.runtime.person_tubes import TrackedPerson, fault_in_person
from workbench.runtime.policies import Relation, SeenPerson
from workbench.runtime.policies.guards import Scene, people_violations, remembered


def test_of_each_person_their_own_measurements_alone_count_and_only_those_by_then() -> None:
    anna, ben = walk("anna"), walk("ben", x=5.0, vx=-1.0)
    alone, both = fed(*anna).at(1.1), fed(*anna, *ben).at(1.1)
    assert person(alone, "anna") == person(both, "anna")
    assert alone.wanted["anna"] == both.wanted["anna"]
    assert [each.name for each in both.people] == ["anna", "ben"]
    estimator = fed(*anna[:6], *ben[:6])
    early = estimator.at(0.55)
    other = fed(*anna[:6], *ben[:6])
    assert early == other.at(0.55)
    assert early.people != both.people


def test_a_measurement_out_of_order_is_refused_and_changes_nothing() -> None:
    estimator, other = fed(*walk("anna")), fed(*walk("anna"))
    with pytest.raises(InputError, match=r"ben: expected a measurement at 1\.100 s or later"):
        estimator.measure(Sighting("ben", "ped", 1.0, 0.0, 0.0))
    with pytest.raises(InputError, match=r"anna: expected a measurement after 1\.100 s"):
        estimator.measure(Sighting("anna", "ped", 1.1, 9.0, 0.0))
    with pytest.raises(InputError, match="expected a finite time"):
        Sighting("anna", "ped", 1.2, math.nan, 0.0)
    with pytest.raises(InputError, match="from the newest measurement on"):
        estimator.at(1.0)
    assert estimator.at(1.2) == other.at(1.2)


def test_the_parts_are_those_of_the_single_filters() -> None:
    """Beliefs at five measurements a second, position and velocity at all of them."""
    seen = walk("anna", count=15)
    track = PersonTrack(
        "", "anna", "ped", np.array([s.t_s for s in seen]), np.array([(s.x_m, s.y_m) for s in seen])
    )
    now = fed(*seen).at(1.4)
    slower = PersonTrack("", "anna", "ped", track.t_s[::2], track.xy_m[::2])
    intents = Intents.of_person(SQUARE, "", "anna", seed=1)
    belief = follow(slower, intents, SETTINGS.intents, SETTINGS.update)[-1]
    assert [w.goal for w in now.wanted["anna"]] == [*(goal.name for goal in SQUARE), UNKNOWN]
    assert [w.probability for w in now.wanted["anna"]] == pytest.approx(belief.weights.tolist())
    free = fed(*seen, rules=NO_GOALS).at(1.4)
    assert [(w.goal, w.probability) for w in free.wanted["anna"]] == [(UNKNOWN, 1.0)]
    [tube] = person(free, "anna").intent
    known = estimate(track, MOTION.numbers)
    end = PreferredVelocity(MOTION.numbers).forecast(known, 1.4, [3.5])[0]
    last = tube.bounds[0][-1]
    reach = (tube.until_s - last.from_s) * np.array([last.vx_mps, last.vy_mps])
    np.testing.assert_allclose(np.array([last.x_m, last.y_m]) + reach, end, atol=1e-9)
    speed = PreferredVelocity(MOTION.numbers).speed_mps(known, 1.4)
    radius = MOTION.free.radius_m(0.9, 3.5, speed) + BODY_M + 0.1
    assert last.radius_m == pytest.approx(radius)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(["every", "likeliest"]), st.floats(0.26, 1.0))
def test_the_decision_can_take_whatever_is_forwarded(seed: int, way: str, threshold: float) -> None:
    rng = np.random.default_rng(seed)
    forwarding = EveryIntent(MOTION, threshold, 0.99, 4.0)
    rules = dataclasses.replace(SETTINGS, forwarding=forwarding)
    if way == "likeliest":
        rules = dataclasses.replace(SETTINGS, forwarding=MostLikelyIntent(MOTION, 0.5, 4.0))
    seen = [Sighting("anna", "ped", 0.3 * k, *rng.uniform(-8.0, 8.0, 2).tolist()) for k in range(4)]
    now = fed(*seen, rules=rules).at(1.0)
    who = person(now, "anna")
    tubes = (*who.intent, guard_disc(who.guard, from_s=0.0, until_s=9.0))
    assert fault_in_person(TrackedPerson("anna", tubes)) is None
    likely = sum(w.probability >= threshold for w in now.wanted["anna"])
    assert len(who.intent) == (max(likely, 1) if way == "every" else 1)
    assert math.fsum(w.probability for w in now.wanted["anna"]) == pytest.approx(1.0)


def lawful(pushes: list[tuple[float, float]]) -> list[tuple[float, float, float, float]]:
    """A motion within LIMITS every 0.01 s."""
    x = y = vx = vy = 0.0
    states = []
    for ax, ay in pushes:
        size = max(math.hypot(ax, ay) / LIMITS.acceleration_mps2, 1.0)
        for _ in range(20):
            vx, vy = vx + 0.01 * ax / size, vy + 0.01 * ay / size
            fast = max(math.hypot(vx, vy) / LIMITS.speed_mps, 1.0)
            vx, vy = vx / fast, vy / fast
            x, y = x + 0.01 * vx, y + 0.01 * vy
            states.append((x, y, vx, vy))
    return states


push = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))


@settings(max_examples=40, deadline=None)
@given(
    st.lists(push, min_size=12, max_size=12),
    st.lists(st.integers(4, 30), min_size=3, max_size=9),
    st.integers(0, 10_000),
    st.integers(0, 45),
)
def test_whoever_keeps_to_the_limits_is_in_their_guard_and_is_never_named(
    pushes: list[tuple[float, float]], gaps: list[int], seed: int, wait: int
) -> None:
    """Also later on, when the last measurement is old and somebody is only assumed."""
    states, rng = lawful(pushes), np.random.default_rng(seed)
    sampled = [k for k in np.cumsum([0, *gaps]).tolist() if k < len(states)]
    seen = []
    for k in sampled:
        turn, size = rng.uniform(0.0, 2.0 * np.pi), NOISE_M * math.sqrt(rng.uniform())
        place = states[k][0] + size * math.cos(turn), states[k][1] + size * math.sin(turn)
        seen.append(Sighting("anna", "ped", 0.01 * k, *place))
    now = min(sampled[-1] + wait, len(states) - 1)
    answer = fed(*seen, rules=NO_GOALS).at(0.01 * now)
    assert answer.violations == ()
    guard = person(answer, "anna").guard
    assert guard.at_s <= 1e-12
    tube = guard_disc(guard, from_s=guard.at_s, until_s=9.0)
    for later in range(now, len(states), 9):
        for bound in tube.bounds:
            piece = bound[-1]
            s = 0.01 * (later - now) - piece.from_s
            away = math.hypot(
                states[later][0] - piece.x_m - piece.vx_mps * s,
                states[later][1] - piece.y_m - piece.vy_mps * s,
            )
            radius = piece.radius_m + piece.growth_mps * s + piece.growth2_mps2 * s * s / 2.0
            assert away + BODY_M <= radius + 1e-9


def test_guards_are_those_of_the_history_that_counts() -> None:
    """What is forgotten of a long one makes no difference."""
    seen = [Sighting("anna", "ped", 0.1 * k, math.sin(0.1 * k), 0.1 * k) for k in range(160)]
    rows = np.array([(s.t_s, s.x_m, s.y_m) for s in seen])
    fit = shipped_guards()
    for guards, law in ((NO_GOALS.guards, LAW), (FittedGuards(fit), FittedGuards(fit).of("ped"))):
        now = fed(*seen, rules=dataclasses.replace(NO_GOALS, guards=guards)).at(16.0)
        track = PersonTrack("", "anna", "ped", rows[:, 0], rows[:, 1:])
        expected, found = law.guard(track, law.limits), now.people[0].guard
        assert found.at_s == pytest.approx(-0.1)
        assert found.position.radius == pytest.approx(expected.position.radius + BODY_M)
        for name in ("x", "y", "radius"):
            want = getattr(expected.velocity, name)
            assert getattr(found.velocity, name) == pytest.approx(want, abs=1e-4)
        assert now.violations == ()


def runner(t_s: float) -> float:
    """Walks at 1 m/s for 1 s, then runs at 6 m/s."""
    return t_s if t_s < 1.0 else 1.0 + 6.0 * (t_s - 1.0)


@pytest.mark.parametrize("fitted", [False, True])
def test_who_breaks_the_limits_is_named_once_asked_and_keeps_wider_ones(fitted: bool) -> None:
    rules = dataclasses.replace(NO_GOALS, guards=FittedGuards(shipped_guards()))
    rules = rules if fitted else NO_GOALS
    before = rules.guards.of("ped").limits
    estimator, named, limits = PeopleEstimator(rules), [], [before]
    for k in range(25):
        estimator.measure(Sighting("anna", "ped", 0.1 * k, runner(0.1 * k), 0.0))
        now = estimator.at(0.1 * k)
        named += now.violations
        assert estimator.at(0.1 * k).violations == ()
        limits.append(now.people[0].guard.limits)
    assert named
    assert all(each.at_s > 1.0 and str(each).startswith("anna at ") for each in named)
    assert named[-1].needed.speed_mps > before.speed_mps
    speeds = [each.speed_mps for each in limits]
    assert speeds == sorted(speeds)
    assert [a.acceleration_mps2 for a in limits] == sorted(a.acceleration_mps2 for a in limits)
    assert limits[9] == before
    # Wide enough for what was seen, with headroom, and still so after they left.
    assert speeds[-1] >= (5.0 if fitted else 6.0)
    assert estimator.at(9.0).people == ()
    estimator.measure(Sighting("anna", "ped", 9.5, 40.0, 0.0))
    assert estimator.at(9.5).people[0].guard.limits == limits[-1]
    estimator.measure(Sighting("ben", "ped", 9.5, 0.0, 0.0))
    assert person(estimator.at(9.5), "ben").guard.limits == before


def test_a_measured_jump_is_explained_by_the_wider_limits() -> None:
    """Under them no guard of before contradicts the one of after, with any headroom from 1 on."""
    for headroom in (1.0, 1.5):
        estimator = PeopleEstimator(dataclasses.replace(NO_GOALS, headroom=headroom))
        for k in range(8):
            estimator.measure(Sighting("anna", "ped", 0.2 * k, 0.3 * k, 4.0 if k > 5 else 0.0))
        named = estimator.at(1.4).violations
        assert named[0].at_s == pytest.approx(1.2)
        wide = estimator.at(1.4).people[0].guard.limits
        assert wide.speed_mps >= headroom * named[0].needed.speed_mps > 10.0


@pytest.mark.parametrize("fitted", [False, True])
@pytest.mark.parametrize("count", [1, 2, 9])
def test_a_track_that_ends_loses_nobody(fitted: bool, count: int) -> None:
    """Cycle by cycle, as FailSafe compares them: who is no longer seen is covered, then gone."""
    rules = NO_GOALS
    if fitted:
        rules = dataclasses.replace(NO_GOALS, guards=FittedGuards(shipped_guards()))
    estimator, seen = PeopleEstimator(rules), walk("anna", count=count)
    scene, assumed = None, 0
    for k in range(count + 14):
        if k < count:
            estimator.measure(seen[k])
        stamp_s = 0.1 * k
        people = tuple(
            SeenPerson(p.name, dataclasses.replace(p.guard, at_s=stamp_s + p.guard.at_s), p.assumed)
            for p in estimator.at(stamp_s).people
        )
        now = Scene(stamp_s, people, Watched(0.0, 0.0, 30.0))
        if scene is not None:
            unseen_mps = people[0].guard.limits.speed_mps if people else 9.0
            found = people_violations(
                scene, now, required=Relation.OVERLAPS, unseen_speed_mps=unseen_mps
            )
            assert found == ()
            now = remembered(scene, now)
        scene, assumed = now, assumed + sum(p.assumed for p in people)
    assert 4 <= assumed <= 6
    assert scene is not None
    assert scene.people == ()


def test_who_comes_back_after_they_left_begins_anew() -> None:
    again = [dataclasses.replace(s, t_s=s.t_s + 5.0, x_m=s.x_m + 3.0) for s in walk("anna")]
    estimator = fed(*walk("anna"), *again)
    fresh = fed(*again)
    assert estimator.at(6.2) == fresh.at(6.2)


def limits_of(estimator: PeopleEstimator, t_s: float) -> MotionLimits:
    return estimator.at(t_s).people[0].guard.limits


def test_who_is_taken_for_another_kind_may_do_what_either_may() -> None:
    """A name of one who broke the limits on foot, used again for somebody on wheels; and one track
    that is first of a pedestrian, then of a cyclist, then of a pedestrian."""
    limits = {
        kind: rules.of(kind).limits for rules in [NO_GOALS.guards] for kind in ("ped", "cyclist")
    }
    assert limits["cyclist"].speed_mps > limits["ped"].speed_mps
    estimator = PeopleEstimator(NO_GOALS)
    for k, x_m in enumerate((0.0, 0.1, 0.7)):
        estimator.measure(Sighting("a", "ped", 0.1 * k, x_m, 0.0))
    wider = limits_of(estimator, 0.2)
    assert limits["ped"].speed_mps < wider.speed_mps < limits["cyclist"].speed_mps
    estimator.measure(Sighting("a", "cyclist", 9.0, 0.0, 0.0))
    assert limits_of(estimator, 9.0).speed_mps == limits["cyclist"].speed_mps
    assert limits_of(estimator, 9.0).acceleration_mps2 >= wider.acceleration_mps2
    estimator = PeopleEstimator(NO_GOALS)
    for k, kind in enumerate(("ped", "cyclist", "ped")):
        estimator.measure(Sighting("b", kind, 0.1 * k, 0.0, 0.0))
        wanted = limits["cyclist" if k else "ped"]
        assert limits_of(estimator, 0.1 * k).speed_mps == wanted.speed_mps
    assert estimator.at(0.2).violations == ()


def test_settings_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InputError, match="gone_age_s"):
        dataclasses.replace(SETTINGS, gone_age_s=0.4)
    with pytest.raises(InputError, match="headroom"):
        dataclasses.replace(SETTINGS, headroom=0.9)
    with pytest.raises(InputError, match="takes 3 intents"):
        EveryIntent(MOTION, 0.25, 0.9, 3.0)
