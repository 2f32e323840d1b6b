"""The published tool's behaviour is what its code does: settings, shortcut, and end of step."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import linprog

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.benchmarks import b1
from workbench.sensitivity import Argument, PublishedTool, learn_discrepancy
from workbench.sensitivity.learning.published import PublishedEnvelope
from workbench.sets.box import Box

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Shrinking:
    """Two states: one shrinks, one swings and depends on the first."""

    rate: float = -1.0
    what: str = "a made-up box"

    @property
    def names(self) -> tuple[str, ...]:
        return ("first", "second")

    @property
    def times(self) -> Array:
        return np.linspace(0.0, 2.0, 21)

    def runs(self, initial_states: Array, seeds: npt.NDArray[np.uint64]) -> Array:
        assert len(set(seeds.tolist())) == 1
        t = self.times
        first = initial_states[:, :1] * np.exp(self.rate * t)
        second = initial_states[:, 1:] * (1.0 + 0.5 * np.sin(3.0 * t)) + 0.3 * t * first
        return np.stack([first, second], axis=2)


_BOX = Box.around({"first": 1.0, "second": 0.0}, radius={"first": 5.0, "second": 5.0})


def _envelope(tool: PublishedTool, box: Box = _BOX) -> PublishedEnvelope:
    growth = tool.learn_from(_Shrinking(), box=box).growth
    assert isinstance(growth, PublishedEnvelope)
    return growth


def _reference(box: Box, *, seed: int, traces: int, state: int) -> tuple[float, float]:
    """ln K and rate by scipy over every pair and instant, with the tool's objective."""
    simulator = _Shrinking()
    rng = np.random.default_rng(seed)
    lower, upper = np.array(box.lower), np.array(box.upper)
    states = np.concatenate([[box.center], lower + rng.random((traces, 2)) * (upper - lower)])
    runs = simulator.runs(states, np.zeros(len(states), dtype=np.uint64))[:, :, state]
    rows, heights = [], []
    for one, other in itertools.combinations(runs, 2):
        for t, a, b in list(zip(simulator.times, one, other, strict=True))[1:]:
            rows.append([-1.0, -t])
            heights.append(-math.log(abs(a - b) / abs(one[0] - other[0])))
    found = linprog(
        [100.0, 50.5 * 2.0], A_ub=rows, b_ub=heights, bounds=[(0.01, 10.0), (None, None)]
    )
    return float(found.x[0]), float(found.x[1])


def test_factor_and_rate_are_the_linear_programs() -> None:
    envelope = _envelope(PublishedTool(seed=3, step_s=0.1))
    for state in (0, 1):
        log_factor, rate = _reference(_BOX, seed=3, traces=10, state=state)
        assert math.log(envelope.factor[state]) == pytest.approx(log_factor, abs=1e-4)
        assert envelope.rate_per_s[state] == pytest.approx(rate, abs=1e-4)


def test_exact_shrinking_gets_the_smallest_factor_allowed() -> None:
    envelope = _envelope(PublishedTool(seed=3, step_s=0.1))
    assert envelope.factor[0] == pytest.approx(math.exp(0.01), rel=1e-4)
    # The line only has to be above ratios from the first step on.
    assert envelope.rate_per_s[0] == pytest.approx(-1.0 - 0.01 / 2.0, abs=1e-3)


def test_two_close_starts_switch_the_learning_of_a_state_off() -> None:
    narrow = Box.around({"first": 1.0, "second": 0.0}, radius={"first": 4e-3, "second": 5.0})
    envelope = _envelope(PublishedTool(seed=3, step_s=0.1), narrow)
    assert (envelope.factor[0], envelope.rate_per_s[0]) == (1.0, 0.0)
    assert envelope.factor[1] > 1.0
    wide = _envelope(PublishedTool(seed=3, step_s=0.1))
    assert wide.rate_per_s[0] != 0.0


def test_a_step_gets_the_width_of_its_end() -> None:
    envelope = PublishedEnvelope((2.0,), (-1.0,), 0.5)
    for t, end in [(0.0, 0.5), (0.2, 0.5), (0.5, 0.5), (0.7, 1.0), (1.0, 1.0), (1.1, 1.5)]:
        assert envelope.half_widths((3.0,), t)[0] == pytest.approx(6.0 * math.exp(-end))


def test_one_seed_one_answer_and_no_promise() -> None:
    tool = PublishedTool(seed=3, step_s=0.1)
    learned = tool.learn_from(_Shrinking(), box=_BOX)
    assert learned.growth == tool.learn_from(_Shrinking(), box=_BOX).growth
    assert learned.growth != _envelope(PublishedTool(seed=4, step_s=0.1))
    (statement,) = learned.statements
    assert statement.argument is Argument.NONE
    assert (statement.epsilon, statement.pairs) == (1.0, 0)
    assert "no probability is claimed" in learned.condition
    assert "all 55 pairs" in learned.condition
    assert learned.rigor is Rigor.SAMPLED


def test_on_b1_it_leaves_most_states_unlearned_and_loses_the_integrals() -> None:
    loop = b1()
    learned = learn_discrepancy(
        loop.system,
        initial_set=loop.initial_set,
        horizon_s=3.0,
        method=PublishedTool(seed=0, step_s=0.05),
    )
    envelope = learned.growth
    assert isinstance(envelope, PublishedEnvelope)
    names = learned.names
    unlearned = {
        n
        for n, k, g in zip(names, envelope.factor, envelope.rate_per_s, strict=True)
        if (k, g) == (1.0, 0.0)
    }
    assert {"steering", "speed_integral", "offset_integral"} <= unlearned
    # Both integrals move, and the bound on them stays 0.
    assert learned.radius(loop.initial_set.radius, 3.0)[names.index("offset_integral")] == 0.0


def test_runs_that_leave_the_numbers_and_too_few_traces_are_refused() -> None:
    with pytest.raises(InputError, match="finite"), np.errstate(all="ignore"):
        PublishedTool(seed=3, step_s=0.1).learn_from(_Shrinking(rate=1000.0), box=_BOX)
    with pytest.raises(InputError, match="at least 2 traces"):
        PublishedTool(seed=3, step_s=0.1, traces=1)
