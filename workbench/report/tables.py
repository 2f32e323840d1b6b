"""Numbers as tables, with a button in the page that saves them as CSV, more digits than shown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.report.page import escaped

Cell = str | int | float | None

# Outward rounding makes numbers of this size out of an exact zero.
_ROUNDED_ZERO = 1e-200


def shown(cell: Cell) -> str:
    """A cell as text: four significant digits, a dash for nothing.

    >>> shown(0.123456), shown(None), shown(7), shown("x"), shown(5e-324)
    ('0.1235', '–', '7', 'x', '0')
    """
    if cell is None:
        return "–"
    if isinstance(cell, float):
        if abs(cell) < _ROUNDED_ZERO:
            return "0"
        return f"{cell:.4g}" if math.isfinite(cell) else {True: "∞", False: "–"}[cell == math.inf]
    return str(cell)


def written(cell: Cell) -> str:
    """A cell in a CSV file: nine significant digits, nothing for nothing.

    >>> written(0.1234567891), written(None), written(float("inf")), written(True), written("x")
    ('0.123456789', '', 'inf', 'True', 'x')
    """
    if isinstance(cell, float):
        return "" if math.isnan(cell) else f"{cell:.9g}"
    return "" if cell is None else str(cell)


@final
@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells under headings that name the units.

    caption: what the numbers are; headings: one per column, with unit in brackets; rows: cells.
    folded: start closed, for long tables. Raises InputError on a row of another length.
    """

    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    folded: bool = False

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.headings):
                raise InputError(
                    f"expected {len(self.headings)} cells per row in table {self.caption!r}, "
                    f"got {len(row)}: {list(row)!r}; give one cell per heading"
                )

    def html(self) -> str:
        """The block as HTML."""
        head = "".join(f'<th scope="col">{escaped(text)}</th>' for text in self.headings)
        body = "".join(
            "<tr>" + "".join(self._cell(cell) for cell in row) + "</tr>" for row in self.rows
        )
        caption = escaped(self.caption)
        grid = (
            f'<div class="table" tabindex="0" role="region" aria-label="{caption}"><table>'
            f"<caption><span>{caption}</span></caption>"
            f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
        )
        if not self.folded:
            return grid
        return f"<details><summary>Numbers: {caption}</summary>{grid}</details>"

    @staticmethod
    def _cell(cell: Cell) -> str:
        if isinstance(cell, str):
            return f"<td>{escaped(cell)}</td>"
        text, value = shown(cell), written(cell)
        kept = f' data-v="{value}"' if value != text else ""
        return f'<td class="number"{kept}>{escaped(text)}</td>'
