"""The semidefinite program behind a metric, for cvxpy and Clarabel."""

from __future__ import annotations

import warnings
from typing import final

import cvxpy as cp
import numpy as np

from workbench.sensitivity.metric_bounds import SIGNED_MOST, sign_vectors
from workbench.sensitivity.vectorised import Array


@final
class MetricProgram:
    """Find P, of least trace(P^-1), in which every given matrix grows at most at a rate.

    A^T P + P A <= 2 g P,  l I <= P <= condition_max l I,  s^T P s <= 1 for all sign vectors s: the
    ellipsoid around the unit box, and the smallest boxes that it is read off as. matrices, radii
    (m, n, n): each A ranges over matrix + D, |D| <= radius. diagonal: P has no other entries. The
    program is built once and solved for several g.
    """

    __slots__ = ("_metric", "_problem", "_rate")

    def __init__(
        self, matrices: Array, radii: Array, *, condition_max: float, diagonal: bool
    ) -> None:
        size = matrices.shape[1]
        P = cp.diag(cp.Variable(size)) if diagonal else cp.Variable((size, size), symmetric=True)
        Z, least = cp.Variable((size, size), symmetric=True), cp.Variable()
        limits = [
            P >> least * np.eye(size),
            P << condition_max * least * np.eye(size),
            cp.bmat([[P, np.eye(size)], [np.eye(size), Z]]) >> 0,
        ]
        if size <= SIGNED_MOST:
            limits += [signs @ P @ signs <= 1.0 for signs in sign_vectors(size)]
        else:
            limits.append(cp.sum(cp.abs(P)) <= 1.0)
        self._rate = cp.Parameter()
        grown = self._rate * P
        limits += [_decays(P, grown, *each) for each in zip(matrices, radii, strict=True)]
        self._metric = P
        self._problem = cp.Problem(cp.Minimize(cp.trace(Z)), limits)

    def solve(self, rate: float) -> Array | None:
        """P (n, n) for the rate g, or None where the solver finds none."""
        self._rate.value = rate
        try:
            with warnings.catch_warnings():
                # An inaccurate answer is as good a proposal as any.
                warnings.simplefilter("ignore")
                self._problem.solve(solver=cp.CLARABEL)
        except cp.error.SolverError:
            return None
        found = self._metric.value
        if found is None or not np.all(np.isfinite(found)):
            return None
        metric = np.asarray(0.5 * (found + found.T))
        return metric if np.linalg.eigvalsh(metric)[0] > 0.0 else None


def _decays(P: cp.Expression, rate_P: cp.Expression, matrix: Array, radius: Array) -> cp.Constraint:
    """A^T P + P A <= 2 g P for A = matrix + D, |D| <= radius, with multipliers b_ij > 0.

    D^T P + P D <= sum_ij E_ij (p_i p_i^T / b_ij + b_ij e_j e_j^T), as a Schur complement.
    """
    size = len(matrix)
    rest = 2.0 * rate_P - matrix.T @ P - P @ matrix
    entries = np.argwhere(radius > 0.0)
    if not len(entries):
        return rest >> 0
    multipliers = cp.Variable(len(entries))
    radii = radius[entries[:, 0], entries[:, 1]]
    pick = np.zeros((size, len(entries)))
    pick[entries[:, 1], np.arange(len(entries))] = 1.0
    covered = pick @ cp.diag(cp.multiply(radii, multipliers)) @ pick.T
    columns = P[:, entries[:, 0].tolist()]
    corner = cp.diag(cp.multiply(1.0 / radii, multipliers))
    return cp.bmat([[rest - covered, columns], [columns.T, corner]]) >> 0
