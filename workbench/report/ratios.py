"""How much wider than sampled trajectories each bound is, over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from workbench.report.curves import Values, require_shape
from workbench.report.drawing import INK, STYLES, Figure, svg_panel, thinned
from workbench.report.tables import Cell, Table

# Ratios beyond this say no more than that a method is of no use there.
_HIGHEST = 1e3
# Up to this ratio the scale is linear.
_LINEAR_TO = 10.0


@final
@dataclass(frozen=True, slots=True)
class RatioCurve:
    """The ratio of one method: label, the group it is drawn with, ratios (M,), inf where no bound.

    Where a proof ends early the curve ends.
    """

    label: str
    group: str
    ratios: Values


def ratio_figure(times_s: Values, curves: Sequence[RatioCurve]) -> Figure:
    """One picture per group of methods, each with its own scale and legend; 1 would be perfect.

    times_s: (M,), s. Raises InputError on ratios of another length.
    """
    for curve in curves:
        require_shape(f"the ratios of {curve.label!r}", curve.ratios, times_s.shape)
    groups = list(dict.fromkeys(curve.group for curve in curves))
    members = {group: [c for c in curves if c.group == group] for group in groups}
    panels = tuple(
        svg_panel(
            partial(_paint, times_s=times_s, curves=members[group], title=group),
            label=f"Width over sampled width in time, methods {group}",
            height_in=3.8,
        )
        for group in groups
    )
    caption = (
        "Half width of each bound over the largest sampled distance, geometric mean over the "
        "states; 1 would be perfect. The pictures have scales of their own. A curve that stops is "
        f"a proof that ends there, or a ratio above {_HIGHEST:g}."
    )
    return Figure(panels, (), caption, _numbers(times_s, curves))


def _top(ratios: Values) -> float:
    finite = ratios[np.isfinite(ratios)]
    return float(finite.max()) if len(finite) else 1.0


def _paint(canvas: Canvas, *, times_s: Values, curves: Sequence[RatioCurve], title: str) -> None:
    axes: Axes = canvas.add_subplot()
    top = 1.2
    for i, curve in enumerate(curves):
        colour, line = STYLES[i % len(STYLES)]
        drawn = np.where(curve.ratios <= _HIGHEST, curve.ratios, np.nan)
        axes.plot(times_s, drawn, color=colour, linestyle=line, linewidth=1.8, label=curve.label)
        top = max(top, _top(drawn))
    axes.axhline(1.0, color=INK, linewidth=0.8, alpha=0.6)
    axes.set_xlim(0.0, float(times_s[-1]))
    axes.set_ylim(0.9 if top > _LINEAR_TO else 1.0 - 0.1 * (top - 1.0), 1.1 * top - 0.1)
    if top > _LINEAR_TO:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_title(title)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("width / sampled (1)" + (", log scale" if top > _LINEAR_TO else ""))
    canvas.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=8.5)


def _numbers(times_s: Values, curves: Sequence[RatioCurve]) -> Table:
    instants = list(thinned(len(times_s), 7))
    rows: list[list[Cell]] = [
        [curve.label, *(float(curve.ratios[k]) for k in instants)] for curve in curves
    ]
    headings = ["method", *(f"{times_s[k]:g} s" for k in instants)]
    return Table("width over sampled width (1) at some instants", headings, rows, folded=True)
