"""Which states share a norm, and which norms: proposals, judged by the growth they promise."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import final

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from workbench.errors import InputError
from workbench.sensitivity.blockwise import (
    Blocks,
    BlockwiseGrowth,
    Metric,
    comparison_bounds,
    part_of,
    rows,
)
from workbench.sensitivity.jacobian import Cells
from workbench.sensitivity.metric_bounds import Form
from workbench.sensitivity.metric_proposal import Aim, propose_metric
from workbench.sensitivity.vectorised import Array


@final
class Proposals:
    """Metrics for blocks of states, from the Jacobian hulls of some cells; each is found once.

    scale (n,): the states' units, in which growth is promised.
    """

    __slots__ = ("_aim", "_cells", "_found", "_scale")

    def __init__(self, cells: Cells, *, scale: Array, aim: Aim) -> None:
        self._cells = cells
        self._scale = scale
        self._aim = aim
        self._found: dict[tuple[int, ...], Metric] = {}

    def metrics(self, blocks: Blocks) -> tuple[Metric, ...]:
        """One metric per block."""
        for block in blocks:
            if block not in self._found:
                hulls = (self._cells.jacobian_lower, self._cells.jacobian_upper)
                low, high = (part_of(ends, block, block) for ends in hulls)
                metric = propose_metric(low, high, scale=self._scale[list(block)], aim=self._aim)
                self._found[block] = rows(metric)
        return tuple(self._found[block] for block in blocks)

    def promise(self, blocks: Blocks) -> float:
        """Mean logarithm over the states of the growth of the unit box over the horizon."""
        metrics = self.metrics(blocks)
        bounds = comparison_bounds(
            self._cells.jacobian_lower,
            self._cells.jacobian_upper,
            blocks=blocks,
            metrics=metrics,
            form=Form.CENTRE_RADIUS,
        )
        none = (0.0,) * len(self._scale)
        growth = BlockwiseGrowth(blocks, metrics, rows(bounds.max(axis=0)), none)
        reached = growth.half_widths(tuple(self._scale.tolist()), self._aim.horizon_s)
        return float(np.log(np.array(reached) / self._scale).mean())


def feedback_groups(cells: Cells) -> Blocks:
    """Strongly connected groups of states, by the entries of the hulls that are not always 0."""
    pattern = np.any((cells.jacobian_lower != 0.0) | (cells.jacobian_upper != 0.0), axis=0)
    count, label = connected_components(csr_array(pattern), directed=True, connection="strong")
    return tuple(sorted(tuple(np.flatnonzero(label == k).tolist()) for k in range(count)))


def core_and_translations(cells: Cells) -> Blocks:
    """The states that some state depends on, together, and every other one alone."""
    felt = np.any((cells.jacobian_lower != 0.0) | (cells.jacobian_upper != 0.0), axis=(0, 1))
    core = tuple(np.flatnonzero(felt).tolist())
    alone = tuple((i,) for i in np.flatnonzero(~felt).tolist())
    return ((core,) if core else ()) + alone


def separated(blocks: Blocks, promise: Callable[[Blocks], float]) -> Blocks:
    """Take states out of their blocks, one at a time, as long as `promise` falls."""
    least = promise(blocks)
    while True:
        options = [_without(blocks, i) for block in blocks if len(block) > 1 for i in block]
        values = [promise(option) for option in options]
        if not options or not min(values) < least or not math.isfinite(min(values)):
            return blocks
        least, blocks = min(zip(values, options, strict=True))


def named_blocks(names: tuple[str, ...], blocks: tuple[tuple[str, ...], ...]) -> Blocks:
    """Blocks of indices from blocks of names. Raises InputError unless they are a partition."""
    if sorted(name for block in blocks for name in block) != sorted(names) or () in blocks:
        raise InputError(
            f"expected blocks with every state of {names} in exactly one, got {blocks}"
        )
    return tuple(tuple(sorted(names.index(name) for name in block)) for block in blocks)


def _without(blocks: Blocks, state: int) -> Blocks:
    rest = [tuple(i for i in block if i != state) for block in blocks]
    return tuple(sorted([*rest, (state,)]))
