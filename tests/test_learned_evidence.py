"""The probabilities stated for a learned bound are exceeded as rarely as their confidence says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from learned_pairs import GivenPairs, random_pairs

from workbench.errors import InputError
from workbench.sensitivity import (
    APriori,
    Argument,
    HoldOut,
    MatrixForm,
    PiecewiseExponential,
    SetExponential,
    WaitAndJudge,
    learn_from_pairs,
)
from workbench.sensitivity.learning.form import Fit
from workbench.sensitivity.scenario import (
    hold_out_bound,
    judged_bound,
    judged_pairs_needed,
    pairs_needed,
    violation_bound,
)


def _defect(pairs: int, delta: float, support: int, epsilon: float) -> float:
    """Left minus right side of the equation for 1 - epsilon, as the source writes it."""
    t = 1.0 - epsilon
    left = sum(math.comb(m, support) * t ** (m - support) for m in range(support, pairs + 1))
    return delta / (pairs + 1) * left - math.comb(pairs, support) * t ** (pairs - support)


@given(st.integers(1, 80), st.integers(0, 12), st.floats(1e-6, 0.5))
def test_judged_bound_is_the_root_of_its_equation(pairs: int, support: int, delta: float) -> None:
    epsilon = judged_bound(pairs, delta=delta, support=support)
    if support >= pairs:
        assert epsilon == 1.0
        return
    assert 0.0 < epsilon <= 1.0
    # The left side is too small just before the root, and large enough from it on.
    assert _defect(pairs, delta, support, epsilon * (1.0 - 1e-6)) < 0.0
    if epsilon < 1.0:
        assert _defect(pairs, delta, support, epsilon) >= 0.0


@given(st.integers(5, 80), st.integers(0, 4), st.floats(1e-6, 0.5))
def test_the_bound_without_the_condition_on_support_is_no_larger(
    pairs: int, support: int, delta: float
) -> None:
    # Of compression: delta / N sum_{m = k}^{N - 1} C(m, k) t^(m - k) = C(N, k) t^(N - k).
    t = 1.0 - judged_bound(pairs, delta=delta, support=support)
    left = sum(math.comb(m, support) * t ** (m - support) for m in range(support, pairs))
    assert delta / pairs * left >= math.comb(pairs, support) * t ** (pairs - support)


def test_judging_costs_little_more_than_knowing_beforehand() -> None:
    for support in (2, 14, 60):
        known = violation_bound(40_000, delta=1e-6, parameters=support)
        judged = judged_bound(40_000, delta=1e-6, support=support)
        assert known < judged < 1.5 * known


def test_counts_beyond_a_machine_word_are_fine() -> None:
    needed = pairs_needed(1e-11, delta=1e-6, parameters=14)
    assert 1e12 < needed < 1e13
    assert violation_bound(needed, delta=1e-6, parameters=14) == pytest.approx(1e-11, rel=1e-6)


def test_more_support_means_a_larger_bound_and_needs_more_pairs() -> None:
    bounds = [judged_bound(2000, delta=1e-3, support=k) for k in range(0, 50, 7)]
    assert bounds == sorted(bounds)
    needed = judged_pairs_needed(0.01, delta=1e-3, support=7)
    assert judged_bound(needed, delta=1e-3, support=7) <= 0.01
    assert judged_bound(needed - 1, delta=1e-3, support=7) > 0.01
    assert judged_pairs_needed(0.01, delta=1e-3, support=8) > needed


@pytest.mark.parametrize("delta", [0.3, 0.01])
@pytest.mark.parametrize("pairs", [1, 20, 200])
def test_hold_out_limit_fails_no_more_often_than_delta_and_hardly_less(
    pairs: int, delta: float
) -> None:
    limits = np.array([hold_out_bound(v, pairs=pairs, delta=delta) for v in range(pairs + 1)])
    failures = []
    for true in np.linspace(0.001, 0.999, 200).tolist():
        chances = [
            math.comb(pairs, v) * true**v * (1.0 - true) ** (pairs - v) for v in range(pairs + 1)
        ]
        failures.append(float(np.sum(np.array(chances)[limits < true])))
    assert max(failures) <= delta * (1.0 + 1e-9)
    assert max(failures) > 0.5 * delta
    assert limits[-1] == 1.0


def _two_free_instants(rng: np.random.Generator, count: int) -> GivenPairs:
    """State 1 starts at 0 and reaches two independent uniform distances: two maxima carry it.

    State 0 vanishes at once: known before the runs, it needs no pair.
    """
    distances = np.zeros((count, 3, 2))
    distances[:, 0, 0] = 1.0
    distances[:, 1:, 1] = rng.random((count, 2))
    return GivenPairs(distances, np.array([0.0, 1.0, 2.0]), np.array([1.0, 0.0]))


def _violation(fit: Fit) -> float:
    """Exact probability that a further pair of `_two_free_instants` leaves the bound."""
    inside = [min(1.0, fit.growth.half_widths((1.0, 0.0), t)[1]) for t in (1.0, 2.0)]
    return 1.0 - inside[0] * inside[1]


def test_scenario_bounds_are_exceeded_as_often_as_delta_where_all_parameters_are_used() -> None:
    rng = np.random.default_rng(17)
    delta, repeats, pairs = 0.2, 150, 60
    # A line through two maxima: the violation is Beta(2, 59), and the bound its exact quantile.
    known = violation_bound(pairs, delta=delta, parameters=2)
    exceeded, judged, both = 0, 0, 0
    for _ in range(repeats):
        fit = SetExponential().fit(_two_free_instants(rng, pairs), pairs)
        violation = _violation(fit)
        exceeded += violation > known
        judged += violation > judged_bound(pairs, delta=delta, support=len(fit.support))
        both += len(fit.support) == 2
    spread = 3.0 * math.sqrt(delta * (1.0 - delta) / repeats)
    assert exceeded / repeats == pytest.approx(delta, abs=spread)
    assert judged <= exceeded
    assert both > 0.9 * repeats


@pytest.mark.parametrize(
    "form", [PiecewiseExponential(2), MatrixForm(2)], ids=["piecewise", "matrix"]
)
def test_judged_bounds_hold_on_fresh_pairs_and_those_are_counted_one_by_one(
    form: PiecewiseExponential | MatrixForm,
) -> None:
    train, fresh, broken = 80, 512, []
    for seed in range(12):
        pairs = random_pairs(seed, count=train + fresh, steps=4, scale=(1.0, 0.2))
        fit = form.fit(pairs, train)
        outside = np.array(
            [
                [
                    np.any(pair[k] > np.array(fit.growth.half_widths(tuple(pair[0]), t)))
                    for k, t in enumerate(pairs.times.tolist())
                ]
                for pair in pairs.distances[train:]
            ]
        )
        counted = HoldOut(0.05, fresh).state(fit, pairs, train)
        assert counted.counted == int(outside.any(axis=1).sum())
        assert counted.epsilon == hold_out_bound(counted.counted, pairs=fresh, delta=0.05)
        assert counted.epsilon_at_an_instant == hold_out_bound(
            int(outside.sum(axis=0).max()), pairs=fresh, delta=0.05
        )
        broken.append(
            [
                counted.counted / fresh > evidence.state(fit, pairs, train).epsilon
                for evidence in (WaitAndJudge(0.05), APriori(0.05))
            ]
        )
    # At most 5 % each; three of twelve would have a chance below 2 %.
    assert max(np.array(broken).sum(axis=0)) <= 2


def test_each_way_says_how_many_pairs_it_needs() -> None:
    assert APriori(1e-6).needed(1e-3, parameters=14) == 39_396
    assert APriori(1e-6).needed(1e-3, parameters=2) == 16_681
    assert HoldOut(1e-6, 1).needed(1e-3) == math.ceil(math.log(1e-6) / math.log1p(-1e-3))
    assert WaitAndJudge(1e-6).needed(1e-3, support=6) == judged_pairs_needed(
        1e-3, delta=1e-6, support=6
    )
    assert pairs_needed(1e-3, delta=1e-6, parameters=7) < WaitAndJudge(1e-6).needed(1e-3, support=6)


def test_statements_say_what_they_rest_on() -> None:
    pairs = random_pairs(3, count=500, steps=4, scale=(1.0, 0.2))
    learned = learn_from_pairs(
        pairs,
        count=300,
        form=SetExponential(),
        evidence=[APriori(0.01), WaitAndJudge(0.01), HoldOut(0.02, 200)],
        region=None,
    )
    known, judged, counted = learned.statements
    assert (known.argument, known.counted, known.pairs) == (Argument.A_PRIORI, 4, 300)
    assert (judged.argument, judged.pairs) == (Argument.WAIT_AND_JUDGE, 300)
    assert (counted.argument, counted.pairs) == (Argument.HOLD_OUT, 200)
    assert known.epsilon == known.epsilon_at_an_instant
    for statement in learned.statements:
        for text in (f"{statement.epsilon:.3g}", "as the test drew them", "at some step instant"):
            assert text in str(statement)
        assert "nothing is claimed between the instants" in str(statement)
        assert str(statement) in learned.condition
    assert "1 - 0.02" in str(counted)


def test_a_hold_out_beyond_the_source_and_wrong_numbers_are_refused() -> None:
    pairs = random_pairs(3, count=50, steps=4, scale=(1.0, 0.2))
    with pytest.raises(InputError, match="expected 60 pairs, and there are only 50"):
        learn_from_pairs(
            pairs, count=40, form=SetExponential(), evidence=[HoldOut(0.1, 20)], region=None
        )
    with pytest.raises(InputError, match="at least one statement"):
        learn_from_pairs(pairs, count=40, form=SetExponential(), evidence=[], region=None)
    for make in (APriori, WaitAndJudge):
        with pytest.raises(InputError, match="0 < delta < 1"):
            make(1.0)
    with pytest.raises(InputError, match="0 < delta < 1"):
        HoldOut(0.0, 5)
    with pytest.raises(InputError, match="at least 1 fresh pair"):
        HoldOut(0.1, 0)
    with pytest.raises(InputError, match="violations <= pairs"):
        hold_out_bound(6, pairs=5, delta=0.1)
    with pytest.raises(InputError, match="as support"):
        judged_bound(6, delta=0.1, support=-1)
