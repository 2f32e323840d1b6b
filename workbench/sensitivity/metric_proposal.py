"""Metrics proposed by semidefinite programs; nothing here is proved, and nothing needs to be.

The rate of `MetricProgram` is bisected down to where no metric is found; among all that were found
the one with the least promised growth e^(r T) max_i sqrt((P^-1)_ii) is taken, r its actual rate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from workbench.sensitivity.interval_arrays import point, positive_definite
from workbench.sensitivity.metric_bounds import (
    SIGNED_MOST,
    Form,
    extreme_matrices,
    metric_rates,
    sign_vectors,
    uncertain_entries,
)
from workbench.sensitivity.vectorised import Array

if TYPE_CHECKING:
    from workbench.sensitivity.metric_program import MetricProgram

_BISECTIONS_MOST = 24
# What bisection leaves open changes the growth over the horizon by less than this share.
_RESOLUTION = 0.01
_RATES_ABOVE = (0.02, 0.06, 0.15, 0.3, 0.6)
_CUTS_MOST = 8
_SLACK = 1e-3
_BITS = 26
_MOST_EXTREMES = 2**14


@final
@dataclass(frozen=True, slots=True)
class Aim:
    """What a metric is chosen for.

    horizon_s: growth counts over this time; condition_max: largest ratio of P's eigenvalues in
    units of the scale; diagonal: P has no other entries; form: how the matrices' hulls are covered.
    """

    horizon_s: float
    condition_max: float
    diagonal: bool
    form: Form


def propose_metric(lower: Array, upper: Array, *, scale: Array, aim: Aim) -> Array:
    """A metric P (n, n) in which the matrices of the hulls [lower, upper] (C, n, n) grow little.

    scale (n,): the states' units, such as half widths of the region or of the initial set. The
    entries of P are exactly symmetric and have 26 bits. Without any metric from the programs,
    diag(1 / scale^2).
    """
    plain = np.diag(1.0 / scale**2)
    known = np.isfinite(lower).all(axis=(1, 2)) & np.isfinite(upper).all(axis=(1, 2))
    if len(scale) == 1 or not known.any():
        return _shortened(plain)
    units = scale[None, None, :] / scale[None, :, None]
    search = _Search(lower[known] * units, upper[known] * units, aim)
    best = min((np.eye(len(scale)), *search.metrics()), key=search.growth)
    short = _shortened(best / scale[:, None] / scale[None, :])
    return short if positive_definite(point(short[None]))[0] else _shortened(plain)


@final
class _Search:
    """Programs over a growing list of the matrices that were violated most.

    A diagonal metric makes A^T P + P A a symmetric interval matrix; it is worst at the matrices
    C + D_z E D_z with sign vectors z, C the centre and E the radius of A.
    """

    def __init__(self, lower: Array, upper: Array, aim: Aim) -> None:
        size = lower.shape[1]
        wide = uncertain_entries(lower, upper)
        many = int((2.0 ** wide.sum(axis=(1, 2))).sum()) > _MOST_EXTREMES
        self._hulls = (lower, upper)
        self._aim = aim
        self._covered = not aim.diagonal and (many or aim.form is Form.CENTRE_RADIUS)
        if aim.diagonal:
            self._matrices = _turned(lower, upper)
        elif self._covered:
            self._matrices = 0.5 * (lower + upper)
        else:
            hulls = zip(lower, upper, strict=True)
            self._matrices = np.concatenate([extreme_matrices(*hull)[0] for hull in hulls])
        self._radii = np.zeros_like(self._matrices)
        if self._covered:
            self._radii = np.where(wide, 0.5 * (upper - lower), 0.0)
        self._active = [int(np.argmax(self._rates(np.eye(size))))]
        self._program: MetricProgram | None = None

    def growth(self, metric: Array) -> float:
        """Logarithm of the growth that the metric promises over the horizon."""
        spread = math.sqrt(np.diag(np.linalg.inv(metric)).max() * _box_norm(metric))
        return float(self._rates(metric).max() * self._aim.horizon_s + math.log(spread))

    def metrics(self) -> Iterable[Array]:
        """Metrics from programs with rates between the least possible and the plain one."""
        high = float(self._rates(np.eye(self._matrices.shape[1])).max())
        low = float(np.linalg.eigvals(self._matrices).real.max())
        span = max(high - low, 1e-6)
        bottom, least = low - 0.05 * span, high
        for _ in range(_BISECTIONS_MOST):
            if (least - bottom) * self._aim.horizon_s < _RESOLUTION:
                break
            trial = 0.5 * (bottom + least)
            metric = self._solved(trial)
            if metric is None:
                bottom = trial
            else:
                least = trial
                yield metric
        for share in _RATES_ABOVE:
            metric = self._solved(least + share * (high - least))
            if metric is not None:
                yield metric

    def _rates(self, metric: Array) -> Array:
        if self._covered:
            lower, upper = self._hulls
            return metric_rates(lower, upper, metric=metric, form=Form.CENTRE_RADIUS)
        factor = np.linalg.cholesky(metric).T
        moved = factor @ self._matrices @ np.linalg.inv(factor)
        return np.asarray(np.linalg.eigvalsh(0.5 * (moved + moved.transpose(0, 2, 1)))[:, -1])

    def _solved(self, rate: float) -> Array | None:
        # Importing cvxpy takes longer than most of what is done without it.
        from workbench.sensitivity.metric_program import MetricProgram

        for _ in range(_CUTS_MOST):
            active = self._active
            if self._program is None:
                self._program = MetricProgram(
                    self._matrices[active],
                    self._radii[active],
                    condition_max=self._aim.condition_max,
                    diagonal=self._aim.diagonal,
                )
            metric = self._program.solve(rate)
            if metric is None:
                return None
            rates = self._rates(metric)
            worst = int(np.argmax(rates))
            if rates[worst] <= rate + _SLACK * (1.0 + abs(rate)) or worst in active:
                break
            self._active.append(worst)
            self._program = None
        return metric


def _turned(lower: Array, upper: Array) -> Array:
    """C + D_z E D_z of every hull and sign vector z of its first states: (m, n, n)."""
    size = lower.shape[1]
    signs = sign_vectors(min(size, SIGNED_MOST))
    signs = np.pad(signs, ((0, 0), (0, size - signs.shape[1])), constant_values=1.0)
    turns = signs[:, :, None] * signs[:, None, :]
    centre, radius = 0.5 * (lower + upper), 0.5 * (upper - lower)
    return np.asarray((centre[:, None] + radius[:, None] * turns).reshape(-1, size, size))


def _box_norm(metric: Array) -> float:
    """max s^T P s over the unit box, or a bound on it."""
    if len(metric) > SIGNED_MOST:
        return float(np.abs(metric).sum())
    signs = sign_vectors(len(metric))
    return float(np.einsum("ki,ij,kj->k", signs, metric, signs).max())


def _shortened(metric: Array) -> Array:
    mantissa, exponent = np.frexp(0.5 * (metric + metric.T))
    return np.asarray(np.ldexp(np.round(np.ldexp(mantissa, _BITS)), exponent - _BITS))
