"""A result in a notebook: as Matplotlib's figure, as tidy rows, as HTML, as a page of its own."""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from matplotlib.artist import Artist
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from workbench import __version__
from workbench.errors import InputError
from workbench.report.drawing import DASHES, Figure, Key, Panel, drawing_style
from workbench.report.page import Page, Section, asset, write_page
from workbench.report.tables import Cell

Row = Mapping[str, Cell]
_COLUMNS = 3
_LEGEND_IN = 0.3


@final
@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What `view` makes of a result. The last expression of a notebook's cell shows itself.

    title: what it is; figures: those of the product's pages; table: one observation per row.
    """

    title: str
    figures: tuple[Figure, ...]
    table: tuple[Row, ...]

    def plot(self) -> Canvas:
        """All pictures as one figure of Matplotlib, drawn by the code that draws the pages."""
        panels = [panel for figure in self.figures for panel in figure.panels]
        keys = list(dict.fromkeys(key for figure in self.figures for key in figure.legend))
        return drawn([panel for panel in panels if isinstance(panel, Panel)], keys)

    def rows(self) -> list[dict[str, Cell]]:
        """The numbers in full: a list of dictionaries, as pandas, polars and pyarrow take it."""
        return [dict(row) for row in self.table]

    def frame(self) -> Any:
        """The rows as a pandas DataFrame. Raises InputError where pandas is not installed."""
        try:
            pandas = importlib.import_module("pandas")
        except ModuleNotFoundError as error:
            raise InputError(
                "frame(): expected pandas to be installed, it is not; pip install pandas, or take "
                "rows(), which is a list of dictionaries"
            ) from error
        return pandas.DataFrame(self.rows())

    def save(self, path: str | Path) -> None:
        """Write it as one HTML file that works offline. InputError where nothing can be written."""
        page = Page(self.title, (), [Section(self.title, self.figures)], __version__, "Python")
        write_page(Path(path), page.html())

    def _repr_html_(self) -> str:
        figures = "".join(figure.html() for figure in self.figures)
        return f'<style>{asset("notebook.css")}</style><div class="workbench">{figures}</div>'


def drawn(panels: Sequence[Panel], keys: Sequence[Key]) -> Canvas:
    """The panels in a grid of at most three columns above their legend, on white."""
    columns = min(_COLUMNS, max(1, len(panels)))
    rows = max(1, math.ceil(len(panels) / columns))
    wide = max((panel.size_in[0] for panel in panels), default=1.0)
    high = max((panel.size_in[1] for panel in panels), default=1.0)
    lines = math.ceil(len(keys) / columns)
    with drawing_style(background="white"):
        canvas = Canvas(
            figsize=(columns * wide, rows * high + _LEGEND_IN * lines), layout="constrained"
        )
        grid = canvas.subfigures(rows, columns, squeeze=False).flat
        for part, panel in zip(grid, panels, strict=False):
            panel.paint(part)
        if keys:
            canvas.legend(
                handles=[_handle(key) for key in keys], loc="outside lower center", ncols=columns,
                frameon=False,
            )  # fmt: skip
    return canvas


def _handle(key: Key) -> Artist:
    """An entry of Matplotlib's legend that looks like this one of a page's."""
    if key.filled:
        return Patch(facecolor=key.colour, hatch=key.hatch or None, alpha=0.7, label=key.label)
    if key.mark:
        return Line2D([], [], color=key.colour, marker=key.mark, linestyle="", label=key.label)
    dashes: Any = next((each for each, svg in DASHES.items() if svg == key.dashes), "--")
    return Line2D([], [], color=key.colour, linestyle=dashes, linewidth=1.8, label=key.label)
