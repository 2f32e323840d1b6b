"""Every fitted form contains every pair it was fitted to at every instant, and few carry it."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from learned_pairs import Array, GivenPairs, random_pairs

from workbench.errors import InputError
from workbench.models.system import system_from_casadi
from workbench.sensitivity import (
    APriori,
    GlobalExponential,
    MatrixForm,
    PiecewiseExponential,
    SetExponential,
    learn_from_pairs,
)
from workbench.sensitivity.learning.form import Form
from workbench.sensitivity.learning.model_simulator import ModelSimulator
from workbench.sensitivity.learning.simulated_pairs import SimulatedPairs
from workbench.sets.box import Box

_COUPLED = (SetExponential(), PiecewiseExponential(1), PiecewiseExponential(3), MatrixForm(2))
_FORMS = (GlobalExponential(), *_COUPLED)
_ids = pytest.mark.parametrize("form", _FORMS, ids=lambda form: form.name)
_coupled_ids = pytest.mark.parametrize("form", _COUPLED, ids=lambda form: form.name)


def _contains(form: Form, pairs: GivenPairs) -> None:
    growth = form.fit(pairs, len(pairs.distances)).growth
    bounds = growth.bounds(pairs.distances[:, 0], pairs.times)
    assert np.all(pairs.distances <= bounds)
    for pair in pairs.distances[:3]:
        for k, t in enumerate(pairs.times.tolist()):
            assert np.all(pair[k] <= np.array(growth.half_widths(tuple(pair[0]), t)))


_DISTANCE = st.one_of(st.just(0.0), st.floats(1e-9, 1e9))


@settings(max_examples=25, deadline=None)
@given(arrays(np.float64, (4, 4, 3), elements=_DISTANCE), st.sampled_from(_COUPLED))
def test_coupled_forms_contain_any_pairs(distances: Array, form: Form) -> None:
    # State 0 always differs at first, state 1 sometimes, state 2 never.
    distances[:, 0] = np.minimum(distances[:, 0], 2.0)
    distances[:, 0, 0] = np.maximum(distances[:, 0, 0], 1e-6)
    distances[:, 0, 2] = 0.0
    _contains(form, GivenPairs(distances, np.arange(4.0), np.array([1.0, 0.5, 0.0])))


@settings(max_examples=15, deadline=None)
@given(arrays(np.float64, (4, 4, 2), elements=_DISTANCE))
def test_the_published_form_contains_any_pairs_that_differ_in_every_state(distances: Array) -> None:
    distances[:, 0] = np.clip(distances[:, 0], 1e-6, 2.0)
    _contains(GlobalExponential(), GivenPairs(distances, np.arange(4.0), np.ones(2)))


@_ids
@pytest.mark.parametrize("seed", range(3))
def test_fits_contain_what_they_were_fitted_to_and_hold_with_nothing_to_spare(
    form: Form, seed: int
) -> None:
    pairs = random_pairs(seed, count=700, steps=8, scale=(1.0, 0.1, 3.0))
    fit = form.fit(pairs, 700)
    ratios = pairs.distances / fit.growth.bounds(pairs.distances[:, 0], pairs.times)
    assert ratios.max() <= 1.0
    assert np.all(ratios[:, 1:].max(axis=(0, 1)) > 1.0 - 1e-5)


@_ids
def test_the_pairs_that_carry_a_fit_alone_give_it_and_no_other_pair_matters(form: Form) -> None:
    pairs = random_pairs(5, count=700, steps=8, scale=(1.0, 0.1, 3.0))
    fit = form.fit(pairs, 700)
    assert 0 < len(fit.support) <= fit.parameters
    assert max(fit.support) >= 512, "expected pairs beyond the first block among them"

    def widths(of: GivenPairs) -> Array:
        growth = form.fit(of, len(of.distances)).growth
        return growth.bounds(pairs.distances[:20, 0], pairs.times)

    everything = widths(pairs)
    assert widths(pairs.only(fit.support)) == pytest.approx(everything, rel=1e-4)
    for left_out in fit.support[:4]:
        fewer = widths(pairs.only(tuple(p for p in fit.support if p != left_out)))
        assert fewer != pytest.approx(everything, rel=1e-4)


@pytest.mark.parametrize("seed", [1, 52, 53])
def test_where_many_matrices_cost_the_same_the_carrying_pairs_decide_too(seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps = int(rng.integers(2, 6))
    distances = rng.integers(0 if seed % 2 else 1, 4, (30, steps + 1, 2)).astype(float)
    distances[:, 0] = rng.integers(1, 3, (30, 2))
    pairs = GivenPairs(distances, np.arange(steps + 1.0), np.array([2.0, 2.0]))
    whole = MatrixForm(1).fit(pairs, 30)
    alone = MatrixForm(1).fit(pairs.only(whole.support), len(whole.support))
    bounds = (each.growth.bounds(distances[:, 0], pairs.times) for each in (whole, alone))
    assert next(bounds) == pytest.approx(next(bounds), rel=1e-4)


@_ids
def test_parameters_are_counted_before_the_runs_as_they_are_after(form: Form) -> None:
    pairs = random_pairs(1, count=20, steps=8, scale=(1.0, 0.1, 3.0))
    expected = {"exponential": 6, "set": 6, "piecewise": 3 * 2, "matrix": 9 * 2}
    assert form.fit(pairs, 20).parameters == form.parameters(pairs.scale)
    if form != PiecewiseExponential(3):
        assert form.parameters(pairs.scale) == expected[form.name]
    assert PiecewiseExponential(3).parameters(pairs.scale) == 12
    assert MatrixForm(2).parameters(np.array([1.0, 0.0, 3.0])) == 12


@_coupled_ids
def test_a_state_that_never_moves_is_bounded_by_zero(form: Form) -> None:
    pairs = random_pairs(2, count=50, steps=6, scale=(1.0, 0.5, 0.0))
    pairs.distances[:, :, 2] = 0.0
    growth = form.fit(pairs, 50).growth
    assert [growth.half_widths((1.0, 0.5, 0.0), t)[2] for t in (0.0, 0.7, 1.5)] == [0.0] * 3
    assert growth.half_widths((1.0, 0.5, 0.0), 1.0)[0] > 0.0


@_coupled_ids
def test_a_state_moved_only_late_is_contained(form: Form) -> None:
    pairs = random_pairs(2, count=50, steps=6, scale=(1.0, 0.5, 0.0))
    pairs.distances[:, :-1, 2] = 0.0
    _contains(form, pairs)


@_coupled_ids
def test_a_distance_along_an_axis_that_was_not_varied_is_refused(form: Form) -> None:
    pairs = random_pairs(2, count=50, steps=6, scale=(1.0, 0.5, 0.0))
    growth = form.fit(pairs, 50).growth
    with pytest.raises(InputError, match=r"states number \[2\], which the runs did not vary"):
        growth.half_widths((0.1, 0.1, 0.1), 1.0)


def test_the_published_form_refuses_states_that_others_move() -> None:
    pairs = random_pairs(2, count=50, steps=6, scale=(1.0, 0.5, 0.0))
    with pytest.raises(InputError, match=r"\['state2'\] separate although their initial"):
        GlobalExponential().fit(pairs, 50)
    pairs.distances[:, :, 2] = 0.0
    assert GlobalExponential().fit(pairs, 50).growth.half_widths((1.0, 1.0, 0.0), 1.0)[2] == 0.0


@_coupled_ids
def test_one_start_for_both_runs_is_nothing_unless_they_separate(form: Form) -> None:
    pairs = random_pairs(2, count=50, steps=6, scale=(1.0, 0.5, 0.0))
    pairs.distances[7] = 0.0
    _contains(form, pairs)
    pairs.distances[7, 3, 1] = 1e-6
    with pytest.raises(InputError, match="pair number 7 start in the same state and separate"):
        form.fit(pairs, 50)


@_ids
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_runs_that_leave_the_numbers_are_refused(form: Form, bad: float) -> None:
    pairs = random_pairs(2, count=600, steps=6, scale=(1.0, 0.5))
    pairs.distances[555, 3, 1] = bad
    with pytest.raises(InputError, match="a run of pair number 555 left the finite numbers"):
        form.fit(pairs, 600)
    form.fit(pairs, 555)


@_ids
def test_more_pairs_than_there_are_and_none_are_refused(form: Form) -> None:
    pairs = random_pairs(2, count=5, steps=6, scale=(1.0, 0.5))
    with pytest.raises(InputError, match="expected 6 pairs, and there are only 5"):
        form.fit(pairs, 6)
    with pytest.raises(InputError, match="at least 1 pair"):
        form.fit(pairs, 0)


def test_wrong_pieces_are_refused() -> None:
    pairs = random_pairs(2, count=5, steps=3, scale=(1.0, 0.5))
    for form in (PiecewiseExponential, MatrixForm):
        with pytest.raises(InputError, match="at least 1 piece"):
            form(0)
        with pytest.raises(InputError, match="no more pieces than the 3 steps"):
            form(4).fit(pairs, 5)


def test_a_chain_of_integrators_has_the_matrix_that_theory_gives() -> None:
    x = ca.SX.sym("x", 2)
    system = system_from_casadi(x, ca.vertcat(x[1], 0.0), ("place", "pace"))
    box = Box.around({"place": 0.0, "pace": 1.0}, radius={"place": 0.5, "pace": 0.1})
    pairs = SimulatedPairs(ModelSimulator.of(system, horizon_s=2.0, step_s=0.25), box, 4)
    learned = learn_from_pairs(
        pairs, count=3000, form=MatrixForm(1), evidence=[APriori(0.1)], region=box
    )
    # |e_place| <= |e_place(0)| + t |e_pace(0)|, and no smaller matrix does for all signs.
    assert learned.radius({"place": 0.3}, 2.0) == pytest.approx((0.3, 0.0), abs=0.01)
    assert learned.radius({"pace": 0.1}, 2.0) == pytest.approx((0.2, 0.1), abs=0.01)
    assert learned.radius({"pace": 0.1}, 1.0) == pytest.approx((0.1, 0.1), abs=0.01)


def test_pieces_follow_growth_that_one_exponential_cannot() -> None:
    times = np.linspace(0.0, 4.0, 9)
    shape = np.where(times < 2.0, np.exp(times), np.exp(4.0 - times))
    first = np.linspace(0.2, 1.7, 30)[:, None]
    pairs = GivenPairs(first[:, None] * shape[:, None], times, np.array([1.0]))
    bent = PiecewiseExponential(2).fit(pairs, 30)
    straight = SetExponential().fit(pairs, 30)
    assert bent.growth.half_widths((1.0,), 4.0)[0] == pytest.approx(1.0, rel=1e-4)
    assert bent.growth.half_widths((1.0,), 1.0)[0] == pytest.approx(math.exp(1.0), rel=1e-4)
    assert straight.growth.half_widths((1.0,), 4.0)[0] > 2.0
    # Every pair touches everywhere, up to rounding; three of them are enough.
    assert len(bent.support) <= 3


def test_one_piece_is_the_set_normalised_exponential() -> None:
    pairs = random_pairs(9, count=200, steps=8, scale=(1.0, 0.0, 3.0))
    one, same = PiecewiseExponential(1).fit(pairs, 200), SetExponential().fit(pairs, 200)
    for t in (0.0, 0.6, 2.0):
        assert one.growth.half_widths((1.0, 0.0, 2.0), t) == pytest.approx(
            same.growth.half_widths((1.0, 0.0, 2.0), t), rel=1e-9
        )
    assert one.support == same.support


def test_the_published_form_is_the_line_above_each_states_own_ratios() -> None:
    times = np.array([0.0, 1.0, 2.0])
    distances = np.array(
        [[[1.0, 2.0], [2.0, 2.0], [4.0, 1.0]], [[1.0, 1.0], [3.0, 0.9], [1.0, 0.8]]]
    )
    growth = GlobalExponential().fit(GivenPairs(distances, times, np.ones(2)), 2).growth
    # ln ratios 0, ln 3, ln 4 and 0, 0, ln 0.8: mean instant 1, the hull there is ln 3 and 0.
    assert growth.half_widths((2.0, 1.0), 1.0) == pytest.approx((6.0, 1.0), rel=1e-4)
    assert growth.half_widths((1.0, 2.0), 2.0)[0] >= 4.0


def test_runs_progress_to_the_end() -> None:
    seen: list[tuple[int, int]] = []
    pairs = random_pairs(2, count=600, steps=6, scale=(1.0, 0.5))
    SetExponential().fit(pairs, 600, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (600, 600)
    assert seen == sorted(seen)


@_ids
def test_half_widths_far_from_one_are_contained_or_refused(form: Form) -> None:
    pairs = random_pairs(3, count=60, steps=8, scale=(1.0, 1.0, 1.0))
    # Distances that shrink by much more than the doubles' digits.
    distances = pairs.distances * np.exp(-np.linspace(0.0, 60.0, 9))[:, None]
    for units in ((1e-90, 1e90, 1.0), (1e-305, 1.0, 1.0), (1.0, 1e-320, 1.0), (1.0, 1.0, 1e290)):
        given_pairs = GivenPairs(distances * units, pairs.times, np.array(units))
        if min(units) > 1e-100 and max(units) < 1e100:
            _contains(form, given_pairs)
            continue
        with pytest.raises(InputError, match=r"half widths .* between 1e-100 and 1e.100 .*units"):
            form.fit(given_pairs, 60)
