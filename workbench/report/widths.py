"""Two tubes of one set beside each other: widths over time and their difference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import final

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.claims import Rigor
from workbench.report.curves import Values, require_shape
from workbench.report.drawing import BLUE, VERMILLION, Figure, Key, svg_panel, thinned
from workbench.report.tables import Cell, Table

_ROWS = 13


@final
@dataclass(frozen=True, slots=True)
class Widths:
    """Half widths (M, n) of a tube at times_s (M,), s, and its rigor."""

    label: str
    rigor: Rigor
    times_s: Values
    half_widths: Values


def width_figure(
    first: Widths, second: Widths, *, names: Sequence[str], units: Sequence[str]
) -> Figure:
    """One picture per state: both half widths over time, what lies between them shaded.

    Both over the same instants. Raises InputError on other shapes.
    """
    for widths in (first, second):
        shape = len(first.times_s), len(names)
        require_shape(f"half widths of {widths.label!r}", widths.half_widths, shape)
    panels = tuple(
        svg_panel(
            partial(_paint, pair=(first, second), column=column, signal=signal),
            label=f"Half widths of {signal[0]} over time",
        )
        for column, signal in enumerate(zip(names, units, strict=True))
    )
    legend = (
        Key(f"{first.label} ({first.rigor.name})", VERMILLION),
        Key(f"{second.label} ({second.rigor.name})", BLUE, "7 3"),
    )
    caption = (
        f"Half width of the set of reachable states: {first.label} against {second.label}. The "
        "shaded part is the difference."
    )
    return Figure(panels, legend, caption, _table(first, second, names, units))


def _paint(
    canvas: Canvas, *, pair: tuple[Widths, Widths], column: int, signal: tuple[str, str]
) -> None:
    axes: Axes = canvas.add_subplot()
    times = pair[0].times_s
    one, other = (widths.half_widths[:, column] for widths in pair)
    axes.fill_between(times, one, other, facecolor=VERMILLION, alpha=0.2, linewidth=0.0)
    for curve, colour, dashes in ((one, VERMILLION, "-"), (other, BLUE, "--")):
        axes.plot(times, curve, color=colour, linestyle=dashes, linewidth=1.8)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("time (s)")
    axes.set_title(signal[0])
    axes.set_ylabel(f"half width ({signal[1]})")


def _table(first: Widths, second: Widths, names: Sequence[str], units: Sequence[str]) -> Table:
    headings = ["time (s)", "tube"]
    headings += [f"{name} ({unit})" for name, unit in zip(names, units, strict=True)]
    difference = first.half_widths - second.half_widths
    rows: list[list[Cell]] = [
        [float(first.times_s[k]), label, *(float(v) for v in values[k])]
        for k in thinned(len(first.times_s), _ROWS)
        for label, values in (
            (first.label, first.half_widths),
            (second.label, second.half_widths),
            ("difference", difference),
        )
    ]
    return Table("half widths at some instants", headings, rows, folded=True)
