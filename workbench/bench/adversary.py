"""Inputs that drive a loop to its extremes: initial corner, parameter corner and switching times
from the signs of the adjoint."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from workbench.bench.lanes import Inputs
from workbench.models.system import Ode
from workbench.sensitivity.vectorised import Array, Vectorised
from workbench.sets import Box

_GRID_S = 0.05
_ROUNDS = 2
_INSTANTS = (0.25, 0.5, 1.0)


def adversarial_inputs(ode: Ode, box: Box, horizon_s: float) -> Inputs:
    """One row per coordinate, direction, instant (1/4, 1/2, 1 of the horizon) and round.

    With lambda' = -A^T lambda, lambda(T) = +-e_i along the current run, the linearised x_i(T) is
    largest at x0 = center + radius sign(lambda(0)), w(t) = the corner that sign(lambda(t)^T B_w)
    names, p likewise from the integral of lambda^T B_p. The second round linearises along the runs
    that the first one found. Bang-bang inputs switch on a grid of at most 0.05 s. The adjoint is
    crude (one product per grid step) and counts a kink's undecided derivative as zero: good for
    attacks, never for a proof.
    """
    steps = max(1, math.ceil(horizon_s / _GRID_S))
    search = _Search(ode, box, horizon_s / steps, steps)
    found = [search.start()]
    for _ in range(_ROUNDS):
        found.append(search.improved(*found[-1]))
    grid: Array = search.h * np.arange(1, steps, dtype=np.float64)
    return joined([switched(x0, p, grid, w) for x0, p, w in found[1:]])


def switched(states: Array, parameters: Array, times: Array, values: Array) -> Inputs:
    """Rows whose disturbance is values[:, k] (N, K, n_w) between times[k-1] and times[k] (K-1,)."""
    if not values.shape[2]:
        values, times = values[:, :1], times[:0]
    changes = (np.diff(values, axis=1) != 0.0).any(axis=2)
    most = int(changes.sum(axis=1).max(initial=0))
    at = np.full((len(states), most), np.inf)
    held = np.repeat(values[:, :1], most + 1, axis=1)
    for row, changing in enumerate(changes):
        where = np.flatnonzero(changing)
        at[row, : len(where)] = times[where]
        held[row, 1 : len(where) + 1] = values[row, where + 1]
        held[row, len(where) + 1 :] = values[row, -1]
    return Inputs(states, parameters, at, held)


def joined(parts: list[Inputs]) -> Inputs:
    """All rows; shorter lists of switches are filled with inf."""
    most = max(part.switches.shape[1] for part in parts)
    missing = [most - part.switches.shape[1] for part in parts]
    return Inputs(
        np.concatenate([part.states for part in parts]),
        np.concatenate([part.parameters for part in parts]),
        np.concatenate([
            np.pad(part.switches, ((0, 0), (0, gap)), constant_values=np.inf)
            for part, gap in zip(parts, missing, strict=True)
        ]),
        np.concatenate([
            np.pad(part.values, ((0, 0), (0, gap), (0, 0)), mode="edge")
            for part, gap in zip(parts, missing, strict=True)
        ]),
    )  # fmt: skip


_Choice = tuple[Array, Array, Array]


class _Search:
    """The field with its three Jacobians, and the goals, one per row."""

    def __init__(self, ode: Ode, box: Box, h: float, steps: int) -> None:
        jacobians = (ca.densify(ca.jacobian(ode.field, v)) for v in (ode.x, ode.p, ode.w))
        symbols = [ode.x, ode.p, ode.w]
        self.field = Vectorised(ode.function())
        self.slopes = Vectorised(ca.Function("slopes", symbols, [ca.vec(j) for j in jacobians]))
        self.h, self.steps, self.n = h, steps, len(ode.states)
        self.ends = [(np.array(box.lower), np.array(box.upper))]
        for ranges in (ode.parameters, ode.disturbances):
            ends = np.array([(r.lower, r.upper) for r in ranges]).reshape(-1, 2)
            self.ends.append((ends[:, 0], ends[:, 1]))
        nominal = [r.nominal for r in (*ode.parameters, *ode.disturbances)]
        self.nominal = np.split(np.array(nominal), [len(ode.parameters)])
        last = np.unique([max(1, round(share * steps)) for share in _INSTANTS])
        goals = np.meshgrid(np.arange(self.n), last, [-1.0, 1.0], indexing="ij")
        self.coordinate, self.last, self.sign = (goal.ravel() for goal in goals)

    def start(self) -> _Choice:
        """Centre, nominal parameters, nominal disturbance."""
        count = len(self.sign)
        center = 0.5 * (self.ends[0][0] + self.ends[0][1])
        p, w = self.nominal
        rows = np.tile(w, (count, self.steps, 1))
        return np.tile(center, (count, 1)), np.tile(p, (count, 1)), rows

    def improved(self, x0: Array, p: Array, w: Array) -> _Choice:
        """The corners that the adjoint along the runs of (x0, p, w) names."""
        a, b_p, b_w = self._along(x0, p, w)
        rows = np.arange(len(self.sign))
        adjoint = np.zeros((len(rows), self.n))
        by_p = np.zeros_like(p)
        by_w = np.zeros_like(w)
        for k in range(self.steps - 1, -1, -1):
            starts = self.last == k + 1
            adjoint[rows[starts], self.coordinate[starts]] = self.sign[starts]
            half = np.einsum("ni,nij->nj", adjoint, a[:, k])
            middle = adjoint + 0.5 * self.h * half
            by_w[:, k] = np.einsum("ni,nij->nj", middle, b_w[:, k])
            by_p += self.h * np.einsum("ni,nij->nj", middle, b_p[:, k])
            adjoint = adjoint + self.h * np.einsum("ni,nij->nj", middle, a[:, k])
        gradients = (adjoint, by_p, by_w)
        x0, p, w = (
            np.where(gradient >= 0.0, high, low)
            for gradient, (low, high) in zip(gradients, self.ends, strict=True)
        )
        return x0, p, w

    def _along(self, x0: Array, p: Array, w: Array) -> tuple[Array, Array, Array]:
        """Jacobians (N, K, n, .) at the middle of each grid step."""
        h, x, middles = self.h, x0.T, []
        with np.errstate(all="ignore"):
            for k in range(self.steps):
                k1 = self.field(x, p.T, w[:, k].T)[0]
                k2 = self.field(x + 0.5 * h * k1, p.T, w[:, k].T)[0]
                middles.append(x + 0.5 * h * k2)
                x = x + h * self.field(middles[-1], p.T, w[:, k].T)[0]
            count = len(x0)
            flat = np.concatenate(middles, axis=1)
            repeated = np.tile(p.T, (1, self.steps))
            held = w.transpose(2, 1, 0).reshape(w.shape[2], self.steps * count)
            slopes = self.slopes(flat, repeated, held)
        a, b_p, b_w = (
            np.nan_to_num(slope, posinf=0.0, neginf=0.0)
            .reshape(width, self.n, self.steps, count)
            .transpose(3, 2, 1, 0)
            for slope, width in zip(slopes, (self.n, p.shape[1], w.shape[2]), strict=True)
        )
        return a, b_p, b_w
