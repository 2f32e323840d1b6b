"""Cameras to try, and the rotation of a camera by matrices."""

from __future__ import annotations

import dataclasses

import numpy as np

from workbench.estimation.camera import gem_e2_camera_path, load_camera

CAMERA = load_camera(gem_e2_camera_path())
TILTED = dataclasses.replace(
    CAMERA,
    mounting=dataclasses.replace(
        CAMERA.mounting, pitch_rad=(-0.02, 0.12), roll_rad=(0.03, 0.06), yaw_rad=(-0.8, -0.7)
    ),
)
UPWARD = dataclasses.replace(
    CAMERA, mounting=dataclasses.replace(CAMERA.mounting, pitch_rad=(-0.06, -0.04))
)
CAMERAS = [CAMERA, TILTED, UPWARD]


def camera_axes(pitch: np.ndarray, roll: np.ndarray) -> np.ndarray:
    """Rotations (N, 3, 3) that turn camera coordinates into level ones."""
    one, zero = np.ones_like(pitch), np.zeros_like(pitch)
    c, s = np.cos(pitch), np.sin(pitch)
    about_y = np.stack([c, zero, s, zero, one, zero, -s, zero, c], -1).reshape(-1, 3, 3)
    c, s = np.cos(roll), np.sin(roll)
    about_x = np.stack([one, zero, zero, zero, c, -s, zero, s, c], -1).reshape(-1, 3, 3)
    return about_y @ about_x


EXACT = dataclasses.replace(
    CAMERA,
    lens=dataclasses.replace(
        CAMERA.lens, focal_x_px=(1700.0, 1700.0), focal_y_px=(1650.0, 1650.0),
        centre_x_px=(1010.0, 1010.0), centre_y_px=(790.0, 790.0), residual_px=0.0,
    ),
    mounting=dataclasses.replace(
        CAMERA.mounting, forward_m=(1.1, 1.1), left_m=(0.3, 0.3), up_m=(1.6, 1.6),
        yaw_rad=(0.6, 0.6), pitch_rad=(0.25, 0.25), roll_rad=(-0.2, -0.2),
    ),
    boxes=dataclasses.replace(CAMERA.boxes, edge_px=0.0, contact_px=0.0),
)  # fmt: skip
"""Nothing is unsure, and every angle is large."""
POINT = dataclasses.replace(
    CAMERA.on_foot, width_m=(0.47, 0.47), tallest_m=1e-6, middle_m=0.0, contact_m=0.0
)
"""A silhouette as flat as a plank on the ground: nothing is unsure."""
