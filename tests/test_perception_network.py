"""A network's answer becomes boxes in the image: letterbox and back is the identity, all heads
agree on the same boxes, suppression is what its definition says by brute force; what cannot be read
is refused with a sentence."""

from __future__ import annotations

import itertools
from fractions import Fraction
from pathlib import Path

import numpy as np
import onnx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from perception_models import (
    CELL,
    NAMES,
    SIDE,
    as_classes,
    as_objectness,
    bright_network,
    constant_network,
)

from workbench.errors import InputError
from workbench.perception.heads import Candidates, Head, decoded, head_of
from workbench.perception.letterbox import letterboxed
from workbench.perception.network import load_network
from workbench.perception.suppression import overlaps, suppressed

SIZES = st.tuples(st.integers(1, 90), st.integers(1, 90))
SEEDS = st.integers(0, 2**32 - 1)


def random_boxes(rng: np.random.Generator, count: int) -> np.ndarray:
    corner, sides = rng.uniform(0, 40, (count, 2)), rng.uniform(0.5, 20, (count, 2))
    return np.concatenate([corner, corner + sides], axis=1)


@given(SIZES, SIZES, SEEDS)
def test_letterbox_and_back_is_the_identity(
    image: tuple[int, int], size: tuple[int, int], seed: int
) -> None:
    boxes = random_boxes(np.random.default_rng(seed), 5)
    framed, chart = letterboxed(np.zeros((*image, 3), dtype=np.uint8), size)
    assert framed.shape == (3, *size)
    assert np.allclose(chart.to_image(chart.to_input(boxes)), boxes, rtol=0, atol=1e-9)
    whole = chart.to_input(np.array([[0.0, 0.0, image[1], image[0]]]))[0]
    assert np.allclose(whole, np.round(whole), atol=1e-9)
    assert (whole >= -1e-9).all()
    assert (whole[[0, 2]] <= size[1] + 1e-9).all()
    assert (whole[[1, 3]] <= size[0] + 1e-9).all()
    touching = np.isclose(whole[2] - whole[0], size[1]) or np.isclose(whole[3] - whole[1], size[0])
    assert touching
    scale = min(size[0] / image[0], size[1] / image[1])
    for side, own in ((image[1], chart.scale_x), (image[0], chart.scale_y)):
        assert abs(own - scale) * side <= 0.5 + 1e-9 or own * side == pytest.approx(1.0)


def test_a_ramp_is_sampled_at_its_own_coordinates() -> None:
    """Colours grow with u and v, so that each input pixel tells where it was taken from."""
    v, u = np.meshgrid(np.arange(60), np.arange(100), indexing="ij")
    image = np.stack([2 * u, 3 * v, 0 * u], axis=-1).astype(np.uint8)
    framed, chart = letterboxed(image, (64, 64))
    for row, column in itertools.product(range(64), range(64)):
        at_u, at_v, *_ = chart.to_image(np.array([[column + 0.5, row + 0.5, 0, 0]]))[0] - 0.5
        if 0.0 <= at_u <= 99.0 and 0.0 <= at_v <= 59.0:
            red, green = framed[0, row, column] * 255.0, framed[1, row, column] * 255.0
            assert red == pytest.approx(2 * at_u, abs=1e-3)
            assert green == pytest.approx(3 * at_v, abs=1e-3)
        elif not (-0.6 <= at_u <= 99.6 and -0.6 <= at_v <= 59.6):
            assert framed[:, row, column] == pytest.approx(114.0 / 255.0)


@given(SEEDS, st.integers(0, 20))
def test_all_heads_agree_on_the_same_boxes(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = random_boxes(rng, count)
    scores = rng.uniform(0.0, 0.9, (count, 3))
    objectness = rng.uniform(0.9, 1.0, count)
    first = decoded(as_classes(boxes, scores), Head.CLASSES, confidence=0.4)
    second = decoded(as_objectness(boxes, scores, objectness), Head.OBJECTNESS, confidence=0.4)
    which, classes = np.nonzero(scores >= 0.4)
    listed = np.concatenate(
        [boxes[which], scores[which, classes][:, None], classes[:, None]], axis=1
    )[None]
    third = decoded(listed, Head.SELECTED, confidence=0.4)
    assert list(first.classes) == list(second.classes) == list(third.classes) == list(classes)
    for other in (second, third):
        assert np.allclose(first.boxes, other.boxes, atol=1e-4)
        assert np.allclose(first.scores, other.scores, atol=1e-5)
    assert np.allclose(first.boxes, boxes[which], atol=1e-4)


def exact_overlap(a: np.ndarray, b: np.ndarray) -> Fraction:
    first, second = ([Fraction(float(end)) for end in box] for box in (a, b))
    sides = [min(first[k + 2], second[k + 2]) - max(first[k], second[k]) for k in (0, 1)]
    common = max(sides[0], Fraction(0)) * max(sides[1], Fraction(0))
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (first, second)]
    return common / (sum(areas) - common)


@given(SEEDS, st.integers(0, 12), st.sampled_from([0.1, 0.45, 0.7]))
def test_suppression_is_its_definition(seed: int, count: int, overlap: float) -> None:
    rng = np.random.default_rng(seed)
    found = Candidates(
        random_boxes(rng, count) * [1, 1, 1, 1],
        rng.choice([0.3, 0.5, 0.5, 0.8], count) + rng.choice([0.0, 0.01], count),
        rng.integers(0, 2, count),
    )
    kept: list[int] = []
    for k in sorted(range(count), key=lambda k: (-found.scores[k], k)):
        rivals = (j for j in kept if found.classes[j] == found.classes[k])
        if all(exact_overlap(found.boxes[k], found.boxes[j]) <= overlap for j in rivals):
            kept.append(k)
    answer = suppressed(found, overlap=overlap)
    assert np.array_equal(answer.boxes, found.boxes[kept])
    assert np.array_equal(answer.scores, found.scores[kept])
    assert np.array_equal(answer.classes, found.classes[kept])


def test_overlap_of_boxes_without_area_is_none() -> None:
    point = np.array([1.0, 1.0, 1.0, 1.0])
    assert overlaps(point, np.array([point, [0.0, 0.0, 2.0, 2.0]])).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("head", ["classes", "objectness"])
def test_a_network_finds_what_is_painted(head: str, tmp_path: Path) -> None:
    """Two red patches in an image of twice the input's size, wider than high: by both heads."""
    network = load_network(bright_network(tmp_path / "bright.onnx", head=head))
    assert network.names == NAMES
    assert network.size == (SIDE, SIDE)
    image = np.zeros((SIDE, 2 * SIDE, 3), dtype=np.uint8)
    # The image lies in input rows 16 to 48; cells (3, 2) and (4, 6) are these pixels of it.
    for row, column in ((3, 2), (4, 6)):
        v, u = (row * CELL - SIDE // 4) * 2, column * CELL * 2
        image[v : v + 2 * CELL, u : u + 2 * CELL, 0] = 255
    found = network.candidates(image, confidence=0.5, overlap=0.5)
    assert list(found.classes) == [0, 0]
    assert found.scores == pytest.approx([1.0, 1.0], abs=1e-5)
    middles = sorted(((b[0] + b[2]) / 2, (b[1] + b[3]) / 2) for b in found.boxes)
    assert np.allclose(middles, [(40.0, 24.0), (104.0, 40.0)], atol=1e-3)
    sides = found.boxes[:, 2:] - found.boxes[:, :2]
    assert np.allclose(sides, [6.0 * CELL, 10.0 * CELL], atol=1e-3)


def test_colours_arrive_as_red_green_blue(tmp_path: Path) -> None:
    network = load_network(bright_network(tmp_path / "bright.onnx", head="classes"))
    image = np.zeros((SIDE, SIDE, 3), dtype=np.uint8)
    image[..., 2] = 255
    assert len(network.candidates(image, confidence=0.5, overlap=0.5).scores) == 0
    image[..., 1], image[..., 0] = 255, 255
    assert len(network.candidates(image, confidence=0.5, overlap=0.5).scores) == 0


@pytest.mark.parametrize(
    ("shape", "classes", "head"),
    [
        ((1, 84, 8400), 80, Head.CLASSES),
        ((1, 25200, 85), 80, Head.OBJECTNESS),
        ((1, 300, 6), 80, Head.SELECTED),
        ((1, 5, 8400), 1, Head.CLASSES),
    ],
)
def test_the_usual_outputs_are_told_apart(shape: tuple[int, ...], classes: int, head: Head) -> None:
    assert head_of(shape, classes) is head


@pytest.mark.parametrize(
    ("shape", "classes"),
    [((1, 255, 80, 80), 80), ((1, 8400, 84), 80), ((1, 25200, 6), 1), ((1, 84, 85), 80), ((), 3)],
)
def test_an_unclear_output_is_refused(shape: tuple[int, ...], classes: int) -> None:
    with pytest.raises(InputError, match="name the head"):
        head_of(shape, classes)


ZEROS = np.zeros((1, 4 + len(NAMES), 2), dtype=np.float32)


def test_numbers_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    output = ZEROS.copy()
    output[0, 4, 0] = np.nan
    network = load_network(constant_network(tmp_path / "nan.onnx", output))
    with pytest.raises(InputError, match="NaN"):
        network.candidates(np.zeros((9, 9, 3), dtype=np.uint8), confidence=0.5, overlap=0.5)


def test_a_class_without_a_name_is_refused(tmp_path: Path) -> None:
    listed = np.array([[[0, 0, 9, 9, 0.9, 7.0]]], dtype=np.float32)
    network = load_network(constant_network(tmp_path / "listed.onnx", listed))
    with pytest.raises(InputError, match="class 7"):
        network.candidates(np.zeros((9, 9, 3), dtype=np.uint8), confidence=0.5, overlap=0.5)


@pytest.mark.parametrize("value", [0.0, 1.5, float("nan")])
def test_thresholds_out_of_range_are_refused(value: float, tmp_path: Path) -> None:
    network = load_network(constant_network(tmp_path / "zeros.onnx", ZEROS))
    image = np.zeros((9, 9, 3), dtype=np.uint8)
    with pytest.raises(InputError, match="confidence"):
        network.candidates(image, confidence=value, overlap=0.5)
    with pytest.raises(InputError, match="overlap"):
        network.candidates(image, confidence=0.5, overlap=value)


def test_images_of_another_kind_are_refused() -> None:
    for image in (np.zeros((4, 4)), np.zeros((4, 4, 3)), np.zeros((0, 4, 3), dtype=np.uint8)):
        with pytest.raises(InputError, match="8-bit RGB"):
            letterboxed(image, (8, 8))  # type: ignore[arg-type]


def test_an_open_size_and_missing_names_must_be_given(tmp_path: Path) -> None:
    path = constant_network(tmp_path / "open.onnx", ZEROS, names=None, sides=("h", "w"))
    with pytest.raises(InputError, match="names of its classes"):
        load_network(path)
    with pytest.raises(InputError, match="size=\\(height, width\\)"):
        load_network(path, names=NAMES)
    network = load_network(path, names=NAMES, size=(32, 48))
    assert network.size == (32, 48)
    assert (
        len(network.candidates(np.zeros((9, 9, 3), np.uint8), confidence=0.5, overlap=0.5).scores)
        == 0
    )


@pytest.mark.parametrize(
    ("stated", "size"), [("[320, 640]", (320, 640)), ("[64,64]", (64, 64)), ("320", None)]
)
def test_an_open_size_is_the_one_that_the_file_says_it_was_trained_for(
    stated: str, size: tuple[int, int] | None, tmp_path: Path
) -> None:
    path = constant_network(tmp_path / "open.onnx", ZEROS, sides=("h", "w"))
    model = onnx.load(str(path))
    onnx.helper.set_model_props(model, {"names": str(dict(enumerate(NAMES))), "imgsz": stated})
    onnx.save(model, str(path))
    if size is None:
        with pytest.raises(InputError, match="size open"):
            load_network(path)
    else:
        assert load_network(path).size == size
        assert load_network(path, size=(32, 96)).size == (32, 96)


def test_files_that_are_no_networks_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such network"):
        load_network(tmp_path / "absent.onnx")
    (tmp_path / "text.onnx").write_text("not a network")
    with pytest.raises(InputError, match="cannot load"):
        load_network(tmp_path / "text.onnx")
    with pytest.raises(InputError, match="leave it out"):
        load_network(constant_network(tmp_path / "zeros.onnx", ZEROS), size=(32, 32))
    with pytest.raises(InputError, match="fits none"):
        load_network(constant_network(tmp_path / "zeros.onnx", ZEROS, names=("person",)))


def test_an_image_of_the_inputs_size_is_not_sampled() -> None:
    image = np.random.default_rng(1).integers(0, 256, (12, 9, 3), dtype=np.uint8)
    framed, chart = letterboxed(image, (12, 9))
    assert np.array_equal(framed, (image.astype(np.float32) / np.float32(255.0)).transpose(2, 0, 1))
    assert (chart.scale_x, chart.scale_y, chart.left_px, chart.top_px) == (1.0, 1.0, 0, 0)
