"""What the published tool DryVR 0.2 does by default, so that it can be measured."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final, final

import numpy as np

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import System
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.learning.exponential import exponentials
from workbench.sensitivity.learning.model_simulator import ModelSimulator
from workbench.sensitivity.learning.pairs import Simulator
from workbench.sensitivity.learning.statement import Argument, Statement
from workbench.sensitivity.sampling import ordered_box, uniform_states
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box

_CLOSE: Final = 1e-3
_LEAST_LOG_FACTOR: Final = 0.01
_LARGEST_LOG_FACTOR: Final = 10.0
# The tool weighs factor and rate as if there were this many instants, whatever there are.
_WEIGHED_INSTANTS: Final = 100


@final
@dataclass(frozen=True, slots=True)
class PublishedEnvelope:
    """|e_i(t)| <= factor_i exp(rate_i s) |e_i(0)|, s the end of the step that holds t.

    The tool's tube adds the end's width to both ends of a step: too little where the rate is
    negative. An instant counts as the end of the step before it; 0 belongs to the first step.
    """

    factor: tuple[float, ...]
    rate_per_s: tuple[float, ...]
    step_s: float

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """What the tool's tube would have."""
        return tuple(self.bounds(np.array([initial]), np.array([t_s]))[0, 0].tolist())

    def bounds(self, initial: Array, times: Array) -> Array:
        """The same for many, (N, K+1, n)."""
        steps = np.maximum(1.0, np.ceil(times / self.step_s - 1e-9))
        ends = exponentials(self.factor, self.rate_per_s, steps * self.step_s)
        return np.asarray(initial[:, None] * ends)


@final
@dataclass(frozen=True, slots=True)
class PublishedTool:
    """DryVR 0.2 with its settings: the centre's run and ten more, all pairs, one LP per state.

    ln |e_i(t_k)| <= ln K_i + gamma_i t_k + ln |e_i(0)| for the 55 pairs of 11 runs, k >= 1, ln K_i
    in [0.01, 10], gamma_i free, smallest ln K_i + gamma_i T 101/200. Where any two runs start
    within 1e-3 in a state, that state gets K_i = 1 and gamma_i = 0 and its runs are not looked at.
    The pairs share runs, so that nothing follows for further ones; nothing is claimed between
    instants. Rigor SAMPLED. Written after the tool's published behaviour: Qi, Fan, Mitra,
    Viswanathan, DryVR 0.2 (`Global_Disc`).

    seed: of the ten initial states, uniform on the set. step_s: spacing of the instants.
    """

    seed: int
    step_s: float
    traces: int = 10

    def __post_init__(self) -> None:
        if self.traces < 2:
            raise InputError(f"expected at least 2 traces, as the tool does, got {self.traces}")

    def learn(self, system: System, *, initial_set: Box, horizon_s: float) -> Discrepancy:
        """What the tool would learn of a system's runs."""
        box = ordered_box(system.ode, initial_set, "initial set")
        simulator = ModelSimulator.of(system, horizon_s=horizon_s, step_s=self.step_s)
        return self.learn_from(simulator, box=box)

    def learn_from(self, simulator: Simulator, *, box: Box) -> Discrepancy:
        """What the tool would learn of any simulator's runs; they all get the same seed."""
        names, times = tuple(simulator.names), simulator.times
        box = box.reordered(names)
        drawn = uniform_states(box, self.traces, np.random.default_rng(self.seed))
        states = np.concatenate([np.array([box.center]), drawn])
        seeds = np.full(len(states), self.seed, dtype=np.uint64)
        runs = simulator.runs(states, seeds)
        if not np.all(np.isfinite(runs)):
            raise InputError(
                "a run left the finite numbers; shorten the horizon, shrink the initial set "
                "or check the gains"
            )
        columns = [_fitted(times, runs[:, :, i]) for i in range(len(names))]
        statement = self._statement(len(states), simulator.what)
        return Discrepancy(
            names=names,
            region=box,
            horizon_s=float(times[-1]),
            rigor=Rigor.SAMPLED,
            growth=PublishedEnvelope(
                tuple(factor for factor, _ in columns),
                tuple(rate for _, rate in columns),
                self.step_s,
            ),
            norm="published tool: |e_i(t)| <= K_i exp(gamma_i t) |e_i(0)| at the end of each step",
            condition=str(statement),
            statements=(statement,),
        )

    def _statement(self, runs: int, what: str) -> Statement:
        count = runs * (runs - 1) // 2
        return Statement(
            Argument.NONE,
            epsilon=1.0,
            epsilon_at_an_instant=1.0,
            delta=0.0,
            pairs=0,
            counted=count,
            distribution=(
                f"all {count} pairs of the centre's run and {runs - 1} runs from states uniform on "
                f"the initial box, which are not independent; {what}"
            ),
        )


def _fitted(times: Array, runs: Array) -> tuple[float, float]:
    """Factor and rate for one state's runs (R, K+1)."""
    first, second = np.triu_indices(len(runs), k=1)
    distances = np.abs(runs[first] - runs[second])
    if np.any(distances[:, 0] <= _CLOSE):
        return 1.0, 0.0
    largest = (distances[:, 1:] / distances[:, :1]).max(axis=0)
    rows = largest > 0.0
    if not rows.any():
        return float(np.exp(_LEAST_LOG_FACTOR)), 0.0
    cp: Any = import_module("cvxpy")
    factor, rate = cp.Variable(), cp.Variable()
    middle = 0.5 * (1.0 + 1.0 / _WEIGHED_INSTANTS) * float(times[-1])
    problem = cp.Problem(
        cp.Minimize(factor + middle * rate),
        [
            factor + times[1:][rows] * rate >= np.log(largest[rows]),
            factor >= _LEAST_LOG_FACTOR,
            factor <= _LARGEST_LOG_FACTOR,
        ],
    )
    problem.solve(solver=cp.CLARABEL)
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        raise RuntimeError(f"the fit of the published tool did not solve: {problem.status}")
    return float(np.exp(factor.value)), float(rate.value)
