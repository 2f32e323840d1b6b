"""Worst margins over the size of the ranges, proved and found."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from matplotlib.figure import Figure

from workbench.models.gains.pictures import BLUE, VERMILLION, figure, ink
from workbench.reach.robustness.verdict import MARGIN_NAMES, MarginName, OverSize, Robust

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PROVED_COLOUR: Final = BLUE
FOUND_COLOUR: Final = VERMILLION


def figure_of(found: OverSize) -> Figure:
    """All margins beside each other."""

    def paint(canvas: Figure) -> None:
        for axes, name in zip(canvas.subplots(1, len(MARGIN_NAMES)), MARGIN_NAMES, strict=True):
            draw_over_size(axes, found, name)

    return figure(paint, width_in=14.0, height_in=3.0)


def draw_over_size(axes: Axes, found: OverSize, name: MarginName) -> None:
    """One margin: what is proved (dots, solid) and what the search found (squares, dashed)."""
    column = MARGIN_NAMES.index(name)
    rows = [each.margins[column] for each in found.answers]
    proved = [math.nan if row.proved is None else row.proved for row in rows]
    worst = [math.nan if row.found is None else row.found for row in rows]
    axes.plot(found.sizes, worst, color=FOUND_COLOUR, marker="s", linestyle="--", markersize=6,
              markerfacecolor="none")  # fmt: skip
    axes.plot(found.sizes, proved, color=PROVED_COLOUR, marker="o", linestyle="-", markersize=4)
    lost = [
        size for size, each in zip(found.sizes, found.answers, strict=True)
        if each.answer is not Robust.PROVED
    ]  # fmt: skip
    if lost:
        axes.axvspan(lost[0], found.sizes[-1] + 0.1, color=ink(), alpha=0.12, linewidth=0.0)
    axes.axvline(1.0, color=ink(), linewidth=0.8, linestyle=":")
    axes.set_xlim(-0.1, found.sizes[-1] + 0.1)
    axes.set_xlabel("size over that of the given ranges (1)")
    axes.set_ylabel(name.label)
