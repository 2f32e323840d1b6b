"""Every position that agrees with a box lies in the answer: over all corners of the parameters, at
random inside, through random poses of the vehicle; each route's bound is no wider than it must be.

The reference solves pinhole equations with rotation matrices; it shares nothing with the product.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from ranging_cases import CAMERA, CAMERAS, EXACT, POINT, camera_axes

from workbench.estimation.camera import Camera, Shape
from workbench.estimation.ranging import (
    BoundingBox,
    Edge,
    RangingAnswer,
    RangingStatus,
    ranged,
    sight_of,
)
from workbench.estimation.ranging_frames import in_global, in_vehicle
from workbench.runtime.onboard.dead_reckoning import Pose


def parameter_box(camera: Camera, shape: Shape) -> dict[str, tuple[float, float]]:
    lens, mounting = camera.lens, camera.mounting
    edge = camera.boxes.edge_px + lens.residual_px
    foot = camera.boxes.contact_px + lens.residual_px
    return {
        "fx": lens.focal_x_px,
        "fy": lens.focal_y_px,
        "cx": lens.centre_x_px,
        "cy": lens.centre_y_px,
        "h": mounting.up_m,
        "pitch": mounting.pitch_rad,
        "roll": mounting.roll_rad,
        "w": shape.width_m,
        "z": (0.0, shape.tallest_m),
        "z2": (0.0, shape.tallest_m),
        "m": (-shape.middle_m, shape.middle_m),
        "el": (-edge, edge),
        "er": (-edge, edge),
        "eb": (-foot, foot),
    }


def corners(box: dict[str, tuple[float, float]], names: list[str]) -> dict[str, np.ndarray]:
    grid = np.array(list(itertools.product(*(box[name] for name in names))))
    return dict(zip(names, grid.T, strict=True))


def by_width(v: dict[str, np.ndarray], box: BoundingBox) -> np.ndarray:
    """Ground points (N, 2) whose silhouette's edges are seen at the box's: two linear equations."""
    axes = camera_axes(v["pitch"], v["roll"])
    p = (v["cx"] - box.left_px - v["el"]) / v["fx"]
    q = (v["cx"] - box.right_px - v["er"]) / v["fx"]
    rows, right = [], []
    for column, height, aside in (
        (p, v["z"], v["m"] + v["w"] / 2),
        (q, v["z2"], v["m"] - v["w"] / 2),
    ):
        # (column ex - ey) . axes^T (F, L, z - h) = aside
        normal = column[:, None] * axes[:, :, 0] - axes[:, :, 1]
        rows.append(normal[:, :2])
        right.append(aside - normal[:, 2] * (height - v["h"]))
    return np.linalg.solve(np.stack(rows, 1), np.stack(right, -1)[..., None])[..., 0]


WIDTH_NAMES = ["fx", "cx", "h", "pitch", "roll", "w", "z", "z2", "m", "el", "er"]


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("edges", [(980.0, 1090.0), (100.0, 190.0), (1900.0, 2010.0), (600, 1500)])
def test_by_width_contains_all_corners(camera: Camera, edges: tuple[float, float]) -> None:
    shape = camera.on_foot
    # The bottom edge is hidden at the top of the image, so that the feet say nothing.
    box = BoundingBox(edges[0], 100.0, edges[1], 101.0, frozenset({Edge.BOTTOM}))
    found = ranged(sight_of(camera), box, shape=shape)
    assert found.status is RangingStatus.UNBOUNDED or found.ahead_m is not None
    v = corners(parameter_box(camera, shape), WIDTH_NAMES)
    places = by_width(v, box)
    assert found.by_width_m is not None
    low, high = found.by_width_m
    assert low <= places[:, 0].min()
    assert places[:, 0].max() <= high
    if found.beside_m is not None:
        assert found.beside_m[0] <= places[:, 1].min()
        assert places[:, 1].max() <= found.beside_m[1]


def test_by_width_is_no_wider_than_it_must_be() -> None:
    """Straight ahead, the hull of the corners is missed by less than a tenth of its width."""
    box = BoundingBox(980.0, 100.0, 1090.0, 101.0, frozenset({Edge.BOTTOM}))
    found = ranged(sight_of(CAMERA), box, shape=CAMERA.on_foot)
    ahead = by_width(corners(parameter_box(CAMERA, CAMERA.on_foot), WIDTH_NAMES), box)[:, 0]
    assert found.by_width_m is not None
    spread = found.by_width_m[1] - found.by_width_m[0]
    assert spread <= 1.1 * (ahead.max() - ahead.min())


def contact_corners(camera: Camera, box: BoundingBox) -> np.ndarray:
    """F of the ground seen along the bottom edge, at every corner; inf above the horizon."""
    v = corners(
        parameter_box(camera, camera.on_foot) | {"u": (box.left_px, box.right_px)},
        ["fx", "fy", "cx", "cy", "h", "pitch", "roll", "eb", "el", "u"],
    )
    axes = camera_axes(v["pitch"], v["roll"])
    a = (v["cx"] - v["u"] - v["el"]) / v["fx"]
    b = (v["cy"] - box.bottom_px - v["eb"]) / v["fy"]
    ray = np.einsum("nij,nj->ni", axes, np.stack([np.ones_like(a), a, b], -1))
    return np.where(ray[:, 2] < 0.0, -v["h"] * ray[:, 0] / np.minimum(ray[:, 2], -1e-300), np.inf)


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("bottom", [830.0, 880.0, 960.0, 1200.0, 1540.0])
def test_by_contact_is_the_hull_of_all_corners(camera: Camera, bottom: float) -> None:
    box = BoundingBox(700.0, 300.0, 760.0, bottom)
    found = ranged(sight_of(camera), box, shape=camera.on_foot)
    ground = contact_corners(camera, box)
    reach = camera.on_foot.contact_m
    if np.isinf(ground).all():
        assert found.status is RangingStatus.CONTRADICTION
        return
    assert found.by_contact_m is not None
    low, high = found.by_contact_m
    assert low <= ground.min() - reach
    assert ground.max() + reach <= high
    assert low == pytest.approx(ground.min() - reach, abs=0.02)
    if np.isfinite(high):
        # Columns and rows are bounded one by one, which costs the correlation through fx and cx.
        assert high == pytest.approx(ground.max() + reach, rel=0.02)


def seen(
    camera: Camera, shape: Shape, rng: np.random.Generator, *, at_ends: bool
) -> tuple[BoundingBox, np.ndarray, np.ndarray] | None:
    """A box as somebody at a drawn place gives it, that place in the vehicle, and the yaw."""
    ends = parameter_box(camera, shape)

    def draw(low: float, high: float) -> float:
        return float(rng.choice([low, high]) if at_ends else rng.uniform(low, high))

    v = {name: draw(*bounds) for name, bounds in ends.items()}
    ahead, beside = rng.uniform(1.5, 25.0), rng.uniform(-0.5, 0.5)
    place = np.array([ahead, beside * ahead])
    axes = camera_axes(np.array([v["pitch"]]), np.array([v["roll"]]))[0]

    def in_camera(ground: np.ndarray, height: float) -> np.ndarray:
        return axes.T @ np.array([*ground, height - v["h"]])

    left, right = in_camera(place, v["z"]), in_camera(place, v["z2"])
    turn = rng.uniform(0.0, 2.0 * np.pi)
    foot = place + rng.choice([1.0, rng.uniform()]) * shape.contact_m * np.array(
        [np.cos(turn), np.sin(turn)]
    )
    lowest = in_camera(foot, 0.0)
    if min(left[0], right[0], lowest[0]) <= 0.1:
        return None
    p = (left[1] + v["m"] + v["w"] / 2) / left[0]
    q = (right[1] + v["m"] - v["w"] / 2) / right[0]
    u_foot = v["cx"] - v["fx"] * lowest[1] / lowest[0]
    u_left, u_right = v["cx"] - v["fx"] * p, v["cx"] - v["fx"] * q
    bottom = v["cy"] - v["fy"] * lowest[2] / lowest[0] + v["eb"]
    inside = 0.0 <= u_left <= u_foot <= u_right <= camera.size_px[0] and bottom > 1.0
    if not inside or not u_left + v["el"] < u_right + v["er"]:
        return None
    yaw = draw(*camera.mounting.yaw_rad)
    turned = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]) @ place
    turned += [draw(*camera.mounting.forward_m), draw(*camera.mounting.left_m)]
    box = BoundingBox(u_left + v["el"], 0.0, u_right + v["er"], bottom)
    return box, place, turned


def hides(box: BoundingBox, camera: Camera, rng: np.random.Generator) -> BoundingBox:
    """The same person with one edge pulled in, and called hidden."""
    edge = rng.choice(list(Edge))
    width, height = box.right_px - box.left_px, box.bottom_px - box.top_px
    left, right, bottom = box.left_px, box.right_px, box.bottom_px
    part = rng.uniform(0.0, 0.8)
    if edge is Edge.LEFT:
        left += part * width
    elif edge is Edge.RIGHT:
        right -= part * width
    else:
        bottom -= part * height
    return BoundingBox(left, box.top_px, right, bottom, frozenset({edge}))


def check(found: RangingAnswer, place: np.ndarray) -> bool:
    """Whether the answer holds the place; True counts a bounded answer."""
    assert found.status is not RangingStatus.CONTRADICTION, found
    assert found.by_width_m is not None
    assert found.by_contact_m is not None
    for low, high in (found.by_width_m, found.by_contact_m):
        assert low <= place[0] <= high
    if found.ahead_m is None or found.beside_m is None:
        return False
    assert found.ahead_m[0] <= place[0] <= found.ahead_m[1]
    assert found.beside_m[0] <= place[1] <= found.beside_m[1]
    return True


@pytest.mark.parametrize("at_ends", [False, True])
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("on_wheels", [False, True])
def test_true_positions_are_contained(camera: Camera, at_ends: bool, on_wheels: bool) -> None:
    rng = np.random.default_rng(7)
    shape = camera.on_wheels if on_wheels else camera.on_foot
    sight = sight_of(camera)
    bounded = tried = 0
    for _ in range(350):
        drawn = seen(camera, shape, rng, at_ends=at_ends)
        if drawn is None:
            continue
        box, place, in_car = drawn
        tried += 1
        check(ranged(sight, hides(box, camera, rng), shape=shape), place)
        found = ranged(sight, box, shape=shape)
        if not check(found, place):
            continue
        bounded += 1
        assert found.ahead_m is not None
        assert found.beside_m is not None
        x, y = in_vehicle(camera, found.ahead_m, found.beside_m)
        assert x[0] <= in_car[0] <= x[1]
        assert y[0] <= in_car[1] <= y[1]
        _check_global(camera, found, in_car, rng, at_ends=at_ends)
    assert tried > 40
    assert bounded > 25


def test_where_everything_is_known_the_answer_is_the_point() -> None:
    """Large angles show a wrong sign; only the feet's column is open, anywhere within the box."""
    rng = np.random.default_rng(1)
    found_any = 0
    for _ in range(300):
        drawn = seen(EXACT, POINT, rng, at_ends=True)
        if drawn is None:
            continue
        box, place, in_car = drawn
        # A millionth of a pixel, for the rounding of the reference.
        boxes = dataclasses.replace(EXACT.boxes, edge_px=1e-6, contact_px=1e-6)
        sight = sight_of(dataclasses.replace(EXACT, boxes=boxes))
        found = ranged(sight, box, shape=POINT)
        assert check(found, place)
        assert found.ahead_m is not None
        assert found.beside_m is not None
        ends = (found.by_width_m, found.ahead_m, found.beside_m)
        assert all(end is not None and end[1] - end[0] < 1e-3 for end in ends)
        x, y = in_vehicle(EXACT, found.ahead_m, found.beside_m)
        assert (x[0], y[0]) == pytest.approx(tuple(in_car), abs=1e-3)
        found_any += 1
    assert found_any > 30


def test_feet_beyond_a_hidden_edge_are_looked_for_there() -> None:
    """Beside the visible part of a person, where a rolled camera sees the ground in other rows."""
    rng = np.random.default_rng(4)
    striding = dataclasses.replace(POINT, contact_m=0.2)
    boxes = dataclasses.replace(EXACT.boxes, edge_px=1e-6, contact_px=1e-6)
    mounting = dataclasses.replace(EXACT.mounting, pitch_rad=(0.05, 0.05))
    sight = sight_of(dataclasses.replace(EXACT, boxes=boxes, mounting=mounting))
    tried = 0
    for _ in range(600):
        drawn = seen(sight.camera, striding, rng, at_ends=True)
        if drawn is not None:
            tried += 1
            check(ranged(sight, hides(drawn[0], EXACT, rng), shape=striding), drawn[1])
    assert tried > 50


def _check_global(
    camera: Camera,
    found: RangingAnswer,
    in_car: np.ndarray,
    rng: np.random.Generator,
    *,
    at_ends: bool,
) -> None:
    assert found.ahead_m is not None
    assert found.beside_m is not None
    middle = (rng.uniform(-50, 50), rng.uniform(-50, 50), rng.uniform(-7, 7))
    half = (0.2, 0.3, rng.choice([0.01, 0.3, 2.0]))
    ends = [(m - r, m + r) for m, r in zip(middle, half, strict=True)]
    pose = Pose(*ends)
    x, y, heading = (rng.choice(end) if at_ends else rng.uniform(*end) for end in ends)
    true = (
        x + np.cos(heading) * in_car[0] - np.sin(heading) * in_car[1],
        y + np.sin(heading) * in_car[0] + np.cos(heading) * in_car[1],
    )
    box = in_global(camera, found.ahead_m, found.beside_m, pose=pose)
    assert all(low <= value <= high for value, (low, high) in zip(true, box, strict=True))
