"""Matrix measures along a trajectory: one scalar in a norm with fixed weights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.models.system import System
from workbench.reach.local.along import LocalRun, Step, require_step, run_along, tube_along
from workbench.reach.local.forecast import likely_region, likely_spread, likely_units
from workbench.reach.local.growth import grown
from workbench.reach.local.reference import Reference
from workbench.reach.tube import Array, ReachTube
from workbench.sensitivity.blockwise import BlockwiseGrowth, box_norm, rows
from workbench.sensitivity.euclidean_norm import EuclideanNorm
from workbench.sensitivity.inputs import Inputs
from workbench.sensitivity.metric_bounds import diagonal_rates
from workbench.sensitivity.rounding import mul_up, sqrt_up, sum_up, up
from workbench.sensitivity.weighted_norm import (
    ExponentialGrowth,
    Norm,
    WeightedNorm,
    given_weights,
    measures,
    require_weights,
    squared_weights,
)
from workbench.sets import Box

_CELLS_TO_PROPOSE = 8


@final
@dataclass(frozen=True, slots=True)
class LocalNorm:
    """||x - x*||' <= mu(W M W^-1) ||x - x*|| + ||d||: row sums (MAX) or column sums (SUM).

    MAX: max_i w_i |e_i|; SUM: sum_i w_i |e_i|; M, d as in `Step`. weights: state -> weight > 0;
    None chooses those that `WeightedNorm` proposes over the region the runs are likely to need.
    step_s: length of a step in s. The weights stay, the rate is that of each step. Rigor ENCLOSED;
    ends early as `run_along` says. Source: Maidens and Arcak, IEEE TAC 60(1), 2015.
    """

    norm: Norm
    weights: Mapping[str, float] | None
    step_s: float

    def __post_init__(self) -> None:
        require_step(self.step_s)
        require_weights(self.weights)

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """A tube from `initial_set` (axes = state names) over [0, horizon_s]."""
        return tube_along(self, system, initial_set=initial_set, horizon_s=horizon_s)

    def along(self, reference: Reference) -> LocalRun:
        """The tube about a trajectory that is known."""
        spread = likely_spread(reference)
        weights = self._weights(reference, spread)
        factors = tuple(weights.tolist())

        def norm(vector: Array) -> float:
            terms = [mul_up(w, r) for w, r in zip(factors, vector.tolist(), strict=True)]
            return max(terms) if self.norm is Norm.MAX else sum_up(terms)

        def rate(step: Step) -> float:
            return float(measures(step.magnitude[None], weights, self.norm)[0])

        extents = np.nextafter(1.0 / weights, np.inf)
        number = _condition(weights, spread)
        return run_along(reference, _Scalar(norm, rate, extents, number))

    def _weights(self, reference: Reference, spread: Array) -> Array:
        if self.weights is not None:
            return given_weights(reference.system.ode.names, self.weights)
        method = WeightedNorm(self.norm, None, _CELLS_TO_PROPOSE, Inputs.SHARED)
        growth = _proposed(method, reference, spread)
        if growth is None:
            return np.asarray(1.0 / likely_units(spread))
        if not isinstance(growth, ExponentialGrowth):
            raise TypeError(f"expected an ExponentialGrowth, got {type(growth).__name__}")
        return np.array(growth.weights)


@final
@dataclass(frozen=True, slots=True)
class LocalEuclidean:
    """||x - x*||' <= mu_2(W M W^-1) ||x - x*|| + ||d||, ||e|| = sqrt(sum_i w_i^2 e_i^2).

    weights: state -> weight > 0; None chooses those that `EuclideanNorm` proposes (by semidefinite
    programs) over the region the runs are likely to need. The rest as in `LocalNorm`; the measure
    is proved by outward-rounded elimination at sign vertices (Rohn, SIAM J. Matrix Anal. Appl.
    15(1), 1994). Rigor ENCLOSED; ends early as `run_along` says.
    """

    weights: Mapping[str, float] | None
    step_s: float

    def __post_init__(self) -> None:
        require_step(self.step_s)
        require_weights(self.weights)

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """A tube from `initial_set` (axes = state names) over [0, horizon_s]."""
        return tube_along(self, system, initial_set=initial_set, horizon_s=horizon_s)

    def along(self, reference: Reference) -> LocalRun:
        """The tube about a trajectory that is known."""
        spread = likely_spread(reference)
        squared = self._squared(reference, spread)
        metric = rows(np.diag(squared))

        def norm(vector: Array) -> float:
            return box_norm(metric, tuple(vector.tolist()))

        def rate(step: Step) -> float:
            hull = step.lower[None], step.upper[None]
            return float(diagonal_rates(*hull, squared_weights=squared)[0])

        extents = np.array([sqrt_up(up(1.0 / value)) for value in squared.tolist()])
        number = _condition(np.sqrt(squared), spread)
        return run_along(reference, _Scalar(norm, rate, extents, number))

    def _squared(self, reference: Reference, spread: Array) -> Array:
        if self.weights is not None:
            return squared_weights(reference.system.ode.names, self.weights)
        growth = _proposed(EuclideanNorm(None, _CELLS_TO_PROPOSE, Inputs.SHARED), reference, spread)
        if growth is None:
            return np.asarray(1.0 / likely_units(spread) ** 2)
        if not isinstance(growth, BlockwiseGrowth):
            raise TypeError(f"expected a BlockwiseGrowth, got {type(growth).__name__}")
        return np.diag(np.array(growth.metrics[0]))


def _condition(weights: Array, spread: Array) -> float:
    """Condition number of W^2 in units of the likely spread."""
    scaled = weights * likely_units(spread)
    return float((scaled.max() / scaled.min()) ** 2)


def _proposed(method: WeightedNorm | EuclideanNorm, reference: Reference, spread: Array) -> object:
    """The growth that the method finds for the likely region, of which only the norm is used.

    None where the Jacobian has no bounds there; the tube may stay in less than this region.
    """
    region = likely_region(reference, spread)
    horizon_s = float(reference.tube.times[-1])
    try:
        return method.derive(reference.system, region=region, horizon_s=horizon_s).growth
    except InputError:
        return None


@final
@dataclass(frozen=True, slots=True)
class _Scalar:
    """The set {norm(e) <= r}; the state is r.

    extents (n,): bounds on |e_i| / norm(e); number: the condition number.
    """

    norm: Callable[[Array], float]
    rate: Callable[[Step], float]
    extents: Array
    number: float

    def start(self, radius: Array) -> float:
        return self.norm(radius)

    def advance(self, state: float, step: Step) -> tuple[float, Array]:
        felt = np.array([self.norm(step.felt)])
        rate = np.array([[self.rate(step)]])
        end, throughout = grown(rate, np.array([state]), felt, step.length_s)
        return float(end[0]), self.half_widths(float(throughout[0]))

    def half_widths(self, state: float) -> Array:
        return np.nextafter(self.extents * state, np.inf)

    def condition(self, state: float) -> float:
        del state
        return self.number
