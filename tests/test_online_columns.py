"""The loop's transition has the bits of the Function that is analysed, and merged columns forget
nothing."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from online_cases import CASES, QUICK, functions_of
from tube_cases import Array

from workbench.codegen.compiler import compile_shared
from workbench.codegen.native_calls import load_function
from workbench.codegen.online_source import OnlineSizes, tube_source
from workbench.reach.online.functions import ORDER, OnlineFunctions
from workbench.reach.online.model import emitted
from workbench.reach.online.point_trig import PRINCIPAL_RAD
from workbench.reach.online.step import advance_function

_DOUBLES = ctypes.POINTER(ctypes.c_double)
_SHIMS = """
int rates_to_phi(const double *in, double *out, double *work) {
  (void)work;
  wb_transition(in, out);
  return 0;
}
int reduced(const double *in, double *out, double *work) {
  wb_set s;
  int i, j;
  memset(&s, 0, sizeof s);
  s.now = s.instants;
  s.g = work;
  s.now->columns = (int)in[0];
  for (j = 0; j < s.now->columns; ++j) {
    s.source[j] = (int)in[1 + j];
    for (i = 0; i < WB_N; ++i) {
      wb_row(s.g, i)[j] = in[1 + s.now->columns + WB_N * j + i];
      s.now->rest[i] += fabs(wb_row(s.g, i)[j]) * WB_UP;
    }
  }
  wb_reduce(&s);
  out[0] = s.now->columns;
  for (i = 0; i < WB_N; ++i) {
    out[1 + i] = s.now->pending[i];
    out[1 + WB_N + i] = s.now->rest[i];
    for (j = 0; j < s.now->columns; ++j) out[1 + 2 * WB_N + WB_N * j + i] = wb_row(s.g, i)[j];
  }
  return 0;
}
"""
_MODEL = "pendulum"


def _found(name: str) -> OnlineFunctions:
    return functions_of(name, quadratic=False)


@functools.cache
def _entry(name: str, function: str) -> Callable[..., int]:
    found = _found(name)
    region = found.ranges.states.reordered(found.model.ode.names)
    shims = _SHIMS if name == _MODEL else _SHIMS[: _SHIMS.index("int reduced")]
    source = tube_source(found, region, OnlineSizes(200, 0.1)) + shims
    return load_function(compile_shared(source, flags=QUICK).shared_object, function)


def _called(name: str, function: str, numbers: Array, size: int) -> Array:
    result, work = np.zeros(size), np.zeros(100_000)
    vectors = [np.ascontiguousarray(numbers, dtype=float), result, work]
    assert _entry(name, function)(*[v.ctypes.data_as(_DOUBLES) for v in vectors]) == 0
    return result


@pytest.mark.parametrize("name", sorted(CASES))
def test_the_transition_has_the_bits_of_the_function_that_is_analysed(name: str) -> None:
    found, rng = _found(name), np.random.default_rng(3)
    model, ranges = found.model, found.ranges
    assert found.rounding is not None
    whole = emitted(advance_function(model, ORDER), principal=found.rounding.angle < PRINCIPAL_RAD)
    for _ in range(20):
        point = [
            rng.uniform(-0.5, 0.5, model.n), np.array(ranges.parameters[0]),
            rng.uniform(-0.1, 0.1, model.n_w), rng.uniform(0, 1, model.n_k),
            rng.uniform(-0.1, 0.1, model.n_k), rng.uniform(0.01, 0.1),
        ]  # fmt: skip
        end, transition = whole(*point)
        x_end, rates = found.advance(*point)
        assert np.array_equal(np.array(end), np.array(x_end))
        assert transition.sparsity() == found.transition
        wanted = np.array(transition.nonzeros())
        got = _called(name, "rates_to_phi", np.array(rates).ravel(), len(wanted))
        assert np.array_equal(got, wanted)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(193, 196), st.floats(0.0, 1.0))
def test_merged_columns_hold_what_they_were_made_of(seed: int, count: int, spread: float) -> None:
    """In every direction the merged set reaches at least as far, and its radius is known."""
    n, rng = _found(_MODEL).model.n, np.random.default_rng(seed)
    sources = rng.integers(0, n + 1, count)
    common = rng.normal(size=(n + 1, n))
    columns = common[sources] + spread * rng.normal(size=(count, n))
    columns *= 10.0 ** rng.uniform(-6, 0, (count, 1)) * rng.choice([-1.0, 0.0, 1.0], (count, 1))
    numbers = np.concatenate([[count], sources, columns.ravel()])
    result = _called(_MODEL, "reduced", numbers, 1 + 2 * n + n * count)
    left = int(result[0])
    pending, rest = result[1 : 1 + n], result[1 + n : 1 + 2 * n]
    merged = result[1 + 2 * n : 1 + 2 * n + n * left].reshape(left, n)
    assert left <= 128
    directions = np.concatenate([rng.normal(size=(50, n)), np.eye(n)])
    before = np.abs(directions @ columns.T).sum(axis=1)
    after = np.abs(directions @ merged.T).sum(axis=1) + np.abs(directions) @ pending
    assert np.all(after >= before * (1 - 1e-13))
    assert np.all(rest >= (np.abs(merged).sum(axis=0) + pending) * (1 - 1e-13))


def test_parallel_columns_merge_without_loss() -> None:
    n = _found(_MODEL).model.n
    count = 194
    columns = np.outer(np.linspace(1.0, 2.0, count), np.arange(1.0, n + 1))
    numbers = np.concatenate([[count], np.zeros(count), columns.ravel()])
    result = _called(_MODEL, "reduced", numbers, 1 + 2 * n + n * count)
    assert int(result[0]) < count
    assert np.all(result[1 : 1 + n] <= 1e-12 * columns.sum())
