"""Our own frames move no value further than `worst_rounding` says, and keep their numbers."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest

from workbench.runtime.protocols import load_protocol
from workbench.runtime.protocols.own_frames import worst_rounding
from workbench.runtime.protocols.people import PersonKind
from workbench.runtime.protocols.tables import LARGEST_ID

BOUNDS = worst_rounding()
PROTOCOL = load_protocol("workbench")


@pytest.mark.parametrize("key", BOUNDS, ids=".".join)
def test_a_value_half_way_between_two_counts_is_moved_within_the_bound(
    key: tuple[str, str],
) -> None:
    """The farthest that a sender who rounds to nearest can be from what it sent, at both ends of
    the range, where the division that decodes is the least exact."""
    message, name = key
    signal, chance = PROTOCOL.by_name[message].signal(name), random.Random(name)
    half = Fraction(signal.factor, 2 * signal.divisor)
    span = signal.raw_max - signal.raw_min
    raws = [signal.raw_min, signal.raw_max]
    raws += [end - chance.randrange(span // 4 + 1) for end in 200 * [signal.raw_max]]
    moved = max(
        abs(Fraction(signal.value_of(raw)) - Fraction(raw * signal.factor, signal.divisor)) + half
        for raw in raws
    )
    assert moved <= Fraction(BOUNDS[key])
    assert Fraction(BOUNDS[key]) < half * (1 + Fraction(1, 1000))


def test_kinds_of_people_are_the_choices_of_the_frame() -> None:
    choices = PROTOCOL.by_name["PERSON_TRACK"].signal("KIND").choices
    assert {kind.value: kind.name for kind in PersonKind} == choices
    assert len(choices) == 3


def test_the_largest_standard_identifier_has_eleven_ones() -> None:
    assert LARGEST_ID.bit_length() == LARGEST_ID.bit_count() == 11
