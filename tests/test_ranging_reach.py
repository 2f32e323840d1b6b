"""The documented distances up to which half a metre holds are the ones that the function finds;
they agree with the closed form for width alone, and less certainty never holds farther."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ranging_cases import CAMERA

from workbench.estimation.ranging import sight_of
from workbench.estimation.ranging_reach import (
    CASES,
    Case,
    by_width_alone_m,
    errors_m,
    reach_row,
    spans_m,
)

DOCUMENT = Path(__file__).parent.parent / "docs" / "ranging.md"
# Nothing but the width and the pixels is unsure.
SURE = dataclasses.replace(
    CAMERA,
    lens=dataclasses.replace(
        CAMERA.lens, focal_x_px=(1739.0, 1739.0), focal_y_px=(1739.0, 1739.0),
        centre_x_px=(1032.0, 1032.0), centre_y_px=(772.0, 772.0), residual_px=0.0,
    ),
    mounting=dataclasses.replace(
        CAMERA.mounting, forward_m=(1.1, 1.1), left_m=(0.0, 0.0), up_m=(1.6, 1.6),
        yaw_rad=(0.0, 0.0), pitch_rad=(0.0, 0.0), roll_rad=(0.0, 0.0),
    ),
)  # fmt: skip


@pytest.mark.parametrize("case", [CASES[4], CASES[6]])
def test_the_document_says_what_the_function_finds(case: Case) -> None:
    assert reach_row(CAMERA, case) in DOCUMENT.read_text(encoding="utf-8").splitlines()


def test_the_document_has_every_case_and_no_other() -> None:
    lines = DOCUMENT.read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line.startswith("| 0")]
    for row, case in zip(rows, CASES, strict=True):
        numbers = tuple(float(cell) for cell in row.strip("| ").split("|")[:6])
        assert numbers == dataclasses.astuple(case)


@pytest.mark.parametrize(("width_m", "pixel"), [(0.02, 2.0), (0.05, 0.5), (0.1, 2.0)])
def test_width_alone_agrees_with_the_closed_form(width_m: float, pixel: float) -> None:
    """The answer's half width to first order, and no farther: who looks narrow looks far away."""
    boxes = dataclasses.replace(CAMERA.boxes, edge_px=pixel)
    seen = dataclasses.replace(
        CAMERA.on_foot, width_m=(0.47 - width_m, 0.47 + width_m), contact_m=0.0, middle_m=0.0
    )
    camera = dataclasses.replace(SURE, boxes=boxes)
    assumed = dataclasses.replace(seen, contact_m=1e3)
    first_order = by_width_alone_m(
        0.5, width_m=0.47, width_error_m=width_m, pixel_error=pixel, focal_px=1739.0
    )
    spans = spans_m(camera, seen=seen, assumed=assumed, error_m=0.5)
    assert spans[0][0] == 1.0
    assert 0.7 * first_order - 0.2 <= spans[0][1] <= first_order


def test_a_tenth_of_a_metre_of_width_is_two_metres_at_ten() -> None:
    reach = by_width_alone_m(2.0, width_m=0.47, width_error_m=0.1, pixel_error=0.0, focal_px=1739.0)
    assert reach == pytest.approx(9.4)


@settings(max_examples=20, deadline=None)
@given(st.floats(2.0, 15.0), st.sampled_from(["width_m", "contact_m", "middle_m", "pose"]))
def test_of_the_same_boxes_less_certainty_never_tells_more(ahead_m: float, grown: str) -> None:
    case = Case(0.05, 1.0, 0.004, 0.1, 0.05)
    camera, seen, pose = case.camera(CAMERA), case.shape(CAMERA), case.pose()
    less, unsure = seen, pose
    if grown == "pose":
        unsure = dataclasses.replace(pose, heading=(-0.02, 0.01))
    elif grown == "width_m":
        less = dataclasses.replace(seen, width_m=(0.4, 0.6))
    else:
        less = dataclasses.replace(seen, **{grown: 0.15})
    sight = sight_of(camera)
    before = errors_m(sight, ahead_m, seen=seen, assumed=seen, pose=pose)
    after = errors_m(sight, ahead_m, seen=seen, assumed=less, pose=unsure)
    assert all(first <= second for first, second in zip(before, after, strict=True))
