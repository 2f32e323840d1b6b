"""Guards of the people's clock, as the policies get them on the monitor's, hold who is meant."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st
from runtime_world import LIMITS, observation, observed, standing

from workbench.runtime import Disc
from workbench.runtime.observation import seen_people

FAR = standing("far", 30.0, 9.0)


@given(st.floats(-5.0, 5.0), st.floats(0.0, 0.4), st.floats(-0.5, 0.5))
def test_a_guard_on_the_clock_allows_for_the_people_clocks_skew(
    low: float, width: float, at_s: float
) -> None:
    """Someone who runs at the limits is in it, whatever the skew was."""
    guard = replace(observed(FAR).guard, at_s=at_s, velocity=Disc(1.0, 0.0, 0.5))
    person = replace(observed(FAR), guard=guard)
    seen = replace(observation(person), skew_s=(low, low + width), stamp_s=50.0)
    (found,) = seen_people(seen)
    assert found.guard.at_s <= 50.0
    for skew_s in (low, low + 0.5 * width, low + width):
        before_s = 50.0 + at_s - skew_s - found.guard.at_s
        assert before_s >= -1e-9
        x_m = guard.position.x - LIMITS.speed_mps * before_s
        assert x_m >= found.guard.position.x - found.guard.position.radius - 1e-9
        vx_mps = guard.velocity.x + guard.velocity.radius + LIMITS.acceleration_mps2 * before_s
        assert vx_mps <= found.guard.velocity.x + found.guard.velocity.radius + 1e-9


def test_without_a_skew_a_guard_on_the_clock_is_the_guard_itself() -> None:
    late = observed(FAR, at_s=-0.25)
    (found,) = seen_people(replace(observation(late), stamp_s=50.0))
    assert found.guard == replace(observed(FAR).guard, at_s=49.75)
