"""A camera file is read into the intervals it states; what is missing, unknown, out of order or
impossible is refused with the file, the section and the way to mend it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.estimation.camera import Camera, gem_e2_camera_path, load_camera

SHIPPED = gem_e2_camera_path().read_text(encoding="utf-8")


def test_the_shipped_file_reads() -> None:
    camera = load_camera(gem_e2_camera_path())
    assert isinstance(camera, Camera)
    assert camera.size_px == (2064, 1544)
    assert camera.mounting.up_m == (1.57, 1.63)
    assert camera.on_foot.width_m == (0.37, 0.57)
    assert "assumed" in camera.mounting.provenance


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("focal_x_px = [1730.0, 1748.0]", "", r"\[lens\] lacks the key focal_x_px"),
        ("focal_x_px", "focal_z_px", "unknown key 'focal_z_px'"),
        ("[1730.0, 1748.0]", "[1748.0, 1730.0]", "swap them"),
        ("[1730.0, 1748.0]", "[0.0, 1748.0]", r"\[lens\] focal_x_px: expected above 0"),
        ("[1.57, 1.63]", "[-0.1, 1.63]", r"\[mounting\] up_m: expected above 0"),
        ("[0.022, 0.038]", "[0.022, 1.2]", "pitch_rad: expected within"),
        ("edge_px = 2.0", "edge_px = -2.0", r"\[boxes\] edge_px: expected a number >= 0"),
        ("tallest_m = 2.2", "tallest_m = 0", r"\[on_wheels\] tallest_m: expected above 0"),
        ("size_px = [2064, 1544]", "size_px = [2064]", "whole pixels"),
        ("size_px = [2064, 1544]", "size_px = [2064.5, 1544]", "whole pixels"),
        ("residual_px = 0.5", "residual_px = 'half'", "expected a finite number"),
        ("[boxes]", "[frames]", "unknown section 'frames'"),
        ("[boxes]", "[boxes", "expected a TOML file"),
    ],
)
def test_what_cannot_be_is_refused(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert old in SHIPPED
    path = tmp_path / "camera.toml"
    path.write_text(SHIPPED.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=said) as refusal:
        load_camera(path)
    assert str(path) in str(refusal.value)


def test_an_absent_file_names_the_shipped_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="copy the shipped one"):
        load_camera(tmp_path / "absent.toml")


def test_values_are_checked_without_a_file() -> None:
    camera = load_camera(gem_e2_camera_path())
    for part, changes in (
        (camera.lens, {"centre_x_px": (2.0, 1.0)}),
        (camera.mounting, {"yaw_rad": (0.0, float("nan"))}),
        (camera.on_foot, {"width_m": (0.5, float("inf"))}),
    ):
        with pytest.raises(InputError, match="lowest <= highest"):
            dataclasses.replace(part, **changes)  # type: ignore[type-var]
