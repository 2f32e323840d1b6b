"""Lagrangian bound: the solution matrix since the start, enclosed, and how much it stretches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.models.system import System
from workbench.reach.local.along import LocalRun, Step, require_step, run_along, tube_along
from workbench.reach.local.growth import grown
from workbench.reach.local.reference import Reference
from workbench.reach.local.transition import inverse_product, transition
from workbench.reach.tube import Array, ReachTube
from workbench.reach.validated.algebra import upward
from workbench.sensitivity.interval_arrays import add, matrix_product, point
from workbench.sensitivity.metric_bounds import Form, coupling_bounds
from workbench.sets import Box

_TINY = 1e-290


@final
@dataclass(frozen=True, slots=True)
class LocalLagrangian:
    """e(t) = F(t) e(0) + forced part, F' = M(t) F, enclosed as F = C (I + D), |D| <= W.

    M as in `Step`, so that F encloses the mean of d xi / d x0 over every segment from x*. C is a
    point matrix that follows the flow: the interval part does not wrap but grows by what C^-1 Phi C
    differs from I, Phi the transition matrix of a step. What e(0) and the disturbances give is read
    off twice: as the box |C| ((I + W) r + u), and as the ball of the metric (C S)^-T (C S)^-1, S
    the initial radii, whose radius is stretched by at most ||I + S^-1 W S||_2 (Cauchy-Green); the
    smaller half width counts. step_s: length of a step in s. Covers all times; Rigor ENCLOSED; ends
    early as `run_along` says. Source: Cyranka, Islam, Byrne, Jones, Smolka, Grosu, CAV 2017 (LRT);
    Gruenbacher et al., CDC 2020 (LRT-NG's metric).
    """

    step_s: float

    def __post_init__(self) -> None:
        require_step(self.step_s)

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """A tube from `initial_set` (axes = state names) over [0, horizon_s]."""
        return tube_along(self, system, initial_set=initial_set, horizon_s=horizon_s)

    def along(self, reference: Reference) -> LocalRun:
        """The tube about a trajectory that is known."""
        return run_along(reference, _Flow())


@final
@dataclass(frozen=True, slots=True)
class Deformation:
    """{C ((I + D) z + v)}: |D| <= spread (n, n), |z| <= radius (n,), |v| <= forced (n,)."""

    frame: Array
    spread: Array
    radius: Array
    forced: Array

    def in_frame(self) -> Array:
        """Bounds (n,) on what D z + v adds."""
        return upward(self.spread @ self.radius + self.forced)

    def box(self) -> Array:
        """|C| (|z| + |D| |z| + |v|)."""
        return upward(np.abs(self.frame) @ (self.radius + self.in_frame()))

    def units(self) -> Array:
        """S (n,): the initial radii, and what has been added where they are 0."""
        least = 1e-9 * max(float(self.radius.max()), _TINY)
        return np.where(self.radius > 0.0, self.radius, self.in_frame() + least)

    def stretch(self) -> float:
        """Bound on ||S^-1 (I + D) S|| over the columns that have a radius."""
        units, wide = self.units(), self.radius > 0.0
        columns = np.eye(len(units)) + upward(self.spread / units[:, None] * units[None, :])
        columns = upward(columns)[:, wide][None]
        if not wide.any():
            return 0.0
        rows, few = np.eye(len(units)), np.eye(int(wide.sum()))
        return float(coupling_bounds(columns, columns, row=rows, column=few, form=Form.VERTICES)[0])

    def ball(self) -> Array:
        """Row norms of C S times the ball's radius; the box has sqrt(count) in units of S."""
        units = self.units()
        start = np.sqrt(float((self.radius > 0.0).sum()))
        forced = upward(self.forced / units)
        radius = upward(self.stretch() * start + np.sqrt(upward(forced @ forced)))
        scaled = upward(np.abs(self.frame) * units[None, :])
        return upward(np.sqrt(upward((scaled * scaled).sum(axis=1))) * radius)


@final
@dataclass(frozen=True, slots=True)
class _Flow:
    """The loop's bound; the state is a `Deformation`."""

    def start(self, radius: Array) -> Deformation:
        size = len(radius)
        return Deformation(np.eye(size), np.zeros((size, size)), radius, np.zeros(size))

    def advance(self, state: Deformation, step: Step) -> tuple[Deformation, Array]:
        moved = transition(step.lower, step.upper, step.length_s)
        frame = (0.5 * moved[0] + 0.5 * moved[1]) @ state.frame
        product, slack = inverse_product(frame, matrix_product(moved, point(state.frame)))
        rest = add(product, point(-np.eye(len(frame))))
        added = upward(np.maximum(np.abs(rest[0]), np.abs(rest[1])) + slack)
        nothing = np.zeros(len(frame))
        felt, _ = grown(step.magnitude, nothing, step.felt, step.length_s)
        pushed, more = inverse_product(frame, (np.diag(-felt), np.diag(felt)))
        push = upward((np.maximum(np.abs(pushed[0]), np.abs(pushed[1])) + more).sum(axis=1))
        spread = upward(state.spread + added + added @ state.spread)
        forced = upward(state.forced + added @ state.forced + push)
        _, throughout = grown(step.magnitude, self.half_widths(state), step.felt, step.length_s)
        return Deformation(frame, spread, state.radius, forced), throughout

    def half_widths(self, state: Deformation) -> Array:
        return np.minimum(state.box(), state.ball())

    def condition(self, state: Deformation) -> float:
        wide = state.radius > 0.0
        units = state.units()
        shape = (state.frame * units[None, :])[wide][:, wide] / units[wide][:, None]
        return float(np.linalg.cond(shape) ** 2) if wide.any() else 1.0
