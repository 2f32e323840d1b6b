"""A decision kernel of the shipped vehicle that is quick to measure, and scenes for it."""

from __future__ import annotations

import functools

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.bench.decision_kernel import DecisionKernel, decision_kernel
from workbench.bench.decision_scenes import Scene, random_scenes
from workbench.codegen.decision_source import DecisionSizes
from workbench.reach.online.kernels import LOCAL_LINEAR, Method

BUDGET = 160


@functools.cache
def small_kernel(method: Method = LOCAL_LINEAR) -> DecisionKernel:
    """Tubes of 1.5 s, in which most cars can stop; some scenes need more than the budget."""
    return decision_kernel(DecisionSizes(30, 0.05, 3, 0, BUDGET, method))


@functools.cache
def scenes() -> tuple[Scene, ...]:
    return tuple(random_scenes(60, seed=3))
