"""A path table is consistent by construction, and its windows are slices of it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from runtime_world import arc_table

from workbench.errors import InputError
from workbench.runtime.path import PathTable


def test_windows_are_slices_of_the_path() -> None:
    table = arc_table(0.1)
    window = table.window(2.6, count=20)
    assert window.start_m == pytest.approx(2.5)
    assert window.x == table.x[50:70]
    assert window.curvature_upper == table.curvature_upper[50:69]
    late = table.window(39.0, count=20)
    assert late.x == table.x[-20:]
    assert late.end_m == pytest.approx(table.end_m)
    assert table.window(-99.0, count=20).x == table.x[:20]
    assert table.window(0.0, count=500) is table
    with pytest.raises(InputError, match="at least 2 nodes"):
        table.window(0.0, count=1)


def _changed(table: PathTable, column: str, index: int, by: float) -> dict[str, tuple[float, ...]]:
    values = list(getattr(table, column))
    values[index] += by
    return {column: tuple(values)}


@pytest.mark.parametrize(
    ("column", "by", "message"),
    [
        ("x", math.nan, "finite"),
        ("x", 1e-5, "equal arc lengths"),
        ("y", -1e-5, "equal arc lengths"),
        ("heading", 1e-4, "heading changes"),
        ("heading", math.tau, "unwrap the heading"),
        ("curvature_lower", 1e-3, "lower <= upper"),
        ("curvature_upper", 9.0, "more densely"),
    ],
)
def test_a_table_that_contradicts_itself_is_refused(column: str, by: float, message: str) -> None:
    table = arc_table(0.1)
    with pytest.raises(InputError, match=message):
        replace(table, **_changed(table, column, 7, by))  # type: ignore[arg-type]


def test_tables_of_wrong_shape_are_refused() -> None:
    table = arc_table(0.1)
    with pytest.raises(InputError, match="n - 1 curvature bounds"):
        replace(table, curvature_lower=table.curvature_lower[1:])
    with pytest.raises(InputError, match="n >= 2 nodes"):
        PathTable(0.0, 1.0, (0.0,), (0.0,), (0.0,), (), ())
    with pytest.raises(InputError, match="spacing_m > 0"):
        replace(table, spacing_m=-0.25)
