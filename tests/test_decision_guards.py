"""Stopping is compared with everything people can do, braking at once with what they intend too."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from decision_answers import Answer
from decision_crowd import distance, somebody
from decision_fixture import (
    BRAKE_S,
    COMPLETE,
    NOT_ASKED,
    NOT_PREDICTED,
    PROVED,
    SAFE,
    STARTS,
    SWITCH_S,
    UNPROVED,
    Seen,
    guarded,
    kernel,
    query,
)
from decision_paths import paths
from decision_stops import AT_ONCE, Runs, drive, excess, sampled_orders

from workbench.runtime.person_tubes import TrackedPerson, TubeKind

_REQUIRED_M = 0.2
_INTENT, _GUARD = TubeKind.INTENT, TubeKind.GUARD
_SCENES = [
    ("straight", "accelerating", AT_ONCE),
    ("left", "rate limit", AT_ONCE),
    ("right", "standing", (0.05, 0.14)),
]
_HELD_SWITCH_S = (0.25, 0.2834)


@functools.cache
def _runs(where: str, start: str, held: tuple[float, float], tube: str) -> Runs:
    chance = np.random.default_rng(5)
    box = STARTS[start].scaled(0.4)
    window = BRAKE_S if tube == "brake" else SWITCH_S if held == AT_ONCE else _HELD_SWITCH_S
    states, orders = sampled_orders(
        box.states(20, chance), window, chance,
        start_s=AT_ONCE if tube == "brake" else held, corners=16,
    )  # fmt: skip
    return drive(box, states, paths()[where], orders, chance)


def _answer(
    where: str, start: str, held: tuple[float, float], people: list[Seen], skew_s: tuple[float, ...]
) -> Answer:
    box, switch = STARTS[start].scaled(0.4), SWITCH_S if held == AT_ONCE else _HELD_SWITCH_S
    numbers = query(
        paths()[where].table, box, people, start_s=held, switch_s=switch, skew_s=skew_s,
        clearance_required_m=[_REQUIRED_M],
    )  # fmt: skip
    return kernel()(numbers)


@pytest.mark.parametrize("skew_s", [(0.0, 0.0), (-0.12, 0.3)])
@pytest.mark.parametrize(("where", "start", "held"), _SCENES)
def test_nobody_comes_closer_than_the_clearances_until_the_car_stands(
    where: str, start: str, held: tuple[float, float], skew_s: tuple[float, float]
) -> None:
    chance = np.random.default_rng(43)
    path, stop, brake = paths()[where], *(_runs(where, start, held, t) for t in ("stop", "brake"))
    verdicts: list[float] = []
    slack: list[float] = []
    for _ in range(15):
        person = guarded(somebody(chance, where))
        answer = _answer(where, start, held, [person], skew_s)
        assert answer.stop.status == answer.brake.status == COMPLETE
        assert excess(answer.stop, stop).max() < 1e-13
        for skew in (*skew_s, chance.uniform(*skew_s)):
            for runs, kind, nearest in (
                (stop, _GUARD, answer.stop.guard),
                (brake, _GUARD, answer.brake.guard),
                (brake, _INTENT, answer.brake.intent),
            ):
                gap = float(distance(runs, path, person, kind, skew_s=skew).min())
                slack.append(gap - nearest.clearance_m)
        stop_safe = answer.stop.guard.clearance_m >= _REQUIRED_M
        brake_safe = min(answer.brake.guard.clearance_m, answer.brake.intent.clearance_m)
        assert answer.stop.verdict == (SAFE if stop_safe else UNPROVED)
        assert answer.brake.verdict == (SAFE if brake_safe >= _REQUIRED_M else UNPROVED)
        assert answer.stop.intent.cause == answer.track.guard.cause == NOT_ASKED
        verdicts += [answer.stop.verdict, answer.brake.verdict]
    assert min(slack) >= -1e-9
    assert float(np.median(slack)) < 1.5
    if held == AT_ONCE:
        assert min(verdicts.count(SAFE), verdicts.count(UNPROVED)) >= 2


def test_a_skew_counts_as_that_much_more_of_the_peoples_time() -> None:
    """Somebody who walks along beside the stopping car, ahead by the skew: a closed form."""
    walks = guarded([1.0, 5.0, 0.0, -1.0, 0.3, 0.0, 0.0])
    plain = _answer("straight", "standing", AT_ONCE, [walks], (0.0, 0.0)).brake.intent
    ahead = _answer("straight", "standing", AT_ONCE, [walks], (0.5, 0.5)).brake.intent
    either = _answer("straight", "standing", AT_ONCE, [walks], (-0.5, 0.5)).brake.intent
    assert plain.clearance_m - 0.5 == pytest.approx(ahead.clearance_m, abs=2e-3)
    # A window that is wider by a second holds the person half a second's way about its middle.
    assert ahead.clearance_m - 1.0 < either.clearance_m <= ahead.clearance_m


def _only(kind: TubeKind) -> TrackedPerson:
    person = guarded([30.0, 20.0, 0.0, 0.0, 0.3, 0.0, 0.0])
    return TrackedPerson("", tuple(tube for tube in person.tubes if tube.kind is kind))


@pytest.mark.parametrize(
    ("kind", "safe"), [(_INTENT, ["track"]), (_GUARD, ["stop"]), (None, ["track", "stop", "brake"])]
)
def test_who_lacks_a_claim_that_is_asked_for_is_never_clear(
    kind: TubeKind | None, safe: list[str]
) -> None:
    both = guarded([30.0, 20.0, 0.0, 0.0, 0.3, 0.0, 0.0])
    people: list[Seen] = [both, both if kind is None else _only(kind)]
    answer = _answer("straight", "rate limit", AT_ONCE, people, (0.0, 0.0))
    for name in ("track", "stop", "brake"):
        tube = getattr(answer, name)
        assert (tube.verdict == SAFE) == (name in safe), name
        asked = {"track": [tube.intent], "stop": [tube.guard], "brake": [tube.intent, tube.guard]}
        causes = [nearest.cause for nearest in asked[name]]
        assert (NOT_PREDICTED in causes) == (name not in safe)
        if name not in safe:
            nearest = max(asked[name], key=lambda one: one.cause)
            assert (nearest.person, nearest.cause) == (1.0, NOT_PREDICTED)


def test_an_empty_road_is_clear_of_nobody() -> None:
    answer = _answer("straight", "rate limit", AT_ONCE, [], (0.0, 0.0))
    for tube in answer.tubes:
        assert tube.verdicts == (SAFE,) * 3
        for nearest in (tube.intent, tube.guard):
            assert nearest.person == -1.0
            assert (nearest.clearance_m == 1e300) == (nearest.cause == PROVED)
