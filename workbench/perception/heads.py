"""What the last layer of a YOLO network says: candidates with box, class and score."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final, final

import numpy as np
import numpy.typing as npt

from workbench.errors import InputError
from workbench.perception.letterbox import Floats


@final
class Head(enum.Enum):
    """Layout of the output, C classes and N candidates; boxes in pixels of the input.

    CLASSES (v8, v9, v11 and their like): [1, 4 + C, N], cx, cy, width, height, a score per class.
    OBJECTNESS (v5, v7): [1, N, 5 + C], cx, cy, width, height, objectness, a score per class; the
    score is objectness times the class's. SELECTED (v10): [1, N, 6], left, top, right, bottom,
    score, class.
    """

    CLASSES = "classes"
    OBJECTNESS = "objectness"
    SELECTED = "selected"


@final
@dataclass(frozen=True, slots=True)
class Candidates:
    """boxes: (M, 4) as left, top, right, bottom in pixels of the input; scores, classes: (M,)."""

    boxes: Floats
    scores: Floats
    classes: npt.NDArray[np.intp]


_SELECTED_NUMBERS: Final = 6


def head_of(shape: tuple[int | str | None, ...], classes: int) -> Head:
    """The one head that an output of this shape can be with so many classes; InputError else."""
    fits = []
    if len(shape) == 3:
        if shape[1] == 4 + classes:
            fits.append(Head.CLASSES)
        if shape[2] == 5 + classes:
            fits.append(Head.OBJECTNESS)
        if shape[2] == _SELECTED_NUMBERS:
            fits.append(Head.SELECTED)
    if len(fits) == 1:
        return fits[0]
    layouts = f"[1, {4 + classes}, N], [1, N, {5 + classes}] or [1, N, 6]"
    raise InputError(
        f"expected an output {layouts} for {classes} classes, got {list(shape)}, which fits "
        f"{' and '.join(str(each) for each in fits) or 'none'}; name the head, or export the "
        "network with its boxes decoded"
    )


def decoded(output: npt.NDArray[np.floating], head: Head, *, confidence: float) -> Candidates:
    """Every box and class with a score of at least `confidence`.

    A box counts once for each class that reaches it: who is a little more like a dog than like a
    person stays a possible person. Raises InputError for numbers that are not finite, which would
    otherwise drop people without a word.
    """
    numbers = np.asarray(output, dtype=np.float64)
    if numbers.ndim != 3 or numbers.shape[0] != 1:
        raise InputError(f"expected an output for one image, got shape {numbers.shape}")
    if not np.isfinite(numbers).all():
        raise InputError(
            "the network answered NaN or infinity; expected finite numbers, export it again in "
            "full precision"
        )
    rows = numbers[0].T if head is Head.CLASSES else numbers[0]
    if head is Head.SELECTED:
        keep = rows[:, 4] >= confidence
        return Candidates(rows[keep, :4], rows[keep, 4], rows[keep, 5].astype(np.intp))
    scores = rows[:, 4:] if head is Head.CLASSES else rows[:, 5:] * rows[:, 4:5]
    which, classes = np.nonzero(scores >= confidence)
    half = 0.5 * rows[which, 2:4]
    centre = rows[which, :2]
    boxes = np.concatenate([centre - half, centre + half], axis=1)
    return Candidates(boxes, scores[which, classes], classes)
