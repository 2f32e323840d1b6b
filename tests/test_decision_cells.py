"""Where the whole set proves too little, it is cut into cells that cover it, within a budget."""

from __future__ import annotations

import ctypes
import functools
import re
import tempfile
from pathlib import Path

import decision_fixture
import numpy as np
import pytest
from decision_fixture import (
    COMPLETE,
    SAFE,
    STARTS,
    UNPROVED,
    Answer,
    DecisionKernel,
    kernel,
    query,
    real_files,
)
from decision_paths import paths, segments, simulate
from test_decision_people import _distance

from workbench.codegen.compiler import compile_shared
from workbench.codegen.decision_source import MOST_TUBES
from workbench.runtime.manifest import SOURCE_FILE

_START = "initial set"


def _person(aside_m: float) -> list[float]:
    return [6.0, aside_m, 0.0, 0.0, 0.5, 0.1, 0.0]


def loaded(library: bytes) -> ctypes.CDLL:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "kernel.so"
        path.write_bytes(library)
        return ctypes.CDLL(str(path))


@functools.cache
def _variant(pattern: str, replacement: str) -> DecisionKernel:
    """The shipped kernel with one place of its text changed."""
    source = real_files()[SOURCE_FILE].decode()
    changed, count = re.subn(pattern, replacement, source)
    assert count == 1
    return DecisionKernel(compile_shared(changed).shared_object)


def _asked(one: DecisionKernel, aside_m: float) -> Answer:
    return one(query(paths()["straight"].table, STARTS[_START], [_person(aside_m)]))


def _whole() -> DecisionKernel:
    return _variant(r"#define WB_TUBES \d+", "#define WB_TUBES 1")


def test_cells_prove_what_the_whole_set_does_not() -> None:
    gained = 0
    for aside_m in np.arange(1.6, 2.6, 0.05):
        whole, cut = _asked(_whole(), aside_m), _asked(kernel(), aside_m)
        assert whole.status == cut.status == COMPLETE
        if whole.verdict == SAFE:
            # The first tube settles it: nothing changes.
            np.testing.assert_array_equal(whole.numbers, cut.numbers)
        elif cut.verdict == SAFE:
            gained += 1
            assert cut.scalar("clearance_m") >= 0.2 > whole.scalar("clearance_m")
        else:
            # What cells could not prove is reported of the whole set.
            np.testing.assert_array_equal(whole.numbers, cut.numbers)
    assert gained >= 2


def test_every_run_stays_in_the_rows_of_the_cells_and_clear_of_people() -> None:
    person, start, path = _person(2.25), STARTS[_START], paths()["straight"]
    answer = _asked(kernel(), 2.25)
    assert answer.verdict == SAFE
    assert _asked(_whole(), 2.25).verdict == UNPROVED
    states = start.states(600, np.random.default_rng(3))
    fine = simulate(start, states, path.curvature, steps=60)
    seen = segments(fine, answer.steps)
    lower, upper = answer.rows("tube_lower", 7), answer.rows("tube_upper", 7)
    assert np.all(lower[:, None, :, None] <= seen + 1e-13)
    assert np.all(seen <= upper[:, None, :, None] + 1e-13)
    assert float(_distance(fine, "straight", person).min()) >= answer.scalar("clearance_m") - 1e-9


def test_cells_cover_the_set_that_is_cut() -> None:
    """With a cut that leaves a gap, or a forgotten cell, runs leave the rows."""
    start, path = STARTS[_START], paths()["straight"]
    states = start.states(600, np.random.default_rng(3))
    fine = segments(simulate(start, states, path.curvature, steps=60), 60)
    faults = [
        (r"half->radius\[axis\] = radius / 2 \*", "half->radius[axis] = radius / 4 *"),
        (r"side \* \(radius / 2\)", "side * (radius / 8)"),
        (r"wb_half\(cells \+ worst, axis, 1\.0,", "wb_half(cells + worst, axis, -1.0,"),
        (r"first \? cells\[i\]\.lower\[k\] : wb_min", "first ? cells[i].lower[k] : wb_max"),
    ]
    for pattern, replacement in faults:
        answer = _asked(_variant(pattern, replacement), 2.25)
        assert answer.verdict == SAFE, pattern
        lower, upper = answer.rows("tube_lower", 7), answer.rows("tube_upper", 7)
        outside = np.maximum(lower[:, None, :, None] - fine, fine - upper[:, None, :, None])
        assert outside.max() > 1e-6, pattern


@pytest.mark.parametrize("aside_m", [1.0, 1.6, 2.25, 3.0])
def test_no_more_tubes_are_computed_than_allowed(aside_m: float) -> None:
    """Somebody in the way, near or far: one tube where that proves enough, at most the budget."""
    source = real_files()[SOURCE_FILE].decode()
    changed, count = re.subn(
        r"(static void wb_decide_cell\([^{]*\{)", r"static int wb_count;\n\1 ++wb_count;", source
    )
    assert count == 1
    changed += "\nint wb_counted(void) { const int n = wb_count; wb_count = 0; return n; }\n"
    library = compile_shared(changed).shared_object
    # One loaded object: the counter is the one of the kernel that is called.
    with pytest.MonkeyPatch.context() as patch:
        handle = loaded(library)
        patch.setattr(decision_fixture, "load_function", lambda _library, name: handle[name])
        answer = _asked(DecisionKernel(library), aside_m)
    counted = handle["wb_counted"]()
    assert counted <= MOST_TUBES
    assert counted % 2 == 1
    assert (counted == 1) == (aside_m == 3.0)
    assert answer.status == COMPLETE
    assert (answer.verdict == SAFE) == (aside_m > 2.0)
    if answer.verdict != SAFE:
        assert counted == MOST_TUBES
