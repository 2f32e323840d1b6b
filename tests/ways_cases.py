"""Ways as they are sent, and people who may take them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

from can_cases import Frame, counts
from hypothesis import strategies as st

from workbench.runtime.protocols import (
    Decoded,
    IntentSet,
    IntentsSeen,
    PeopleSeen,
    PersonKind,
    Refusal,
    SentIntents,
    SentPerson,
    Way,
    decode,
    encode,
    intent_frames,
    load_protocol,
    people_frames,
    worst_rounding,
)

OWN = load_protocol("workbench")
WALKER = SentPerson(7, PersonKind.ON_FOOT, 12.34, -5.6, 0.5, -1.25, 0.5, 0.3, 0.04)
PERIOD_S = 0.5
ERROR_M = worst_rounding()["PERSON_WAY", "X"] + 1e-9
RADIUS_M = worst_rounding()["PERSON_WAY", "RADIUS"]


def crowd(number: int = 1, *tracks: int) -> PeopleSeen:
    """A set of people a metre from each other, one every 0.2 s."""
    people = tuple(
        dataclasses.replace(WALKER, track=track, x_m=WALKER.x_m + k)
        for k, track in enumerate(tracks)
    )
    return PeopleSeen(number % 256, number / 5, 40.0, people)


def straight(person: SentPerson, knots: int, *, vx: float = 1.0, vy: float = 0.0) -> Way:
    """A way from where somebody is, with a radius that grows by a decimetre a knot."""
    return tuple(
        (person.x_m + vx * PERIOD_S * k, person.y_m + vy * PERIOD_S * k, 0.5 + 0.1 * k)
        for k in range(knots)
    )


A_WAY = straight(WALKER, 3)


def sent(
    people: PeopleSeen, ways: Mapping[int, Sequence[Way]], *, period_s: float = PERIOD_S
) -> SentIntents:
    """The set, which can be sent."""
    made = intent_frames(people, ways, knot_period_s=period_s)
    assert not isinstance(made, Refusal), made
    return made


def frames_of(people: PeopleSeen) -> list[Frame]:
    """The frames of the people themselves."""
    frames = people_frames(
        people.people, number=people.number, stamp_s=people.stamp_s,
        watched_radius_m=people.watched_radius_m,
    )  # fmt: skip
    assert not isinstance(frames, Refusal), frames
    return list(frames)


THREE = crowd(5, 7, 8, 9)
A, B, C = THREE.people
WAYS: dict[int, tuple[Way, ...]] = {
    9: (straight(C, 3), straight(C, 2, vx=-1.0)),
    7: (straight(A, 4),),
}


def by_hand(
    parts: Sequence[tuple[int, int, int]], *, number: int = 1, stamp_s: float = 0.2,
    count: int | None = None,
) -> list[Frame]:  # fmt: skip
    """A set of (INDEX, INTENT, KNOT), in whatever order."""
    header = {
        "SET": number, "COUNT": len(parts) if count is None else count, "MORE": 0,
        "STAMP": stamp_s, "KNOT_PERIOD": PERIOD_S,
    }  # fmt: skip
    rows: list[tuple[str, dict[str, float]]] = [("INTENTS", header)]
    for index, intent, knot in parts:
        place = {"SET": number, "INDEX": index, "INTENT": intent, "KNOT": knot}
        rows.append(("PERSON_WAY", place | {"X": knot / 2, "Y": 0.0, "RADIUS": 0.5}))
    found = []
    for name, values in rows:
        data = encode(OWN, name, values)
        assert isinstance(data, bytes), data
        found.append((OWN.by_name[name].frame_id, data))
    return found


def drawn_ways() -> st.SearchStrategy[tuple[Way, ...]]:
    """Ways of a person, about where they are, whose numbers need not be those of frames."""
    disc = st.tuples(st.floats(-80.0, 80.0), st.floats(-80.0, 80.0), st.floats(0.0, 20.0))
    way = st.lists(disc, min_size=2, max_size=6).map(tuple)
    return st.lists(way, min_size=1, max_size=3).map(tuple)


def drawn_sets(most: int = 4) -> st.SearchStrategy[tuple[PeopleSeen, dict[int, tuple[Way, ...]]]]:
    """People and ways of some of them, within what one set can hold."""
    place = counts(-(2**19), 2**19, 0.01)
    spot = st.tuples(st.integers(0, 0xFFFF), place, place, st.none() | drawn_ways())
    rows = st.lists(spot, max_size=most, unique_by=lambda row: row[0])
    return st.tuples(rows, st.integers(1, 1000)).map(_set_of)


def _set_of(
    drawn: tuple[list[tuple[int, float, float, tuple[Way, ...] | None]], int],
) -> tuple[PeopleSeen, dict[int, tuple[Way, ...]]]:
    rows, number = drawn
    people = tuple(
        dataclasses.replace(WALKER, track=track, x_m=x, y_m=y) for track, x, y, _ in rows
    )
    ways = {
        track: tuple(tuple((x + a, y + b, r) for a, b, r in way) for way in person_ways)
        for track, x, y, person_ways in rows
        if person_ways is not None
    }
    return PeopleSeen(number % 256, number / 5, 40.0, people), ways


def values_of(frame: Decoded | Refusal) -> dict[str, float]:
    """What an accepted frame says."""
    assert isinstance(frame, Decoded), frame
    return dict(frame.values)


def fed(frames: Sequence[Frame], start: IntentSet | None = None) -> IntentSet:
    state = start or IntentSet()
    for frame_id, data in frames:
        state = state.taking(decode(OWN, frame_id, data))
    return state


def whole(state: IntentSet) -> IntentsSeen:
    outcome = state.outcome
    assert isinstance(outcome, IntentsSeen), outcome
    return outcome


def same(seen: IntentsSeen, people: PeopleSeen, ways: dict[int, tuple[Way, ...]]) -> bool:
    """Whether a set says what was sent, within what its frames round."""
    expected = [
        (index, person, way)
        for index, person in enumerate(people.people)
        for way in ways.get(person.track, ())
    ]
    if len(expected) != len(seen.ways):
        return False
    return all(
        found.index == index
        and len(found.knots) == len(way)
        and all(
            abs(person.x_m + dx - x) <= ERROR_M
            and abs(person.y_m + dy - y) <= ERROR_M
            and abs(dr - r) <= RADIUS_M
            for (dx, dy, dr), (x, y, r) in zip(found.knots, way, strict=True)
        )
        for found, (index, person, way) in zip(seen.ways, expected, strict=True)
    )
