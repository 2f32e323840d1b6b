"""Odd steps, points, tiny, huge and impossible sets: contained, ended early, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from tube_cases import assert_contains, box, dense_times, starts, system_of, tube_of

from workbench.errors import InputError
from workbench.reach import ValidatedTube


@pytest.mark.parametrize(
    ("horizon_s", "step_s"), [(1.0, 0.3), (0.07, 0.3), (0.95, 0.1), (1.0, 1 / 3)]
)
def test_a_step_that_does_not_divide_the_horizon(horizon_s: float, step_s: float) -> None:
    initial = box(x=(0.9, 1.1))
    tube = tube_of(system_of(lambda x: [-x], "x"), initial, horizon_s, step_s)
    assert tube.complete
    assert tube.times[0] == 0.0
    assert tube.times[-1] == horizon_s
    assert np.diff(tube.times).max() <= step_s * (1 + 1e-8)
    times = dense_times(tube)
    assert_contains(tube, times, (starts(initial) * np.exp(-times))[:, :, None], 0.0)


@pytest.mark.parametrize(
    "interval",
    [
        (0.0, 0.0),
        (5e-324, 5e-324),
        (0.0, 1e-310),
        (1e-200, 2e-200),
        (1e100, 1.1e100),
        (-1e200, 1e200),
        (1.0, 1.0),
        (-1e-12, 1e-12),
    ],
)
def test_tiny_and_huge_sets_of_a_linear_flow(interval: tuple[float, float]) -> None:
    initial = box(x=interval)
    tube = tube_of(system_of(lambda x: [-x], "x"), initial, 1.0)
    times = dense_times(tube)
    size = max(abs(interval[0]), abs(interval[1]))
    runs = (starts(initial) * np.exp(-times))[:, :, None]
    assert_contains(tube, times, runs, allowance=1e-13 * size)
    assert not np.isnan(tube.lower).any()


@pytest.mark.parametrize("interval", [(1e150, 2e150), (-1e300, 1e300), (1e308, 1.7e308)])
def test_overflow_ends_the_proof(interval: tuple[float, float]) -> None:
    tube = tube_of(system_of(lambda x: [x * x], "x"), box(x=interval), 1.0)
    assert not tube.complete
    assert tube.message
    assert len(tube.lower) == 0


@pytest.mark.parametrize("size", [1e140, 1e153, 1e155, 1e157, 1e158, 1e160])
def test_an_overflowing_remainder_is_never_dropped(size: float) -> None:
    """x is large enough for squares of its radius to overflow, and hardly acts on y."""
    system = system_of(lambda x, y: [0 * x + 1e-170 * x * x, y * y + 1e-320 * x * x], "x", "y")
    tube = tube_of(system, box(x=(-size, size), y=(0.5, 1.5)), 0.1, 0.1)
    times = dense_times(tube)
    y0 = np.linspace(0.5, 1.5, 11)[:, None]
    runs = np.stack([np.zeros((11, len(times))), y0 / (1 - y0 * times)], axis=2)
    assert_contains(tube, times, runs)


def test_sets_that_are_no_sets_are_refused() -> None:
    system = system_of(lambda x: [-x], "x")
    for bad in ((float("nan"), 1.0), (0.0, float("inf")), (1.0, 0.0)):
        with pytest.raises(ValueError, match="finite end points"):
            tube_of(system, box(x=bad), 1.0)
    with pytest.raises(InputError, match="expected an initial set over the states"):
        tube_of(system, box(y=(0.0, 1.0)), 1.0)
    for horizon_s in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="horizon_s"):
            tube_of(system, box(x=(0.0, 1.0)), horizon_s)
    for step_s in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="step_s"):
            ValidatedTube(step_s)
