"""What two trajectories have in common besides the system, and what it costs when they do not."""

from __future__ import annotations

import enum
from typing import final

import casadi as ca
import numpy as np

from workbench.errors import InputError
from workbench.models.signals import Ranged
from workbench.models.system import Ode, System
from workbench.sensitivity.jacobian import Cells
from workbench.sensitivity.kink_ranges import KinkRanges, decimal_hull, lifted
from workbench.sensitivity.kinks import SmoothForm, smooth_form
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box


class Inputs(enum.Enum):
    """Which parameters (constants) and disturbances (functions of time) the trajectories have.

    SHARED: the same for both. SAME_PARAMETERS: the same parameters; each has its own disturbances.
    AGAINST_NOMINAL: the second has the nominal ones, the first any. INDEPENDENT: each its own.
    All within their ranges.
    """

    SHARED = "the same parameters and the same disturbances (as functions of time)"
    SAME_PARAMETERS = "the same parameters, and disturbances that are any functions of time each"
    AGAINST_NOMINAL = (
        "any constant parameters and any disturbances over time for the first, the nominal ones "
        "for the second"
    )
    INDEPENDENT = "constant parameters and disturbances over time that are any for each"

    @property
    def condition(self) -> str:
        """For which pairs of trajectories a proved bound holds."""
        return (
            "both trajectories stay in the region up to the time asked for, with "
            f"{self.value}, within their ranges"
        )


def mismatch(system: System, *, region: Box, inputs: Inputs, cells: Cells) -> tuple[float, ...]:
    """m_i >= sup |f_i(x, p, w) - f_i(x, p', w')| over the cells and all pairs that `inputs` allow.

    m_i = max over the cells of sum_j sup |df_i / dq_j| gap_j, q = (p, w), by interval Jacobians
    with the kinks' generalised derivatives; gap_j bounds |q_j - q'_j|. One number per state, in its
    unit per second; 0 for SHARED. Rigor ENCLOSED. Raises InputError where the region lacks an axis
    that the derivative depends on, or the derivative cannot be enclosed.
    """
    ode = system.ode
    gaps = _gaps(ode, inputs)
    columns = np.flatnonzero(gaps).tolist()
    if not columns:
        return (0.0,) * len(ode.names)
    effect = _InputJacobian(smooth_form(ode), columns)
    unknown = [ode.names[i] for i in effect.axes if ode.names[i] not in region.names]
    if unknown:
        raise InputError(
            f"the effect of parameters and disturbances depends on {unknown}; give the region an "
            "interval for each of them"
        )
    total = np.zeros((len(cells.lower), len(ode.names)))
    sizes = effect.magnitudes(cells)
    for k, gap in enumerate(gaps[columns]):
        with np.errstate(all="ignore"):
            term = np.nextafter(sizes[:, :, k] * gap, np.inf)
            added = np.nextafter(total + term, np.inf)
        total = np.where(sizes[:, :, k] == 0.0, total, added)
    if not np.isfinite(total).all():
        raise InputError(
            "the derivative by parameters and disturbances could not be enclosed on the region; "
            "shrink the region or their ranges"
        )
    return tuple(total.max(axis=0).tolist())


@final
class _InputJacobian:
    """Encloses the generalised derivative of a field by the chosen entries of (p, w) over cells."""

    __slots__ = ("_function", "_kinks", "_size", "axes")

    def __init__(self, form: SmoothForm, columns: list[int]) -> None:
        ode, count = form.ode, form.kappa.numel()
        inputs = ca.vertcat(ode.p, ode.w)[columns]
        shares = [ca.SX.sym(name, count) for name in ("driver", "floor", "ceiling")]
        expression = ca.densify(_derivative(form, inputs, shares))
        self._size = expression.shape
        self._kinks = KinkRanges(form)
        self._function = lifted(
            ca.Function(
                "by_inputs",
                [ode.x, form.p, ode.w, form.kappa, *shares],
                [expression],
                ["x", "p", "w", "kappa", "driver", "floor", "ceiling"],
                ["value"],
            )
        )
        used = ca.which_depends(ca.vertcat(ca.vec(expression), form.drivers), ode.x, 1, False)
        self.axes: tuple[int, ...] = tuple(np.flatnonzero(used).tolist())

    def magnitudes(self, cells: Cells) -> Array:
        """sup |df_i / dq_j| over each cell: (C, n, columns); inf where it is not enclosed."""
        x = (np.ascontiguousarray(cells.lower.T), np.ascontiguousarray(cells.upper.T))
        kinks = self._kinks.on(x)
        low, high, valid = self._function(
            [x, *self._kinks.constant, kinks.kappa, kinks.driver, kinks.floor, kinks.ceiling]
        )
        size = np.where(valid == 1.0, np.maximum(np.abs(low), np.abs(high)), np.inf)
        size = np.where(np.isnan(size), np.inf, size)
        return np.asarray(size.T.reshape(-1, self._size[1], self._size[0]).transpose(0, 2, 1))


def _derivative(form: SmoothForm, inputs: ca.SX, shares: list[ca.SX]) -> ca.SX:
    """d field / d inputs with d kappa = driver d d + floor d floor + ceiling d ceiling."""
    driver, floor, ceiling = shares
    rows: list[ca.SX] = []
    for i in range(form.kappa.numel()):
        row = ca.jacobian(form.drivers[i], inputs)
        through = ca.jacobian(form.drivers[i], form.kappa)
        for j in range(i):
            row = row + through[j] * rows[j]
        rows.append(
            driver[i] * row
            + floor[i] * ca.jacobian(form.floor[i], inputs)
            + ceiling[i] * ca.jacobian(form.ceiling[i], inputs)
        )
    derivative = ca.jacobian(form.field, inputs)
    if rows:
        derivative = derivative + ca.jacobian(form.field, form.kappa) @ ca.vertcat(*rows)
    return ca.sparsify(derivative)


def _gaps(ode: Ode, inputs: Inputs) -> Array:
    """Bounds on |q_j - q'_j| for the parameters, then the disturbances."""
    if inputs is Inputs.SHARED:
        return np.zeros(len(ode.parameters) + len(ode.disturbances))
    same = inputs is Inputs.SAME_PARAMETERS
    return np.array(
        [
            *(0.0 if same else _gap(each, inputs) for each in ode.parameters),
            *(_gap(each, inputs) for each in ode.disturbances),
        ]
    )


def _gap(signal: Ranged, inputs: Inputs) -> float:
    if signal.lower == signal.upper:
        return 0.0
    low, high = decimal_hull(signal.lower)[0], decimal_hull(signal.upper)[1]
    if inputs is Inputs.AGAINST_NOMINAL:
        ends = decimal_hull(signal.nominal)
        return float(np.nextafter(max(high - ends[0], ends[1] - low), np.inf))
    return float(np.nextafter(high - low, np.inf))
