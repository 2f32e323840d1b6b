"""Whoever leaves a guard is recorded with what it took, and is within the wider limits after."""

from __future__ import annotations

import dataclasses
import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.estimation.guard_limits import limits_violation, widened
from workbench.runtime import Disc, Guard, MotionLimits
from workbench.runtime.policies.guards import Relation, relation_to

LIMITS = MotionLimits(2.0, 1.0)
HERE = Guard(0.0, Disc(0.0, 0.0, 0.1), Disc(1.0, 0.0, 0.2), LIMITS)
far, some, late = st.floats(-30.0, 30.0), st.floats(0.0, 2.0), st.floats(0.5, 3.0)
discs = st.builds(Disc, far, far, some)


@given(discs, discs, discs, discs, late)
def test_within_what_was_needed_nothing_is_refuted_and_below_it_something_is(
    p: Disc, w: Disc, p1: Disc, w1: Disc, t: float
) -> None:
    before, now = Guard(0.0, p, w, LIMITS), Guard(t, p1, w1, LIMITS)
    found = limits_violation("anna", before, now)
    assert (found is None) == (relation_to(before, now) is not Relation.OUTSIDE)
    if found is None:
        return
    wide = widened(LIMITS, found, headroom=1.0)
    assert relation_to(dataclasses.replace(before, limits=wide), now) is not Relation.OUTSIDE
    for name in ("speed_mps", "acceleration_mps2"):
        needed = getattr(found.needed, name)
        assert getattr(wide, name) == needed >= getattr(LIMITS, name)
        if needed > 1.1 * getattr(LIMITS, name):
            less = dataclasses.replace(wide, **{name: 0.99 * needed})
            refuted = relation_to(dataclasses.replace(before, limits=less), now)
            assert refuted is Relation.OUTSIDE


@given(discs, late, st.floats(1.0, 3.0), st.floats(0.0, 40.0), st.floats(0.0, 40.0))
def test_widening_never_narrows(
    p1: Disc, t: float, headroom: float, speed: float, acceleration: float
) -> None:
    found = limits_violation("anna", HERE, Guard(t, p1, HERE.velocity, LIMITS))
    assume(found is not None)
    assert found is not None
    limits = MotionLimits(speed, acceleration)
    wide = widened(limits, found, headroom=headroom)
    assert wide.speed_mps >= speed
    assert wide.acceleration_mps2 >= acceleration
    if found.needed.speed_mps == LIMITS.speed_mps:
        assert wide.speed_mps == speed


def test_the_record_says_who_when_and_how_much() -> None:
    found = limits_violation("anna", HERE, Guard(1.0, Disc(3.2, 0.0, 0.1), HERE.velocity, LIMITS))
    assert found is not None
    assert (
        str(found) == "anna at 1.000 s: needs 3.00 m/s and 3.60 m/s^2, "
        "allowed were 2.00 m/s and 1.00 m/s^2"
    )
    assert widened(LIMITS, found, headroom=1.5).speed_mps == pytest.approx(4.5)


def test_two_places_at_one_time_and_what_is_no_number_are_faults_of_the_measurement() -> None:
    with pytest.raises(InputError, match="no speed explains it"):
        limits_violation("anna", HERE, dataclasses.replace(HERE, position=Disc(9.0, 0.0, 0.1)))
    broken = Guard(1.0, Disc(math.nan, 0.0, 0.1), HERE.velocity, LIMITS)
    with pytest.raises(InputError, match="expected finite"):
        limits_violation("anna", HERE, broken)


def test_headroom_below_one_is_refused() -> None:
    found = limits_violation("anna", HERE, Guard(1.0, Disc(9.0, 0.0, 0.1), HERE.velocity, LIMITS))
    assert found is not None
    with pytest.raises(InputError, match="headroom"):
        widened(LIMITS, found, headroom=0.9)
