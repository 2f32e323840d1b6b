"""Inner approximation: what the reachable hull is proved to contain, with a witness per face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.claims import Rigor
from workbench.models.system import Ode, System
from workbench.reach.inner.choice_flow import ChoiceFlow
from workbench.reach.inner.choices import Choices
from workbench.reach.inner.extremes import Admissible, SearchEffort, extreme_choices
from workbench.reach.inner.point_runs import PointRuns, validated_runs
from workbench.reach.tube import Array, ReachTube, TubeStatus
from workbench.reach.validated.tube import time_grid
from workbench.sensitivity.sampling import ordered_box
from workbench.sensitivity.vectorised import Index
from workbench.sets import Box

# Quotients of widths are rounded outward by this share: it covers a difference, a quotient and the
# mean of 2^20 of them.
_ROUNDING = 2.0**-30
# Instants of two grids closer than this are the same instant.
_SAME_TIME_S = 1e-9


@final
@dataclass(frozen=True, slots=True)
class Witness:
    """One admissible trajectory: initial state, parameters, and disturbances held per interval.

    parameters: name -> value for those with a range; signal (K, n_w): row k on [t_k, t_k+1), in the
    order `disturbances`.
    """

    initial_state: dict[str, float]
    parameters: dict[str, float]
    disturbances: tuple[str, ...]
    signal: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class InnerHull:
    """At times[k] the hull of all reachable states contains [lower_at[k], upper_at[k]].

    times (K+1) in s; lower_at, upper_at (K+1, n): a validated trajectory reaches at most lower_at,
    another at least upper_at. Where lower_at > upper_at nothing is proved (a single trajectory,
    whose enclosure has a width). witness (K+1, n, 2): which of `choices` reaches the lower and the
    upper end; ode: the equation they solve. Only instants: nothing is said between them. status,
    message: as of a `ReachTube`.
    """

    times: Array
    lower_at: Array
    upper_at: Array
    names: tuple[str, ...]
    choices: Choices
    witness: Index
    status: TubeStatus
    message: str
    rigor: Rigor
    ode: Ode

    @property
    def complete(self) -> bool:
        """Whether the validated trajectories reach the horizon."""
        return self.status is TubeStatus.COMPLETE

    def width_at(self) -> Array:
        """Proved lower bound (K+1, n) on the width of the reachable hull, in the states' units."""
        width = (self.upper_at - self.lower_at) * (1.0 - _ROUNDING)
        return np.maximum(width, 0.0)

    def witness_of(self, name: str, instant: int, *, upper: bool) -> Witness:
        """The trajectory that reaches the upper (or lower) end of state `name` at times[instant].

        >>> import casadi as ca
        >>> from workbench.models import system_from_casadi
        >>> x = ca.SX.sym("x")
        >>> decay = system_from_casadi(x, -x, ("x",))
        >>> inner = inner_hull(decay, initial_set=Box(("x",), (1.0,), (2.0,)), horizon_s=0.1,
        ...     step_s=0.05, effort=SearchEffort(starts=4, rounds=1, every=1, seed=1))
        >>> inner.witness_of("x", 2, upper=True).initial_state
        {'x': 2.0}
        """
        i = self.names.index(name)
        return witness_of_choice(
            self.ode, self.choices.take(self.witness[instant, i, [int(upper)]])
        )


def witness_of_choice(ode: Ode, choice: Choices) -> Witness:
    """The single row of `choice` by names."""
    ranged = [p.name for p in ode.parameters if p.lower < p.upper]
    return Witness(
        dict(zip(ode.names, choice.states[0].tolist(), strict=True)),
        dict(zip(ranged, choice.constants[0].tolist(), strict=True)),
        tuple(w.name for w in ode.disturbances),
        choice.signals[0],
    )


def inner_hull(
    system: System, *, initial_set: Box, horizon_s: float, step_s: float, effort: SearchEffort
) -> InnerHull:
    """Prove from below how far the trajectories from `initial_set` spread over [0, horizon_s].

    Candidates for each state, instant (0, step_s, ..., horizon_s) and side come from vertices,
    gradient ascent and coordinate search on float runs; each is then one exact initial state,
    parameter value and disturbance (piecewise constant on the grid), whose trajectory is enclosed.
    The end of a face is the validated end of the best: reached for certain, so that
        [lower_at, upper_at] inside the reachable hull inside every tube.
    Trajectories depend continuously on the choices, which form a connected set: where all of them
    last that long, each value in between is also taken. Rigor ENCLOSED whatever the search finds;
    `effort` only sets tightness. A proof that ends early is a value (`InnerHull.status`).
    InputError where the names differ.
    Source: Goubault and Putot, inner approximations, HSCC 2017, here by extremal trajectories.
    """
    ode = system.ode
    times = time_grid(horizon_s, step_s)
    admissible = Admissible.of(ode, ordered_box(ode, initial_set, "initial set"), len(times) - 1)
    choices = extreme_choices(ChoiceFlow.of(ode, times), admissible, effort)
    found = validated_runs(ode, choices, times)
    lower, upper, witness = _faces(found)
    return InnerHull(
        found.times, lower, upper, ode.names, choices, witness, found.status, found.message,
        Rigor.ENCLOSED, ode,
    )  # fmt: skip


def _faces(found: PointRuns) -> tuple[Array, Array, Index]:
    """The validated ends of all faces (K+1, n) and the trajectories (K+1, n, 2) that reach them."""
    best = np.stack([found.upper.argmin(axis=1), found.lower.argmax(axis=1)], axis=2)
    lower, upper = found.upper.min(axis=1), found.lower.max(axis=1)
    return lower, upper, best


def proved_ratio(tube: ReachTube, inner: InnerHull) -> Array:
    """Width of `tube` / inner width, (K+1, n), at the instants of `inner` (same within 1e-9 s).

    An upper bound, rounded up, on tube width / true width of the reachable hull, to the rigor of
    the tube; inf where the inner width is 0 or the tube has no such instant. The tube's set at an
    instant is cut with the segments on both sides of it.
    """
    lower, upper = tube.lower_at.copy(), tube.upper_at.copy()
    for side in (slice(1, None), slice(None, -1)):
        lower[side] = np.maximum(lower[side], tube.lower)
        upper[side] = np.minimum(upper[side], tube.upper)
    rows = np.array([int(np.argmin(np.abs(tube.times - t))) for t in inner.times])
    shared = np.abs(tube.times[rows] - inner.times) <= _SAME_TIME_S
    outer = (upper - lower)[rows] * (1.0 + _ROUNDING)
    width = inner.width_at()
    known = shared[:, None] & (width > 0.0)
    ratio = np.where(known, outer / np.where(known, width, 1.0), np.inf)
    return np.asarray(ratio * (1.0 + _ROUNDING))
