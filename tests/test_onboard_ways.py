"""Ways are used of the people whom they belong to, until they are too old, and whatever is wrong
with a set of them is counted and takes nothing else away."""

from __future__ import annotations

import dataclasses

import pytest
from onboard_intakes import give, intake
from onboard_sensors import BOUNDS
from ways_cases import A_WAY, by_hand, crowd, frames_of, sent, straight

from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.set_streams import SetSeen
from workbench.runtime.onboard.way_tubes import recent_ways
from workbench.runtime.onboard.ways import WaysSeen
from workbench.runtime.protocols import NoSet, PeopleSeen, SetFault, Way

S = 1_000_000


def heard(found: Intake, people: PeopleSeen, ways: dict[int, list[Way]], at_us: int) -> None:
    """A set of people, and after it what they may want."""
    give(found, frames_of(people), at_us)
    give(found, list(sent(people, ways).frames), at_us + 30_000)


def ways_of(found: Intake) -> WaysSeen:
    seen = found.ways.seen
    assert isinstance(seen, WaysSeen)
    return seen


def counted(found: Intake) -> dict[SetFault, int]:
    return {fault: count.total for fault, count in found.ways.counts.faults.items()}


def test_before_anything_came_there_is_nothing() -> None:
    found = intake()
    assert found.ways.seen == NoSet(SetFault.NOTHING_YET)
    give(found, frames_of(crowd(1, 7)), S)
    assert (found.ways.heard, counted(found), found.ways.counts.whole) == (False, {}, 0)
    give(found, by_hand([])[:1], S)
    assert found.ways.heard


def test_ways_are_held_by_track_where_their_people_are_and_at_their_stamp() -> None:
    found, people = intake(), crowd(5, 7, 8, 9)
    a, _, c = people.people
    heard(found, people, {9: [straight(c, 2), straight(c, 3, vy=1.0)], 7: [straight(a, 2)]}, S)
    seen, of = ways_of(found), found.people
    assert isinstance(of, SetSeen)
    assert seen.stamp_us is of.stamp_us
    assert seen.period_us == 500_000
    assert {track: len(ways) for track, ways in seen.ways.items()} == {7: 1, 9: 2}
    assert seen.ways[9][1] == tuple(
        (c.x_m + round(x - c.x_m, 2), c.y_m + round(y - c.y_m, 2), r)
        for x, y, r in straight(c, 3, vy=1.0)
    )
    assert (found.ways.counts.whole, found.ways.counts.incomplete.total) == (1, 0)
    assert counted(found) == {}


def test_ways_of_other_people_are_counted_and_not_used() -> None:
    people = crowd(5, 7, 8)
    ways = list(sent(people, {7: [straight(people.people[0], 2)]}).frames)
    for others in (
        None,
        crowd(6, 7, 8),
        dataclasses.replace(people, stamp_s=people.stamp_s + 0.0001),
        dataclasses.replace(people, number=6),
    ):
        found = intake()
        if others is not None:
            give(found, frames_of(others), S)
        give(found, ways, S + 1)
        assert found.ways.seen == NoSet(SetFault.NOTHING_YET)
        assert counted(found) == {SetFault.OTHER_PEOPLE: 1}
        assert (found.ways.counts.whole, found.ways.heard) == (0, True)
    many = intake()
    full = [dataclasses.replace(people.people[0], track=track) for track in range(33)]
    give(many, frames_of(people), S)
    give(many, frames_of(dataclasses.replace(crowd(6), people=tuple(full))), S)
    give(many, ways, S + 1)
    assert counted(many) == {SetFault.OTHER_PEOPLE: 1}


def test_ways_of_somebody_whom_the_set_lacks_are_those_of_other_people() -> None:
    for index, fits in ((1, True), (2, False), (31, False)):
        found = intake()
        give(found, frames_of(crowd(1, 7, 8)), S)
        give(found, by_hand([(0, 0, 0), (0, 0, 1), (index, 0, 0), (index, 0, 1)]), S)
        assert (found.ways.counts.whole, counted(found)) == (
            (1, {}) if fits else (0, {SetFault.OTHER_PEOPLE: 1})
        )


def test_a_set_that_fails_takes_nothing_from_the_one_before() -> None:
    found, people = intake(), crowd(5, 7)
    heard(found, people, {7: [A_WAY]}, S)
    held, later = ways_of(found), crowd(6, 7)
    give(found, frames_of(later), S + 200_000)
    frames = list(sent(later, {7: [A_WAY]}).frames)
    give(found, [frames[0], frames[2]], S + 230_000)
    flipped = (frames[1][0], frames[1][1][:-1] + bytes([frames[1][1][-1] ^ 1]))
    give(found, [flipped], S + 231_000)
    assert counted(found) == {SetFault.REFUSED: 1}
    last = found.ways.counts.faults[SetFault.REFUSED].last_us
    assert last == S + 231_000
    give(found, frames_of(crowd(7, 7)), S + 400_000)
    give(found, by_hand([(0, 0, 0), (0, 0, 2)], number=7, stamp_s=1.4), S + 430_000)
    assert counted(found) == {SetFault.OUT_OF_ORDER: 1, SetFault.REFUSED: 1}
    assert ways_of(found) is held
    assert found.ways.counts.whole == 1
    # The next one that fits takes its place, also of those who have no way in it.
    heard(found, crowd(8, 7), {}, S + 600_000)
    assert ways_of(found).ways == {}
    assert (ways_of(found).stamp_us[0] > held.stamp_us[1], found.ways.counts.whole) == (True, 2)


def test_what_is_repeated_or_replayed_is_counted() -> None:
    found, people = intake(), crowd(5, 7)
    heard(found, people, {7: [A_WAY]}, S)
    give(found, list(sent(people, {7: [A_WAY]}).frames), S + 50_000)
    assert counted(found) == {SetFault.REPEATED: 1}
    give(found, list(sent(crowd(4, 7), {7: [A_WAY]}).frames), S + 60_000)
    assert counted(found) == {SetFault.REPEATED: 1, SetFault.REGRESSED: 1}
    # A header that comes early loses the open set.
    give(found, frames_of(crowd(6, 7)), S + 200_000)
    give(found, list(sent(crowd(6, 7), {7: [A_WAY]}).frames)[:2], S + 210_000)
    give(found, list(sent(crowd(7, 7), {}).frames), S + 220_000)
    assert counted(found) == {
        SetFault.REPEATED: 1, SetFault.REGRESSED: 1, SetFault.OUT_OF_ORDER: 1,
        SetFault.OTHER_PEOPLE: 1,
    }  # fmt: skip


def test_whose_ways_were_left_out_is_counted_in_rows() -> None:
    found = intake()
    for number, more in ((1, True), (2, True), (3, False), (4, True)):
        people = crowd(number, 7)
        ways: dict[int, list[Way]] = {7: [A_WAY]} | ({99: [A_WAY]} if more else {})
        heard(found, people, ways, number * S)
    incomplete = found.ways.counts.incomplete
    assert (incomplete.total, incomplete.in_a_row, found.ways.counts.whole) == (3, 1, 4)
    assert incomplete.last_us == 4 * S + 30_000


def test_ways_are_used_until_they_are_as_old_as_people_may_be() -> None:
    found = intake()
    assert recent_ways(found.ways.seen, S, BOUNDS) is None
    heard(found, crowd(5, 7), {7: [A_WAY]}, S)
    seen = ways_of(found)
    last_us = seen.stamp_us[0] + BOUNDS.people_age_us
    assert recent_ways(seen, last_us, BOUNDS) is seen
    assert recent_ways(seen, last_us + 1, BOUNDS) is None


def test_they_are_forgotten_with_all_other_sets() -> None:
    found = intake()
    heard(found, crowd(5, 7), {7: [A_WAY]}, S)
    found.forget_sets()
    assert found.ways.seen == NoSet(SetFault.NOTHING_YET)
    assert not found.ways.heard
    # A sender that was started again is believed again.
    heard(found, crowd(1, 7), {7: [A_WAY]}, 2 * S)
    assert ways_of(found).ways


@pytest.mark.parametrize("period_s", [0.05, 0.425, 1.275])
def test_the_period_is_that_of_the_frames(period_s: float) -> None:
    found, people = intake(), crowd(5, 7)
    give(found, frames_of(people), S)
    give(found, list(sent(people, {7: [A_WAY]}, period_s=period_s).frames), S)
    assert ways_of(found).period_us == round(period_s * S)
