"""No dropped, repeated, swapped, altered or replayed frame makes a whole set of wrong content."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import pytest
from can_cases import PLACE, Frame, fault, sent_people
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.runtime.protocols import (
    CAPACITY,
    PeopleSeen,
    PersonKind,
    PersonSet,
    Reason,
    Refusal,
    SentPerson,
    SetFault,
    decode,
    load_protocol,
    localisation_frames,
    people_frames,
)

OWN = load_protocol("workbench")
WALKER = SentPerson(
    track=7,
    kind=PersonKind.ON_FOOT,
    x_m=12.34,
    y_m=-5.6,
    position_radius_m=0.5,
    x_speed_mps=-1.25,
    y_speed_mps=0.5,
    velocity_radius_mps=0.3,
    age_s=0.04,
)
THREE_PEOPLE = (
    WALKER,
    dataclasses.replace(WALKER, track=8, x_m=1.0, kind=PersonKind.ON_WHEELS),
    dataclasses.replace(WALKER, track=9, y_m=2.5, kind=PersonKind.ASSUMED),
)


def frames_of(
    people: Sequence[SentPerson], number: int, *, watched_radius_m: float = 40.0
) -> list[Frame]:
    """The frames of a set, one every 0.2 s."""
    frames = people_frames(
        people, number=number % 256, stamp_s=number / 5, watched_radius_m=watched_radius_m
    )
    assert not isinstance(frames, Refusal), frames
    return list(frames)


def fed(frames: Sequence[Frame], start: PersonSet | None = None) -> PersonSet:
    """What remains after some frames."""
    state = start or PersonSet()
    for frame_id, data in frames:
        state = state.taking(decode(OWN, frame_id, data))
    return state


def wholes(frames: Sequence[Frame], start: PersonSet | None = None) -> list[PeopleSeen]:
    """Every whole set, as it becomes whole."""
    state, found = start or PersonSet(), []
    for frame_id, data in frames:
        before = state.frames.completed
        state = state.taking(decode(OWN, frame_id, data))
        if state.frames.completed > before:
            assert isinstance(state.outcome, PeopleSeen)
            found.append(state.outcome)
    return found


@settings(max_examples=60, deadline=None)
@given(sent_people(6), st.integers(0, 255))
def test_a_set_arrives_as_it_was_sent(people: tuple[SentPerson, ...], number: int) -> None:
    frames = frames_of(people, number)
    assert len(frames) == 1 + 3 * len(people)
    seen = fed(frames).outcome
    assert seen == PeopleSeen(number % 256, number / 5, 40.0, people)
    for cut in range(len(frames)):
        expected = SetFault.UNFINISHED if cut else SetFault.NOTHING_YET
        assert fault(fed(frames[:cut])) is expected


def test_thirty_two_people_are_a_set_and_more_are_never_one() -> None:
    crowd = [dataclasses.replace(WALKER, track=k) for k in range(CAPACITY)]
    full = frames_of(crowd, 1)
    assert len(full) == 97
    seen = fed(full).outcome
    assert isinstance(seen, PeopleSeen)
    assert [person.track for person in seen.people] == list(range(CAPACITY))
    for many in (33, 34, 100, 255):
        people = [dataclasses.replace(WALKER, track=k) for k in range(many)]
        frames = frames_of(people, 2)
        assert len(frames) == 1
        state = fed(full + frames)
        assert fault(state) is SetFault.OVER_CAPACITY
        # Neither the set before nor parts that follow all the same make a set of it.
        assert fault(fed(full[1:], state)) is SetFault.OVER_CAPACITY
        assert wholes(full + frames + frames_of(crowd[:2], 3))[-1].number == 3


def test_what_is_missing_is_said() -> None:
    assert str(PersonSet().outcome) == "no header was received"
    first, second, third, *_ = frames_of(THREE_PEOPLE, 5)
    assert str(fed([first, third]).outcome) == (
        "a part is missing, out of order, or of another set "
        "(PERSON_MOTION of 0 in SET 5, expected PERSON_POSITION of 0)"
    )
    assert str(fed([first, second]).outcome) == "parts are still missing (8 parts)"


def test_capacity_and_kinds_are_those_of_the_table() -> None:
    count = OWN.by_name["PEOPLE"].signal("COUNT")
    index = OWN.by_name["PERSON_POSITION"].signal("INDEX")
    assert (count.raw_max, index.raw_max + 1) == (CAPACITY, CAPACITY)
    kinds = OWN.by_name["PERSON_TRACK"].signal("KIND").choices
    assert kinds == {kind.value: kind.name for kind in PersonKind}


def test_nobody_is_a_whole_set() -> None:
    assert fed(frames_of((), 9)).outcome == PeopleSeen(9, 1.8, 40.0, ())


def test_any_dropped_frame_is_seen() -> None:
    frames = frames_of(THREE_PEOPLE, 5)
    after = frames_of(THREE_PEOPLE[:1], 6)
    for gone in range(len(frames)):
        left = frames[:gone] + frames[gone + 1 :]
        assert [seen.number for seen in wholes(left + after)] == [6]
        state = fed(left)
        last = gone == len(frames) - 1
        lost_header = gone == 0
        expected = SetFault.UNFINISHED if last else SetFault.OUT_OF_ORDER
        assert fault(state) is (SetFault.NOTHING_YET if lost_header else expected)
        assert fed(left + after).frames.lost == (not lost_header)


def test_any_two_swapped_frames_are_seen() -> None:
    frames = frames_of(THREE_PEOPLE, 5)
    for first in range(len(frames)):
        for second in range(first + 1, len(frames)):
            swapped = list(frames)
            swapped[first], swapped[second] = swapped[second], swapped[first]
            assert wholes(swapped) == []


def test_a_frame_delivered_twice_in_a_row_is_dropped_and_counted() -> None:
    frames = frames_of(THREE_PEOPLE, 5)
    (whole,) = wholes(frames)
    for twice in range(len(frames)):
        state = fed(frames[: twice + 1] + frames[twice:])
        assert state.outcome == whole
        assert (state.frames.duplicates, state.frames.completed, state.frames.lost) == (1, 1, 0)


def test_a_frame_delivered_twice_later_breaks_the_set() -> None:
    frames = frames_of(THREE_PEOPLE, 5)
    for early in range(len(frames) - 1):
        for late in range(early + 2, len(frames)):
            again = [*frames[:late], frames[early], *frames[late:]]
            assert wholes(again) == []


def test_every_flipped_bit_of_a_set_is_seen() -> None:
    frames = frames_of(THREE_PEOPLE[:2], 5)
    for place, (frame_id, data) in enumerate(frames):
        for bit in range(64):
            flipped = (int.from_bytes(data, "big") ^ (1 << bit)).to_bytes(8, "big")
            changed = [*frames[:place], (frame_id, flipped), *frames[place + 1 :]]
            state = fed(changed)
            assert state.frames.completed == 0
            assert fault(state) is SetFault.REFUSED
            assert Reason.WRONG_CHECKSUM.value in str(state.outcome)


def test_a_frame_of_wrong_length_breaks_the_set() -> None:
    frames = frames_of(THREE_PEOPLE, 5)
    for place, (frame_id, data) in enumerate(frames):
        for wrong in (data[:-1], data + b"\0", b""):
            changed = [*frames[:place], (frame_id, wrong), *frames[place + 1 :]]
            assert wholes(changed) == []


def test_parts_of_another_set_are_not_taken() -> None:
    frames, others = frames_of(THREE_PEOPLE, 5), frames_of(THREE_PEOPLE[::-1], 6)
    for place in range(1, len(frames)):
        mixed = [*frames[:place], others[place], *frames[place + 1 :]]
        assert wholes(mixed) == []
        assert wholes(frames[:place] + others[place:]) == []
    # A stray part takes a whole set away again, because its header was lost.
    assert fault(fed(frames + others[1:])) is SetFault.OUT_OF_ORDER


@st.composite
def disturbed(draw: st.DrawFn) -> tuple[list[PeopleSeen], list[Frame]]:
    """Four sets of people, and their frames dropped, repeated, swapped, replayed, altered."""
    numbers = [draw(st.integers(0, 255))]
    numbers += [numbers[0] + step for step in (1, 2, 3)]
    sets = [draw(sent_people(3)) for _ in numbers]
    sent = [PeopleSeen(n % 256, n / 5, 40.0, p) for n, p in zip(numbers, sets, strict=True)]
    frames = [f for n, p in zip(numbers, sets, strict=True) for f in frames_of(p, n)]
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, len(frames) - 1))
        to = draw(st.integers(0, len(frames) - 1))
        kind = draw(st.sampled_from(["drop", "repeat", "swap", "replay", "flip", "cut"]))
        if kind == "drop" and len(frames) > 1:
            del frames[at]
        elif kind == "repeat":
            frames.insert(to, frames[at])
        elif kind == "swap":
            frames[at], frames[to] = frames[to], frames[at]
        elif kind == "replay":
            window = frames[at : at + draw(st.integers(1, 8))]
            frames[to:to] = window
        else:
            frame_id, data = frames[at]
            bit = draw(st.integers(0, 63))
            changed = (int.from_bytes(data.ljust(8, b"\0"), "big") ^ (1 << bit)).to_bytes(8, "big")
            frames[at] = (frame_id, changed if kind == "flip" else data[:-1])
    return sent, frames


@settings(max_examples=400, deadline=None)
@given(disturbed())
def test_no_disturbed_stream_makes_a_whole_set_that_was_not_sent(
    case: tuple[list[PeopleSeen], list[Frame]],
) -> None:
    sent, frames = case
    found = wholes(frames)
    assert all(seen in sent for seen in found)
    stamps = [seen.stamp_s for seen in found]
    assert stamps == sorted(set(stamps))


def test_a_replayed_window_is_refused() -> None:
    window = [frame for number in range(5) for frame in frames_of(THREE_PEOPLE, number)]
    state = fed(window)
    assert state.frames.completed == 5
    assert wholes(window, state) == []
    assert fault(fed(window, state)) is SetFault.REPEATED
    assert fault(fed(window[: len(window) // 5], state)) is SetFault.REGRESSED
    # An old set whose counter lies ahead again is shown by its stamp.
    later = fed(frames_of((), 200))
    assert fault(fed(frames_of((), 4), later)) is SetFault.REGRESSED


def test_a_set_may_be_missed_but_not_go_back() -> None:
    state = fed(frames_of((), 250))
    assert [s.number for s in wholes(frames_of((), 250 + 100), state)] == [(250 + 100) % 256]
    assert wholes(frames_of((), 250 + 128), state) == []
    stuck = people_frames((), number=251, stamp_s=50.0, watched_radius_m=1.0)
    assert not isinstance(stuck, Refusal)
    assert fault(fed(stuck, state)) is SetFault.REGRESSED


def test_two_people_of_one_track_are_no_set() -> None:
    state = fed(frames_of((WALKER, dataclasses.replace(WALKER, x_m=0.0)), 1))
    assert fault(state) is SetFault.TRACK_TWICE


def test_other_frames_do_not_matter() -> None:
    frames = frames_of(THREE_PEOPLE, 5)
    place = localisation_frames(PLACE)
    assert not isinstance(place, Refusal)
    others = [*place, (0x123, bytes(8))]
    mixed = [each for frame in frames for each in (frame, *others)]
    assert wholes(mixed) == wholes(frames)


@pytest.mark.parametrize(
    "change",
    [
        {"position_radius_m": 20.48},
        {"x_speed_mps": 20.48},
        {"x_m": math.nan},
        {"age_s": -0.1},
        {"track": 2**16},
    ],
)
def test_who_cannot_be_sent_is_not_left_out(change: dict[str, float]) -> None:
    person = dataclasses.replace(WALKER, **change)  # type: ignore[arg-type]
    frames = people_frames((person,), number=1, stamp_s=0.0, watched_radius_m=1.0)
    assert isinstance(frames, Refusal)
    assert frames.reason in (Reason.OUT_OF_RANGE, Reason.NOT_FINITE)
