"""Componentwise bound along a trajectory: what each distance feeds into each other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.models.system import System
from workbench.reach.local.along import LocalRun, Step, require_step, run_along, tube_along
from workbench.reach.local.reference import Reference
from workbench.reach.tube import Array, ReachTube
from workbench.reach.validated.algebra import upward
from workbench.sensitivity.rounding import exp_up
from workbench.sets import Box

_LONGEST = 100.0
# `upward` covers this many operations.
_MOST_OPERATIONS = 2**12


@final
@dataclass(frozen=True, slots=True)
class LocalGrowth:
    """|x(t) - x*(t)| <= y(t), y' = G y + d in every step, G_ii = sup M_ii, G_ij = sup |M_ij|.

    M is the mean Jacobian between x* and the other trajectories over the step, d what other
    parameters and disturbances than the reference's add to the rates. step_s: length of a step in
    s. Exact for cascades; sign loss makes it grow for oscillating loops. Rigor ENCLOSED; ends early
    as `run_along` says. Source: Kapela and Zgliczynski, DCDS-B 11(2), 2009.
    """

    step_s: float

    def __post_init__(self) -> None:
        require_step(self.step_s)

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """A tube from `initial_set` (axes = state names) over [0, horizon_s]."""
        return tube_along(self, system, initial_set=initial_set, horizon_s=horizon_s)

    def along(self, reference: Reference) -> LocalRun:
        """The tube about a trajectory that is known; there is no metric."""
        return run_along(reference, _Componentwise())


@final
@dataclass(frozen=True, slots=True)
class _Componentwise:
    """The set {|e| <= y}; the state is y (n,)."""

    def start(self, radius: Array) -> Array:
        return radius

    def advance(self, state: Array, step: Step) -> tuple[Array, Array]:
        return grown(step.magnitude, state, step.felt, step.length_s)

    def half_widths(self, state: Array) -> Array:
        return state

    def condition(self, state: Array) -> float:
        del state
        return float("nan")


def grown(matrix: Array, start: Array, felt: Array, length_s: float) -> tuple[Array, Array]:
    """y at the end and a bound on it throughout, for y' <= matrix y + felt, rounded up.

    matrix (b, b) with entries >= 0 off the diagonal; start, felt (b,) >= 0. Without negative rates
    the solution rises, so that its end bounds all of it. Infinite where the series would be long.
    """
    size = len(matrix)
    if not (start.any() or felt.any()):
        return np.zeros(size), np.zeros(size)
    # One more state that stays 1 feeds what is felt.
    whole = np.zeros((size + 1, size + 1))
    whole[:size, :size], whole[:size, size] = matrix, felt
    vector = np.append(start, 1.0)
    end = _exponential(whole, vector, length_s)[:size]
    if not (np.diag(matrix) < 0.0).any():
        return end, end
    np.fill_diagonal(whole, np.maximum(np.diag(whole), 0.0))
    return end, _exponential(whole, vector, length_s)[:size]


def _exponential(matrix: Array, vector: Array, length_s: float) -> Array:
    """exp(M t) v, rounded up, for entries >= 0 off the diagonal and v >= 0.

    exp(M t) = e^(-a t) exp((M + a I) t) with M + a I >= 0, whose series has terms >= 0 only; after
    N terms with |(M + a I) t| <= (N + 1) / 2 the rest is at most the largest entry of the last one.
    """
    shift = max(0.0, -float(np.diag(matrix).min()))
    raised = matrix + shift * np.eye(len(matrix))
    np.fill_diagonal(raised, upward(np.diag(raised)))
    norm = float(upward(raised.sum(axis=1)).max()) * length_s
    count = 2 * (int(norm) + 1) + 20 if norm < _LONGEST else 0
    if (count + 1) * (len(matrix) + 4) > _MOST_OPERATIONS or not count:
        return np.full(len(vector), np.inf)
    # Among subnormal numbers `upward` would not cover what products lose.
    vector = upward(vector)
    term, total = vector, vector
    for k in range(1, count + 1):
        term = (raised @ term) * (length_s / k)
        total = total + term
    decay = exp_up(-math.nextafter(shift * length_s, 0.0)) if shift else 1.0
    return upward(upward(total + term.max()) * decay)
