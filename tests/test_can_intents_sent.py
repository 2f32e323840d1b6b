"""Whoever's ways cannot be sent, or do not fit, is named and left out whole, and nobody else is."""

from __future__ import annotations

import math

import pytest
from ways_cases import (
    OWN,
    PERIOD_S,
    THREE,
    WAYS,
    A,
    B,
    crowd,
    fed,
    same,
    sent,
    straight,
    values_of,
    whole,
)

from workbench.runtime.protocols import (
    CAPACITY,
    PeopleSeen,
    Reason,
    Refusal,
    Way,
    decode,
    intent_frames,
)
from workbench.runtime.protocols.intents import MOST_KNOTS, MOST_PARTS, MOST_WAYS


def test_numbers_are_those_of_the_table() -> None:
    header, part = OWN.by_name["INTENTS"], OWN.by_name["PERSON_WAY"]
    assert header.signal("COUNT").raw_max == MOST_PARTS
    most = [part.signal(name).raw_max + 1 for name in ("INDEX", "INTENT", "KNOT")]
    assert most == [CAPACITY, MOST_WAYS, MOST_KNOTS]
    assert header.signal("KNOT_PERIOD").value_of(1) == 0.005
    taken = sum(signal.length for signal in part.signals)
    assert taken == sum(signal.length for signal in header.signals) == 64


def test_more_than_fits_leaves_whole_persons_out_the_least_important_ones() -> None:
    people = crowd(1, *range(1, 9))
    long = {person.track: [straight(person, MOST_KNOTS)] for person in people.people[:7]}
    made = sent(people, long)
    assert made.left_out == {7: "expected at most 0 more knots, got 16"}
    assert len(made.frames) == 1 + MOST_PARTS
    assert whole(fed(made.frames)).more
    # Whoever still fits is sent, also after somebody who does not.
    two = {**dict(list(long.items())[:5]), 6: long[6] * 2, 8: [straight(people.people[7], 2)]}
    made = sent(people, two)
    assert made.left_out == {6: "expected at most 16 more knots, got 32"}
    assert [way.index for way in whole(fed(made.frames)).ways] == [0, 1, 2, 3, 4, 7]
    exactly = {**dict(list(long.items())[:6])}
    assert (sent(people, exactly).left_out, len(sent(people, exactly).frames)) == ({}, 97)
    assert not whole(fed(sent(people, exactly).frames)).more


@pytest.mark.parametrize(
    ("ways", "why"),
    [
        ([], "expected 1 to 3 ways, got 0"),
        ([straight(A, 2)] * 4, "expected 1 to 3 ways, got 4"),
        ([straight(A, 1)], "expected 2 to 16 knots, got 1"),
        ([straight(A, 2), straight(A, 17)], "expected 2 to 16 knots, got 17"),
        ([straight(A, 2, vx=163.84)], "PERSON_WAY.X: out of range (81.92, expected -81.92 to 81."),
        ([straight(A, 2, vy=-163.86)], "PERSON_WAY.Y: out of range (-81.93"),
        ([((A.x_m, A.y_m, 20.48), *straight(A, 2))], "PERSON_WAY.RADIUS: out of range (20.48"),
        ([((math.nan, A.y_m, 0.0), *straight(A, 2))], "PERSON_WAY.X: not finite (nan"),
        ([((A.x_m, A.y_m, -0.01), *straight(A, 2))], "PERSON_WAY.RADIUS: out of range (-0.01"),
    ],
)
def test_a_person_who_cannot_be_sent_is_named_and_all_others_are_sent(
    ways: list[Way], why: str
) -> None:
    made = sent(THREE, {7: ways, 8: [straight(B, 2)]})
    assert made.left_out.keys() == {7}
    assert made.left_out[7].startswith(why)
    seen = whole(fed(made.frames))
    assert seen.more
    assert [way.index for way in seen.ways] == [1]


def test_the_most_that_can_be_sent_is_sent() -> None:
    for ways in ([straight(A, 2)] * 3, [straight(A, 16)], [straight(A, 2, vx=-163.84)]):
        made = sent(THREE, {7: ways})
        assert made.left_out == {}
        assert same(whole(fed(made.frames)), THREE, {7: tuple(ways)})


def test_a_track_that_the_set_lacks_is_named() -> None:
    made = sent(THREE, {10: [straight(A, 2)]})
    assert made.left_out == {10: "expected the track of somebody in the set"}
    assert values_of(decode(OWN, *made.frames[0]))["MORE"] == 1


@pytest.mark.parametrize(
    ("period_s", "why"),
    [
        (0.045, "INTENTS.KNOT_PERIOD: out of range (0.045, expected 0.05 to 1.275 s)"),
        (1.28, "INTENTS.KNOT_PERIOD: out of range (1.28, expected 0.05 to 1.275 s)"),
        (math.inf, "INTENTS.KNOT_PERIOD: not finite (inf)"),
        (0.333, "INTENTS.KNOT_PERIOD: out of range (0.333, expected a whole number of 0.005 s)"),
        (0.5 + 2e-9, "INTENTS.KNOT_PERIOD: out of range (0.500000002, expected a whole number"),
        (0.5 - 2e-9, "INTENTS.KNOT_PERIOD: out of range (0.499999998, expected a whole number"),
    ],
)
def test_a_period_that_is_not_exact_is_refused(period_s: float, why: str) -> None:
    made = intent_frames(THREE, WAYS, knot_period_s=period_s)
    assert isinstance(made, Refusal)
    assert made.reason in (Reason.OUT_OF_RANGE, Reason.NOT_FINITE)
    assert (made.frame_id, made.message, made.signal) == (0x6CC, "INTENTS", "KNOT_PERIOD")
    assert str(made).startswith(why)


@pytest.mark.parametrize("period_s", [0.05, 0.425, 0.5 + 2.0**-30, 0.5 - 2.0**-30, 1.275])
def test_a_period_of_whole_counts_arrives(period_s: float) -> None:
    seen = whole(fed(sent(THREE, WAYS, period_s=period_s).frames))
    assert seen.knot_period_s == pytest.approx(period_s, abs=1e-9)


def test_a_stamp_that_cannot_be_sent_is_refused() -> None:
    late = PeopleSeen(1, 1e6, 40.0, THREE.people)
    made = intent_frames(late, WAYS, knot_period_s=PERIOD_S)
    assert isinstance(made, Refusal)
    assert made.signal == "STAMP"
