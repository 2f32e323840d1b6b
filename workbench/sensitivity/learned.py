"""DryVR's learned discrepancy: exponentials per coordinate, fitted to pairs of runs by an LP."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import import_module
from typing import Any, final

import numpy as np
import numpy.typing as npt

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import Ode, System
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.sampling import (
    instants,
    ordered_box,
    parameter_states,
    rollout,
    step_count,
    uniform_states,
)
from workbench.sensitivity.scenario import ScenarioStatement, pairs_needed, violation_bound
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box

_BLOCK = 4096
# Weight of rate^2 beside the LP's objective: only decides between equally good lines.
_TIE_BREAK = 1e-6
# Far above the solver's tolerance, far below what matters in a logarithm.
_LIFT = 1e-7


@final
@dataclass(frozen=True, slots=True)
class ExponentialEnvelope:
    """|e_i(t)| <= amplitude_i exp(rate_i t) rho with rho = max_j |e_j(0)| / scale_j.

    scale: half widths of the initial set the envelope was learned on, in the states' units; a
    coordinate with scale 0 did not vary there, so its initial distance must be 0. amplitude: in the
    states' units; 0 for a coordinate that never moved. evidence: the honest statement.
    """

    scale: tuple[float, ...]
    amplitude: tuple[float, ...]
    rate_per_s: tuple[float, ...]
    evidence: ScenarioStatement

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """Bound on |e_i(t)|; InputError for a distance along an axis that was never varied."""
        unseen = [
            j
            for j, (r, s) in enumerate(zip(initial, self.scale, strict=True))
            if r > 0.0 and s == 0.0
        ]
        if unseen:
            raise InputError(
                f"expected initial radius 0 for the states number {unseen}, which the runs did not "
                "vary; learn on a set that is wide along them"
            )
        rho = max((r / s for r, s in zip(initial, self.scale, strict=True) if s > 0.0), default=0.0)
        return tuple(
            a * math.exp(g * t_s) * rho
            for a, g in zip(self.amplitude, self.rate_per_s, strict=True)
        )


@final
@dataclass(frozen=True, slots=True)
class LearnedExponential:
    """Fit ln |e_i(t_k)| <= ln(K_i r_i) + gamma_i t_k + ln rho to `pairs` independent pairs of runs.

    LP (cvxpy, Clarabel): minimise sum_k (ln K_i + gamma_i t_k) over the step instants, per
    coordinate, with ln K_i >= 0 where the initial set has width. A coordinate without initial
    width gives no constraint at t = 0; its K_i r_i is fitted as one number in the state's unit.
    Each pair is one draw of two states (independent, uniform on the box) and of the parameters
    (uniform on their ranges, shared by the two); disturbances stay at their nominal values. pairs,
    seed: the sample; step_s: spacing of the instants; delta: 1 - confidence of the statement.
    Rigor SAMPLED. Source: Fan, Qi, Mitra, Viswanathan, "DryVR", CAV 2017; scenario bound as in
    `scenario`.
    """

    pairs: int
    seed: int
    step_s: float
    delta: float

    def __post_init__(self) -> None:
        if self.pairs < 1 or not 0.0 < self.delta < 1.0:
            raise InputError(
                "expected pairs >= 1 and 0 < delta < 1, "
                f"got pairs={self.pairs}, delta={self.delta!r}"
            )

    @classmethod
    def promising(
        cls, epsilon: float, *, delta: float, system: System, seed: int, step_s: float
    ) -> LearnedExponential:
        """As many pairs as (epsilon, delta) needs with two fitted parameters per state."""
        parameters = 2 * len(system.ode.states)
        pairs = pairs_needed(epsilon, delta=delta, parameters=parameters)
        return cls(pairs=pairs, seed=seed, step_s=step_s, delta=delta)

    def learn(self, system: System, *, initial_set: Box, horizon_s: float) -> Discrepancy:
        """The envelope of these runs, with its (epsilon, delta)."""
        ode = system.ode
        box = ordered_box(ode, initial_set, "initial set")
        scale = np.array(box.radius)
        if not np.any(scale > 0.0):
            raise InputError("expected an initial set with some width, got a point; widen an axis")
        times = instants(horizon_s, self.step_s)
        ratios = self._largest_ratios(system, box, horizon_s)
        units = np.where(scale > 0.0, scale, 1.0)
        logs = np.log(ratios / units, where=ratios > 0.0, out=np.full(ratios.shape, -np.inf))
        offset, rate = fit_exponentials(times, logs, at_least_one=scale > 0.0)
        amplitude = np.where(np.isfinite(offset), units * np.exp(offset), 0.0)
        count = 2 * len(ode.states)
        evidence = ScenarioStatement(
            epsilon=violation_bound(self.pairs, delta=self.delta, parameters=count),
            delta=self.delta,
            pairs=self.pairs,
            parameters=count,
            distribution=_distribution(ode),
        )
        envelope = ExponentialEnvelope(
            tuple(scale.tolist()), tuple(amplitude.tolist()), tuple(rate.tolist()), evidence
        )
        return Discrepancy(
            names=ode.names,
            region=box,
            horizon_s=horizon_s,
            rigor=Rigor.SAMPLED,
            growth=envelope,
            norm="learned: |e_i(t)| <= K_i r_i exp(gamma_i t) max_j |e_j(0)|/r_j, r half widths",
            condition=f"both start in the initial set with the same parameters; {evidence}",
        )

    def _largest_ratios(self, system: System, box: Box, horizon_s: float) -> Array:
        """max over pairs of |e_i(t_k)| / rho, array (K+1, n)."""
        rng = np.random.default_rng(self.seed)
        scale = np.array(box.radius)
        moving = scale > 0.0
        largest = np.zeros((step_count(horizon_s, self.step_s) + 1, len(scale)))
        for start in range(0, self.pairs, _BLOCK):
            count = min(_BLOCK, self.pairs - start)
            states = uniform_states(box, 2 * count, rng)
            shared = parameter_states(system.ode.parameters, count, rng)
            runs = rollout(
                system,
                states,
                horizon_s=horizon_s,
                step_s=self.step_s,
                parameters=np.concatenate([shared, shared]),
            )
            if not np.all(np.isfinite(runs)):
                raise InputError(
                    "a run left the finite numbers; shorten the horizon, shrink the initial set "
                    "or check the gains"
                )
            first, second = states[:count], states[count:]
            rho = np.max(np.abs(first - second)[:, moving] / scale[moving], axis=1)
            distances = np.abs(runs[:count] - runs[count:]) / rho[:, None, None]
            largest = np.maximum(largest, distances.max(axis=0))
        return largest


def fit_exponentials(
    times: Array, logs: Array, *, at_least_one: npt.NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Lines offset_i + rate_i t above the points (t_k, logs[k, i]) with the smallest sum over k.

    times (K+1,), logs (K+1, n) with -inf for "no constraint"; at_least_one (n,): offset_i >= 0 and
    the value 0 at t = 0 is known. Returns offset (n,), -inf where nothing constrains, and rate
    (n,) in 1/s. The solver's answer is lifted until it satisfies every constraint. Raises
    RuntimeError if it fails.
    """
    # Half a second to import: whoever only proves or drives should not wait for it.
    cp: Any = import_module("cvxpy")
    points = logs.copy()
    points[0] = np.where(at_least_one, 0.0, -np.inf)
    finite = np.isfinite(points)
    active = np.flatnonzero(finite.any(axis=0))
    offset, rate = np.full(logs.shape[1], -np.inf), np.zeros(logs.shape[1])
    if not len(active):
        return offset, rate
    a, g = cp.Variable(len(active)), cp.Variable(len(active))
    constraints, cost = [], _TIE_BREAK * cp.sum_squares(g)
    for column, i in enumerate(active):
        rows = finite[:, i]
        line = a[column] + g[column] * times[rows]
        constraints.append(line >= points[rows, i])
        cost = cost + cp.sum(line) / int(rows.sum())
    problem = cp.Problem(cp.Minimize(cost), constraints)
    problem.solve(solver=cp.CLARABEL)
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        raise RuntimeError(f"the exponential fit did not solve: {problem.status}")
    rate[active] = g.value
    excess = np.where(finite, points - times[:, None] * rate, -np.inf)[:, active].max(axis=0)
    offset[active] = np.maximum(a.value, excess) + _LIFT
    return offset, rate


def _distribution(ode: Ode) -> str:
    text = "two independent states uniform on the initial box"
    if any(ranged.lower < ranged.upper for ranged in ode.parameters):
        text += ", shared parameters uniform on their ranges"
    if ode.disturbances:
        text += ", disturbances at their nominal values"
    return text
