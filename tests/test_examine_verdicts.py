"""Cross-examination finds planted lies with a replayable witness and never refutes a true bound."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.benchmarks import b1
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode, system_from_casadi
from workbench.sensitivity import (
    Discrepancy,
    Examination,
    ExaminationVerdict,
    Examiner,
    GrowthMatrix,
    Inputs,
    LearnedExponential,
    ProvedEnvelope,
    cross_examine,
    derive_discrepancy,
    learn_discrepancy,
)
from workbench.sets.box import Box

_MATRIX = np.array([[0.0, 1.0], [-2.0, -0.3]])
_SET = Box.around({"position": 0.5, "rate": 0.0}, radius={"position": 0.2, "rate": 0.4})
_CENTRE = Examiner(
    samples=300,
    seed=0,
    step_s=0.1,
    goals_per_coordinate=6,
    rounds=5,
    starts=2,
    second_order_rounds=1,
    any_centre=False,
    closer=True,
    stays_in_region=Rigor.ENCLOSED,
)
_PAIRS = Examiner(
    samples=300,
    seed=0,
    step_s=0.1,
    goals_per_coordinate=6,
    rounds=5,
    starts=2,
    second_order_rounds=1,
    any_centre=True,
    closer=True,
    stays_in_region=Rigor.ENCLOSED,
)


@dataclass(frozen=True)
class _Tight:
    """The exact envelope |exp(A t)| r of a linear system; one state times `factor` near `at_s`."""

    matrix: np.ndarray
    factor: float
    coordinate: int
    at_s: float
    slack: float = 0.0

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        widths = (1.0 + self.slack) * np.abs(expm(self.matrix * t_s)) @ np.array(initial)
        if abs(t_s - self.at_s) < 0.05:
            widths[self.coordinate] *= self.factor
        return tuple(widths.tolist())


def _linear() -> Ode:
    x = ca.SX.sym("x", 2)
    return system_from_casadi(x, ca.DM(_MATRIX) @ x, ("position", "rate"))


def _claim(
    factor: float, coordinate: int = 0, at_s: float = 1.3, slack: float = 0.0
) -> Discrepancy:
    return Discrepancy(
        names=("position", "rate"),
        region=None,
        horizon_s=2.0,
        norm="planted",
        rigor=Rigor.SAMPLED,
        condition="none",
        growth=_Tight(_MATRIX, factor, coordinate, at_s, slack),
    )


def _examine(claim: Discrepancy, method: Examiner, *proved: ProvedEnvelope) -> Examination:
    return cross_examine(
        _linear(), initial_set=_SET, horizon_s=2.0, learned=claim, proved=proved, method=method
    )


@pytest.mark.parametrize("method", [_CENTRE, _PAIRS])
@pytest.mark.parametrize("factor", [0.99, 0.95, 0.8])
@pytest.mark.parametrize(("coordinate", "at_s"), [(0, 1.3), (1, 0.1), (1, 2.0)])
def test_a_shrunk_tight_envelope_is_refuted_where_it_was_shrunk(
    method: Examiner, factor: float, coordinate: int, at_s: float
) -> None:
    claim = _claim(factor, coordinate, at_s)
    outcome = _examine(claim, method)
    assert outcome.verdict is ExaminationVerdict.REFUTED
    witness = outcome.witness
    assert witness is not None
    assert witness.coordinate == claim.names[coordinate]
    assert witness.time_s == pytest.approx(at_s)
    assert _SET.contains(witness.first)
    assert _SET.contains(witness.second)
    assert witness.replay(_linear()) == witness.distance
    assert witness.excess > 10.0 * witness.integration_error
    flow = expm(_MATRIX * at_s) @ (np.array(witness.second) - np.array(witness.first))
    assert abs(flow[coordinate]) == pytest.approx(witness.distance, rel=1e-6)


@pytest.mark.parametrize("method", [_CENTRE, _PAIRS])
def test_a_true_bound_is_not_refuted_even_when_it_is_tight(method: Examiner) -> None:
    outcome = _examine(_claim(1.0), method)
    assert outcome.verdict is ExaminationVerdict.CONSISTENT
    assert outcome.witness is None
    np.testing.assert_allclose(outcome.driven, outcome.learned, rtol=1e-5)
    assert np.all(outcome.sampled <= outcome.driven)


def test_coverage_tells_where_the_bound_fails() -> None:
    # The slack covers the error of Runge-Kutta, which a tight bound would feel.
    coverage = {c.group: c for c in _examine(_claim(0.8, at_s=0.8, slack=1e-5), _PAIRS).coverage}
    assert set(coverage) == {"interior", "faces", "vertices", "other centres", "closer pairs"}
    assert coverage["vertices"].pairs == 4
    assert coverage["vertices"].whole_run == 0.5
    assert coverage["vertices"].per_instant[8] == 0.5
    assert coverage["vertices"].per_instant[7] == 1.0
    assert coverage["vertices"].worst_ratio == pytest.approx(1.25, rel=1e-4)
    assert 0.5 < coverage["interior"].whole_run < 1.0


def _envelope(scale: float, rigor: Rigor) -> ProvedEnvelope:
    growth = _Tight(_MATRIX, 1.0, 0, 1.0)
    return ProvedEnvelope(
        "exact",
        lambda t: tuple(scale * value for value in growth.half_widths(_SET.radius, t)),
        rigor,
        "none",
    )


def test_a_bound_above_a_proof_is_implied_by_it() -> None:
    outcome = _examine(_claim(1.1), _CENTRE, _envelope(1.0, Rigor.ENCLOSED))
    assert outcome.verdict is ExaminationVerdict.IMPLIED_BY_PROOF
    assert outcome.proved[0].implies_learned
    assert outcome.proved[0].worst_ratio == pytest.approx(1.0, rel=1e-5)


@pytest.mark.parametrize(
    ("method", "scale", "rigor"),
    [
        (_PAIRS, 1.0, Rigor.ENCLOSED),  # a tube about one run says nothing on other pairs
        (_CENTRE, 1.01, Rigor.ENCLOSED),  # not below the learned bound
        (_CENTRE, 1.0, Rigor.NUMERICAL),  # no proof
    ],
)
def test_nothing_weaker_counts_as_proof(method: Examiner, scale: float, rigor: Rigor) -> None:
    outcome = _examine(_claim(1.0), method, _envelope(scale, rigor))
    assert outcome.verdict is ExaminationVerdict.CONSISTENT


def test_a_derived_discrepancy_implies_a_looser_claim_for_all_pairs() -> None:
    x = ca.SX.sym("x")
    system = system_from_casadi(x, -2.0 * x, ("x",))
    box = Box.around({"x": 1.0}, radius={"x": 0.25})
    learned = learn_discrepancy(
        system,
        initial_set=box,
        horizon_s=1.0,
        method=LearnedExponential(pairs=20, seed=0, step_s=0.1, delta=0.1),
    )
    proved = derive_discrepancy(
        system, region=Box.around({"x": 0.0}, radius={"x": 2.0}), horizon_s=1.0,
        method=GrowthMatrix(cells=1, inputs=Inputs.SHARED),
    )  # fmt: skip
    outcome = cross_examine(
        system, initial_set=box, horizon_s=1.0, learned=learned, proved=[proved], method=_PAIRS
    )
    assert outcome.verdict is ExaminationVerdict.IMPLIED_BY_PROOF
    assert outcome.proved[0].worst_ratio == pytest.approx(1.0, rel=1e-4)


def test_a_bound_of_zero_for_a_state_that_moves_is_refuted() -> None:
    outcome = _examine(_claim(0.0), _CENTRE)
    assert outcome.verdict is ExaminationVerdict.REFUTED
    assert outcome.witness is not None
    assert outcome.witness.bound == 0.0


def test_parameter_ranges_take_part_and_stand_in_the_witness() -> None:
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    ranges = (Ranged("growth", "1/s", 0.0, -1.0, 1.0),)
    ode = Ode("grow", (Signal("x", ""),), ranges, (), x, p, ca.SX(0, 1), p * x)
    growth = _Tight(np.array([[0.5]]), 1.0, 0, 0.0)
    claim = Discrepancy(("x",), None, 1.0, "planted", Rigor.SAMPLED, "none", growth)
    box = Box.around({"x": 1.0}, radius={"x": 0.5})
    outcome = cross_examine(
        ode, initial_set=box, horizon_s=1.0, learned=claim, proved=(), method=_CENTRE
    )
    witness = outcome.witness
    assert witness is not None
    assert witness.parameters[0] > 0.5
    expected = 0.5 * math.exp(witness.parameters[0] * witness.time_s)
    assert witness.replay(ode) == pytest.approx(expected, rel=1e-6)


def test_the_learned_bound_of_b1_fails_at_vertices_although_samples_obey_it() -> None:
    benchmark = b1()
    learned = learn_discrepancy(
        benchmark.system,
        initial_set=benchmark.initial_set,
        horizon_s=3.0,
        method=LearnedExponential(pairs=2000, seed=0, step_s=0.05, delta=1e-6),
    )
    outcome = cross_examine(
        benchmark.system,
        initial_set=benchmark.initial_set,
        horizon_s=3.0,
        learned=learned,
        proved=(),
        method=Examiner(
            samples=2000,
            seed=1,
            step_s=0.05,
            goals_per_coordinate=4,
            rounds=2,
            starts=2,
            second_order_rounds=1,
            any_centre=False,
            closer=False,
            stays_in_region=Rigor.ENCLOSED,
        ),
    )
    coverage = {c.group: c.whole_run for c in outcome.coverage}
    assert outcome.verdict is ExaminationVerdict.REFUTED
    assert coverage["interior"] > 0.99
    assert coverage["vertices"] < 0.9


def test_a_bound_over_other_states_is_refused() -> None:
    x = ca.SX.sym("x", 2)
    other = system_from_casadi(x, x, ("a", "b"))
    with pytest.raises(InputError, match="a bound over"):
        cross_examine(
            other,
            initial_set=Box.around({"a": 0.0, "b": 0.0}, radius={"a": 1.0}),
            horizon_s=1.0,
            learned=_claim(1.0),
            proved=(),
            method=_CENTRE,
        )


def test_a_bound_that_shrinks_too_fast_is_refuted_by_closer_pairs() -> None:
    @dataclass(frozen=True)
    class Shrinking:
        def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
            share = max(r / s for r, s in zip(initial, _SET.radius, strict=True))
            exact = _Tight(_MATRIX, 1.0, 0, 9.0, slack=1e-4).half_widths(initial, t_s)
            return tuple(min(share, 1.0) * width for width in exact)

    claim = Discrepancy(
        ("position", "rate"), None, 2.0, "shrinking", Rigor.SAMPLED, "none", Shrinking()
    )
    outcome = _examine(claim, _CENTRE)
    witness = outcome.witness
    assert outcome.verdict is ExaminationVerdict.REFUTED
    assert witness is not None
    gap = np.abs(np.array(witness.second) - np.array(witness.first)) / np.array(_SET.radius)
    assert gap.max() < 0.6
    assert {each.group: each.whole_run for each in outcome.coverage}["closer pairs"] < 0.5
    alone = _examine(claim, dataclasses.replace(_CENTRE, closer=False))
    assert alone.verdict is ExaminationVerdict.CONSISTENT


def test_a_lie_at_the_very_start_is_found() -> None:
    outcome = _examine(_claim(0.99, 0, 0.0), _CENTRE)
    assert outcome.witness is not None
    assert outcome.witness.time_s == 0.0
    assert outcome.witness.replay(_linear()) == pytest.approx(0.2)


@dataclass(frozen=True)
class _Shrinking:
    """A tenth of the initial distance, whatever the time."""

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """At every time but the first."""
        return tuple((0.1 if t_s > 0.0 else 1.0) * width for width in initial)


@pytest.mark.parametrize("method", [_CENTRE, _PAIRS])
def test_runs_that_end_beyond_all_numbers_do_not_hide_a_witness(method: Examiner) -> None:
    """Half of the set blows up, the other half stays near where it began."""
    x = ca.SX.sym("x")
    system = system_from_casadi(x, 1e3 * ca.fmax(0.0, x - 0.5) ** 3, ("x",))
    claim = dataclasses.replace(_claim(1.0), names=("x",), growth=_Shrinking())
    found = cross_examine(
        system, initial_set=Box(("x",), (-1.0,), (1.5,)), horizon_s=2.0, learned=claim,
        proved=(), method=dataclasses.replace(method, closer=False),
    )  # fmt: skip
    assert np.isinf([each.worst_ratio for each in found.coverage]).any()
    assert found.verdict is ExaminationVerdict.REFUTED
    assert found.witness is not None
    assert math.isfinite(found.witness.distance)
