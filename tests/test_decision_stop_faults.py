"""Faults planted in the C text of the tubes that end in a standstill are caught by sampled runs."""

from __future__ import annotations

import ctypes
import functools

import pytest
from decision_fixture import (
    COMPLETE,
    STARTS,
    DecisionKernel,
    kernel,
    query,
    real_text,
    with_faults,
)
from decision_paths import paths
from decision_stops import SPEED, Scene, excess, runs_of

# Expressions of the C text, and what stands there instead.
FAULTS = {
    "the late end of the switch is ignored": (
        "wb_braked(d, t - d->order->switch_upper, -1)",
        "wb_braked(d, t - d->order->switch_lower, -1)",
    ),
    "the early end of the switch is ignored": (
        "wb_braked(d, t - d->order->switch_lower, 1)",
        "wb_braked(d, t - d->order->switch_upper, 1)",
    ),
    "TRACK until the late end": (
        "t + h > order->switch_lower", "t + h > order->switch_upper",
    ),
    "no delay": ("t - brake[WB_BRAKE_DELAY]", "t"),
    "the delay twice": ("t - brake[WB_BRAKE_DELAY]", "t - 2 * brake[WB_BRAKE_DELAY]"),
    "no build-up": ("brake[WB_BRAKE_BUILD_UP] / 2", "0.0"),
    "the strongest braking is the weakest": (
        "d->q[WB_Q_BRAKE + WB_BRAKE_MOST] * braked", "d->q[WB_Q_BRAKE + WB_BRAKE_LEAST] * braked",
    ),
    "the weakest braking is the strongest": (
        "d->q[WB_Q_BRAKE + WB_BRAKE_LEAST] * braked", "d->q[WB_Q_BRAKE + WB_BRAKE_MOST] * braked",
    ),
    "the share of the steering stays 1": (
        "wb_min(wb_max(v / d->q[WB_Q_BRAKE + WB_BRAKE_STOP_SPEED] - 1.0, 0.0), 1.0)", "1.0",
    ),
    "the share of the steering falls with the slowest": (
        "wb_steering_share(d, d->high + d->misread[1]) + WB_SPEED_ROUNDING",
        "wb_steering_share(d, d->low)",
    ),
    "what is let go only turns right": (
        "wb_max(d->q[WB_Q_PARAMETERS + WB_RATE_MAX], 0.0) * share[1]", "0.0",
    ),
    "what is let go only turns left": (
        "wb_min(d->q[WB_Q_PARAMETERS + WB_RATE_MIN], 0.0) * share[1]", "0.0",
    ),
    "no acceleration while it waits": ("most * tracked", "0.0"),
    "no deceleration while it waits": ("least * tracked", "0.0"),
    "the fastest is that of the end": ("wb_max(t, wb_min(wb_peak(d), t + h))", "t + h"),
    "the slowest is that of the start": ("wb_slowest(d, t + h)", "wb_slowest(d, t)"),
    "the car stands before it does": (
        "wb_fastest(d, t) <= 0.0", "wb_fastest(d, t) <= 0.2",
    ),
    "the speed of the rows is TRACK's": ("low[WB_SPEED] = d->low", "0.0"),
    "the integral is not reset": (
        "waits ? wb_min(low[WB_SPEED_INTEGRAL], 0.0) : 0.0", "low[WB_SPEED_INTEGRAL]",
    ),
    "the start is at the early end": ("floor(k - late - 1e-9)", "floor(k - early - 1e-9)"),
    "the start is at the late end": ("floor(k + 1 - early + 1e-9)", "floor(k + 1 - late + 1e-9)"),
    "no row is added for the late start": ("ceil(late + 2e-9)", "0.0"),
    "the command does not wait": (
        "command[1] - order->held_lower", "command[1] - order->held_upper",
    ),
    "the start keeps the speed's integral": (
        "wb_max(cell->radius[WB_SPEED_INTEGRAL], fabs(center))",
        "cell->radius[WB_SPEED_INTEGRAL]",
    ),
}  # fmt: skip

_CATCHERS = [
    Scene("left", "accelerating", 0.5, (0.1, 0.35)),
    Scene("left", "point", 1.0, (0.2, 0.2)),
    Scene("straight", "slow", 1.0, (0.2, 0.2)),
    Scene("S", "initial set", 1 / 3),
    Scene("straight", "braking", 0.2, (0.05, 0.3)),
    Scene("right", "charged", 0.5, (0.25, 0.3), (0.02, 0.14)),
    Scene("right", "accelerating", 0.5, (0.25, 0.3), (0.02, 0.14)),
    Scene("right", "accelerating", 0.5, (0.25, 0.25), (0.1, 0.1)),
]


@functools.cache
def _faulty() -> DecisionKernel:
    return with_faults(real_text(), tuple(FAULTS.values()))


def _with_fault(number: int) -> DecisionKernel:
    ctypes.c_int.in_dll(_faulty().handle, "wb_fault").value = number
    return _faulty()


def test_without_a_fault_it_is_the_shipped_kernel() -> None:
    for start in STARTS.values():
        numbers = query(paths()["left"].table, start)
        one, other = _with_fault(0)(numbers), kernel()(numbers)
        assert one.numbers.tobytes() == other.numbers.tobytes()


@pytest.mark.parametrize("name", FAULTS)
def test_some_run_leaves_the_rows_of_a_faulty_kernel(name: str) -> None:
    faulty = _with_fault(list(FAULTS).index(name) + 1)
    worst = 0.0
    for scene in _CATCHERS:
        tube = scene.answer(faulty).stop
        assert tube.steps
        if tube.status == COMPLETE and tube.rows("upper", 7)[-1, SPEED] > 0.0:
            return  # no standstill, yet complete
        worst = max(worst, float(excess(tube, runs_of(scene, "stop", 16)).max()))
        if worst > 1e-6:
            return
    pytest.fail(f"largest excess {worst}")


def test_no_run_leaves_the_rows_without_a_fault() -> None:
    for scene in _CATCHERS:
        tube = scene.answer(kernel()).stop
        assert tube.status == COMPLETE, scene
        assert excess(tube, runs_of(scene, "stop", 16)).max() < 1e-13
