"""Learned tubes of B1 against trajectories that they have not seen, as docs/learned-beta shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.bench.tight_envelope import tight_envelope
from workbench.models.benchmarks import b1
from workbench.reach import ValidatedTube, compute_tube
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.learning.evidence import APriori
from workbench.sensitivity.learning.form import Form
from workbench.sensitivity.learning.learn import learn_from_pairs
from workbench.sensitivity.learning.model_simulator import ModelSimulator
from workbench.sensitivity.learning.published import PublishedTool
from workbench.sensitivity.learning.simulated_pairs import SimulatedPairs
from workbench.sensitivity.sampling import instants, rollout, uniform_states
from workbench.sensitivity.vectorised import Array

HORIZON_S = 3.0
STEP_S = 0.05
# The trajectories are integrated this much finer than they are looked at: their error is 1e-10.
_FINER = 4
_RUN_ERROR = 1e-9
_TEST_SEED = 2026


@final
@dataclass(frozen=True, slots=True, eq=False)
class Trajectories:
    """Distances from the middle run at the instants: random (N, K+1, n), vertices (V, K+1, n).

    judged (J,): the states that vary initially. true_x: half width in x at the end.
    """

    random: Array
    vertices: Array
    judged: tuple[int, ...]
    true_x: float


@final
@dataclass(frozen=True, slots=True)
class Score:
    """Of one tube: shares of random and of vertex trajectories that leave it at some instant in a
    judged state; shares of their instants after the first that are inside; half width in x at the
    end over the true one; epsilon of its statement, NaN without one."""

    random_leave: float
    vertices_leave: float
    random_inside: float
    vertices_inside: float
    width: float
    epsilon: float


def trajectories(count: int) -> Trajectories:
    """`count` random starts of B1, all vertices, and what is true of x at 3 s."""
    model = b1()
    box = model.initial_set.reordered(model.system.ode.names)
    starts = [
        np.array([box.center]),
        uniform_states(box, count, np.random.default_rng(_TEST_SEED)),
        np.unique(np.array(list(box.vertices())), axis=0),
    ]
    fine = rollout(
        model.system, np.concatenate(starts), horizon_s=HORIZON_S, step_s=STEP_S / _FINER
    )
    runs = fine[:, ::_FINER]
    distances = np.abs(runs[1:] - runs[0])
    ends = tight_envelope(np.array([0.0, HORIZON_S]), starts=2, seed=1)
    judged = tuple(np.flatnonzero(np.array(box.radius)).tolist())
    return Trajectories(distances[:count], distances[count:], judged, float(ends.distance[-1, 0]))


def score(half_widths: Array, seen: Trajectories, epsilon: float) -> Score:
    """Of half widths (K+1, n) about the middle run."""
    judged = list(seen.judged)
    limits = half_widths[:, judged] + _RUN_ERROR
    leave, share = [], []
    for group in (seen.random, seen.vertices):
        inside = np.all(group[:, :, judged] <= limits, axis=2)
        leave.append(1.0 - float(np.mean(np.all(inside, axis=1))))
        share.append(float(np.mean(inside[:, 1:])))
    width = float(half_widths[-1, 0]) / seen.true_x
    return Score(leave[0], leave[1], share[0], share[1], width, epsilon)


def _widths(bound: Discrepancy) -> Array:
    start = b1().initial_set.reordered(bound.names).radius
    return np.array([bound.radius(start, t) for t in instants(HORIZON_S, STEP_S).tolist()])


def published(seeds: Iterable[int], seen: Trajectories, tick: Callable[[], None]) -> list[Score]:
    """What the published tool learns from each seed."""
    model, scores = b1(), []
    for seed in seeds:
        tool = PublishedTool(seed=seed, step_s=STEP_S)
        bound = tool.learn(model.system, initial_set=model.initial_set, horizon_s=HORIZON_S)
        scores.append(score(_widths(bound), seen, float("nan")))
        tick()
    return scores


def learned(
    form: Form,
    pairs: int,
    *,
    delta: float,
    seeds: Iterable[int],
    seen: Trajectories,
    tick: Callable[[], None],
) -> list[Score]:
    """What `form` learns from `pairs` independent pairs of each seed, stated a priori."""
    model, scores = b1(), []
    simulator = ModelSimulator.of(model.system, horizon_s=HORIZON_S, step_s=STEP_S)
    for seed in seeds:
        bound = learn_from_pairs(
            SimulatedPairs(simulator, model.initial_set, seed),
            count=pairs,
            form=form,
            evidence=[APriori(delta=delta)],
            region=model.initial_set,
        )
        scores.append(score(_widths(bound), seen, bound.statements[0].epsilon))
        tick()
    return scores


def proved(seen: Trajectories) -> Score:
    """Of the validated tube."""
    model = b1()
    tube = compute_tube(
        model.system,
        initial_set=model.initial_set,
        horizon_s=HORIZON_S,
        method=ValidatedTube(STEP_S),
    )
    assert tube.complete, tube.message
    centre = np.array([model.initial_set.reordered(tube.names).center])
    fine = rollout(model.system, centre, horizon_s=HORIZON_S, step_s=STEP_S / _FINER)
    middle = fine[0, ::_FINER]
    half_widths = np.maximum(tube.upper_at - middle, middle - tube.lower_at)
    return score(half_widths, seen, 0.0)
