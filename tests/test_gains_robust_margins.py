"""What is proved for all cars holds for each by python-control, and is near what a search finds."""

from __future__ import annotations

import itertools
import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.over_speed import disk_margins
from workbench.models.gains.ranged_loop import Car, Ranges
from workbench.models.gains.ranged_search import margins_of, search
from workbench.models.vehicle import gem_e2
from workbench.reach.robustness import margins as proofs
from workbench.reach.robustness.inclusions import LoopInclusion
from workbench.reach.robustness.margins import MarginProofs, frequency_range
from workbench.reach.robustness.minimise import lower_bound
from workbench.reach.robustness.verdict import (
    MARGIN_NAMES,
    Effort,
    Margin,
    Robust,
    Robustness,
    over_size,
    robustness,
)

Array = NDArray[np.float64]
LOOP = LateralLoop.of(gem_e2())
SMALL = Ranges((1.7, 1.8), (0.97, 1.03), (0.0, 0.05))
EFFORT = Effort(boxes=20_000, seed=1)
INCLUSION = LoopInclusion(LOOP)


def open_loop(loop: LateralLoop, car: Car) -> control.StateSpace:
    """From the command to the steering rate's negative, without delay, from the equations."""
    known, true = loop.speed_mps, car.speed_scale * loop.speed_mps
    ahead, kp, ki, kd = loop.look_ahead_m, loop.proportional, loop.integral, loop.derivative
    A = np.zeros((4, 4))
    A[0, 1], A[1, 2] = true, true / car.wheelbase_m
    A[3, :2] = 1.0, ahead
    row = [kp, kp * ahead + kd * known, kd * ahead * known / loop.wheelbase_m, ki]
    return control.ss(A, [[0.0], [0.0], [1.0], [0.0]], [row], [[0.0]])


def by_control(loop: LateralLoop, car: Car) -> dict[str, float]:
    """Margins of python-control, from the frequency response with the exact delay."""
    w = np.geomspace(0.2, 100.0, 1000)
    L = np.asarray(open_loop(loop, car)(1j * w)) * np.exp(-1j * w * car.delay_s)
    response = control.frd(L, w, smooth=True)
    gains, phases, _, _, crossed, _ = control.stability_margins(response, returnall=True)
    return {
        "phase_deg": float(np.abs(phases).min()),
        "gain_low": max((float(g) for g in gains if 0.0 < g <= 1.0), default=0.0),
        "gain_high": min((float(g) for g in gains if g > 1.0), default=math.inf),
        "delay_s": float((np.radians(phases % 360.0) / crossed).min()),
        "disk": disk_margins(response, w).size,
    }


def worse_or_equal(margin: Margin, value: float) -> bool:
    """Whether `value` keeps what is proved, up to python-control's own grid."""
    if margin.proved is None:
        return False
    sign = -1.0 if margin.name.larger_is_worse else 1.0
    return sign * value >= sign * margin.proved - 1e-6 * abs(value)


@pytest.fixture(scope="module")
def small() -> Robustness:
    return robustness(LOOP, SMALL, effort=EFFORT)


def test_small_ranges_are_proved_and_the_search_is_near(small: Robustness) -> None:
    assert small.answer is Robust.PROVED
    assert small.witness is None
    for margin in small.margins:
        assert margin.proved is not None
        assert margin.found is not None
        assert worse_or_equal(margin, margin.found)
        assert margin.proved == pytest.approx(margin.found, rel=2e-3)


def test_every_sampled_car_keeps_what_is_proved(small: Robustness) -> None:
    rng = np.random.default_rng(7)
    cars = [Car(*(float(rng.uniform(*end)) for end in SMALL.ends)) for _ in range(4)]
    for car in (*cars, *SMALL.corners()):
        found = by_control(LOOP, car)
        for margin in small.margins:
            assert worse_or_equal(margin, found[margin.name.key]), (margin.name.key, car)


def test_the_worst_cars_have_their_margins_by_python_control(small: Robustness) -> None:
    for margin in small.margins:
        assert margin.at is not None
        assert by_control(LOOP, margin.at)[margin.name.key] == pytest.approx(margin.found, rel=1e-4)


def test_the_range_matters(small: Robustness) -> None:
    """The nominal car alone would pass bounds that its neighbours break."""
    nominal = by_control(LOOP, Car(1.75, 1.0, 0.0))
    by_key = {each.name.key: each for each in small.margins}
    assert nominal["phase_deg"] == pytest.approx(58.3076, abs=1e-3)
    assert by_key["phase_deg"].found is not None
    assert by_key["phase_deg"].found < nominal["phase_deg"] - 5.0
    assert by_key["gain_low"].found is not None
    assert by_key["gain_low"].found > nominal["gain_low"] + 0.01


def test_larger_ranges_keep_less() -> None:
    found = over_size(LOOP, SMALL, effort=EFFORT, sizes=(0.0, 1.5))
    for column, name in enumerate(MARGIN_NAMES):
        sign = -1.0 if name.larger_is_worse else 1.0
        values = [each.margins[column].proved for each in found.answers]
        assert values[0] is not None
        assert all(
            b is not None and a is not None and sign * b < sign * a
            for a, b in itertools.pairwise(values)
        )


def test_too_long_a_delay_is_refuted_by_a_car() -> None:
    found = robustness(LOOP, Ranges((1.7, 1.8), (0.97, 1.03), (0.0, 0.3)), effort=EFFORT)
    assert found.answer is Robust.REFUTED
    assert found.witness is not None
    assert found.witness.delay_s > 0.264
    assert all(each.proved is None and each.found is None for each in found.margins)


def test_too_weak_a_damping_is_refuted_without_delay() -> None:
    swinging = LOOP.at({"kp": 2.0, "kd": 0.3, "look-ahead": 0.5})
    found = robustness(swinging, Ranges((1.7, 1.8), (0.97, 1.03), (0.0, 0.0)), effort=EFFORT)
    assert found.answer is Robust.REFUTED


def test_a_cap_leaves_the_answer_open() -> None:
    # Hardly below the delay that the worst car bears.
    close = Ranges((1.4, 2.1), (0.8, 1.2), (0.0, 0.19))
    capped = robustness(LOOP, close, effort=Effort(1, 1))
    assert capped.answer is Robust.OPEN
    found = robustness(LOOP, close, effort=EFFORT)
    assert found.answer is Robust.PROVED
    assert all(each.proved is None and each.found is not None for each in capped.margins)


def test_a_wrong_sign_would_be_seen(small: Robustness, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the delay's sign turned, proofs exceed what the search has found."""
    import workbench.reach.robustness.inclusions as inner

    right = inner._quantities

    def turned(box: object, p: object) -> object:
        w, wheelbase, scale, delay = inner.ca.vertsplit(box)
        return right(inner.ca.vertcat(w, wheelbase, scale, -delay), p)

    monkeypatch.setattr(inner, "_quantities", turned)
    wrong = MarginProofs(LOOP, SMALL, most=20_000).phase(90.0)
    phase = small.margins[0]
    assert wrong.value is not None
    assert phase.found is not None
    assert wrong.value > phase.found


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.5, 20.0), st.floats(1.2, 2.2), st.floats(0.6, 1.4), st.floats(0.0, 0.3),
    st.floats(0.0, 0.3), st.integers(0, 1000),
)  # fmt: skip
def test_ranges_over_boxes_hold_the_open_loop(
    w: float, base: float, scale: float, delay: float, size: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    lower = np.array([w, base, scale, delay])
    upper = lower * (1.0 + size)
    inside = [lower, upper, *rng.uniform(lower, upper, (8, 4))]
    found = INCLUSION(lower[None], upper[None])
    for point in inside:
        car = Car(*map(float, point[1:]))
        M = -complex(open_loop(LOOP, car)(1j * point[0])) * np.exp(-1j * point[0] * point[3])
        near = 2.0 * M.real / (1.0 + abs(M) ** 2)
        for interval, value in (
            (found.real, M.real), (found.imaginary, M.imag), (found.square, abs(M) ** 2),
            (found.near, near),
        ):  # fmt: skip
            slack = 1e-9 * (1.0 + abs(value))
            assert interval[0][0] - slack <= value <= interval[1][0] + slack


def test_beyond_the_frequencies_the_loop_is_far_from_one() -> None:
    ranges = Ranges((1.4, 2.1), (0.7, 1.3), (0.0, 0.2))
    low, high = frequency_range(LOOP, ranges)
    for car in ranges.corners():
        values = np.abs(np.asarray(open_loop(LOOP, car)(1j * np.array([low, low / 3]))))
        assert values.min() >= 20.0
        assert abs(complex(open_loop(LOOP, car)(1j * high))) <= 1.0 / 20.0


@settings(max_examples=25, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_branch_and_bound_finds_the_least_of_a_parabola(x: float, y: float) -> None:
    def bounds(lower: Array, upper: Array) -> tuple[Array, Array]:
        near = np.clip([x, y], lower, upper)
        return ((near - [x, y]) ** 2).sum(axis=1) + 1.0, upper - lower

    boxes = np.array([[-2.0, -2.0]]), np.array([[2.0, 2.0]])
    found = lower_bound(bounds, boxes, aim=1.5, most=4000)
    assert found.value <= 1.0 + 1e-12
    beyond = lower_bound(
        lambda low, high: (bounds(low, high)[0] + 1.0, high - low), boxes, aim=1.9, most=4000
    )
    assert beyond.value >= 1.9
    assert beyond.boxes < 4000


def test_conversions_round_down() -> None:
    angle = proofs._converted(proofs._ANGLE, math.cos(math.radians(40.0)))
    assert angle == pytest.approx(40.0, abs=1e-9)
    disk = proofs._converted(proofs._DISK, 0.6)
    assert disk == pytest.approx(1.0, abs=1e-12)
    assert proofs._converted(proofs._ANGLE, 1.0) is None


def test_search_and_margins_of_one_car_agree_with_python_control() -> None:
    car = Car(1.6, 1.1, 0.08)
    values = margins_of(LOOP, np.array([[1.6, 1.1, 0.08]]))
    found = by_control(LOOP, car)
    one = (1.6, 1.6), (1.1, 1.1), (0.08, 0.08)
    searched, suspect = search(LOOP, Ranges(*one), seed=1)
    assert suspect is None
    for name in (each.key for each in MARGIN_NAMES):
        assert float(values.of(name)[0]) == pytest.approx(found[name], rel=1e-4)
        assert searched[name].value == pytest.approx(found[name], rel=1e-4)


def test_without_an_integral_it_works_too() -> None:
    plain = LOOP.at({"ki": 0.0})
    ranges = Ranges((1.7, 1.8), (0.97, 1.03), (0.02, 0.05))
    found = robustness(plain, ranges, effort=EFFORT)
    assert found.answer is Robust.PROVED
    for car in ranges.corners()[::3]:
        values = by_control(plain, car)
        assert all(worse_or_equal(each, values[each.name.key]) for each in found.margins)


def test_reverse_and_no_boxes_are_refused() -> None:
    with pytest.raises(InputError, match="speed > 0"):
        robustness(LOOP.at({"speed": -1.0}), SMALL, effort=EFFORT)
    with pytest.raises(InputError, match="at least 1"):
        Effort(0, 1)
