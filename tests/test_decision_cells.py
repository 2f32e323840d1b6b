"""Where the whole set proves too little, it is cut into cells that cover it, within a budget."""

from __future__ import annotations

import ctypes
import functools

import numpy as np
import pytest
from decision_answers import Array, TubeAnswer
from decision_crowd import distance, intent_distance
from decision_fixture import (
    COMPLETE,
    SAFE,
    STARTS,
    UNPROVED,
    DecisionKernel,
    Start,
    Text,
    compiled,
    guarded,
    kernel,
    nested,
    query,
    real_text,
    text_of,
)
from decision_paths import paths, segments, simulate
from decision_stops import drive, excess, sampled_orders

from workbench.codegen.decision_source import MOST_TUBES
from workbench.runtime.person_tubes import TubeKind

_START = "initial set"


def _person(aside_m: float) -> list[float]:
    return [6.0, aside_m, 0.0, 0.0, 0.5, 0.1, 0.0]


def _variant(pattern: str, replacement: str) -> DecisionKernel:
    """The shipped kernel with one place of its text changed."""
    return compiled(real_text().edited((pattern, replacement)))


def _asked(one: DecisionKernel, aside_m: float) -> TubeAnswer:
    return one(query(paths()["straight"].table, STARTS[_START], [_person(aside_m)])).track


@functools.cache
def _fine() -> Array:
    start = STARTS[_START]
    states = start.states(600, np.random.default_rng(3))
    return simulate(start, states, paths()["straight"].curvature, steps=60)


def _whole() -> DecisionKernel:
    return _variant(r"#define WB_TUBES \d+", "#define WB_TUBES 1")


def _check_same(one: TubeAnswer, other: TubeAnswer) -> None:
    for name in ("intent", "lower", "upper", "occupancy", "rows", "cells"):
        np.testing.assert_array_equal(one.field(name), other.field(name))


def test_cells_prove_what_the_whole_set_does_not() -> None:
    gained = 0
    for aside_m in np.arange(1.6, 2.6, 0.05):
        whole, cut = _asked(_whole(), aside_m), _asked(kernel(), aside_m)
        assert whole.status == cut.status == COMPLETE
        if whole.verdict == SAFE:
            # The first tube settles it: nothing changes.
            _check_same(whole, cut)
        elif cut.verdict == SAFE:
            gained += 1
            assert cut.intent.clearance_m >= 0.2 > whole.intent.clearance_m
        else:
            # What cells could not prove is reported of the whole set.
            _check_same(whole, cut)
    assert gained >= 2


def test_every_run_stays_in_the_rows_of_the_cells_and_clear_of_people() -> None:
    person = _person(2.25)
    answer = _asked(kernel(), 2.25)
    assert answer.verdict == SAFE
    assert _asked(_whole(), 2.25).verdict == UNPROVED
    fine = _fine()
    seen = segments(fine, answer.steps)
    lower, upper = answer.rows("lower", 7), answer.rows("upper", 7)
    assert np.all(lower[:, None, :, None] <= seen + 1e-13)
    assert np.all(seen <= upper[:, None, :, None] + 1e-13)
    nearest = float(intent_distance(fine, "straight", person).min())
    assert nearest >= answer.intent.clearance_m - 1e-9


def test_cells_cover_the_set_that_is_cut() -> None:
    """With a cut that leaves a gap, or a forgotten cell, runs leave the rows."""
    fine = segments(_fine(), 60)
    faults = [
        (r"half->radius\[axis\] = radius / 2 \*", "half->radius[axis] = radius / 4 *"),
        (r"side \* \(radius / 2\)", "side * (radius / 8)"),
        (r"wb_half\(cells \+ worst, axis, 1\.0,", "wb_half(cells + worst, axis, -1.0,"),
        (r"\*lower = first \? low : wb_min", "*lower = first ? low : wb_max"),
    ]
    for pattern, replacement in faults:
        answer = _asked(_variant(pattern, replacement), 2.25)
        assert answer.verdict == SAFE, pattern
        lower, upper = answer.rows("lower", 7), answer.rows("upper", 7)
        outside = np.maximum(lower[:, None, :, None] - fine, fine - upper[:, None, :, None])
        assert outside.max() > 1e-6, pattern


def test_stops_stay_in_the_rows_of_cells_and_out_of_guards() -> None:
    """Cells that stand at different times stay in the rows of the others."""
    path, somebody = (
        paths()["straight"],
        guarded([5.0, 4.5, 0.0, 0.0, 0.3, 0.1, 0.1], spread_mps=0.1),
    )
    start = Start((0.0, 0.1, 0.0, 2.2, 0.0, 0.0, 0.0), (0.02, 0.02, 0.01, 0.6, 0.01, 0.0, 0.0), 2.8)
    window = (0.1, 0.1834)
    answer = kernel()(query(path.table, start, [somebody], switch_s=window)).stop
    assert (answer.status, answer.verdict) == (COMPLETE, SAFE)
    assert answer.cells >= 3
    chance = np.random.default_rng(9)
    states, orders = sampled_orders(start.states(60, chance), window, chance, corners=32)
    runs = drive(start, states, path, orders, chance)
    assert excess(answer, runs).max() < 1e-13
    nearest = float(distance(runs, path, somebody, TubeKind.GUARD).min())
    assert nearest >= answer.guard.clearance_m - 1e-9


@functools.cache
def _counting() -> DecisionKernel:
    """Counts the tubes that are computed for TRACK, for stopping and for braking at once."""
    text = text_of(levels=1).edited(
        (r"(static void wb_run_cell\([^{]*\{)", r"\1 ++wb_counts[c->order.mask - 1];")
    )
    return compiled(Text("int wb_counts[3];\n" + text.source, text.query, text.result))


@pytest.mark.parametrize("aside_m", [1.0, 1.6, 2.25, 3.0, 6.0, 20.0])
def test_no_more_tubes_are_computed_than_allowed(aside_m: float) -> None:
    """Somebody in the way, near or far: one tube where that proves enough, at most the budget."""
    kernel, start = _counting(), STARTS[_START].scaled(0.5)
    counts = (ctypes.c_int * 3).in_dll(kernel.handle, "wb_counts")
    counts[:] = [0, 0, 0]
    numbers = query(
        paths()["straight"].table, start, [guarded(_person(aside_m))], text_of(levels=1).query,
        **nested(start, (1.0,)),
    )  # fmt: skip
    answer = kernel(numbers)
    clear = ((2.25, 3.0, 6.0, 20.0), (20.0,), (20.0,))
    for tube, counted, far in zip(answer.tubes, counts, clear, strict=True):
        assert counted <= MOST_TUBES
        assert counted % 2 == 1
        assert tube.status == COMPLETE
        if aside_m in far:
            assert tube.verdict == SAFE
        if tube.verdict == SAFE:
            assert tube.cells == (counted + 1) // 2
        else:
            assert counted == MOST_TUBES
    if aside_m == 20.0:
        assert list(counts) == [1, 1, 1]
    if aside_m == 1.0:
        assert {tube.verdict for tube in answer.tubes} == {UNPROVED}
