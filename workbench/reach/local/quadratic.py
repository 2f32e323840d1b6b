"""Quadratic norms of groups of states along a trajectory; their metrics may change on the way."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.reach.local.along import Step
from workbench.reach.local.forecast import likely_hulls, likely_spread, likely_units
from workbench.reach.local.growth import grown
from workbench.reach.local.reference import Reference
from workbench.reach.tube import Array
from workbench.sensitivity.block_choice import Proposals
from workbench.sensitivity.blockwise import Blocks, Metric, box_norm, comparison_bounds, part_of
from workbench.sensitivity.jacobian import Cells
from workbench.sensitivity.metric_bounds import Form, coupling_bounds, uncertain_entries
from workbench.sensitivity.metric_proposal import Aim

_HULLS_PER_PROPOSAL = 6
_MOST_VERTICES = 14


@final
@dataclass(frozen=True, slots=True)
class LocalEffort:
    """How metrics are chosen and proved along a trajectory.

    vertices: hulls with at most this many uncertain entries in a block are covered by their
    extreme matrices (exact, two to the power of the entries), others by centre and radius;
    condition_max: largest ratio of a metric's eigenvalues in units of the likely spread; proposals:
    at how many evenly spaced steps a metric is proposed, the start included.
    """

    vertices: int
    condition_max: float
    proposals: int

    def __post_init__(self) -> None:
        if not 0 <= self.vertices <= _MOST_VERTICES:
            raise InputError(f"expected vertices from 0 to {_MOST_VERTICES}, got {self.vertices}")
        if self.proposals < 1:
            raise InputError(f"expected at least 1 proposal, got {self.proposals}")
        if not self.condition_max >= 1.0:
            raise InputError(f"expected condition_max >= 1, got {self.condition_max!r}")

    def form(self, lower: Array, upper: Array, blocks: Blocks) -> Form:
        """How the hulls [lower, upper] (C, n, n) are covered, with these blocks."""
        uncertain = uncertain_entries(lower, upper).astype(np.float64)
        counts = [
            part_of(uncertain, rows, columns).sum(axis=(1, 2)).max()
            for rows in blocks
            for columns in blocks
        ]
        return Form.VERTICES if max(counts) <= self.vertices else Form.CENTRE_RADIUS


@final
@dataclass(frozen=True, slots=True)
class Ellipsoids:
    """{|e_k| <= norms_k}: |e_k|^2 = e_k^T P_k e_k for the states e_k of block k."""

    norms: Array
    metrics: tuple[Metric, ...]


@final
@dataclass(frozen=True, slots=True)
class Forecast:
    """What metrics are chosen from: likely spread (K+1, n), units (n,), hulls of the Jacobian."""

    reference: Reference
    spread: Array
    units: Array
    hulls: Cells

    @classmethod
    def of(cls, reference: Reference) -> Forecast:
        """From a few runs about the reference."""
        spread = likely_spread(reference)
        hulls = likely_hulls(reference, spread, _thinned(0, len(reference.tube.lower)))
        return cls(reference, spread, likely_units(spread), hulls)

    def proposals(self, first: int, blocks: Blocks, effort: LocalEffort) -> Proposals:
        """Metrics of blocks, or of parts of them, for the steps from `first` to the end."""
        tube, hulls = self.reference.tube, self.hulls
        if first:
            steps = _thinned(first, len(tube.lower))
            hulls = likely_hulls(self.reference, self.spread, steps)
        horizon_s = float(tube.times[-1] - tube.times[first])
        form = effort.form(hulls.jacobian_lower, hulls.jacobian_upper, blocks)
        aim = Aim(horizon_s, effort.condition_max, diagonal=False, form=form)
        return Proposals(hulls, scale=self.units, aim=aim)

    def bound(
        self, blocks: Blocks, effort: LocalEffort, first: Proposals | None = None
    ) -> QuadraticBound:
        """The bound with metrics proposed at evenly spaced steps; `first` is used at step 0."""
        steps = len(self.reference.tube.lower)
        starts = sorted({i * steps // effort.proposals for i in range(effort.proposals)})
        plan = {
            k: (first if first and k == 0 else self.proposals(k, blocks, effort)).metrics(blocks)
            for k in starts
        }
        return QuadraticBound(blocks, plan, effort, self.units, self.reference.tube.times)


@final
@dataclass(frozen=True, slots=True)
class QuadraticBound:
    """|e_k|' <= sum_l C_kl |e_l| + |d_k|, C proved for each step's mean Jacobian (`metric_bounds`).

    plan: metrics to start with, at step 0, and proposals for later steps; one is taken when the
    half widths that it promises at the end are smaller, and multiplies |e_k| by the largest
    |e|_new / |e|_old, sqrt(lambda_max(P_old^-1/2 P_new P_old^-1/2)), which is proved too.
    """

    blocks: Blocks
    plan: Mapping[int, tuple[Metric, ...]]
    effort: LocalEffort
    units: Array
    times: Array

    def start(self, radius: Array) -> Ellipsoids:
        """Around the box, in the first metrics."""
        return Ellipsoids(self._norms(self.plan[0], radius), self.plan[0])

    def advance(self, state: Ellipsoids, step: Step) -> tuple[Ellipsoids, Array]:
        """In new metrics first, if this step proposes any that are worth their price."""
        if step.index in self.plan and step.index > 0:
            moved = changed(state, self.plan[step.index])
            if self._promise(moved, step) < self._promise(state, step):
                state = moved
        end, throughout = self._grown(state, step, step.length_s)
        return Ellipsoids(end, state.metrics), self.half_widths(
            Ellipsoids(throughout, state.metrics)
        )

    def half_widths(self, state: Ellipsoids) -> Array:
        """sqrt((P^-1)_ii) |e|."""
        result = np.zeros(len(self.units))
        for block, metric, norm in zip(self.blocks, state.metrics, state.norms, strict=True):
            result[list(block)] = np.nextafter(extents(metric) * norm, np.inf)
        return result

    def condition(self, state: Ellipsoids) -> float:
        """The largest one of the blocks."""
        numbers = [1.0]
        for block, metric in zip(self.blocks, state.metrics, strict=True):
            units = self.units[list(block)]
            numbers.append(float(np.linalg.cond(np.array(metric) * np.outer(units, units))))
        return max(numbers)

    def _grown(self, state: Ellipsoids, step: Step, length_s: float) -> tuple[Array, Array]:
        hull = step.lower[None], step.upper[None]
        comparison = comparison_bounds(
            *hull,
            blocks=self.blocks,
            metrics=state.metrics,
            form=self.effort.form(*hull, self.blocks),
        )[0]
        if not np.isfinite(comparison).all():
            return (np.full(len(self.blocks), np.inf),) * 2
        return grown(comparison, state.norms, self._norms(state.metrics, step.felt), length_s)

    def _promise(self, state: Ellipsoids, step: Step) -> float:
        """Mean logarithm of the half widths at the end if all steps were like this one."""
        end, _ = self._grown(state, step, float(self.times[-1] - self.times[step.index]))
        widths = self.half_widths(Ellipsoids(end, state.metrics)) / self.units
        return float(np.log(np.maximum(widths, 1e-300)).mean())

    def _norms(self, metrics: tuple[Metric, ...], half_widths: Array) -> Array:
        pairs = zip(self.blocks, metrics, strict=True)
        return np.array([box_norm(P, tuple(half_widths[list(b)].tolist())) for b, P in pairs])


def changed(state: Ellipsoids, metrics: tuple[Metric, ...]) -> Ellipsoids:
    """The same set, enclosed in ellipsoids of other metrics."""
    factors = [change_factor(*pair) for pair in zip(state.metrics, metrics, strict=True)]
    return Ellipsoids(np.nextafter(state.norms * np.array(factors), np.inf), metrics)


@functools.lru_cache(maxsize=4096)
def change_factor(old: Metric, new: Metric) -> float:
    """c with |e|_new <= c |e|_old for all e, proved; inf where nothing is."""
    unit = np.eye(len(old))[None]
    bound = coupling_bounds(unit, unit, row=np.array(new), column=np.array(old), form=Form.VERTICES)
    return float(bound[0])


@functools.lru_cache(maxsize=4096)
def extents(metric: Metric) -> Array:
    """c (n,) with |e_i| <= c_i |e|_P: sqrt((P^-1)_ii), proved; inf where nothing is."""
    unit = np.eye(len(metric))[:, None, :]
    return coupling_bounds(unit, unit, row=np.eye(1), column=np.array(metric), form=Form.VERTICES)


def _thinned(first: int, last: int) -> list[int]:
    count = min(_HULLS_PER_PROPOSAL, last - first)
    return sorted({round(k) for k in np.linspace(first, last - 1, count)})
