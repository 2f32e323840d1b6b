"""A YOLO network from an ONNX file, run by ONNX Runtime."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
import onnxruntime

from workbench.errors import InputError
from workbench.perception.heads import Candidates, Head, decoded, head_of
from workbench.perception.letterbox import Image, letterboxed
from workbench.perception.suppression import suppressed

_TYPES: Final = {"tensor(float)": np.float32, "tensor(float16)": np.float16}


@final
@dataclass(frozen=True, slots=True)
class Network:
    """size: (height, width) of its input; names: of its classes, in their order."""

    session: Any
    size: tuple[int, int]
    names: tuple[str, ...]
    head: Head

    def candidates(self, image: Image, *, confidence: float, overlap: float) -> Candidates:
        """What it sees in an image (H, W, 3; 8-bit RGB), boxes in the image's pixels.

        confidence: least score; overlap: intersection over union above which the worse of two boxes
        of a class is dropped. Neither has a default: who is missed is decided here.
        """
        for name, value in (("confidence", confidence), ("overlap", overlap)):
            if not 0.0 < value <= 1.0:
                raise InputError(f"{name}: expected above 0 and up to 1, got {value!r}")
        framed, chart = letterboxed(image, self.size)
        fed = self.session.get_inputs()[0]
        answer = self.session.run(None, {fed.name: framed[None].astype(_TYPES[fed.type])})[0]
        found = suppressed(decoded(answer, self.head, confidence=confidence), overlap=overlap)
        if len(found.classes) and not 0 <= found.classes.min() <= found.classes.max() < len(
            self.names
        ):
            raise InputError(
                f"the network answered class {found.classes.max()}, and has {len(self.names)} names"
            )
        return Candidates(chart.to_image(found.boxes), found.scores, found.classes)


def load_network(
    path: str | Path,
    *,
    names: Sequence[str] | None = None,
    size: tuple[int, int] | None = None,
    head: Head | None = None,
    threads: int = 1,
) -> Network:
    """Load a network whose input is one RGB image of values 0 to 1 and whose output is a `Head`.

    names of classes, size and head are read from the file where it states them, and must be given
    where it does not. Networks that want BGR or values up to 255, or that leave the decoding of
    boxes to their user, cannot be told from others by their file: check one image by eye. Raises
    InputError for what cannot be used.
    """
    if not Path(path).is_file():
        raise InputError(f"{path}: no such network; expected an ONNX file")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3
    try:
        session = onnxruntime.InferenceSession(
            str(path), options, providers=["CPUExecutionProvider"]
        )
    except Exception as error:  # the runtime's errors share no class that it exports
        raise InputError(f"{path}: ONNX Runtime cannot load it ({error})") from error
    try:
        known = tuple(names) if names is not None else _stated_names(session)
        shape = tuple(session.get_outputs()[0].shape)
        return Network(session, _size(session, size), known, head or head_of(shape, len(known)))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _stated_names(session: Any) -> tuple[str, ...]:
    """The entry `names` of the file's metadata, as exporters of this family write it."""
    text = session.get_modelmeta().custom_metadata_map.get("names")
    if text is None:
        raise InputError("the file does not state the names of its classes; give names=...")
    try:
        stated = ast.literal_eval(text)
    except (SyntaxError, ValueError):
        stated = None
    if isinstance(stated, list):
        stated = dict(enumerate(stated))
    if not isinstance(stated, dict) or sorted(stated) != list(range(len(stated))) or not stated:
        raise InputError(
            f"names: expected a dictionary from 0, 1, ... to names, got {text[:80]!r}; give "
            "names=..."
        )
    return tuple(str(stated[k]) for k in range(len(stated)))


def _size(session: Any, given: tuple[int, int] | None) -> tuple[int, int]:
    inputs = session.get_inputs()
    if len(inputs) != 1 or inputs[0].type not in _TYPES or len(inputs[0].shape) != 4:
        got = [(each.name, each.type, each.shape) for each in inputs]
        raise InputError(f"expected one input [1, 3, height, width] of floats, got {got}")
    count, channels, *sides = inputs[0].shape
    if channels not in (3, None) and not isinstance(channels, str):
        raise InputError(f"expected an input of 3 colours, got {inputs[0].shape}")
    if isinstance(count, int) and count != 1:
        raise InputError(f"expected an input of one image, got {inputs[0].shape}")
    stated = tuple(side for side in sides if isinstance(side, int))
    if len(stated) == 2 and given not in (None, stated):
        raise InputError(f"size: the network's input is {stated}, got {given!r}; leave it out")
    if len(stated) == 2:
        return stated[0], stated[1]
    given = given or _trained_size(session)
    if given is None or min(given) < 1:
        raise InputError("the network leaves its input's size open; give size=(height, width)")
    return given


def _trained_size(session: Any) -> tuple[int, int] | None:
    """The entry `imgsz` of the metadata, [height, width], of a network that takes any size."""
    text = session.get_modelmeta().custom_metadata_map.get("imgsz", "")
    found = re.fullmatch(r"\[(\d+), *(\d+)\]", text)
    return (int(found[1]), int(found[2])) if found else None
