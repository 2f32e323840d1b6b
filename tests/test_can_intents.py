"""Ways arrive as they were sent or not at all: no lost, swapped, altered or replayed frame makes a
set of other ways."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from can_cases import Frame
from cli_fixture import invoke
from hypothesis import given, settings
from hypothesis import strategies as st
from test_can_command import written
from ways_cases import (
    OWN,
    PERIOD_S,
    THREE,
    WAYS,
    A,
    C,
    by_hand,
    crowd,
    drawn_sets,
    fed,
    frames_of,
    same,
    sent,
    straight,
    whole,
)

from workbench.runtime.protocols import (
    IntentSet,
    IntentsSeen,
    NoSet,
    PeopleSeen,
    SetFault,
    Way,
    decode,
)


def fault(state: IntentSet) -> SetFault:
    outcome = state.outcome
    assert isinstance(outcome, NoSet), outcome
    return outcome.fault


def wholes(frames: Sequence[Frame], start: IntentSet | None = None) -> list[IntentsSeen]:
    """Every whole set, as it becomes whole."""
    state, found = start or IntentSet(), []
    for frame_id, data in frames:
        before = state.frames.completed
        state = state.taking(decode(OWN, frame_id, data))
        if state.frames.completed > before and isinstance(state.outcome, IntentsSeen):
            found.append(state.outcome)
    return found


@settings(max_examples=60, deadline=None)
@given(drawn_sets())
def test_a_set_arrives_as_it_was_sent(
    case: tuple[PeopleSeen, dict[int, tuple[Way, ...]]],
) -> None:
    people, ways = case
    made = sent(people, ways)
    assert made.left_out == {}
    seen = whole(fed(made.frames))
    assert (seen.number, seen.stamp_s) == (people.number, people.stamp_s)
    assert (seen.knot_period_s, seen.more) == (PERIOD_S, False)
    assert same(seen, people, ways)
    assert len(made.frames) == 1 + sum(len(way) for each in ways.values() for way in each)
    for cut in range(len(made.frames)):
        assert fault(fed(made.frames[:cut])) is (
            SetFault.UNFINISHED if cut else SetFault.NOTHING_YET
        )


def test_persons_come_in_the_order_of_the_set_whatever_their_importance() -> None:
    seen = whole(fed(sent(THREE, WAYS).frames))
    assert [(way.index, len(way.knots)) for way in seen.ways] == [(0, 4), (2, 3), (2, 2)]
    assert seen.ways[0].knots[0] == (0.0, 0.0, 0.5)
    assert seen.ways[0].knots[3] == (1.5, 0.0, 0.8)


def test_nobody_is_a_whole_set() -> None:
    assert whole(fed(sent(THREE, {}).frames)) == IntentsSeen(5, 1.0, PERIOD_S, False, ())


@pytest.mark.parametrize(
    ("parts", "why"),
    [
        ([(0, 0, 0), (0, 0, 2)], "knots [0, 2] of intent 0 of 0, expected 0, 1 and so on"),
        ([(0, 0, 1), (0, 0, 2)], "knots [1, 2] of intent 0 of 0, expected 0, 1 and so on"),
        ([(0, 0, 1), (0, 0, 0)], "knots [1, 0] of intent 0 of 0, expected 0, 1 and so on"),
        ([(3, 0, 0)], "knots [0] of intent 0 of 3, expected 0, 1 and so on"),
        ([(0, 1, 0), (0, 1, 1)], "knots [0, 1] of intent 1 of 0, expected intent 0 of 0"),
        (
            [(0, 0, 0), (0, 0, 1), (0, 2, 0), (0, 2, 1)],
            "knots [0, 1] of intent 2 of 0, expected intent 1 of 0",
        ),
        (
            [(0, 1, 0), (0, 1, 1), (0, 0, 0), (0, 0, 1)],
            "knots [0, 1] of intent 1 of 0, expected intent 0 of 0",
        ),
        (
            [(1, 0, 0), (1, 0, 1), (0, 0, 0), (0, 0, 1)],
            "knots [0, 1] of intent 0 of 0, expected intent 0 of 1",
        ),
        (
            [(0, 0, 0), (0, 0, 1), (1, 0, 0), (1, 0, 1), (0, 1, 0), (0, 1, 1)],
            "knots [0, 1] of intent 1 of 0, expected intent 1 of 1",
        ),
        (
            [(0, 0, 0), (0, 0, 1), (1, 1, 0), (1, 1, 1)],
            "knots [0, 1] of intent 1 of 1, expected intent 0 of 1",
        ),
        (
            [(0, 0, 0), (0, 0, 1), (2, 0, 0), (0, 0, 2)],
            "knots [0] of intent 0 of 2, expected 0, 1 and so on",
        ),
    ],
)
def test_knots_that_do_not_come_in_order_are_no_set(
    parts: list[tuple[int, int, int]], why: str
) -> None:
    state = fed(by_hand(parts))
    assert state.frames.completed == 1
    assert state.outcome == NoSet(SetFault.OUT_OF_ORDER, why)


def test_knots_in_order_are_a_set() -> None:
    parts = [(0, 0, 0), (0, 0, 1), (0, 1, 0), (0, 1, 1), (0, 1, 2), (4, 0, 0), (4, 0, 1)]
    seen = whole(fed(by_hand(parts)))
    assert [(way.index, len(way.knots)) for way in seen.ways] == [(0, 2), (0, 3), (4, 2)]


def test_a_part_of_another_set_says_which() -> None:
    (header, first, *_), others = by_hand([(3, 0, 0), (3, 0, 1)]), by_hand([(3, 0, 1)], number=2)
    assert str(fed([header, first, others[1]]).outcome) == (
        "a part is missing, out of order, or of another set "
        "(PERSON_WAY of 3 in SET 2, expected PERSON_WAY)"
    )


def test_any_dropped_or_swapped_frame_is_seen() -> None:
    frames, after = sent(THREE, WAYS).frames, sent(crowd(6, 7, 8, 9), WAYS).frames
    for gone in range(len(frames)):
        left = [*frames[:gone], *frames[gone + 1 :]]
        assert wholes(left) == []
        assert [seen.number for seen in wholes([*left, *after])] == [6]
    for first in range(len(frames)):
        for second in range(first + 1, len(frames)):
            swapped = list(frames)
            swapped[first], swapped[second] = swapped[second], swapped[first]
            assert wholes(swapped) == []


def test_a_frame_that_takes_the_place_of_another_is_seen() -> None:
    frames = sent(THREE, WAYS).frames
    for gone in range(1, len(frames)):
        for again in range(1, len(frames)):
            if abs(gone - again) > 0:
                replaced = [*frames[:gone], frames[again], *frames[gone + 1 :]]
                assert wholes(replaced) == []


def test_every_flipped_bit_and_wrong_length_is_seen() -> None:
    frames = sent(THREE, WAYS).frames
    for place, (frame_id, data) in enumerate(frames):
        flips = [(int.from_bytes(data, "big") ^ (1 << bit)).to_bytes(8, "big") for bit in range(64)]
        for wrong in (*flips, data[:-1], data + b"\0", b""):
            changed = [*frames[:place], (frame_id, wrong), *frames[place + 1 :]]
            assert wholes(changed) == []
            assert fault(fed(changed)) is SetFault.REFUSED


def test_a_replayed_set_is_refused() -> None:
    window = [f for n in range(1, 5) for f in sent(crowd(n, 7, 8, 9), WAYS).frames]
    state = fed(window)
    assert state.frames.completed == 4
    assert wholes(window, state) == []
    assert fault(fed(window[: len(window) // 4], state)) is SetFault.REGRESSED
    # One back, stamped later.
    back = PeopleSeen(3, 1.0, 40.0, THREE.people)
    assert fault(fed(sent(back, WAYS).frames, state)) is SetFault.REGRESSED
    last = window[-len(window) // 4 :]
    assert fault(fed(last, state)) is SetFault.REPEATED


def test_other_frames_do_not_matter() -> None:
    frames, others = sent(THREE, WAYS).frames, frames_of(THREE)
    mixed = [each for frame in frames for each in (frame, *others)]
    assert wholes(mixed) == wholes(frames) != []


@st.composite
def disturbed(draw: st.DrawFn) -> list[Frame]:
    """Four sets, and their frames dropped, repeated, swapped, replayed, altered."""
    frames = [f for n in (1, 2, 3, 4) for f in sent(crowd(n, 7, 8, 9), _changed(n)).frames]
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, len(frames) - 1))
        to = draw(st.integers(0, len(frames) - 1))
        kind = draw(st.sampled_from(["drop", "repeat", "swap", "replay", "flip"]))
        if kind == "drop":
            del frames[at]
        elif kind == "repeat":
            frames.insert(to, frames[at])
        elif kind == "swap":
            frames[at], frames[to] = frames[to], frames[at]
        elif kind == "replay":
            frames[to:to] = frames[at : at + draw(st.integers(1, 8))]
        else:
            frame_id, data = frames[at]
            flipped = int.from_bytes(data, "big") ^ (1 << draw(st.integers(0, 63)))
            frames[at] = (frame_id, flipped.to_bytes(8, "big"))
    return frames


def _changed(number: int) -> dict[int, tuple[Way, ...]]:
    return {9: (straight(C, 3, vx=number), straight(C, 2)), 7: (straight(A, 2 + number),)}


@settings(max_examples=200, deadline=None)
@given(disturbed())
def test_no_disturbed_stream_makes_ways_that_were_not_sent(frames: list[Frame]) -> None:
    meant = [whole(fed(sent(crowd(n, 7, 8, 9), _changed(n)).frames)) for n in (1, 2, 3, 4)]
    found = wholes(frames)
    assert all(seen in meant for seen in found)
    assert [seen.number for seen in found] == sorted({seen.number for seen in found})


def test_the_command_counts_whole_and_broken_sets(tmp_path: Path) -> None:
    good = [*frames_of(THREE), *sent(THREE, WAYS).frames]
    decoded = ("can", "decode", "--protocol", "workbench")
    result = invoke(*decoded, written(tmp_path / "good.log", good))
    assert result.status == 0, result.out
    assert "intents: 1 whole sets, 0 unfinished ones, 0 frames twice" in result.out
    assert "INTENT 1, KNOT 0, X 0 m, Y 0 m, RADIUS 0.5 m" in result.out
    result = invoke(*decoded, written(tmp_path / "bad.log", by_hand([(0, 0, 0), (0, 0, 2)])))
    assert result.status == 1
    assert f"1 times intents: {SetFault.OUT_OF_ORDER.value}" in result.out
