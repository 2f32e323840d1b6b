"""A localisation is whole or none, and arrives within the rounding that is stated."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from can_cases import PLACE, Frame, fault
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.runtime.protocols import (
    LocalisationSet,
    Localised,
    NoSet,
    Reason,
    Refusal,
    SetFault,
    decode,
    encode,
    load_protocol,
    localisation_frames,
    worst_rounding,
)

OWN = load_protocol("workbench")


def place_fed(frames: Sequence[Frame]) -> LocalisationSet:
    state = LocalisationSet()
    for frame_id, data in frames:
        state = state.taking(decode(OWN, frame_id, data))
    return state


def test_a_localisation_is_whole_or_none() -> None:
    sent = localisation_frames(PLACE)
    assert not isinstance(sent, Refusal)
    frames = list(sent)
    assert place_fed(frames).outcome == PLACE
    assert place_fed([frames[0], *frames]).outcome == PLACE
    for gone in range(4):
        assert isinstance(place_fed(frames[:gone] + frames[gone + 1 :]).outcome, NoSet)
        for other in range(gone):
            swapped = list(frames)
            swapped[gone], swapped[other] = swapped[other], swapped[gone]
            assert isinstance(place_fed(swapped).outcome, NoSet)
    assert fault(place_fed(frames[:1])) is SetFault.UNFINISHED
    assert fault(LocalisationSet()) is SetFault.NOTHING_YET


def test_a_heading_that_is_not_observable_is_no_localisation() -> None:
    sent = localisation_frames(PLACE)
    assert not isinstance(sent, Refusal)
    radii = {"SET": 4, "X_RADIUS": 0.2, "Y_RADIUS": 0.3, "HEADING_OBSERVED": 0}
    data = encode(OWN, "LOC_RADII", radii)
    assert isinstance(data, bytes)
    state = place_fed([*sent[:3], (OWN.by_name["LOC_RADII"].frame_id, data)])
    assert fault(state) is SetFault.REFUSED
    assert Reason.SAID_INVALID.value in str(state.outcome)


@settings(max_examples=200, deadline=None)
@given(st.floats(-8000, 8000), st.floats(-3.14, 3.14), st.floats(-30, 30), st.floats(0, 1e5))
def test_what_arrives_is_within_the_stated_rounding(
    x_m: float, heading_rad: float, speed_mps: float, stamp_s: float
) -> None:
    sent = dataclasses.replace(
        PLACE, x_m=x_m, heading_rad=heading_rad, speed_mps=speed_mps, stamp_s=stamp_s
    )
    frames = localisation_frames(sent)
    assert not isinstance(frames, Refusal)
    seen = place_fed(frames).outcome
    assert isinstance(seen, Localised)
    bound = worst_rounding()
    assert abs(seen.x_m - x_m) <= bound["LOC_POSITION", "X"]
    assert abs(seen.heading_rad - heading_rad) <= bound["LOC_MOTION", "HEADING"]
    assert abs(seen.speed_mps - speed_mps) <= bound["LOC_MOTION", "SPEED"]
    assert abs(seen.stamp_s - stamp_s) <= bound["LOC_STAMP", "STAMP"]


def test_what_is_missing_is_said() -> None:
    place = localisation_frames(PLACE)
    assert not isinstance(place, Refusal)
    assert str(place_fed([place[0], place[2]]).outcome).endswith(
        "(LOC_MOTION in SET 4, expected LOC_POSITION)"
    )
