"""The step that runs is the one whose truncation is bounded, and its sensitivities are its own."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from workbench.models.benchmarks import Benchmark, b1, b2_noise, b2_path
from workbench.reach.step_functions import step_functions
from workbench.reach.step_symbols import rk4

LOOPS = [b1(), b2_path(), b2_noise()]


@pytest.mark.parametrize("loop", LOOPS, ids=lambda loop: loop.name)
def test_advance_is_the_classical_step_with_its_derivatives(loop: Benchmark) -> None:
    steps = step_functions(loop.system.ode)
    form, relaxed = steps.form, steps.relaxed
    x, w, h = form.ode.x, form.ode.w, ca.SX.sym("h")
    others = [form.p, w, relaxed.slope, relaxed.offset, relaxed.error]
    field = ca.Function("g", [x, *others], [relaxed.field])
    end = rk4(field, x, h, others)
    v = ca.vertcat(w, relaxed.error)
    expected = ca.Function("step", [x, *others, h], [end, ca.jacobian(end, x), ca.jacobian(end, v)])
    rng = np.random.default_rng(1)
    kinks = relaxed.slope.numel()
    for _ in range(50):
        state = np.array(loop.initial_set.center) + rng.uniform(-0.3, 0.3, x.numel())
        p, w_mid = form.parameter_values(), rng.uniform(-0.1, 0.1, w.numel())
        slope, offset = rng.uniform(0, 1, kinks), rng.uniform(-0.1, 0.1, kinks)
        step = rng.uniform(0.005, 0.06)
        got = steps.advance(state, p, w_mid, slope, offset, step)
        wanted = expected(state, p, w_mid, slope, offset, np.zeros(kinks), step)
        for one, other in zip(got[:3], wanted, strict=True):
            np.testing.assert_allclose(np.array(one), np.array(other), rtol=1e-11, atol=1e-12)
