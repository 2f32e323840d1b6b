"""Interval enclosures of the generalised Jacobian of a field over the cells of a region."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from workbench.errors import InputError
from workbench.models.system import System
from workbench.runtime.floats import float_mode_fault
from workbench.sensitivity.kink_ranges import KinkRanges, lifted
from workbench.sensitivity.kinks import generalised_jacobian, smooth_form
from workbench.sensitivity.vectorised import Array, Index
from workbench.sets.box import Box


@final
@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """C cells that cover a region, with J(x) in [jacobian_lower, jacobian_upper] on each.

    lower, upper (C, n); jacobian_lower, jacobian_upper (C, n, n), infinite where it could not be
    enclosed. Holds for every parameter and disturbance in their ranges.
    """

    lower: Array
    upper: Array
    jacobian_lower: Array
    jacobian_upper: Array

    @property
    def magnitude(self) -> Array:
        """Metzler majorants (C, n, n): diagonal sup J_ii, elsewhere sup |J_ij|."""
        bound = np.maximum(np.abs(self.jacobian_lower), np.abs(self.jacobian_upper))
        diagonal = np.arange(bound.shape[1])
        bound[:, diagonal, diagonal] = self.jacobian_upper[:, diagonal, diagonal]
        return bound


@final
class IntervalJacobian:
    """Encloses the generalised Jacobian of `system` over boxes, many at once.

    Constants of the graph are symbols, kinks have interval selectors (see `kinks`), every
    operation is outward rounded. Raises InputError for a field that has no derivative, and where
    the processor does not compute as the rounding assumes.
    """

    __slots__ = ("_jacobian", "_kinks", "_names", "axes")

    def __init__(self, system: System) -> None:
        fault = float_mode_fault()
        if fault is not None:
            raise InputError(f"expected IEEE-754 arithmetic rounded to nearest, but {fault}")
        form = smooth_form(system.ode)
        expression, selector = generalised_jacobian(form)
        ode, x = system.ode, system.ode.x
        shared = [x, form.p, ode.w, form.kappa]
        names = ["x", "p", "w", "kappa"]
        jacobian = ca.Function(
            "jacobian",
            [*shared, selector],
            [ca.densify(expression)],
            [*names, "selector"],
            ["value"],
        )
        self._names = ode.names
        self._jacobian = lifted(jacobian)
        self._kinks = KinkRanges(form)
        used = ca.which_depends(ca.vertcat(ca.vec(expression), form.drivers), x, 1, False)
        self.axes: tuple[int, ...] = tuple(np.flatnonzero(used).tolist())

    def on(self, lower: Array, upper: Array) -> Cells:
        """Enclosures on the cells lower <= x <= upper, both (C, n)."""
        count, size = lower.shape
        x = (np.ascontiguousarray(lower.T), np.ascontiguousarray(upper.T))
        kinks = self._kinks.on(x)
        low, high, valid = self._jacobian([x, *self._kinks.constant, kinks.kappa, kinks.driver])
        good = (valid == 1.0) & np.isfinite(low).all(axis=0) & np.isfinite(high).all(axis=0)
        low = np.where(good, low, -np.inf).T.reshape(count, size, size).transpose(0, 2, 1)
        high = np.where(good, high, np.inf).T.reshape(count, size, size).transpose(0, 2, 1)
        return Cells(lower, upper, low, high)

    def start(self, region: Box) -> Cells:
        """One cell: the region, with unrestricted axes that the Jacobian does not feel set to 0.

        Raises InputError naming an axis that the region lacks although the Jacobian depends on it.
        """
        names = self._names
        missing = [names[i] for i in self.axes if names[i] not in region.names]
        if missing:
            raise InputError(
                f"the Jacobian depends on {missing}; give the region an interval for each of them"
            )
        ends = [region.interval(name) if name in region.names else (0.0, 0.0) for name in names]
        return self.on(np.array([[low for low, _ in ends]]), np.array([[high for _, high in ends]]))


def refined(
    jacobian: IntervalJacobian, cells: Cells, *, budget: int, score: Callable[[Cells], Array]
) -> Cells:
    """Split the cells with the highest `score` (C,) until there are about `budget` of them.

    Each chosen cell is halved along the axis whose halves have the lowest worst score.
    """
    axes = [i for i in jacobian.axes if np.any(cells.upper[:, i] > cells.lower[:, i])]
    while axes and len(cells.lower) < budget:
        scores = score(cells)
        most = max(1, min(budget - len(cells.lower), len(scores) // 4))
        order = np.argsort(-scores, kind="stable")
        chosen, kept = order[:most], order[most:]
        halves = _best_halves(jacobian, cells, chosen, axes=axes, score=score)
        cells = _joined([_taken(cells, kept), halves])
    return cells


def require_enclosed(cells: Cells, names: tuple[str, ...]) -> None:
    """Raise InputError with the first cell on which the Jacobian could not be enclosed."""
    bad = np.flatnonzero(~np.isfinite(cells.jacobian_upper).all(axis=(1, 2)))
    if len(bad):
        cell = dict(
            zip(
                names,
                zip(cells.lower[bad[0]].tolist(), cells.upper[bad[0]].tolist(), strict=True),
                strict=True,
            )
        )
        raise InputError(
            f"the Jacobian could not be enclosed on {cell} (a pole, a domain or an overflow); "
            "shrink the region there or allow more cells"
        )


def _best_halves(
    jacobian: IntervalJacobian,
    cells: Cells,
    chosen: Index,
    *,
    axes: list[int],
    score: Callable[[Cells], Array],
) -> Cells:
    options = [
        jacobian.on(*_halved(cells.lower[chosen], cells.upper[chosen], axis)) for axis in axes
    ]
    worst = np.array([score(option).reshape(2, -1).max(axis=0) for option in options])
    widths = (cells.upper - cells.lower)[chosen][:, axes].T
    worst = np.where(widths > 0.0, worst, np.inf)
    # Where every choice is equally bad (an enclosure still fails), the widest axis is halved.
    stuck = np.all(worst == worst[0], axis=0) | ~np.isfinite(worst).any(axis=0)
    best = np.where(stuck, np.argmax(widths, axis=0), np.argmin(worst, axis=0))
    count = len(chosen)
    rows = [np.flatnonzero(best == k) for k in range(len(axes))]
    return _joined(
        [
            _taken(option, np.concatenate([r, r + count]))
            for option, r in zip(options, rows, strict=True)
        ]
    )


def _halved(lower: Array, upper: Array, axis: int) -> tuple[Array, Array]:
    middle = lower[:, axis] + 0.5 * (upper[:, axis] - lower[:, axis])
    left, right = upper.copy(), lower.copy()
    left[:, axis], right[:, axis] = middle, middle
    return np.concatenate([lower, right]), np.concatenate([left, upper])


def _taken(cells: Cells, rows: Index) -> Cells:
    return Cells(
        cells.lower[rows], cells.upper[rows], cells.jacobian_lower[rows], cells.jacobian_upper[rows]
    )


def _joined(parts: list[Cells]) -> Cells:
    return Cells(
        np.concatenate([part.lower for part in parts]),
        np.concatenate([part.upper for part in parts]),
        np.concatenate([part.jacobian_lower for part in parts]),
        np.concatenate([part.jacobian_upper for part in parts]),
    )
