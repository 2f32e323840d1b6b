"""Claim: intervals and statements count recordings, not steps, and agree with their formulas."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest

from workbench.errors import InputError
from workbench.simulation.conformance.counting import clustered, containment, statement
from workbench.simulation.conformance.enclosing import Enclosed


@given(st.integers(1, 60), st.data())
def test_with_one_trial_per_recording_the_interval_is_clopper_and_pearsons(
    of: int, data: st.DataObject
) -> None:
    inside = data.draw(st.integers(0, of))
    share = clustered(inside, sizes=[1] * of)
    exact = binomtest(inside, of).proportion_ci(0.95, method="exact")
    assert share.low == pytest.approx(exact.low, abs=1e-9)
    assert share.high == pytest.approx(exact.high, abs=1e-9)


@given(st.integers(1, 40), st.integers(1, 30), st.data())
def test_more_windows_of_the_same_recordings_do_not_narrow_the_interval(
    recordings: int, each: int, data: st.DataObject
) -> None:
    inside = data.draw(st.integers(0, recordings))
    one = clustered(inside, sizes=[1] * recordings)
    many = clustered(inside * each, sizes=[each] * recordings)
    assert (one.low, one.high) == pytest.approx((many.low, many.high))


@pytest.mark.parametrize(
    "sizes", [[6, 1, 8, 11, 7, 7], [100, 1, 1, 1, 1, 1], [7] * 6, [1, 2, 4, 8, 16, 32]]
)
def test_the_interval_holds_the_truth_where_recordings_are_inside_as_a_whole(
    sizes: list[int],
) -> None:
    """Exactly, over all outcomes: the worst dependence that windows of one recording can have."""
    outcomes = np.array(list(itertools.product((0, 1), repeat=len(sizes))))
    shares = [clustered(int(inside), sizes=sizes) for inside in outcomes @ sizes]
    low, high = (np.array([getattr(each, end) for each in shares]) for end in ("low", "high"))
    whole = outcomes.sum(axis=1)
    for truth in np.linspace(0.02, 0.98, 49):
        weight = truth**whole * (1.0 - truth) ** (len(sizes) - whole)
        assert weight[(low <= truth) & (truth <= high)].sum() >= 0.95


@pytest.mark.parametrize(("inside", "sizes"), [(2, [1]), (-1, [1]), (1, [1, 0]), (0, [])])
def test_counts_that_cannot_be_are_refused(inside: int, sizes: list[int]) -> None:
    with pytest.raises(InputError, match="expected recordings of at least one step"):
        clustered(inside, sizes=sizes)


def test_the_bound_known_before_the_fit_solves_its_equation() -> None:
    stated = statement(recordings=80, parameters=3, discards=False, supporting=2)
    assert binom.cdf(2, 80, stated.a_priori) == pytest.approx(0.05, rel=1e-6)


def test_nothing_is_known_before_a_fit_that_may_leave_windows_out() -> None:
    stated = statement(recordings=80, parameters=3, discards=True, supporting=2)
    assert stated.a_priori is None
    assert "nothing was known before the fit" in str(stated)
    assert stated.epsilon < 1.0


def test_wait_and_judge_solves_its_equation() -> None:
    stated = statement(recordings=50, parameters=3, discards=False, supporting=2)
    assert 50 * math.comb(50, 2) * (1.0 - stated.epsilon) ** 48 == pytest.approx(0.05)


@given(st.integers(2, 200), st.integers(0, 5))
def test_more_recordings_say_more_and_more_deciding_ones_less(count: int, supporting: int) -> None:
    def epsilon(recordings: int, deciding: int) -> float:
        return statement(
            recordings=recordings, parameters=3, discards=False, supporting=deciding
        ).epsilon

    assert epsilon(count + 50, supporting) <= epsilon(count, supporting)
    assert epsilon(count, supporting) <= epsilon(count, supporting + 1)


def test_too_few_recordings_say_nothing() -> None:
    stated = statement(recordings=2, parameters=3, discards=False, supporting=2)
    assert (stated.epsilon, stated.a_priori) == (1.0, 1.0)
    assert "which says nothing" in str(stated)
    assert statement(recordings=0, parameters=3, discards=False, supporting=0).epsilon == 1.0


def test_steps_windows_and_recordings_are_counted() -> None:
    inside = np.array([[True, True], [True, False], [True, True]])
    ones = np.ones((3, 2, 2))
    area = np.array([[1.0, 3.0], [1.0, np.nan], [2.0, 2.0]])
    found = containment(Enclosed(("a", "a", "b"), ones, ones, inside, area))
    assert (found.steps.inside, found.steps.of) == (5, 6)
    assert (found.windows.inside, found.windows.of) == (2, 3)
    assert (found.recordings.inside, found.recordings.of) == (1, 2)
    assert found.windows.trials == pytest.approx(9.0 / 5.0)
    assert found.recordings.trials == 2.0
    assert found.proof_ended == 1
    assert found.mean_area_m2 == pytest.approx(9.0 / 5.0)
    assert [each.windows_inside for each in found.by_recording] == [1, 1]
