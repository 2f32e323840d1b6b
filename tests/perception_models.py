"""Small ONNX networks whose answers are known: constant outputs, or boxes found in the image."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from workbench.perception.letterbox import Floats

SIDE = 64
NAMES = ("person", "bicycle", "car")
# One candidate per cell of CELL x CELL input pixels.
CELL = 8


def as_classes(boxes: Floats, scores: Floats) -> np.ndarray:
    """[1, 4 + C, N] of boxes (N, 4; left, top, right, bottom) and scores (N, C)."""
    centre, sides = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    return np.concatenate([centre, sides, scores], axis=1).T[None].astype(np.float32)


def as_objectness(boxes: Floats, scores: Floats, objectness: Floats) -> np.ndarray:
    """[1, N, 5 + C] with the same products of objectness and class score."""
    centre, sides = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    parts = [centre, sides, objectness[:, None], scores / objectness[:, None]]
    return np.concatenate(parts, axis=1)[None].astype(np.float32)


def constant_network(
    path: Path,
    output: np.ndarray,
    *,
    names: Sequence[str] | None = NAMES,
    sides: Sequence[int | str] = (SIDE, SIDE),
) -> Path:
    """A network that answers `output` to every image."""
    image = helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, *sides])
    answer = helper.make_tensor_value_info("output0", TensorProto.FLOAT, list(output.shape))
    nodes = [
        # The image takes part with weight 0, so that the input is not pruned away.
        helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "zero"], ["nothing"]),
        helper.make_node("Add", ["constant", "nothing"], ["output0"]),
    ]
    constants = [
        numpy_helper.from_array(output.astype(np.float32), "constant"),
        numpy_helper.from_array(np.array(0.0, dtype=np.float32), "zero"),
    ]
    return _saved(path, helper.make_graph(nodes, "g", [image], [answer], constants), names)


def bright_network(path: Path, *, head: str) -> Path:
    """A network that sees a person in every cell that is red: a box of three cells by five about
    the cell, whose score is the red above the green there, averaged over the cell."""
    count = (SIDE // CELL) ** 2
    image = helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, SIDE, SIDE])
    weights = np.zeros((1, 3, CELL, CELL), dtype=np.float32)
    weights[0, 0], weights[0, 1] = 1.0 / CELL**2, -1.0 / CELL**2
    middles = (np.arange(SIDE // CELL) + 0.5) * CELL
    v, u = np.meshgrid(middles, middles, indexing="ij")
    boxes = np.stack([u.ravel(), v.ravel(), np.full(count, 3.0 * CELL), np.full(count, 5.0 * CELL)])
    constants = [
        numpy_helper.from_array(weights, "weights"),
        numpy_helper.from_array(boxes[None].astype(np.float32), "boxes"),
        numpy_helper.from_array(np.zeros((1, 2, count), dtype=np.float32), "others"),
        numpy_helper.from_array(np.ones((1, 1, count), dtype=np.float32), "sure"),
        numpy_helper.from_array(np.array([1, 1, count], dtype=np.int64), "flat"),
    ]
    parts = (
        ["boxes", "person", "others"]
        if head == "classes"
        else ["boxes", "sure", "person", "others"]
    )
    nodes = [
        helper.make_node("Conv", ["images", "weights"], ["grid"], strides=[CELL, CELL]),
        helper.make_node("Reshape", ["grid", "flat"], ["person"]),
        helper.make_node("Concat", parts, ["joined"], axis=1),
    ]
    shape = [1, 4 + len(NAMES), count]
    if head == "classes":
        nodes.append(helper.make_node("Identity", ["joined"], ["output0"]))
    else:
        nodes.append(helper.make_node("Transpose", ["joined"], ["output0"], perm=[0, 2, 1]))
        shape = [1, count, 5 + len(NAMES)]
    answer = helper.make_tensor_value_info("output0", TensorProto.FLOAT, shape)
    return _saved(path, helper.make_graph(nodes, "g", [image], [answer], constants), NAMES)


def colour_network(path: Path, *, size: tuple[int, int]) -> Path:
    """A network that sees a red person, a green person and a blue car, each in the box of all its
    pixels: c - (the two other colours) > 0.4. size: (height, width) of its input."""
    weights = (2.0 * np.eye(3) - 1.0).reshape(3, 3, 1, 1)
    constants = {
        "weights": weights,
        "enough": 0.4,
        "score": 0.9,
        "half": 0.5,
        "people": [[[1.0, 1.0, 0.0]]],
        "nobody": [[[0.0, 0.0, 0.0]]],
        "cars": [[[0.0, 0.0, 1.0]]],
    }
    nodes = [
        helper.make_node("Conv", ["images", "weights"], ["purity"]),
        helper.make_node("Greater", ["purity", "enough"], ["marked"]),
        helper.make_node("Cast", ["marked"], ["mask"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMax", ["mask"], ["some"], axes=[2, 3], keepdims=0),
    ]
    # Along columns (u) and rows (v): the first and one past the last that is marked.
    for name, over, length in (("u", 2, size[1]), ("v", 3, size[0])):
        numbers = np.arange(length, dtype=np.float64)
        constants |= {f"{name}_first": numbers - length, f"{name}_last": numbers + 1.0,
                      f"{name}_length": float(length)}  # fmt: skip
        nodes += [
            helper.make_node("ReduceMax", ["mask"], [f"{name}_any"], axes=[over], keepdims=0),
            helper.make_node("Mul", [f"{name}_any", f"{name}_first"], [f"{name}_lows"]),
            helper.make_node("ReduceMin", [f"{name}_lows"], [f"{name}_low"], axes=[2], keepdims=0),
            helper.make_node("Add", [f"{name}_low", f"{name}_length"], [f"{name}_begin"]),
            helper.make_node("Mul", [f"{name}_any", f"{name}_last"], [f"{name}_highs"]),
            helper.make_node("ReduceMax", [f"{name}_highs"], [f"{name}_end"], axes=[2], keepdims=0),
            helper.make_node("Add", [f"{name}_begin", f"{name}_end"], [f"{name}_sum"]),
            helper.make_node("Mul", [f"{name}_sum", "half"], [f"{name}_centre"]),
            helper.make_node("Sub", [f"{name}_end", f"{name}_begin"], [f"{name}_side"]),
        ]
    nodes.append(helper.make_node("Mul", ["some", "score"], ["scores"]))
    rows = ["u_centre", "v_centre", "u_side", "v_side", "scores"]
    axis = numpy_helper.from_array(np.array([1], dtype=np.int64), "axis")
    nodes += [helper.make_node("Unsqueeze", [row, "axis"], [f"{row}_row"]) for row in rows]
    kinds = ("people", "nobody", "cars")
    nodes += [helper.make_node("Mul", ["scores_row", kind], [f"is_{kind}"]) for kind in kinds]
    parts = [*(f"{row}_row" for row in rows[:4]), *(f"is_{kind}" for kind in kinds)]
    nodes.append(helper.make_node("Concat", parts, ["output0"], axis=1))
    image = helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, *size])
    answer = helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 4 + len(NAMES), 3])
    held = [numpy_helper.from_array(np.array(value, dtype=np.float32), name)
            for name, value in constants.items()]  # fmt: skip
    return _saved(path, helper.make_graph(nodes, "g", [image], [answer], [*held, axis]), NAMES)


def _saved(path: Path, graph: onnx.GraphProto, names: Sequence[str] | None) -> Path:
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 9
    if names is not None:
        helper.set_model_props(model, {"names": str(dict(enumerate(names)))})
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path
