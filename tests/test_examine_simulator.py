"""A bound on a black box's runs is refuted by a pair that the box repeats, and else let be."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import pytest

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.sensitivity import Discrepancy, ExaminationVerdict, Examiner
from workbench.sensitivity.examine_simulator import cross_examine_simulator
from workbench.sensitivity.learning.drawing import Workforce
from workbench.sensitivity.learning.pairs import Simulator
from workbench.sets import Box

_SET = Box.around({"a": 1.0, "b": 0.0}, radius={"a": 0.5, "b": 0.0})
_HERE = Workforce(1, 64)
_SAMPLING = Examiner(
    samples=40,
    seed=3,
    step_s=0.5,
    goals_per_coordinate=2,
    rounds=0,
    starts=1,
    second_order_rounds=0,
    any_centre=False,
    closer=False,
    stays_in_region=Rigor.SAMPLED,
)


@dataclass(frozen=True)
class _Peaked:
    """b grows with the height of a narrow peak at a = 1.37, which samples seldom meet."""

    names: tuple[str, ...] = ("a", "b")
    what: str = "a peak"

    @property
    def times(self) -> np.ndarray:
        return np.array([0.0, 0.5, 1.0])

    def runs(self, initial_states: np.ndarray, seeds: np.ndarray) -> np.ndarray:
        a, b = initial_states.T
        height = np.exp(-(((a - 1.37) / 0.1) ** 2)) - np.exp(-((0.37 / 0.1) ** 2))
        later = [np.stack([a, b + t * height], axis=1) for t in self.times]
        return np.stack(later, axis=1)


@dataclass
class _Forgetful:
    """Another answer at every call."""

    names: tuple[str, ...] = ("a", "b")
    what: str = "noise"
    calls: int = 0

    @property
    def times(self) -> np.ndarray:
        return np.array([0.0, 0.5, 1.0])

    def runs(self, initial_states: np.ndarray, seeds: np.ndarray) -> np.ndarray:
        self.calls += 1
        noise = np.random.default_rng(self.calls).normal(size=(len(initial_states), 3, 2))
        noise[:, 0] = 0.0
        return initial_states[:, None] + noise


@dataclass(frozen=True)
class _Steady:
    """At most `a` and, from 0.5 s on, `b` apart."""

    b: float

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        return (initial[0], self.b * t_s)


def _claim(b: float, horizon_s: float = 1.0, names: tuple[str, ...] = ("a", "b")) -> Discrepancy:
    return Discrepancy(names, None, horizon_s, "planted", Rigor.SAMPLED, "none", _Steady(b))


def _examine(simulator: Simulator, claim: Discrepancy, method: Examiner = _SAMPLING):
    return cross_examine_simulator(
        simulator, initial_set=_SET, learned=claim, method=method, workforce=_HERE
    )


def test_a_lie_that_samples_meet_leaves_a_witness_that_the_box_repeats() -> None:
    found = _examine(_Peaked(), _claim(0.5))
    witness = found.witness
    assert found.verdict is ExaminationVerdict.REFUTED
    assert witness is not None
    assert witness.coordinate == "b"
    assert witness.replay(_Peaked()) == witness.distance
    assert witness.excess > 0.0
    assert _SET.contains(witness.first)
    assert _SET.contains(witness.second)
    height = math.exp(-(((witness.second[0] - 1.37) / 0.1) ** 2)) - math.exp(-(3.7**2))
    assert witness.distance == pytest.approx(witness.time_s * height)


def test_differences_climb_to_what_samples_miss() -> None:
    claim = _claim(0.9999)
    assert _examine(_Peaked(), claim).verdict is ExaminationVerdict.CONSISTENT
    driven = _examine(_Peaked(), claim, dataclasses.replace(_SAMPLING, rounds=25))
    assert driven.verdict is ExaminationVerdict.REFUTED
    assert driven.driven[-1, 1] == pytest.approx(1.0, abs=1e-4)


def test_a_true_bound_is_consistent_and_nothing_more() -> None:
    found = _examine(_Peaked(), _claim(1.0), dataclasses.replace(_SAMPLING, rounds=5, closer=True))
    assert found.verdict is ExaminationVerdict.CONSISTENT
    assert found.proved == ()
    assert {each.group for each in found.coverage} >= {"interior", "vertices", "closer pairs"}


def test_what_the_box_does_not_repeat_refutes_nothing() -> None:
    found = _examine(_Forgetful(), _claim(0.01))
    assert found.verdict is ExaminationVerdict.CONSISTENT
    assert found.coverage[0].whole_run < 0.5


def test_the_two_runs_of_a_pair_share_their_seed() -> None:
    seen: list[np.ndarray] = []

    @dataclass(frozen=True)
    class Watched:
        names: tuple[str, ...] = ("a", "b")
        what: str = "watched"
        times = np.array([0.0, 0.5, 1.0])

        def runs(self, initial_states: np.ndarray, seeds: np.ndarray) -> np.ndarray:
            seen.append(seeds)
            return np.repeat(initial_states[:, None], 3, axis=1)

    _examine(Watched(), _claim(1.0))
    assert seen
    for seeds in seen:
        half = len(seeds) // 2
        np.testing.assert_array_equal(seeds[:half], seeds[half:])
    assert len(np.unique(seen[0])) > 10


@pytest.mark.parametrize(
    ("claim", "message"),
    [(_claim(1.0, names=("a", "c")), "a bound over"), (_claim(1.0, horizon_s=0.5), "up to 1 s")],
)
def test_a_bound_of_something_else_is_refused(claim: Discrepancy, message: str) -> None:
    with pytest.raises(InputError, match=message):
        _examine(_Peaked(), claim)
