"""Ways become tubes of those they were sent of, guards stay, and who is judged without is named."""

from __future__ import annotations

import dataclasses

import pytest
from onboard_core_cases import SETTINGS
from onboard_intakes import filled, give, observed
from onboard_sensors import BOUNDS
from ways_cases import A_WAY, crowd, frames_of, sent, straight

from workbench.runtime.observation import Observation, fault_in_observation, tracked_people
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.found_in_intents import found_in_intents
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.ways import WaysSeen
from workbench.runtime.person_tubes import PersonTube
from workbench.runtime.protocols import PeopleSeen, PersonKind, SentPerson, Way

S = 1_000_000
TOLD_OF: OnboardSettings = dataclasses.replace(
    SETTINGS,
    sensors=BOUNDS,
    limits=dataclasses.replace(
        SETTINGS.limits,
        localisation_age_us=BOUNDS.localisation_age_us,
        people_age_us=BOUNDS.people_age_us,
    ),
)
NUMBER, STAMP_S = 2, 1.05


def told(ways: dict[int, list[Way]], *people: SentPerson) -> Intake:
    """All that an observation needs, at 1.08 s, of these people with these ways."""
    found = filled()
    seen = PeopleSeen(NUMBER, STAMP_S, 30.0, people)
    give(found, frames_of(seen), 1_060_000)
    give(found, list(sent(seen, ways).frames), 1_080_000)
    return found


def intents(found: Intake, now_us: int = 1_080_000) -> dict[str, tuple[PersonTube, ...]]:
    seen = observed(found, now_us)
    assert isinstance(seen, Observation)
    assert fault_in_observation(seen, tracked_people(seen)) is None
    return {each.name: each.intent for each in seen.people}


def going_on(*people: SentPerson) -> dict[str, tuple[PersonTube, ...]]:
    """The same without any way."""
    return intents(told({}, *people))


def found_of(found: Intake, now_us: int = 1_080_000) -> list[Found]:
    seen = observed(found, now_us)
    observation = seen if isinstance(seen, Observation) else None
    return list(found_in_intents(found, observation, TOLD_OF, now_us))


def two() -> tuple[SentPerson, SentPerson]:
    return crowd(NUMBER, 7, 8).people  # type: ignore[return-value]


def test_a_persons_ways_are_their_tubes_and_who_has_none_goes_on() -> None:
    a, b = two()
    tubes = intents(told({7: [straight(a, 4), straight(a, 3, vx=0.2)]}, a, b))
    assert [len(tube.bounds[0]) for tube in tubes["7"]] == [4, 3]
    assert all(len(tube.bounds) == 1 for tube in tubes["7"])
    assert tubes["8"] == going_on(a, b)["8"]
    (older,) = tubes["8"]
    assert len(older.bounds) == 2


def test_guards_do_not_change_whatever_is_sent() -> None:
    a, b = two()
    with_ways, without = (
        observed(told(ways, a, b), 1_080_000) for ways in ({7: [straight(a, 4)]}, {})
    )
    assert isinstance(with_ways, Observation)
    assert isinstance(without, Observation)
    stripped = [
        dataclasses.replace(each, people=tuple(
            dataclasses.replace(person, intent=()) for person in each.people
        ))
        for each in (with_ways, without)
    ]  # fmt: skip
    assert stripped[0] == stripped[1]
    assert with_ways != without


def test_whoever_is_assumed_may_want_all_that_they_can_do() -> None:
    a, b = two()
    assumed = dataclasses.replace(a, kind=PersonKind.ASSUMED)
    found = told({7: [straight(a, 4)], 8: [straight(b, 4)]}, assumed, b)
    assert intents(found)["7"] == going_on(assumed, b)["7"]
    assert found_of(found) == []


def test_ways_serve_the_same_track_in_later_sets_until_they_are_too_old() -> None:
    a, b = two()
    found = told({7: [straight(a, 4)]}, a, b)
    for number in range(3, 16):
        at_us = 1_080_000 + (number - 2) * 100_000
        later = PeopleSeen(number, STAMP_S + (number - 2) / 10, 30.0, (b, a))
        give(found, frames_of(later), at_us)
        ways = found_in_intents(found, None, TOLD_OF, at_us)
        # Stamped at 1.05 s or a little before, used for 1.2 s.
        old = number >= 14
        assert [each.fault for each in ways] == [Fault.INTENTS_LOST] * old


def test_the_way_of_a_later_set_of_people_is_where_it_was_sent() -> None:
    a, b = two()
    found = told({7: [straight(a, 4)]}, a, b)
    (before,) = intents(found)["7"]
    moved = dataclasses.replace(a, x_m=a.x_m + 0.1)
    give(found, frames_of(PeopleSeen(3, STAMP_S + 0.03, 30.0, (b, moved))), 1_090_000)
    (after,) = intents(found, 1_090_000)["7"]
    for piece, later in zip(before.bounds[0], after.bounds[0], strict=True):
        assert later.numbers == pytest.approx((piece.from_s - 0.01, *piece.numbers[1:]))
    # Another one's way is not taken for theirs.
    assert len(intents(found, 1_090_000)["8"][0].bounds) == 2


def test_nothing_is_found_where_nobody_sends_ways() -> None:
    found = filled()
    assert found_of(found) == []
    assert list(found_in_intents(found, None, TOLD_OF, 10 * S)) == []


def test_what_is_wrong_with_ways_is_named_since_when_it_is() -> None:
    a, b = two()
    stamp_us = 1_060_000
    good: dict[int, list[Way]] = {7: [straight(a, 4)], 8: [straight(b, 4)]}
    found = told(good, a, b)
    assert found_of(found) == []
    seen = found.ways.seen
    assert isinstance(seen, WaysSeen)
    last_us = seen.stamp_us[0] + BOUNDS.people_age_us
    assert list(found_in_intents(found, None, TOLD_OF, last_us)) == []
    assert list(found_in_intents(found, None, TOLD_OF, last_us + 1)) == [
        Found(Fault.INTENTS_LOST, "the last set is too old", last_us)
    ]
    away = [tuple((x + 40.0, y, r) for x, y, r in straight(a, 4))]
    for ways, detail in (
        ({7: good[7]}, "1 people, track 8: no way was sent"),
        ({7: away, 8: good[8]}, "1 people, track 7: not where a way has them"),
        ({7: away}, "2 people, track 7: not where a way has them; track 8: no way was sent"),
    ):
        (lost,) = found_of(told(ways, a, b))
        assert lost == Found(Fault.INTENTS_LOST, detail, seen.stamp_us[1])
    assert seen.stamp_us[1] <= stamp_us


@pytest.mark.parametrize("count", [4, 5, 9])
def test_of_many_people_four_are_named(count: int) -> None:
    people = crowd(NUMBER, *range(count)).people
    (lost,) = found_of(told({}, *people))
    named = [f"track {k}: no way was sent" for k in range(4)] + ["..."] * (count > 4)
    assert lost.detail == f"{count} people, " + "; ".join(named)


def test_before_any_set_fits_that_is_named() -> None:
    found = filled()
    give(found, list(sent(crowd(9, 7), {7: [A_WAY]}).frames), 1_080_000)
    assert found_of(found) == [
        Found(Fault.INTENTS_LOST, "no whole set of the newest people yet", 0)
    ]


def test_a_dropped_set_is_told_for_as_long_as_a_report_counts() -> None:
    a, b = two()
    found = told({7: [straight(a, 4)], 8: [straight(b, 4)]}, a, b)
    give(found, list(sent(PeopleSeen(NUMBER, STAMP_S, 30.0, (a, b)), {}).frames), 1_090_000)
    told_now = list(found_in_intents(found, None, TOLD_OF, 1_190_000))
    assert told_now == [
        Found(Fault.OUT_OF_ORDER, "intents: the set's counter repeats the one before", 1_090_000)
    ]
    assert list(found_in_intents(found, None, TOLD_OF, 1_190_001)) == []
