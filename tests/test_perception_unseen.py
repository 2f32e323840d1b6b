"""Whoever comes out of what the camera cannot see is in a disc that is given to the guard: behind a
box, and across the edges of the view, for all cameras and poses within their intervals."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from ranging_cases import CAMERAS, EXACT, camera_axes

from workbench.errors import InputError
from workbench.estimation.camera import Camera
from workbench.estimation.ranging import BoundingBox, Sight, sight_of
from workbench.perception.unseen import View, edges, shadow, watched_disc
from workbench.runtime.onboard.dead_reckoning import Pose
from workbench.runtime.person_guard import Disc

VIEW = View(near_m=3.0, far_m=20.0, inset_px=30.0, slices=4, assumed=True)
POSE = Pose((4.9, 5.1), (-2.2, -2.0), (2.0, 2.06))
Draw = dict[str, float]


def edge_discs(sight: Sight, view: View, *, pose: Pose) -> tuple[Disc, ...]:
    return tuple(disc for edge in edges(sight, view, pose=pose) for disc in edge.discs)


def shadow_discs(
    sight: Sight, box: BoundingBox, view: View, *, from_m: float, pad_m: float, pose: Pose
) -> tuple[Disc, ...]:
    found = shadow(sight, box, view, from_m=from_m, pad_m=pad_m, pose=pose)
    return () if found is None else found.discs


def draw(camera: Camera, rng: np.random.Generator, *, at_ends: bool) -> Draw:
    lens, mounting = camera.lens, camera.mounting
    ends = {
        "fx": lens.focal_x_px, "fy": lens.focal_y_px, "cx": lens.centre_x_px,
        "cy": lens.centre_y_px, "h": mounting.up_m, "pitch": mounting.pitch_rad,
        "roll": mounting.roll_rad, "yaw": mounting.yaw_rad, "forward": mounting.forward_m,
        "left": mounting.left_m, "x": POSE.x, "y": POSE.y, "heading": POSE.heading,
    }  # fmt: skip
    return {
        name: float(rng.choice(pair) if at_ends else rng.uniform(*pair))
        for name, pair in ends.items()
    }


def slope(v: Draw, u_px: float, v_px: float) -> float:
    """L / F along the line of sight through a pixel, by rotation matrices."""
    axes = camera_axes(np.array([v["pitch"]]), np.array([v["roll"]]))[0]
    ray = axes @ [1.0, (v["cx"] - u_px) / v["fx"], (v["cy"] - v_px) / v["fy"]]
    return float(ray[1] / ray[0])


def on_plane(v: Draw, ahead: float, beside: float) -> complex:
    in_car = complex(v["forward"], v["left"]) + complex(ahead, beside) * np.exp(1j * v["yaw"])
    return complex(v["x"], v["y"]) + in_car * np.exp(1j * v["heading"])


def covered(discs: tuple[Disc, ...], place: complex, grown_m: float = 0.0) -> bool:
    return any(abs(place - complex(d.x, d.y)) <= d.radius + grown_m + 1e-9 for d in discs)


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("at_ends", [False, True])
def test_everything_behind_a_box_is_covered(camera: Camera, at_ends: bool) -> None:
    rng = np.random.default_rng(11)
    sight = sight_of(camera)
    for _ in range(40):
        left, top = rng.uniform(0, 1800), rng.uniform(200, 800)
        box = BoundingBox(left, top, left + rng.uniform(20, 200), top + rng.uniform(50, 700))
        from_m, pad_m = rng.uniform(3.0, 15.0), rng.choice([0.0, 0.3])
        discs = shadow_discs(sight, box, VIEW, from_m=from_m, pad_m=pad_m, pose=POSE)
        assert len(discs) == VIEW.slices
        for _ in range(40):
            v = draw(camera, rng, at_ends=at_ends)
            error = camera.boxes.edge_px + camera.lens.residual_px
            u = rng.choice(
                [box.left_px - error, box.right_px + error, rng.uniform(left, box.right_px)]
            )
            row = rng.choice([box.top_px, box.bottom_px])
            ahead = rng.choice([from_m, VIEW.far_m, rng.uniform(from_m, VIEW.far_m)])
            beside = ahead * slope(v, u, row) + rng.choice([-pad_m, pad_m])
            assert covered(discs, on_plane(v, ahead, beside))


@pytest.mark.parametrize("edge_px", [0.0, 15.0])
def test_a_thin_shadow_follows_its_line_of_sight(edge_px: float) -> None:
    """Of a camera turned by large known angles: many small discs, all on the line and all of it."""
    rng = np.random.default_rng(9)
    boxes = dataclasses.replace(EXACT.boxes, edge_px=edge_px)
    sight, v = sight_of(dataclasses.replace(EXACT, boxes=boxes)), draw(EXACT, rng, at_ends=True)
    pose = Pose((v["x"],) * 2, (v["y"],) * 2, (v["heading"],) * 2)
    view = dataclasses.replace(VIEW, slices=150)
    for _ in range(12):
        u, row = rng.uniform(100, 1900), rng.uniform(100, 1400)
        box = BoundingBox(u, row, u + 0.1, row + 0.1)
        discs = shadow_discs(sight, box, view, from_m=4.0, pad_m=0.0, pose=pose)
        assert max(disc.radius for disc in discs) < (0.25 if edge_px == 0.0 else 0.7)
        for ahead in rng.uniform(4.0, 20.0, 12):
            at_u = u + rng.choice([-edge_px, edge_px])
            assert covered(discs, on_plane(v, ahead, ahead * slope(v, at_u, row)))


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("at_ends", [False, True])
def test_whoever_walks_into_the_view_is_in_a_grown_disc(camera: Camera, at_ends: bool) -> None:
    rng = np.random.default_rng(5)
    discs = edge_discs(sight_of(camera), VIEW, pose=POSE)
    assert len(discs) == 2 * VIEW.slices
    top_mps = 2.5
    crossings = 0
    for _ in range(1500):
        v = draw(camera, rng, at_ends=at_ends)
        u = rng.choice([VIEW.inset_px, camera.size_px[0] - VIEW.inset_px])
        edge = slope(v, u, rng.uniform(0.0, camera.size_px[1]))
        start = np.array([rng.uniform(-5, 25), rng.uniform(-25, 25)])
        end = np.array([rng.uniform(3, 20), rng.uniform(-10, 10)])
        outward = 1.0 if u == VIEW.inset_px else -1.0

        def outside(place: np.ndarray, edge: float = edge, outward: float = outward) -> float:
            return outward * (place[1] - edge * place[0])

        if not outside(start) > 0.0 > outside(end):
            continue
        part = outside(start) / (outside(start) - outside(end))
        crossed = start + part * (end - start)
        if not VIEW.near_m <= crossed[0] <= VIEW.far_m:
            continue
        crossings += 1
        length = float(np.linalg.norm(end - start))
        for share in (part, 1.0, rng.uniform(part, 1.0)):
            place = on_plane(v, *(start + share * (end - start)))
            walked_for_s = share * length / top_mps
            assert covered(discs, place, grown_m=top_mps * walked_for_s)
    assert crossings > 60


def test_more_slices_are_smaller_discs() -> None:
    sight = sight_of(CAMERAS[0])
    few, many = (edge_discs(sight, dataclasses.replace(VIEW, slices=n), pose=POSE) for n in (2, 8))
    assert max(d.radius for d in many) < 0.5 * max(d.radius for d in few)
    whole = math.hypot(VIEW.far_m - VIEW.near_m, 0.0)
    assert (
        max(d.radius for d in edge_discs(sight, dataclasses.replace(VIEW, slices=1), pose=POSE))
        < whole
    )


def test_nothing_is_hidden_beyond_what_is_looked_at() -> None:
    sight = sight_of(CAMERAS[0])
    box = BoundingBox(900.0, 500.0, 1000.0, 900.0)
    assert shadow_discs(sight, box, VIEW, from_m=20.0, pad_m=0.0, pose=POSE) == ()
    near = shadow_discs(sight, box, VIEW, from_m=0.5, pad_m=0.0, pose=POSE)
    assert near == shadow_discs(sight, box, VIEW, from_m=3.0, pad_m=0.0, pose=POSE)


@pytest.mark.parametrize("yaw_rad", [0.0, 2.0, 3.14])
def test_the_watched_disc_stays_within_what_is_looked_at(yaw_rad: float) -> None:
    rng = np.random.default_rng(2)
    mounting = dataclasses.replace(CAMERAS[0].mounting, yaw_rad=(yaw_rad, yaw_rad))
    camera = dataclasses.replace(CAMERAS[0], mounting=mounting)
    watched = watched_disc(camera, VIEW, pose=POSE)
    assert watched.radius_m > VIEW.far_m - 2.0
    for _ in range(500):
        v = draw(camera, rng, at_ends=True)
        rim = complex(watched.x_m, watched.y_m) + watched.radius_m * np.exp(1j * rng.uniform(0, 7))
        from_camera = (rim - on_plane(v, 0.0, 0.0)) * np.exp(-1j * (v["heading"] + v["yaw"]))
        assert from_camera.real <= VIEW.far_m + 1e-9


@pytest.mark.parametrize(
    "wrong",
    [{"near_m": 0.0}, {"far_m": 3.0}, {"slices": 0}, {"inset_px": -1.0}, {"far_m": math.inf}],
)
def test_a_view_that_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match="expected"):
        dataclasses.replace(VIEW, **wrong)


def test_limits_say_what_is_not_covered() -> None:
    told = VIEW.limits(CAMERAS[0])
    untold = dataclasses.replace(VIEW, assumed=False).limits(CAMERAS[0])
    assert set(told) < set(untold)
    assert any("nobody is looked for" in limit for limit in told)
