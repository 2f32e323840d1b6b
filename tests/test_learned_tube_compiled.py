"""The compiled learned tube is the Python one to rounding, for any form of beta and any regions."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest

from workbench.claims import Rigor
from workbench.codegen.learned_tube import CompiledLearnedTube
from workbench.errors import InputError
from workbench.models import system_from_casadi
from workbench.models.benchmarks import all_benchmarks
from workbench.reach import LearnedTube, ReachTube, TubeStatus, compute_tube
from workbench.sensitivity import (
    Discrepancy,
    LearnedExponential,
    MatrixForm,
    PublishedTool,
    learn_discrepancy,
)
from workbench.sensitivity.learning.evidence import APriori
from workbench.sensitivity.learning.learn import learn_from_pairs
from workbench.sensitivity.learning.model_simulator import ModelSimulator
from workbench.sensitivity.learning.simulated_pairs import SimulatedPairs
from workbench.sets import Box

STEP_S = 0.05
B2 = next(each for each in all_benchmarks() if each.name == "B2")
FIELDS = ("times", "lower", "upper", "lower_at", "upper_at")
ROUNDING = 1e-11


@dataclass(frozen=True)
class Summed:
    """A beta by sums: |e_i(t)| <= sum_j cos(i j + t)^2 r_j."""

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        return tuple(
            sum(math.cos(i * j + t_s) ** 2 * r for j, r in enumerate(initial))
            for i in range(len(initial))
        )


def summed() -> Discrepancy:
    ode = B2.system.ode
    return Discrepancy(ode.names, None, 3.0, "summed", Rigor.SAMPLED, "", Summed())


def learned() -> Discrepancy:
    method = LearnedExponential(pairs=300, seed=3, step_s=STEP_S, delta=1e-6)
    return learn_discrepancy(B2.system, initial_set=B2.initial_set, horizon_s=3.0, method=method)


def same(one: ReachTube, other: ReachTube) -> bool:
    return (one.status, one.names, one.rigor) == (other.status, other.names, other.rigor) and all(
        np.allclose(getattr(one, name), getattr(other, name), rtol=ROUNDING, atol=ROUNDING)
        for name in FIELDS
    )


def matrix() -> Discrepancy:
    box = B2.initial_set.reordered(B2.system.ode.names)
    simulator = ModelSimulator.of(B2.system, horizon_s=3.0, step_s=STEP_S)
    pairs = SimulatedPairs(simulator, box, 3)
    evidence = [APriori(1e-6)]
    return learn_from_pairs(pairs, count=300, form=MatrixForm(3), evidence=evidence, region=box)


def published() -> Discrepancy:
    tool = PublishedTool(seed=1, step_s=STEP_S)
    return tool.learn(B2.system, initial_set=B2.initial_set, horizon_s=3.0)


@pytest.mark.parametrize("bound", [learned, matrix, published, summed])
@pytest.mark.parametrize("regions", [{}, {"x": 2, "y": 3, "speed": 2}])
def test_compiled_and_python_give_one_tube(
    bound: Callable[[], Discrepancy], regions: dict[str, int]
) -> None:
    method = LearnedTube(bound(), regions, STEP_S)
    compiled = CompiledLearnedTube(B2.system, method, horizon_s=3.0)
    for horizon_s in (3.0, 0.35):
        python = compute_tube(
            B2.system, initial_set=B2.initial_set, horizon_s=horizon_s, method=method
        )
        assert python.complete
        found = compiled.tube(B2.initial_set, horizon_s=horizon_s)
        assert same(found, python)
        shifted = dataclasses.replace(python, upper_at=python.upper_at + 1e-9)
        assert not same(found, shifted)


def test_both_end_where_the_bound_or_the_numbers_do() -> None:
    small = Box.from_intervals(dict.fromkeys(B2.system.ode.names, (-1.0, 1.0)))
    bound = dataclasses.replace(summed(), region=small)
    compiled = CompiledLearnedTube(B2.system, LearnedTube(bound, {}, STEP_S), horizon_s=1.0)
    outside = compiled.tube(B2.initial_set, horizon_s=1.0)
    assert outside.status is TubeStatus.LEFT_REGION
    assert len(outside.lower) == 0

    x = ca.SX.sym("x", 2)
    explodes = system_from_casadi(x, ca.vertcat(x[0] ** 3, x[1]), ("x", "y"))
    box = Box(("x", "y"), (2.0, 0.0), (2.2, 0.1))
    flat = Discrepancy(("x", "y"), None, 3.0, "summed", Rigor.SAMPLED, "", Summed())
    method = LearnedTube(flat, {"x": 2}, STEP_S)
    python = compute_tube(explodes, initial_set=box, horizon_s=2.0, method=method)
    found = CompiledLearnedTube(explodes, method, horizon_s=2.0).tube(box, horizon_s=2.0)
    assert found.status is python.status is TubeStatus.ENCLOSURE_FAILED
    assert len(found.times) == len(python.times)


def test_a_radius_that_nothing_was_learned_of_has_no_tube() -> None:
    method = LearnedTube(dataclasses.replace(learned(), region=None), {}, STEP_S)
    compiled = CompiledLearnedTube(B2.system, method, horizon_s=1.0)
    sides = {name: B2.initial_set.interval(name) for name in B2.initial_set.names}
    wide = Box.from_intervals(sides | {"speed_integral": (0.0, 0.1)})
    assert compiled.tube(wide, horizon_s=1.0).status is TubeStatus.LEFT_REGION
    with pytest.raises(InputError, match="did not"):
        compute_tube(B2.system, initial_set=wide, horizon_s=1.0, method=method)


def test_a_horizon_beyond_the_compiled_one_is_refused() -> None:
    method = LearnedTube(summed(), {}, STEP_S)
    with pytest.raises(InputError, match="at most 20 steps"):
        CompiledLearnedTube(B2.system, method, horizon_s=1.0).tube(B2.initial_set, horizon_s=2.0)
