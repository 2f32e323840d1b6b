"""A contradiction and a missing farthest position are said, not guessed; less certainty never gives
a smaller set."""

from __future__ import annotations

import dataclasses

import pytest
from ranging_cases import CAMERA

from workbench.estimation.ranging import BoundingBox, Edge, RangingStatus, ranged, sight_of


@pytest.mark.parametrize("width_m", [(0.94, 1.0), (0.14, 0.19)])
def test_a_wrong_width_is_a_contradiction_not_a_choice(width_m: tuple[float, float]) -> None:
    box = BoundingBox(990.0, 600.0, 1074.0, 1000.0)
    assert ranged(sight_of(CAMERA), box, shape=CAMERA.on_foot).status is RangingStatus.FOUND
    wrong = dataclasses.replace(CAMERA.on_foot, width_m=width_m)
    found = ranged(sight_of(CAMERA), box, shape=wrong)
    assert found.status is RangingStatus.CONTRADICTION
    assert found.ahead_m is None
    assert found.beside_m is None
    assert "by the width" in found.reason
    assert "by the feet" in found.reason


def test_feet_above_the_horizon_are_a_contradiction() -> None:
    found = ranged(sight_of(CAMERA), BoundingBox(990, 100, 1074, 300), shape=CAMERA.on_foot)
    assert found.status is RangingStatus.CONTRADICTION
    assert "horizon" in found.reason


def test_hidden_feet_beside_a_thin_box_have_no_farthest_position() -> None:
    box = BoundingBox(1000.0, 600.0, 1002.0, 700.0, frozenset({Edge.BOTTOM}))
    found = ranged(sight_of(CAMERA), box, shape=CAMERA.on_foot)
    assert found.status is RangingStatus.UNBOUNDED
    assert "at least" in found.reason


@pytest.mark.parametrize("grown", ["width_m", "pitch_rad", "focal_x_px", "edge_px", "contact_px"])
def test_less_certainty_never_gives_a_smaller_set(grown: str) -> None:
    box = BoundingBox(400.0, 600.0, 470.0, 1000.0)
    less = CAMERA
    if grown == "width_m":
        less = dataclasses.replace(
            CAMERA, on_foot=dataclasses.replace(CAMERA.on_foot, width_m=(0.3, 0.7))
        )
    elif grown == "pitch_rad":
        mounting = dataclasses.replace(CAMERA.mounting, pitch_rad=(0.0, 0.06))
        less = dataclasses.replace(CAMERA, mounting=mounting)
    elif grown == "focal_x_px":
        less = dataclasses.replace(
            CAMERA, lens=dataclasses.replace(CAMERA.lens, focal_x_px=(1700.0, 1780.0))
        )
    else:
        less = dataclasses.replace(CAMERA, boxes=dataclasses.replace(CAMERA.boxes, **{grown: 9.0}))
    before = ranged(sight_of(CAMERA), box, shape=CAMERA.on_foot)
    after = ranged(sight_of(less), box, shape=less.on_foot)
    for name in ("ahead_m", "beside_m", "by_width_m", "by_contact_m"):
        narrow, wide = getattr(before, name), getattr(after, name)
        assert wide[0] <= narrow[0] <= narrow[1] <= wide[1]
    assert after != before
