"""The containment tests notice a planted fault in the tube, of the desk and of the compiled one."""

from __future__ import annotations

import functools
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from tube_cases import (
    Array,
    box,
    dense_times,
    disturbed,
    escapes,
    march,
    pressing_states,
    system_of,
)

from workbench.bench.scoreboard import wide_region
from workbench.codegen import c_source
from workbench.codegen.c_source import KernelSizes
from workbench.codegen.tube_kernel import CompiledTube
from workbench.models import Ranged
from workbench.models.benchmarks import Benchmark, b1, b2
from workbench.reach import ReachTube, SensitivityTube, sensitivity_tube

Outputs = dict[str, Array]
Fault = Callable[[str, Outputs], None]


def _swinging() -> Benchmark:
    """A pushed oscillator: it turns between instants, and its input switches within steps."""
    push = (Ranged.symmetric("push", "", 0.3),)
    system = disturbed(lambda x, _p, w: [4 * x[1], -4 * x[0] + w], ("x", "y"), disturbances=push)
    return Benchmark("swinging", system, box(x=(0.9, 1.0), y=(0.0, 0.05)))


def _limited() -> Benchmark:
    """A decay that is at its limit all the time."""
    system = system_of(lambda x: [-ca.fmin(ca.fmax(x, -0.2), 0.2)], "x")
    return Benchmark("limited", system, box(x=(0.9, 1.1)))


def scale(function: str, output: str, factor: float) -> Fault:
    def fault(name: str, outputs: Outputs) -> None:
        if name == function or name.startswith(f"{function}_"):
            outputs[output] = factor * outputs[output]

    return fault


def wrong_sign_in_the_transition(name: str, outputs: Outputs) -> None:
    if name == "wb_advance":
        size = len(outputs["x_end"])
        matrix = outputs["transition"].reshape(size, size).copy()
        heading_by_steering = 4 * size + 2
        matrix.ravel()[heading_by_steering] *= -1
        outputs["transition"] = matrix.ravel()


def shift_of_the_nominal(name: str, outputs: Outputs) -> None:
    if name == "wb_advance":
        outputs["x_end"] = outputs["x_end"] + 1e-3


FAULTS: dict[str, tuple[Callable[[], Benchmark], Fault]] = {
    "wrong sign in the transition": (b1, wrong_sign_in_the_transition),
    "no remainder": (b1, scale("wb_remainder", "box", 0.0)),
    "shifted nominal": (b1, shift_of_the_nominal),
    "no chord deviation": (_swinging, scale("wb_remainder", "chord", 0.0)),
    "no disturbance": (_swinging, scale("wb_advance", "by_exogenous", 0.0)),
    "no kink error": (b2, scale("wb_relaxation", "gap_i", 0.0)),
    "half the kink's offset": (_limited, scale("wb_relaxation", "offset_i", 0.5)),
}


HORIZON_S = 1.5


def desk_tube(loop: Benchmark) -> ReachTube:
    method = SensitivityTube(0.05)
    return method.tube(loop.system, initial_set=loop.initial_set, horizon_s=HORIZON_S)


@functools.cache
def leaves_the_desk_tube(make: Callable[[], Benchmark]) -> int:
    loop = make()
    return leaving(loop, desk_tube(loop))


def leaving(loop: Benchmark, tube: ReachTube) -> int:
    """Escapes of pressing states, under disturbances that follow the oscillation, if any."""
    times = dense_times(tube)
    states = pressing_states(loop.system, loop.initial_set, tube, count=800)
    ranges = loop.system.ode.disturbances
    if not ranges:
        return escapes(tube, times, march(loop.system, states, times))
    phases = np.linspace(0, 2 * np.pi, 8)[:, None]
    values = 0.3 * np.sign(np.sin(4 * times[:-1] + phases))
    states = np.repeat(states[:16], 8, axis=0)
    inputs = np.tile(values, (16, 1))[:, :, None]
    return escapes(tube, times, march(loop.system, states, times, disturbances=inputs))


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_in_the_desk_tube_is_noticed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    make, fault = FAULTS[name]
    loop = make()
    sound = sensitivity_tube._call

    def faulty(function: ca.Function, values: dict[str, Array]) -> Outputs:
        outputs = sound(function, values)
        fault(function.name(), outputs)
        return outputs

    assert leaves_the_desk_tube(make) == 0
    monkeypatch.setattr(sensitivity_tube, "_call", faulty)
    assert leaving(loop, desk_tube(loop)) > 0


# Text of the hand-written loop and what stands there instead.
SLIPS: dict[str, tuple[Callable[[], Benchmark], str, str]] = {
    "no remainder": (b1, "added = box[i] + cut_x[i]", "added = cut_x[i]"),
    "no chord deviation": (_swinging, "s->chord[i];", "0.0;"),
    "no disturbance": (_swinging, "radius > 0.0", "radius > 1e9"),
    "no kink error": (b2, "s->gap[i] = gap;", "s->gap[i] = 0.0;"),
    "pending box forgotten": (b1, "s->columns) + pending[i];", "s->columns);"),
}  # fmt: skip


def kernel_tube(loop: Benchmark) -> ReachTube:
    sizes = KernelSizes(30, 0.05, 2)
    kernel = CompiledTube(loop.system, region=wide_region(loop), sizes=sizes)
    return kernel.tube(loop.initial_set, horizon_s=HORIZON_S, step_s=0.05)


@pytest.mark.parametrize("name", SLIPS)
def test_a_slip_in_the_c_text_is_noticed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    make, right, wrong = SLIPS[name]
    loop = make()
    sound = c_source.c_text
    assert right in sound("tube.c")
    assert leaving(loop, kernel_tube(loop)) == 0
    monkeypatch.setattr(c_source, "c_text", lambda file: sound(file).replace(right, wrong))
    assert leaving(loop, kernel_tube(loop)) > 0
