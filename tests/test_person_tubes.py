"""Tubes of people hold what they claim: predictions between knots, and every lawful motion."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from person_cases import disc_at, exact_disc, holds

from workbench.errors import InputError
from workbench.runtime.observation import Person
from workbench.runtime.person_tubes import (
    MOST_PEOPLE,
    MOST_PIECES,
    MOST_TUBES,
    DiscPiece,
    PersonTube,
    RadiusBetween,
    TrackedPerson,
    TubeKind,
    fault_in_people,
    fault_in_person,
    packed,
    timed_discs,
    tracked,
)

STANDING = DiscPiece(0.0, 1.0, 2.0, 0.0, 0.0, 0.3, 0.0, 0.0)


def person(*pieces: DiscPiece, until_s: float = 9.0) -> TrackedPerson:
    return TrackedPerson("p", (PersonTube(TubeKind.INTENT, (pieces,), until_s),))


_coordinate = st.floats(-1e4, 1e4)
_knots = st.lists(
    st.tuples(st.floats(1e-3, 2.0), _coordinate, _coordinate, st.floats(0.0, 5.0)),
    min_size=2, max_size=6,
)  # fmt: skip


@settings(max_examples=100, deadline=None)
@given(_knots, st.floats(-1e3, 1e3), st.fractions(0, 1))
def test_a_timed_tube_holds_the_discs_between_its_knots(
    knots: list[tuple[float, float, float, float]], start_s: float, share: Fraction
) -> None:
    times = [start_s + float(t) for t in np.cumsum([knot[0] for knot in knots])]
    _, xs, ys, radii = zip(*knots, strict=True)
    for between in RadiusBetween:
        tube = timed_discs(times, xs, ys, radii, between=between)
        for j, piece in enumerate(tube.bounds[0]):
            span = Fraction(times[j + 1]) - Fraction(times[j])
            a, b = ([Fraction(row[j + i]) for row in (xs, ys, radii)] for i in (0, 1))
            true = [p + (q - p) * share for p, q in zip(a, b, strict=True)]
            if between is RadiusBetween.LARGER:
                true[2] = max(a[2], b[2])
            found = exact_disc(piece, Fraction(times[j]) + share * span)
            assert holds(found, tuple(true))
            assert float(found[2] - true[2]) < 1e-9
        assert tube.until_s == times[-1]


def test_everything_up_to_capacity_has_no_fault_and_one_more_names_the_limit() -> None:
    pieces = tuple(dataclasses.replace(STANDING, from_s=0.1 * k) for k in range(MOST_PIECES))
    tube = PersonTube(TubeKind.GUARD, (pieces[:5], pieces[5:]), 2.0)
    full = [TrackedPerson(f"p{i}", (tube,) * MOST_TUBES) for i in range(MOST_PEOPLE)]
    assert fault_in_people(full) is None
    assert "at most 32 people, got 33" in str(fault_in_people([*full, full[0]]))
    five = TrackedPerson("p", (tube,) * 5)
    assert "1 to 4 tubes, got 5" in str(fault_in_person(five))
    long = dataclasses.replace(tube, bounds=(*tube.bounds, (STANDING,)))
    assert "at most 16 pieces, got 17" in str(fault_in_person(TrackedPerson("p", (long,))))
    crowd = packed(full)
    assert (crowd.count, len(crowd.tubes), len(crowd.pieces)) == (32, 128 * 5, 128 * 16 * 9)


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(DiscPiece)])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300, -1e300])
def test_every_number_out_of_range_is_a_fault(name: str, value: float) -> None:
    assert fault_in_person(person(STANDING)) is None
    fault = fault_in_person(person(dataclasses.replace(STANDING, **{name: value})))
    assert fault is not None
    assert name in fault


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (TrackedPerson("p", ()), "1 to 4 tubes, got 0"),
        (TrackedPerson("p", (PersonTube(TubeKind.INTENT, (), 1.0),)), "at least one bound"),
        (TrackedPerson("p", (PersonTube(TubeKind.INTENT, ((),), 1.0),)), "at least one piece"),
        (TrackedPerson("p", (PersonTube("hope", ((STANDING,),), 1.0),)), "intent or guard"),  # type: ignore[arg-type]
        (person(STANDING, until_s=math.nan), "until_s"),
        (person(STANDING, until_s=1e10), "until_s"),
        (person(STANDING, until_s=0.0), "one after the other"),
        (person(STANDING, STANDING), "one after the other"),
        (person(dataclasses.replace(STANDING, radius_m=-0.1)), "radius_m"),
        (person(dataclasses.replace(STANDING, growth2_mps2=-0.1)), "growth2_mps2"),
    ],
)
def test_a_fault_says_what_was_expected(bad: TrackedPerson, words: str) -> None:
    assert words in str(fault_in_person(bad))
    assert f"person {bad.name!r}" in str(fault_in_people([bad]))


def test_knots_of_different_lengths_are_misuse_and_times_that_stand_still_a_fault() -> None:
    with pytest.raises(InputError, match="one length of at least 2"):
        timed_discs([0.0, 1.0], [0.0], [0.0, 1.0], [0.1, 0.1], between=RadiusBetween.LINE)
    still = timed_discs([0.0, 0.0], [0.0, 1.0], [0.0, 1.0], [0.1, 0.1], between=RadiusBetween.LINE)
    assert fault_in_person(TrackedPerson("p", (still,))) is not None


def test_a_disc_of_one_observation_is_one_tube_for_ever() -> None:
    seen = Person("p", 1.0, 2.0, 0.5, -0.5, 0.3, 0.1, 0.2)
    (tube,) = tracked(seen).tubes
    assert fault_in_people([tracked(seen)]) is None
    assert disc_at(tube.bounds[0], 2.0) == pytest.approx((2.0, 1.0, 0.3 + 0.2 + 0.4))
