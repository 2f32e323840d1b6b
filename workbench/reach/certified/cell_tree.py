"""The binary tree of cuts behind the cells of a region."""

from __future__ import annotations

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.jacobian import Cells
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box

Split = dict[str, int | float] | None


def splits_of(cells: Cells, region: Box, names: tuple[str, ...]) -> list[Split]:
    """Cuts in preorder, the lower half first, None for a leaf: they cut `region` into `cells`.

    Each cut is {"axis": state number, "at": end point}; axes that the region lacks are not cut.
    Raises InputError where no sequence of cuts through whole parts gives these cells.
    """
    axes = [k for k, name in enumerate(names) if name in region.names]
    splits: list[Split] = []
    pending = [np.arange(len(cells.lower))]
    while pending:
        part = pending.pop()
        if len(part) == 1:
            splits.append(None)
            continue
        axis, at = _cut(cells.lower[part], cells.upper[part], axes)
        splits.append({"axis": axis, "at": at})
        below = cells.upper[part, axis] <= at
        pending += [part[np.flatnonzero(~below)], part[np.flatnonzero(below)]]
    return splits


def _cut(lower: Array, upper: Array, axes: list[int]) -> tuple[int, float]:
    for axis in axes:
        low, high = lower[:, axis], upper[:, axis]
        for at in np.unique(low)[1:].tolist():
            if not np.any((low < at) & (at < high)):
                return axis, at
    raise InputError(
        "expected cells that come from halving the region again and again; derive the bound with "
        "the methods of workbench.sensitivity"
    )
