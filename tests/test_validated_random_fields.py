"""Claim: no run of a random field leaves its tube: kinks, parameters and inputs that switch."""

from __future__ import annotations

import itertools

import casadi as ca
import numpy as np
import pytest
from tube_cases import Array, assert_contains, disturbed, march

from workbench.models import Ode, Ranged
from workbench.reach import ReachTube, compute_tube
from workbench.reach.validated.tube import ValidatedTube
from workbench.sets import Box

NAMES = ("x", "y", "z")
# Runs follow inputs that switch every 4 ms; the Runge-Kutta error across a kink is below this.
ALLOWANCE = 2e-7


def expression(rng: np.random.Generator, leaves: list[ca.SX], depth: int) -> ca.SX:
    """A random expression that is smooth but for its kinks, and defined everywhere."""
    if depth == 0 or rng.random() < 0.15:
        constant = ca.SX(float(rng.normal()))
        return leaves[rng.integers(len(leaves))] if rng.random() < 0.8 else constant
    a, b = (expression(rng, leaves, depth - 1) for _ in range(2))
    limit = 0.5 * abs(float(rng.normal()))
    made = [
        a + b, a - b, a * b, a * b, ca.sin(a), ca.cos(a), ca.tanh(a), ca.atan(0.5 * a),
        1 / (2 + a * a), ca.sqrt(1.5 + a * a), ca.fabs(a), ca.fmin(a, b), ca.fmax(a, b),
        ca.fmin(ca.fmax(a, -limit), limit), ca.atan2(a, 2 + ca.fabs(b)), ca.exp(-a * a),
        ca.asin(0.5 * ca.sin(a)), a / (3 + ca.cos(b)), b * ca.if_else(a < 0, a, 2 * a),
    ]  # fmt: skip
    return made[rng.integers(len(made))]


def random_system(rng: np.random.Generator, depth: int) -> Ode:
    n, n_p, n_w = (int(rng.integers(low, 3)) for low in (1, 0, 0))
    parameters = tuple(
        Ranged(f"p{i}", "", 0.3, 0.3 - d, 0.3 + d)
        for i, d in enumerate(rng.choice([0.0, 0.2], n_p))
    )
    inputs = tuple(
        Ranged(f"w{i}", "", 0.0, -d, 2 * d) for i, d in enumerate(rng.choice([0.02, 0.2], n_w))
    )

    def field(x: ca.SX, p: ca.SX, w: ca.SX) -> list[ca.SX]:
        leaves = [*ca.vertsplit(x), *ca.vertsplit(p), *ca.vertsplit(w)]
        return [0.5 * expression(rng, leaves, depth) - 0.3 * x[i] for i in range(n)]

    return disturbed(field, NAMES[:n], parameters=parameters, disturbances=inputs)


def fine_times(tube: ReachTube) -> Array:
    """All instants, and times at most 4 ms apart between them."""
    parts = [
        np.linspace(start, end, max(3, int((end - start) / 0.004) + 1))[1:]
        for start, end in itertools.pairwise(tube.times)
    ]
    return np.concatenate([tube.times[:1], *parts])


def switching(rng: np.random.Generator, ode: Ode, runs: int, steps: int) -> Array:
    """Inputs (runs, steps, n_w) at their ends; some runs never switch, some do often."""
    lower, upper = (
        np.array([getattr(d, end) for d in ode.disturbances]) for end in ("lower", "upper")
    )
    flips = (
        rng.random((runs, steps, len(lower))) < rng.choice([0.0, 0.01, 0.2], runs)[:, None, None]
    )
    high = (np.cumsum(flips, axis=1) + rng.integers(0, 2, (runs, 1, len(lower)))) % 2 == 1
    return np.where(high, upper, lower)


def contained(seed: int, depth: int) -> bool:
    """Whether there was a tube to hold runs against; none of them may leave it."""
    rng = np.random.default_rng(seed)
    ode = random_system(rng, depth)
    n, runs = len(ode.names), 80
    center, radius = rng.normal(size=n) * 0.5, rng.choice([0.0, 1e-6, 0.05, 0.2], n)
    start = Box(ode.names, tuple(center - radius), tuple(center + radius))
    method = ValidatedTube(float(rng.choice([0.05, 0.13])), int(rng.integers(1, 4)))
    tube = compute_tube(ode, initial_set=start, horizon_s=0.5, method=method)
    if len(tube.times) < 2:
        return False
    signs = np.sign(rng.normal(size=(runs, n))) * np.where(rng.random((runs, 1)) < 0.7, 1.0, 0.4)
    states = np.clip(center + radius * signs, center - radius, center + radius)
    times = fine_times(tube)
    ends = [np.array([q.lower, q.nominal, q.upper]) for q in ode.parameters]
    held = np.array([rng.choice(e, runs) for e in ends]).T.reshape(runs, len(ends))
    inputs = switching(rng, ode, runs, len(times) - 1)
    followed = march(
        ode, states, times,
        parameters=held if ode.parameters else None,
        disturbances=inputs if ode.disturbances else None,
    )  # fmt: skip
    assert_contains(tube, times, followed, ALLOWANCE)
    return True


@pytest.mark.parametrize("seed", range(8))
def test_no_run_leaves(seed: int) -> None:
    contained(seed, 3)


@pytest.mark.campaign
def test_no_run_of_many_fields_leaves() -> None:
    assert sum(contained(seed, 4) for seed in range(1000, 1150)) > 120
