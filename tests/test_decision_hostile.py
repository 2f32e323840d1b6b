"""No number in a query, however wrong, makes the kernel say SAFE about what it cannot judge."""

from __future__ import annotations

import numpy as np
import pytest
from decision_answers import Answer, Array, TubeAnswer
from decision_fixture import (
    BAD_INPUT,
    BUDGET,
    COMPLETE,
    INVALID,
    LEFT_REGION,
    NO_ENCLOSURE,
    PROVED,
    SAFE,
    STARTS,
    STEP_S,
    UNFINISHED,
    UNPROVED,
    Start,
    guarded,
    kernel,
    people_fields,
    place,
    query,
    real_manifest,
)
from decision_paths import arc, paths
from numpy.typing import NDArray

_ASIDE = [6.0, -7.0, 1.4, 0.0, 0.5, 0.3, 0.5]


_ASIDE_GUARDED = guarded([6.0, -12.0, 0.4, 0.0, 0.5, 0.3, 0.3])
_TUBE_STATUS = (COMPLETE, LEFT_REGION, NO_ENCLOSURE, UNFINISHED)


def _valid() -> Array:
    """A query that is SAFE in all three tubes, with every kind of number in it."""
    start = Start((0.0, 0.05, 0.01, 2.5, 0.01, 0.1, 0.1), (0.1, 0.02, 0.01, 0.1, 0.01, 0.05, 0.05))
    numbers = query(arc(0.05, nodes=100).table, start, [_ASIDE_GUARDED] * 3, skew_s=(-0.01, 0.01))
    assert {tube.verdict for tube in kernel()(numbers).tubes} == {SAFE}
    return numbers


def _refused(answer: Answer) -> bool:
    """Bad input, and nothing is said at all."""
    return answer.status == BAD_INPUT and all(
        tube.verdicts == (INVALID,) * 3
        and (tube.status, tube.steps, tube.level) == (BAD_INPUT, 0, -1)
        and tube.intent.clearance_m == tube.guard.clearance_m == -1e300
        for tube in answer.tubes
    )


def _check_promises(answer: Answer, numbers: Array) -> None:
    """What holds for every answer."""
    assert answer.status in (COMPLETE, BAD_INPUT)
    if answer.status == BAD_INPUT:
        assert _refused(answer)
        return
    assert 0 <= answer.spent <= BUDGET
    center, radius = numbers[:7], numbers[21:28]
    for tube, asked in zip(answer.tubes, ("i", "g", "ig"), strict=True):
        _check_tube(tube, asked, numbers)
        if tube.steps and tube.level == 0 and not numbers[place("start_s", 1)]:
            lower, upper = tube.rows("lower", 7)[0], tube.rows("upper", 7)[0]
            # The speed's integral may be reset by BRAKE at once, which adds to the row.
            assert (lower <= center - radius)[:5].all()
            assert (center + radius <= upper)[:5].all()


def _check_tube(tube: TubeAnswer, asked: str, numbers: Array) -> None:
    assert set(tube.verdicts) <= {SAFE, UNPROVED}
    assert list(tube.verdicts) == sorted(tube.verdicts, reverse=True)
    assert tube.status in _TUBE_STATUS
    assert 0 <= tube.steps <= real_manifest().steps
    lower, upper = tube.rows("lower", 7), tube.rows("upper", 7)
    assert np.isfinite(lower).all()
    assert np.isfinite(upper).all()
    assert (lower <= upper).all()
    assert (tube.rows("occupancy", 5)[:, 3:] >= 0.0).all()
    kinds = [kind for letter, kind in (("i", tube.intent), ("g", tube.guard)) if letter in asked]
    for nearest in kinds:
        latest_s = real_manifest().steps * STEP_S + numbers[place("start_s")]
        assert 0.0 <= nearest.time_s < latest_s
        assert not np.isnan(nearest.clearance_m)
    if tube.verdict == SAFE:
        assert tube.status == COMPLETE
        assert all(nearest.cause == PROVED for nearest in kinds)
        required_m = numbers[place("clearance_required_m")]
        assert all(nearest.clearance_m >= required_m for nearest in kinds)
        assert tube.steps == real_manifest().steps or upper[-1, 3] == 0.0


def _unused(numbers: Array) -> NDArray[np.bool_]:
    """Which numbers are of people's tubes and pieces beyond the ones that count."""
    unused = np.zeros(len(numbers), bool)
    for name in ("people_tubes", "people_pieces"):
        field = next(f for f in real_manifest().query if f.name == name)
        unused[field.span] = True
        given = len(people_fields([_ASIDE_GUARDED] * 3)[name])
        unused[field.offset : field.offset + given] = False
    return unused


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_bad_input_wherever_it_is_read(value: float) -> None:
    numbers = _valid()
    unused = _unused(numbers)
    for index in np.flatnonzero(~unused):
        wrong = numbers.copy()
        wrong[index] = value
        assert _refused(kernel()(wrong)), index
    before = kernel()(numbers).numbers.tobytes()
    numbers[unused] = value
    assert kernel()(numbers).numbers.tobytes() == before


@pytest.mark.parametrize("value", [1e308, -1e308, 1e155, -1e16, 5e-324, -0.0])
def test_extreme_numbers_leave_no_nan_behind(value: float) -> None:
    numbers = _valid()
    read = np.flatnonzero(~_unused(numbers))
    path = (read >= place("path_x", 4)) & (read < place("front_m"))
    chance = np.random.default_rng(29)
    for index in (*read[~path], *chance.choice(read[path], 40)):
        wrong = numbers.copy()
        wrong[index] = value
        _check_promises(kernel()(wrong), wrong)


def test_random_rubbish_leaves_no_nan_behind() -> None:
    chance = np.random.default_rng(31)
    for _ in range(500):
        numbers = _valid_copy(chance)
        count = chance.integers(1, 6)
        where = chance.choice(np.flatnonzero(numbers), count)
        numbers[where] *= 10.0 ** chance.uniform(-300, 300, count) * chance.choice([-1, 1], count)
        _check_promises(kernel()(numbers), numbers)


def _valid_copy(chance: np.random.Generator) -> Array:
    start = list(STARTS.values())[chance.integers(len(STARTS))]
    path = list(paths().values())[chance.integers(len(paths()))]
    return query(path.table, start, [_ASIDE_GUARDED, _ASIDE])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("path_count", value) for value in (-1.0, 0.0, 1.0, 1.5, 2.5, 129.0, 1e9, 1e308, -1e308)),
        *(("people_count", value) for value in (-1.0, 0.5, 2.0, 33.0, 1e10, 1e308, -1e308)),
        *(("tubes_count", value) for value in (-1.0, 0.5, 7.0, 129.0, 1e10, 1e308, -1e308)),
        *(("path_spacing_m", value) for value in (0.0, -0.25)),
        *((name, -1e-9) for name in ("front_m", "rear_m", "half_width_m", "clearance_required_m")),
        *((name, value) for name in ("switch_s", "start_s", "brake_s") for value in (-1e-9, 1e12)),
        ("skew_s", 1.0), ("skew_s", -1e10),
    ],
)  # fmt: skip
def test_counts_and_sizes_out_of_range_are_bad_input(name: str, value: float) -> None:
    numbers = _valid()
    numbers[place(name)] = value
    assert _refused(kernel()(numbers))


@pytest.mark.parametrize("number", range(5))
def test_a_brake_that_does_not_brake_is_bad_input(number: int) -> None:
    """No deceleration, none at most, time that runs backwards, no speed to freeze the steering."""
    numbers = _valid()
    numbers[place("brake", number)] = (0.0, 1.9, -0.1, -0.1, 0.0)[number]
    assert _refused(kernel()(numbers))


@pytest.mark.parametrize("index", range(21))
def test_a_negative_radius_is_bad_input(index: int) -> None:
    numbers = _valid()
    numbers[place("initial_radius", index)] = -1e-12
    assert _refused(kernel()(numbers))


@pytest.mark.parametrize("piece", range(9))
@pytest.mark.parametrize("index", [6, 8])
def test_a_disc_of_negative_size_or_acceleration_is_bad_input(piece: int, index: int) -> None:
    numbers = _valid()
    numbers[place("people_pieces", 9 * piece + index)] = -0.1
    assert _refused(kernel()(numbers))


def test_people_beyond_the_count_are_not_looked_at() -> None:
    numbers = _valid()
    ahead = guarded([5.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0])
    four = query(arc(0.05, nodes=100).table, STARTS["point"], [_ASIDE_GUARDED] * 3 + [ahead])
    for name in ("people_tubes", "people_pieces"):
        span = next(f for f in real_manifest().query if f.name == name).span
        numbers[span] = four[span]
    assert {tube.verdict for tube in kernel()(numbers).tubes} == {SAFE}
    numbers[place("people_count")] = 4.0
    numbers[place("tubes_count")] = 8.0
    assert {tube.verdict for tube in kernel()(numbers).tubes} == {UNPROVED}


def test_a_body_of_no_size_and_one_beyond_measure() -> None:
    table, start = paths()["straight"].table, STARTS["point"]
    none = {"front_m": [0.0], "rear_m": [0.0], "half_width_m": [0.0]}
    answer = kernel()(query(table, start, [[5.0, 3.0, 0.0, 0.0, 0.3, 0.0, 0.0]], **none)).track
    assert answer.verdict == SAFE
    assert 2.7 - 3e-5 < answer.intent.clearance_m <= 2.7
    huge = kernel()(query(table, start, [_ASIDE_GUARDED], front_m=[1e200]))
    assert {tube.verdict for tube in huge.tubes} == {UNPROVED}


@pytest.mark.parametrize("size", [1e4, 1e16, 1e160, 1e300])
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
        assert kernel()(query(table, start, [person])).track.verdict != SAFE


@pytest.mark.parametrize("held_s", [3.1, 200.0, 1e8, 1e9])
def test_a_start_that_is_held_for_ever_is_not_reported(held_s: float) -> None:
    """Its rows are beyond those that a result holds."""
    times = dict.fromkeys(("start_s", "switch_s"), (held_s, held_s))
    answer = kernel()(query(paths()["straight"].table, STARTS["standing"], [], **times))
    assert (answer.stop.verdict, answer.stop.steps) == (UNPROVED, 0)


def test_a_set_too_wide_or_outside_the_path_is_refused() -> None:
    table = paths()["straight"].table
    for index in range(7):
        numbers = query(table, STARTS["point"])
        numbers[place("initial_radius", index)] = 50.0
        assert {tube.verdict for tube in kernel()(numbers).tubes} == {UNPROVED}
    for station in (-4.1, -1e6, 1e6, 27.7):
        numbers = query(table, STARTS["point"])
        for level in range(3):
            numbers[place("initial_center", 7 * level)] = station
        for tube in kernel()(numbers).tubes:
            assert (tube.verdict, tube.status) == (UNPROVED, LEFT_REGION)


def test_a_bend_whose_centre_the_set_reaches_is_refused() -> None:
    tight = arc(1.0, nodes=60, spacing_m=0.25)
    for radius in (0.0, 0.4):
        box = Start((0.0, 1.0, 0.0, 2.8, 0.0, 0.0, 0.0), (0.0, radius, 0.0, 0.0, 0.0, 0.0, 0.0))
        answer = kernel()(query(tight.table, box))
        assert {tube.verdict for tube in answer.tubes} == {UNPROVED}


def test_curvature_bounds_the_wrong_way_round_are_bad_input() -> None:
    for bin_ in range(99):
        numbers = _valid()
        numbers[place("path_curvature_lower", bin_)] = 0.06
        assert _refused(kernel()(numbers))
