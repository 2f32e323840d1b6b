"""No number in a query, however wrong, makes the kernel say SAFE about what it cannot judge."""

from __future__ import annotations

import numpy as np
import pytest
from decision_fixture import (
    BAD_INPUT,
    COMPLETE,
    INVALID,
    LEFT_REGION,
    SAFE,
    STARTS,
    STEP_S,
    UNPROVED,
    Answer,
    Array,
    Start,
    kernel,
    place,
    query,
    real_manifest,
)
from decision_paths import arc, paths

_ASIDE = [6.0, -7.0, 1.4, 0.0, 0.5, 0.3, 0.5]


def _valid() -> Array:
    """A query that is SAFE with every kind of number in it."""
    start = Start((0.0, 0.05, 0.01, 2.5, 0.01, 0.1, 0.1), (0.1, 0.02, 0.01, 0.1, 0.01, 0.05, 0.05))
    numbers = query(arc(0.05, nodes=100).table, start, [_ASIDE] * 3)
    assert kernel()(numbers).verdict == SAFE
    return numbers


def _check_promises(answer: Answer, numbers: Array) -> None:
    """What holds for every answer."""
    assert answer.verdict in (SAFE, UNPROVED, INVALID)
    assert (answer.verdict == INVALID) == (answer.status != COMPLETE)
    if answer.verdict == INVALID:
        return
    # Somebody infinitely wide leaves no clearance: -inf, which is no proof either.
    assert np.isfinite(answer.numbers).all() or answer.verdict == UNPROVED
    assert not np.isnan(answer.numbers).any()
    lower, upper = answer.rows("tube_lower", 7), answer.rows("tube_upper", 7)
    assert len(lower) == real_manifest().steps
    assert (lower <= upper).all()
    center, radius = numbers[:7], numbers[7:14]
    assert (lower[0] <= center - radius).all()
    assert (center + radius <= upper[0]).all()
    assert (answer.rows("occupancy", 5)[:, 3:] >= 0.0).all()
    assert 0.0 <= answer.scalar("clearance_time_s") < real_manifest().steps * STEP_S
    safe = answer.scalar("clearance_m") >= numbers[place("clearance_required_m")]
    assert (answer.verdict == SAFE) == safe


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_bad_input_wherever_it_stands(value: float) -> None:
    numbers = _valid()
    for index in range(len(numbers)):
        wrong = numbers.copy()
        wrong[index] = value
        answer = kernel()(wrong)
        assert (answer.verdict, answer.status, answer.steps) == (INVALID, BAD_INPUT, 0), index


@pytest.mark.parametrize("value", [1e308, -1e308, 1e155, -1e16, 5e-324, -0.0])
def test_extreme_numbers_leave_no_nan_behind(value: float) -> None:
    numbers = _valid()
    unused = numbers == 0.0
    for index in np.flatnonzero(~unused | (np.arange(len(numbers)) < place("path_x", 4))):
        wrong = numbers.copy()
        wrong[index] = value
        _check_promises(kernel()(wrong), wrong)


def test_random_rubbish_leaves_no_nan_behind() -> None:
    chance = np.random.default_rng(31)
    for _ in range(500):
        numbers = _valid_copy(chance)
        count = chance.integers(1, 6)
        where = chance.integers(0, len(numbers), count)
        numbers[where] *= 10.0 ** chance.uniform(-300, 300, count) * chance.choice([-1, 1], count)
        _check_promises(kernel()(numbers), numbers)


def _valid_copy(chance: np.random.Generator) -> Array:
    start = list(STARTS.values())[chance.integers(len(STARTS))]
    path = list(paths().values())[chance.integers(len(paths()))]
    return query(path.table, start, [_ASIDE])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("path_count", value) for value in (-1.0, 0.0, 1.0, 1.5, 2.5, 129.0, 1e9, 1e308, -1e308)),
        *(("people_count", value) for value in (-1.0, 0.5, 33.0, 1e10, 1e308, -1e308)),
        *(("path_spacing_m", value) for value in (0.0, -0.25)),
        *((name, -1e-9) for name in ("front_m", "rear_m", "half_width_m", "clearance_required_m")),
    ],
)
def test_counts_and_sizes_out_of_range_are_bad_input(name: str, value: float) -> None:
    numbers = _valid()
    numbers[place(name)] = value
    answer = kernel()(numbers)
    assert (answer.verdict, answer.status, answer.steps) == (INVALID, BAD_INPUT, 0)


@pytest.mark.parametrize("index", range(7))
def test_a_negative_radius_is_bad_input(index: int) -> None:
    numbers = _valid()
    numbers[place("initial_radius", index)] = -1e-12
    assert kernel()(numbers).status == BAD_INPUT


@pytest.mark.parametrize("person", range(3))
@pytest.mark.parametrize("index", [4, 5, 6])
def test_a_disc_that_shrinks_is_bad_input(person: int, index: int) -> None:
    numbers = _valid()
    numbers[place("people", 7 * person + index)] = -0.1
    assert kernel()(numbers).status == BAD_INPUT


def test_people_beyond_the_count_are_not_looked_at() -> None:
    numbers = _valid()
    ahead = [5.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0]
    numbers[place("people", 21) : place("people", 28)] = ahead
    assert kernel()(numbers).verdict == SAFE
    numbers[place("people_count")] = 4.0
    assert kernel()(numbers).verdict == UNPROVED


def test_a_body_of_no_size_and_one_beyond_measure() -> None:
    table, start = paths()["straight"].table, STARTS["point"]
    none = {"front_m": [0.0], "rear_m": [0.0], "half_width_m": [0.0]}
    answer = kernel()(query(table, start, [[5.0, 3.0, 0.0, 0.0, 0.3, 0.0, 0.0]], **none))
    assert answer.verdict == SAFE
    assert 2.7 - 3e-5 < answer.scalar("clearance_m") <= 2.7
    huge = kernel()(query(table, start, [_ASIDE], front_m=[1e200]))
    assert huge.verdict != SAFE


@pytest.mark.parametrize("size", [1e16, 1e160, 1e300])
def test_a_person_at_an_absurd_place_or_speed_is_never_in_the_way_unnoticed(size: float) -> None:
    """Somebody that fast passes the car, somebody that wide covers it."""
    table, start = paths()["straight"].table, STARTS["point"]
    for person in (
        [-size, 0.0, 2.0 * size, 0.0, 0.3, 0.0, 0.0],
        [0.0, size, 0.0, -size, 0.3, 0.0, 0.0],
        [5.0, 30.0, 0.0, 0.0, size, 0.0, 0.0],
        [5.0, 30.0, 0.0, 0.0, 0.3, size, 0.0],
        [5.0, 30.0, 0.0, 0.0, 0.3, 0.0, size],
    ):
        assert kernel()(query(table, start, [person])).verdict != SAFE


def test_a_set_too_wide_or_outside_the_path_is_refused() -> None:
    table = paths()["straight"].table
    for index in range(7):
        numbers = query(table, STARTS["point"])
        numbers[place("initial_radius", index)] = 50.0
        assert kernel()(numbers).verdict == INVALID
    for station in (-4.1, -1e6, 1e6, 27.7):
        numbers = query(table, STARTS["point"])
        numbers[place("initial_center")] = station
        answer = kernel()(numbers)
        assert (answer.verdict, answer.status) == (INVALID, LEFT_REGION)


def test_a_bend_whose_centre_the_set_reaches_is_refused() -> None:
    tight = arc(1.0, nodes=60, spacing_m=0.25)
    start = STARTS["point"]
    numbers = query(tight.table, start)
    numbers[place("initial_center", 1)] = 1.0
    assert kernel()(numbers).verdict == INVALID
    numbers[place("initial_radius", 1)] = 0.4
    assert kernel()(numbers).verdict == INVALID


def test_curvature_bounds_the_wrong_way_round_are_bad_input() -> None:
    for bin_ in range(99):
        numbers = _valid()
        numbers[place("path_curvature_lower", bin_)] = 0.06
        assert kernel()(numbers).status == BAD_INPUT
