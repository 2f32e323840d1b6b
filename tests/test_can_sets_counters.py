"""A set whose counter does not go forward is not believed, however new its stamp says it is."""

from __future__ import annotations

import dataclasses

import pytest

from workbench.runtime.protocols import (
    LocalisationSet,
    Localised,
    NoSet,
    SetFault,
    decode,
    load_protocol,
    localisation_frames,
)

OWN = load_protocol("workbench")
FIRST = Localised(100, 50.0, 1.0, 2.0, 0.5, 1.5, 0.1, 0.1, 0.01, 0.05)


def heard(state: LocalisationSet, sent: Localised) -> LocalisationSet:
    frames = localisation_frames(sent)
    assert isinstance(frames, tuple)
    for frame_id, data in frames:
        state = state.taking(decode(OWN, frame_id, data))
    return state


@pytest.mark.parametrize(
    ("number", "stamp_s", "fault"),
    [
        (101, 50.1, None),
        (227, 50.1, None),
        (100, 50.1, SetFault.REPEATED),
        (99, 50.1, SetFault.REGRESSED),
        (228, 50.1, SetFault.REGRESSED),
        (101, 50.0, SetFault.REGRESSED),
        (101, 49.9, SetFault.REGRESSED),
    ],
)
def test_the_next_set_has_a_later_counter_and_a_later_stamp(
    number: int, stamp_s: float, fault: SetFault | None
) -> None:
    whole = heard(LocalisationSet(), FIRST)
    assert isinstance(whole.outcome, Localised)
    # Frames of another value than the last, so that none is a repetition.
    after = heard(whole, dataclasses.replace(FIRST, number=number, stamp_s=stamp_s, x_m=1.5))
    outcome = after.outcome
    assert (outcome.fault if isinstance(outcome, NoSet) else None) is fault
