"""From a folder of images to the monitor's people: everybody who is seen or hidden is on the list
where they are, nobody is placed against a contradiction, and edges that may be cut are hidden."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from perception_models import NAMES, SIDE, as_classes, constant_network
from ranging_cases import CAMERA

from workbench.errors import InputError
from workbench.estimation.ranging import BoundingBox, Edge, sight_of
from workbench.perception.detections import Detection, detect, with_hidden_edges, with_riders
from workbench.perception.images import frames, read_image
from workbench.perception.letterbox import letterboxed
from workbench.perception.network import load_network
from workbench.perception.people import Looking, look, observed_people, place
from workbench.perception.tracks import TrackLimits, Tracks
from workbench.perception.unseen import View
from workbench.runtime.observation import Observation, fault_in_observation, tracked_people
from workbench.runtime.onboard.dead_reckoning import Pose
from workbench.runtime.person_guard import MotionLimits
from workbench.runtime.protocols.people import PersonKind

POSE = Pose((10.0, 10.0), (20.0, 20.0), (math.pi / 2, math.pi / 2))
VIEW = View(near_m=4.0, far_m=25.0, inset_px=30.0, slices=3, assumed=True)
LIMITS = TrackLimits(MotionLimits(2.5, 2.0), MotionLimits(7.0, 3.0), forget_s=1.0, memory_s=1.0)
FOOT, WHEELS = PersonKind.ON_FOOT, PersonKind.ON_WHEELS


def projected(
    ahead: float, beside: float, *, width: float = 0.47, tall: float = 1.75
) -> BoundingBox:
    """The box of somebody on the ground, for the middle values of the camera."""
    fx, h, pitch = 1739.0, 1.6, 0.03
    depth = ahead * math.cos(pitch) + h * math.sin(pitch)
    u, half = 1032.0 - fx * beside / depth, 0.5 * fx * width / depth

    def row(height: float) -> float:
        below = (h - height) * math.cos(pitch) - ahead * math.sin(pitch)
        return 772.0 + fx * below / (ahead * math.cos(pitch) + (h - height) * math.sin(pitch))

    return BoundingBox(u - half, row(tall), u + half, row(0.0))


def person(box: BoundingBox, label: str = "person", kind: PersonKind | None = FOOT) -> Detection:
    return Detection(label, kind, 0.9, box)


def numbers(box: BoundingBox) -> list[float]:
    return [box.left_px, box.top_px, box.right_px, box.bottom_px]


def folder_of(tmp_path: Path, count: int) -> Path:
    folder = tmp_path / "images"
    folder.mkdir()
    for k in range(count):
        PIL.Image.new("RGB", CAMERA.size_px, (k, 0, 0)).save(folder / f"{k:03d}.bmp")
    return folder


def test_a_folder_of_images_becomes_people(tmp_path: Path) -> None:
    """One 6 m ahead and one 9 m ahead, half a metre to the left and 1.5 m to the right."""
    truth = [(6.0, 0.5), (9.0, -1.5)]
    image = np.zeros((CAMERA.size_px[1], CAMERA.size_px[0], 3), dtype=np.uint8)
    chart = letterboxed(image, (SIDE, SIDE))[1]
    boxes = chart.to_input(np.array([numbers(projected(*each)) for each in truth]))
    output = as_classes(boxes, np.array([[0.9, 0.0, 0.0], [0.8, 0.0, 0.0]]))
    network = load_network(constant_network(tmp_path / "two.onnx", output))
    looking = Looking(0.5, 0.5, VIEW, LIMITS)
    seen = list(
        look(
            network,
            frames(folder_of(tmp_path, 3), rate_hz=5.0),
            sight_of(CAMERA),
            pose_at=lambda t_s: POSE,
            looking=looking,
        )
    )
    assert [round(each.t_s, 6) for each in seen] == [0.0, 0.2, 0.4]
    for each in seen:
        assert each.placed.unplaced == ()
        assert [track.number for track in each.tracks.people] == [1, 2]
        for track, (ahead, beside) in zip(each.tracks.people, truth, strict=True):
            disc = track.guard.position
            # Heading pi / 2: ahead is +y, to the left is -x; the camera is 1.12 m before the axle.
            away = math.hypot(disc.x - (10.0 - beside), disc.y - (20.0 + 1.12 + ahead))
            assert away <= disc.radius <= 1.5
        assumed = [p for p in each.people if p.assumed]
        assert len(assumed) == 2 * VIEW.slices + 2 * VIEW.slices
        assert len(each.people) == 2 + len(assumed)
        observation = Observation(
            x=(10.0, 10.0), y=(20.0, 20.0), heading=POSE.heading, steering=(0.0, 0.0),
            speed=(0.0, 0.0), speed_integral=(0.0, 0.0), offset_integral=(0.0, 0.0),
            reference_speed_mps=1.0, people=each.people, stamp_s=each.t_s, watched=each.watched,
        )  # fmt: skip
        assert fault_in_observation(observation, tracked_people(observation)) is None


def test_without_assumed_people_the_limits_say_so(tmp_path: Path) -> None:
    output = np.zeros((1, 4 + len(NAMES), 2), dtype=np.float32)
    network = load_network(constant_network(tmp_path / "none.onnx", output))
    looking = Looking(0.5, 0.5, dataclasses.replace(VIEW, assumed=False), LIMITS)
    (seen,) = look(
        network,
        frames(folder_of(tmp_path, 1), rate_hz=5.0),
        sight_of(CAMERA),
        pose_at=lambda t_s: POSE,
        looking=looking,
    )
    assert seen.people == ()
    assert any("nobody comes from beside" in limit for limit in seen.limits)


def test_a_contradiction_is_told_and_not_placed() -> None:
    box = projected(8.0, 0.0)
    child = dataclasses.replace(box, left_px=box.left_px - 200.0, right_px=box.right_px + 200.0)
    placed = place(sight_of(CAMERA), [person(child)], VIEW, pose=POSE)
    assert placed.sightings == ()
    assert "by the width" in placed.unplaced[0]


def test_who_shows_no_farthest_position_is_assumed_in_their_shadow() -> None:
    """Feet and one side hidden, at a distance of which only the box says nothing."""
    whole = projected(10.0, 0.2)
    cut = frozenset({Edge.BOTTOM, Edge.RIGHT})
    thin = BoundingBox(whole.left_px, whole.top_px, whole.left_px + 3.0, 700.0, cut)
    # Small discs, as large ones would cover what lies beside the line of sight anyway.
    view = dataclasses.replace(VIEW, slices=100)
    placed = place(sight_of(CAMERA), [person(thin)], view, pose=POSE)
    assert placed.sightings == ()
    assert placed.unplaced == ()
    shadow = placed.hidden[2 * view.slices :]
    # Their left edge is theirs, so they are half a width to the right of its line of sight.
    for ahead in (6.0, 10.0, 24.0, 24.9):
        beside = 0.435 * ahead / 10.0 - 0.235
        spot = (10.0 - beside, 20.0 + 1.12 + ahead)
        assert any(math.hypot(spot[0] - d.x, spot[1] - d.y) <= d.radius for d in shadow)


def test_a_car_hides_people_behind_it() -> None:
    car = person(BoundingBox(900.0, 600.0, 1300.0, 1000.0), "car", None)
    placed = place(sight_of(CAMERA), [car], VIEW, pose=POSE)
    assert placed.sightings == ()
    assert len(placed.hidden) == 3 * VIEW.slices
    cut = dataclasses.replace(
        car, box=dataclasses.replace(car.box, hidden=frozenset({Edge.BOTTOM}))
    )
    nearer = place(sight_of(CAMERA), [cut], VIEW, pose=POSE).hidden[2 * VIEW.slices]
    assert nearer.y - nearer.radius < placed.hidden[2 * VIEW.slices].y - placed.hidden[6].radius


def test_discs_for_the_monitor_hold_the_body_and_the_widest_limits() -> None:
    sight = sight_of(CAMERA)
    placed = place(sight, [person(projected(8.0, 0.0))], VIEW, pose=POSE)
    tracks = Tracks(LIMITS).after(placed.sightings, at_s=3.0)
    seen, *assumed = observed_people(sight, tracks, placed.hidden, stamp_s=3.1)
    assert seen.guard.at_s == pytest.approx(-0.1)
    body = seen.guard.position.radius - placed.sightings[0].place.radius
    assert body == pytest.approx(CAMERA.on_foot.body_m)
    assert len(seen.intent) == 1
    for each, disc in zip(assumed, placed.hidden, strict=True):
        assert each.assumed
        assert each.guard.limits == LIMITS.on_wheels
        assert each.guard.velocity.radius == 7.0
        assert each.guard.position.radius - disc.radius == pytest.approx(CAMERA.on_wheels.body_m)


@pytest.mark.parametrize(
    ("other", "hidden"),
    [
        ((0.0, 0.0, 50.0, 50.0), set()),
        ((150.0, 250.0, 250.0, 350.0), {Edge.LEFT}),
        ((250.0, 250.0, 350.0, 350.0), {Edge.RIGHT}),
        ((220.0, 350.0, 280.0, 450.0), {Edge.BOTTOM}),
        ((150.0, 350.0, 350.0, 450.0), {Edge.LEFT, Edge.RIGHT, Edge.BOTTOM}),
        ((220.0, 250.0, 280.0, 350.0), set()),
        ((301.0, 250.0, 350.0, 350.0), {Edge.RIGHT}),
        ((303.0, 250.0, 350.0, 350.0), set()),
    ],
)
def test_edges_that_another_box_reaches_are_hidden(
    other: tuple[float, float, float, float], hidden: set[Edge]
) -> None:
    seen = [
        person(BoundingBox(200.0, 200.0, 300.0, 400.0)),
        person(BoundingBox(*other), "car", None),
    ]
    found = with_hidden_edges(seen, size_px=(1000, 1000), edge_px=2.0)
    assert found[0].box.hidden == hidden


def test_edges_at_the_border_are_hidden() -> None:
    for box, hidden in (
        (BoundingBox(1.0, 0.0, 30.0, 40.0), {Edge.LEFT}),
        (BoundingBox(5.0, 0.0, 98.5, 40.0), {Edge.RIGHT}),
        (BoundingBox(5.0, 0.0, 30.0, 79.0), {Edge.BOTTOM}),
        (BoundingBox(5.0, 0.0, 30.0, 70.0), set()),
    ):
        (found,) = with_hidden_edges([person(box)], size_px=(100, 80), edge_px=2.0)
        assert found.box.hidden == hidden


def test_riders_stand_on_their_wheels() -> None:
    rider, bicycle = BoundingBox(200, 200, 300, 400), BoundingBox(150, 320, 350, 460)
    parked, walker = BoundingBox(600, 320, 800, 460), BoundingBox(900, 200, 960, 400)
    seen = [person(rider), person(bicycle, "bicycle", None), person(parked, "bicycle", None)]
    found = with_riders([*seen, person(walker)])
    assert [each.kind for each in found] == [WHEELS, FOOT, None]
    assert numbers(found[0].box) == [200, 200, 300, 460]
    assert found[2].box == parked


def test_a_network_must_know_people(tmp_path: Path) -> None:
    output = np.zeros((1, 4 + 2, 2), dtype=np.float32)
    network = load_network(constant_network(tmp_path / "n.onnx", output, names=("cat", "dog")))
    with pytest.raises(InputError, match="classes person"):
        detect(network, np.zeros((9, 9, 3), np.uint8), confidence=0.5, overlap=0.5, edge_px=1.0)


def test_boxes_are_cut_at_the_border(tmp_path: Path) -> None:
    boxes = np.array([[-10.0, 10.0, 20.0, 80.0], [-30.0, 10.0, -5.0, 40.0]])
    output = as_classes(boxes, np.array([[0.9, 0, 0], [0.8, 0, 0]]))
    network = load_network(constant_network(tmp_path / "n.onnx", output))
    image = np.zeros((SIDE, SIDE, 3), np.uint8)
    (found,) = detect(network, image, confidence=0.5, overlap=0.5, edge_px=1.0)
    assert numbers(found.box) == pytest.approx([0.0, 10.0, 20.0, SIDE], abs=1e-4)
    assert found.box.hidden == {Edge.LEFT, Edge.BOTTOM}


def test_times_come_from_the_table_of_frames(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, 3)
    (folder / "frames.csv").write_text("file,t\n001.bmp,5.0\n000.bmp,5.5\n")
    found = list(frames(folder))
    assert [(each.name, each.t_s) for each in found] == [("001.bmp", 5.0), ("000.bmp", 5.5)]
    assert found[0].image[0, 0].tolist() == [1, 0, 0]
    assert found[0].image.shape == (CAMERA.size_px[1], CAMERA.size_px[0], 3)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("file,t\n000.bmp,1\n001.bmp,1\n", "times that increase"),
        ("file,t\nabsent.bmp,1\n", "lacks 'absent.bmp'"),
        ("file,t\n", "lists no image"),
        ("name,t\n", "missing column"),
    ],
)
def test_tables_of_frames_that_cannot_be_are_refused(table: str, said: str, tmp_path: Path) -> None:
    folder = folder_of(tmp_path, 2)
    (folder / "frames.csv").write_text(table)
    with pytest.raises(InputError, match=said):
        list(frames(folder))


def test_what_is_no_folder_of_images_is_refused(tmp_path: Path) -> None:
    (tmp_path / "drive.mp4").write_bytes(b"")
    with pytest.raises(InputError, match="found a file"):
        list(frames(tmp_path / "drive.mp4"))
    (tmp_path / "drive.mp4").unlink()
    with pytest.raises(InputError, match="no such folder"):
        list(frames(tmp_path / "absent"))
    with pytest.raises(InputError, match="found none"):
        list(frames(tmp_path))
    with pytest.raises(InputError, match="rate above 0"):
        list(frames(folder_of(tmp_path, 1)))
    (tmp_path / "broken.png").write_bytes(b"no image")
    with pytest.raises(InputError, match="cannot be read"):
        read_image(tmp_path / "broken.png")


def test_without_pillow_the_extra_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(__import__("sys").modules, "PIL.Image", None)
    with pytest.raises(InputError, match=r"reach-workbench\[perception\]"):
        read_image(tmp_path / "any.png")
