"""No value is moved further by our own frames than `worst_rounding` says, nearly by as much."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest

from workbench.runtime.protocols import load_protocol
from workbench.runtime.protocols.own_frames import worst_rounding

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
