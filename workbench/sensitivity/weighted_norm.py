"""Proved scalar discrepancy: the matrix measure of the Jacobian in a weighted norm."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.optimize import linprog

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import System
from workbench.sensitivity.discrepancy import Discrepancy, Proof
from workbench.sensitivity.inputs import Inputs, mismatch
from workbench.sensitivity.jacobian import Cells, IntervalJacobian, refined, require_enclosed
from workbench.sensitivity.rounding import exp_integral_up, exp_up, mul_up, sum_up, up
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box

_RATES_TRIED = 24
# A half width below this is no unit to measure a state in.
_LEAST_UNIT = 1e-100


class Norm(enum.Enum):
    """MAX: max_i w_i |e_i|, measured by row sums; SUM: sum_i w_i |e_i|, by column sums."""

    MAX = "MAX"
    SUM = "SUM"


@final
@dataclass(frozen=True, slots=True)
class ExponentialGrowth:
    """||e(t)|| <= e^(c t) ||e(0)|| + int_0^t e^(c s) ds ||mismatch||.

    norm, weights: the norm, one weight > 0 per state (1 / the states' units); rate_per_s: c;
    mismatch: one bound >= 0 per state on what different inputs add to its rate.
    """

    norm: Norm
    weights: tuple[float, ...]
    rate_per_s: float
    mismatch: tuple[float, ...]

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """The bound divided by the weights, rounded up."""
        exponent = up(self.rate_per_s * t_s) if t_s and self.rate_per_s else 0.0
        grown = mul_up(self._norm(initial), exp_up(exponent) if exponent else 1.0)
        felt = self._norm(self.mismatch)
        if felt:
            grown = sum_up((grown, mul_up(felt, exp_integral_up(self.rate_per_s, t_s))))
        return tuple(up(grown / w) if grown else 0.0 for w in self.weights)

    def _norm(self, vector: tuple[float, ...]) -> float:
        terms = [mul_up(w, r) for w, r in zip(self.weights, vector, strict=True)]
        return max(terms) if self.norm is Norm.MAX else sum_up(terms)


@final
@dataclass(frozen=True, slots=True)
class WeightedNorm:
    """||e(t)|| <= e^(c t) ||e(0)|| with c >= sup over the region of mu(W J W^-1).

    MAX: mu = max_i (J_ii + sum_j |J_ij| w_i / w_j); SUM: the same by columns; J the interval
    Jacobian. weights: state -> weight > 0; None chooses those that minimise the guaranteed
    relative growth max_i |e_i(T)| / s_i over the horizon, from initial distances s_j, the region's
    half widths (one linear program per rate; its answer is only a proposal, c is computed
    afterwards by outward-rounded arithmetic). cells: the region is split into about this many,
    where mu is largest. inputs: what the trajectories share; what they do not enters as
    `ExponentialGrowth.mismatch`. Needs both trajectories in the (convex) region. Rigor
    ENCLOSED. Raises InputError where the Jacobian cannot be enclosed.
    Source: Maidens and Arcak, IEEE TAC 60(1), 2015.
    """

    norm: Norm
    weights: Mapping[str, float] | None
    cells: int
    inputs: Inputs

    def __post_init__(self) -> None:
        if self.cells < 1:
            raise InputError(f"expected at least 1 cell, got {self.cells}")
        require_weights(self.weights)

    def derive(self, system: System, *, region: Box, horizon_s: float) -> Discrepancy:
        """The bound with its weights and rate."""
        names = system.ode.names
        jacobian = IntervalJacobian(system)
        cells = jacobian.start(region)
        scale = half_widths(names, region)
        if self.weights is not None:
            weights = given_weights(names, self.weights)
        else:
            cells = self._split(jacobian, cells, 1.0 / scale, self.cells // 2)
            weights = _optimal(cells.magnitude, scale, horizon_s=horizon_s, norm=self.norm)
            cells = self._split(jacobian, cells, weights, 3 * self.cells // 4)
            weights = _optimal(cells.magnitude, scale, horizon_s=horizon_s, norm=self.norm)
        cells = self._split(jacobian, cells, weights, self.cells)
        require_enclosed(cells, names)
        growth = ExponentialGrowth(
            self.norm,
            tuple(weights.tolist()),
            float(measures(cells.magnitude, weights, self.norm).max()),
            mismatch(system, region=region, inputs=self.inputs, cells=cells),
        )
        kind = "max_i w_i |e_i|" if self.norm is Norm.MAX else "sum_i w_i |e_i|"
        return Discrepancy(
            names=names,
            region=region,
            horizon_s=horizon_s,
            rigor=Rigor.ENCLOSED,
            norm=f"weighted: ||e(t)|| <= exp(c t) ||e(0)||, ||e|| = {kind}",
            condition=self.inputs.condition,
            growth=growth,
            proof=Proof(self.inputs, cells),
        )

    def _split(
        self, jacobian: IntervalJacobian, cells: Cells, weights: Array, budget: int
    ) -> Cells:
        def score(candidates: Cells) -> Array:
            return measures(candidates.magnitude, weights, self.norm)

        return refined(jacobian, cells, budget=budget, score=score)


def measures(magnitude: Array, weights: Array, norm: Norm) -> Array:
    """Upper bounds (C,) on the matrix measures of Metzler majorants (C, n, n), rounded up."""
    with np.errstate(all="ignore"):
        entries = np.nextafter(magnitude * weights[:, None], np.inf)
        entries = np.nextafter(entries / weights, np.inf)
        entries = np.where(magnitude == 0.0, 0.0, entries)
    diagonal = np.arange(len(weights))
    entries[:, diagonal, diagonal] = magnitude[:, diagonal, diagonal]
    if norm is Norm.SUM:
        entries = entries.transpose(0, 2, 1)
    total = np.zeros(entries.shape[:2])
    for j in range(len(weights)):
        added = np.nextafter(total + entries[:, :, j], np.inf)
        total = np.where(entries[:, :, j] == 0.0, total, added)
    return np.asarray(np.where(np.isnan(total), np.inf, total).max(axis=1))


def _optimal(magnitude: Array, scale: Array, *, horizon_s: float, norm: Norm) -> Array:
    """Weights with the least guaranteed growth e^(c T) kappa(c) among a row of rates c.

    For a fixed c the Metzler condition is linear in 1/w (MAX) or w (SUM), and so is kappa.
    """
    plain = 1.0 / scale
    scaled = magnitude[np.isfinite(magnitude).all(axis=(1, 2))] * (
        scale[None, None, :] / scale[None, :, None]
    )
    if not len(scaled):
        return plain
    rows = _undominated(scaled if norm is Norm.MAX else scaled.transpose(0, 2, 1))
    ceiling = float(measures(magnitude, plain, norm).max())
    floor = max(float(np.linalg.eigvals(m).real.max()) for m in scaled)
    best, least = plain, math.inf
    for rate in np.linspace(floor, min(ceiling, floor + 50.0), _RATES_TRIED):
        vector = _vector(rows, float(rate), norm)
        if vector is None:
            continue
        spread = vector.max() if norm is Norm.MAX else vector.sum()
        growth = float(rate) * horizon_s + math.log(spread / vector.min())
        if growth < least:
            least, best = growth, (plain / vector if norm is Norm.MAX else plain * vector)
    return best


def _vector(rows: list[Array], rate: float, norm: Norm) -> Array | None:
    """v >= 1 with (M v)_i <= rate v_i for every row, of least spread; None where there is none."""
    size = len(rows)
    blocks = [
        np.hstack([r - rate * np.eye(size)[i], np.zeros((len(r), 1))]) for i, r in enumerate(rows)
    ]
    if norm is Norm.MAX:
        blocks.append(np.hstack([np.eye(size), -np.ones((size, 1))]))
        cost = np.append(np.zeros(size), 1.0)
    else:
        cost = np.append(np.ones(size), 0.0)
    matrix = np.vstack(blocks)
    bounds = [(1.0, 1e9)] * (size + 1)
    answer = linprog(cost, A_ub=matrix, b_ub=np.zeros(len(matrix)), bounds=bounds, method="highs")
    if not answer.success or answer.x is None:
        return None
    vector = np.asarray(answer.x[:size])
    return vector if np.all(np.isfinite(vector)) and np.all(vector > 0.0) else None


def _undominated(matrices: Array) -> list[Array]:
    """Per row index, the rows of all matrices that no other row exceeds everywhere."""
    result = []
    for i in range(matrices.shape[1]):
        rows = np.unique(matrices[:, i, :], axis=0)[::-1]
        keep: list[Array] = []
        for row in rows:
            if not any(np.all(row <= other) for other in keep):
                keep.append(row)
        result.append(np.array(keep))
    return result


def half_widths(names: tuple[str, ...], region: Box) -> Array:
    """Half widths (n,) of the region, the unit of each state; 1 where it has none to speak of."""
    widths = dict(zip(region.names, region.radius, strict=True))
    found = np.array([widths.get(name, 0.0) for name in names])
    return np.where(found > _LEAST_UNIT, found, 1.0)


def require_weights(weights: Mapping[str, float] | None) -> None:
    """Raise InputError unless all weights, if there are any, make a norm."""
    bad = {k: w for k, w in (weights or {}).items() if not (math.isfinite(w) and w > 0.0)}
    if bad:
        raise InputError(f"expected finite weights > 0, got {bad}")


def given_weights(names: tuple[str, ...], weights: Mapping[str, float]) -> Array:
    """The weights in the order of the states. Raises InputError unless there is one for each."""
    if set(weights) != set(names):
        raise InputError(f"expected one weight for each of {names}, got {sorted(weights)}")
    return np.array([float(weights[name]) for name in names])


def squared_weights(names: tuple[str, ...], weights: Mapping[str, float]) -> Array:
    """Their squares, as `given_weights`. Raises InputError where these leave the doubles."""
    with np.errstate(all="ignore"):
        squared = given_weights(names, weights) ** 2
    if not np.all((squared > 0.0) & np.isfinite(squared)):
        raise InputError(f"expected weights between 1e-150 and 1e150, got {dict(weights)}")
    return np.asarray(squared)
