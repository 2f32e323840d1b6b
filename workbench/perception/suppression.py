"""Of boxes that show the same thing, the best one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from workbench.perception.heads import Candidates
from workbench.perception.letterbox import Floats


def overlaps(box: Floats, others: Floats) -> Floats:
    """Intersection over union of one box (4,) with others (N, 4); 0 where the union is empty."""
    low = np.maximum(box[:2], others[:, :2])
    high = np.minimum(box[2:], others[:, 2:])
    common = np.prod(np.maximum(high - low, 0.0), axis=1)
    union = _area(box[None]) + _area(others) - common
    share: Floats = np.divide(common, union, out=np.zeros_like(common), where=union > 0.0)
    return share


def suppressed(found: Candidates, *, overlap: float) -> Candidates:
    """The candidates of which no better one of their class covers more than `overlap`.

    Greedy, from the highest score on (of equals, the first): one is kept unless its intersection
    over union with a kept one of its class is above `overlap`.
    """
    order = np.argsort(-found.scores, kind="stable")
    kept: list[int] = []
    for number in np.unique(found.classes):
        kept += _kept(found.boxes, order[found.classes[order] == number], overlap)
    chosen = np.array(sorted(kept, key=lambda k: (-found.scores[k], k)), dtype=np.intp)
    return Candidates(found.boxes[chosen], found.scores[chosen], found.classes[chosen])


def _kept(boxes: Floats, order: npt.NDArray[np.intp], overlap: float) -> list[int]:
    kept = []
    while len(order):
        best, order = order[0], order[1:]
        kept.append(int(best))
        order = order[overlaps(boxes[best], boxes[order]) <= overlap]
    return kept


def _area(boxes: Floats) -> Floats:
    sides = np.maximum(boxes[:, 2:] - boxes[:, :2], 0.0)
    area: Floats = np.prod(sides, axis=1)
    return area
