"""A line holds over its range, and rounding budgets exceed measured rounding."""

from __future__ import annotations

import ctypes
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import flint
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from online_cases import QUICK
from test_online_parts import functions
from tube_cases import Array

from workbench.codegen.compiler import compile_shared
from workbench.codegen.native_calls import load_function
from workbench.codegen.online_source import OnlineSizes, tube_source
from workbench.models.graph import graph_of
from workbench.reach.online.model import emitted
from workbench.reach.online.rounding import rounding_bounds
from workbench.reach.online.step import advance_function, second_function


def _line(low: float, high: float, floor: float, ceiling: float) -> Array:
    result = np.zeros(3)
    pointer = ctypes.POINTER(ctypes.c_double)
    arguments = np.array([low, high, floor, ceiling])
    _line_entry()(arguments.ctypes.data_as(pointer), result.ctypes.data_as(pointer), None)
    return result


@functools.cache
def _line_entry() -> Callable[..., int]:
    found = functions("saturated", quadratic=False)
    region = found.ranges.states.reordered(found.model.ode.names)
    source = tube_source(found, region, OnlineSizes(4, 0.1))
    source += (
        "\nint line_of(const double *in, double *out, double *work) "
        "{ (void)work; wb_line(in[0], in[1], in[2], in[3], out); return 0; }\n"
    )
    return load_function(compile_shared(source, flags=QUICK).shared_object, "line_of")


ENDS = st.floats(-1e4, 1e4)


@settings(max_examples=300, deadline=None)
@given(st.tuples(ENDS, ENDS), st.tuples(ENDS, ENDS), st.booleans(), st.lists(st.floats(0, 1)))
@example((-1.0, 1.0), (0.0, 0.0), True, [0.5])
@example((0.0, 1e-12), (0.0, 1.0), False, [0.5])
def test_a_line_is_never_farther_from_the_limit_than_it_says(
    ends: tuple[float, float], limits: tuple[float, float], one_sided: bool, shares: list[float]
) -> None:
    low, high = sorted(ends)
    floor, ceiling = (-1e300, max(limits)) if one_sided else sorted(limits)
    slope, offset, gap = _line(low, high, floor, ceiling)
    assert 0.0 <= slope <= 1.0
    corners = [low, high, min(max(floor, low), high), max(min(ceiling, high), low)]
    for driver in [*corners, *(min(low + share * (high - low), high) for share in shares)]:
        line = flint.fmpq(*slope.as_integer_ratio()) * flint.fmpq(*driver.as_integer_ratio())
        line += flint.fmpq(*offset.as_integer_ratio())
        limited = flint.fmpq(*min(max(driver, floor), ceiling).as_integer_ratio())
        assert abs(line - limited) <= flint.fmpq(*gap.as_integer_ratio())


@pytest.mark.parametrize("bad", range(2))
def test_a_line_of_nothing_is_refused(bad: int) -> None:
    numbers = [0.0, 1.0, 0.2, 0.6]
    numbers[bad] = math.nan
    gap = _line(*numbers)[2]
    assert not gap <= 1e6


_BALLS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b, "sq": lambda a: a * a, "neg": lambda a: -a, "inv": lambda a: 1 / a,
    "twice": lambda a: 2 * a, "fabs": abs, "sin": lambda a: a.sin(), "cos": lambda a: a.cos(),
    "tan": lambda a: a.tan(), "sqrt": lambda a: a.sqrt(),
}  # fmt: skip


def in_balls(function: ca.Function, values: Sequence[Array]) -> list[list[flint.arb]]:
    """The function's outputs in balls of 300 bits."""
    graph, found = graph_of(function), []
    for node in graph.nodes:
        if node.element is not None:
            found.append(flint.arb(float(values[node.element[0]][node.element[1]])))
        elif node.constant is not None:
            found.append(flint.arb(node.constant))
        else:
            found.append(_BALLS[node.name](*(found[k] for k in node.operands)))
    return [[found[k] for k in row] for row in graph.outputs]


@pytest.mark.parametrize("name", ["pendulum", "saturated", "quotient", "forced"])
def test_rounding_budgets_exceed_measured_rounding(name: str) -> None:
    """Also that they are no fantasy: some rounding reaches a thousandth of its budget."""
    flint.ctx.prec = 300
    found = functions(name, quadratic=True)
    model, rng, largest = found.model, np.random.default_rng(2), 0.0
    p = np.array(found.ranges.parameters[0])
    for function in (advance_function(model, 5), second_function(model, found.columns)):
        count = function.n_in()
        sizes = [1.4, 0.0, 0.3, 1.0, 1.0, 0.5 if function.name() == "wb_second" else 0.1]
        low = [p if k == 1 else np.full(function.size1_in(k), -sizes[k]) for k in range(count)]
        high = [p if k == 1 else np.full(function.size1_in(k), sizes[k]) for k in range(count)]
        budget = rounding_bounds(function, list(zip(low, high, strict=True)), sums={})
        code = emitted(function, principal=False)
        for _ in range(40):
            values = [rng.uniform(a, b) for a, b in zip(low, high, strict=True)]
            computed = [np.array(v.nonzeros()) for v in code.call([ca.DM(v) for v in values])]
            for got, want, bound in zip(computed, in_balls(function, values), budget, strict=True):
                for number, ball, most in zip(got, want, bound, strict=True):
                    error = float(abs(flint.arb(float(number)) - ball).upper())
                    assert error <= most
                    largest = max(largest, error / most if most else 0.0)
    assert largest > 1e-3
