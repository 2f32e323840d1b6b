"""Width against time of tubes that are computed in microseconds, and growth of that time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, final

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import NullFormatter, NullLocator, StrMethodFormatter

from workbench.errors import InputError
from workbench.report.drawing import (
    DASHES,
    INK,
    PALETTE,
    STYLES,
    Dashes,
    Figure,
    Key,
    svg_panel,
)
from workbench.report.tables import Cell, Table

_LETTERS: Final = "abcdefghijklmnopqrstuvwxyz"
_MARKERS: Final = ("o", "s", "^", "D", "v")
_SIGNS: Final = {"o": "●", "s": "■", "^": "▲", "D": "◆", "v": "▼"}


@final
@dataclass(frozen=True, slots=True)
class FrontierPoint:
    """One tube: series (kernel and form), step in s, cells of the initial set, microseconds for all
    of them, width over sampled width (1 would be perfect)."""

    series: str
    step_s: float
    cells: int
    time_us: float
    ratio: float


@final
@dataclass(frozen=True, slots=True)
class Frontier:
    """The tubes of one loop; references: width ratios of the validated tubes by their cells;
    trajectory_us: time of one compiled trajectory. Raises InputError without points."""

    loop: str
    points: Sequence[FrontierPoint]
    references: Mapping[int, float]
    trajectory_us: float

    def __post_init__(self) -> None:
        if not self.points:
            raise InputError(f"expected at least one tube of {self.loop}, got none to draw")


@final
@dataclass(frozen=True, slots=True)
class GrowthCurve:
    """Time of one series over what grows: values (T in s, or cells), microseconds."""

    series: str
    values: Sequence[float]
    time_us: Sequence[float]


def frontier_figure(frontiers: Sequence[Frontier], *, signal: str) -> Figure:
    """One picture per loop: percent of width beyond the sampled width of `signal` against time.

    Both scales are logarithmic; the number at a point counts the cells; the line joins the points
    that no other point beats in both.
    """
    names = list(dict.fromkeys(p.series for f in frontiers for p in f.points))
    steps = sorted({p.step_s for f in frontiers for p in f.points}, reverse=True)
    looks = {name: (_LETTERS[k], PALETTE[k % len(PALETTE)]) for k, name in enumerate(names)}
    markers = dict(zip(steps, _MARKERS * len(steps), strict=False))
    panels = tuple(
        svg_panel(
            partial(_paint, frontier=f, looks=looks, markers=markers, signal=signal),
            label=f"Width of {signal} against time on {f.loop}",
            height_in=3.8,
        )
        for f in frontiers
    )
    legend = (
        *(Key(f"{letter}: {name}", colour, mark="o") for name, (letter, colour) in looks.items()),
        Key("not beaten in both", INK),
        Key("validated tubes", INK, "2 3"),
    )
    shapes = ", ".join(f"{_SIGNS[markers[step]]} {step:g} s" for step in steps)
    caption = (
        f"Mean width of {signal} over 0 to 3 s beyond the sampled width, against the time for all "
        f"cells on one core. Marker: step ({shapes}); letter: as in the legend; number: cells of "
        "the initial set; stairs: what no other setting beats in both. Dotted: widths of the "
        "validated tubes, cells at the right; they take seconds."
    )
    return Figure(panels, legend, caption, _numbers(frontiers))


def _paint(
    canvas: Canvas, *, frontier: Frontier, looks: Mapping[str, tuple[str, str]],
    markers: Mapping[float, str], signal: str,
) -> None:  # fmt: skip
    axes: Axes = canvas.add_subplot()
    for cells, ratio in frontier.references.items():
        axes.axhline(_percent(ratio), color=INK, linestyle=":", linewidth=1.0, alpha=0.6)
        axes.annotate(
            str(cells), (1.0, _percent(ratio)), xycoords=("axes fraction", "data"), xytext=(2, 0),
            textcoords="offset points", fontsize=8.0, va="center",
        )  # fmt: skip
    best = _best(frontier.points)
    axes.plot(
        [p.time_us for p in best], [_percent(p.ratio) for p in best], color=INK, linewidth=0.8,
        alpha=0.6, drawstyle="steps-post", zorder=1,
    )  # fmt: skip
    for p in frontier.points:
        letter, colour = looks[p.series]
        axes.plot(
            p.time_us, _percent(p.ratio), marker=markers[p.step_s], color=colour,
            markersize=6.0, linestyle="none",
        )  # fmt: skip
        axes.annotate(
            f"{letter}{p.cells}", (p.time_us, _percent(p.ratio)), xytext=(5, 4),
            textcoords="offset points", fontsize=8.0,
        )  # fmt: skip
    _logarithmic(axes)
    axes.axvline(frontier.trajectory_us, color=INK, linewidth=0.8, alpha=0.4)
    axes.annotate(
        " one trajectory", (frontier.trajectory_us, 0.02), xycoords=("data", "axes fraction"),
        rotation=90, fontsize=8.0, va="bottom",
    )  # fmt: skip
    axes.set_title(frontier.loop)
    axes.set_xlabel("time for all cells (us), log scale")
    axes.set_ylabel(f"{signal} beyond sampled (%), log scale")


def _logarithmic(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    for scale in (axes.xaxis, axes.yaxis):
        scale.set_major_formatter(StrMethodFormatter("{x:g}"))
        scale.set_minor_formatter(NullFormatter())


def _percent(ratio: float) -> float:
    """Width beyond the sampled one; at least a ten-thousandth of a percent, so that it has a place
    on the scale."""
    return max(100.0 * (ratio - 1.0), 1e-4)


def _best(points: Sequence[FrontierPoint]) -> list[FrontierPoint]:
    """Points that no other point beats in time and width, by time.

    >>> slow, fast = FrontierPoint("a", 0.1, 1, 9.0, 1.1), FrontierPoint("a", 0.1, 1, 2.0, 1.2)
    >>> worse = FrontierPoint("a", 0.1, 1, 3.0, 1.3)
    >>> [p.time_us for p in _best([slow, worse, fast])]
    [2.0, 9.0]
    """
    best: list[FrontierPoint] = []
    for point in sorted(points, key=lambda p: (p.time_us, p.ratio)):
        if not best or point.ratio < best[-1].ratio:
            best.append(point)
    return best


def _numbers(frontiers: Sequence[Frontier]) -> Table:
    rows: list[list[Cell]] = [
        [f.loop, p.series, p.step_s, p.cells, p.time_us, p.ratio]
        for f in frontiers
        for p in sorted(f.points, key=lambda p: p.time_us)
    ]
    headings = ["loop", "kernel and form", "step (s)", "cells", "time (us)", "width ratio (1)"]
    return Table("width and time of every tube", headings, rows, folded=True)


def growth_panels(
    growths: Mapping[str, Sequence[GrowthCurve]], *, over: str, logarithmic: bool
) -> Figure:
    """One picture per loop: microseconds over what grows, and a thin line of proportional growth.

    over: name and unit of the horizontal axis; logarithmic: both scales are.
    """
    names = list(dict.fromkeys(c.series for curves in growths.values() for c in curves))
    styles = {name: STYLES[k % len(STYLES)] for k, name in enumerate(names)}
    panels = tuple(
        svg_panel(
            partial(
                _paint_growth, curves=curves, styles=styles, words=(loop, over),
                logarithmic=logarithmic,
            ),
            label=f"Time over {over} on {loop}",
        )
        for loop, curves in growths.items()
    )  # fmt: skip
    legend = (
        *(Key(name, styles[name][0], DASHES[styles[name][1]]) for name in names),
        Key("proportional to the first", INK),
    )  # fmt: skip
    rows: list[list[Cell]] = [
        [loop, c.series, float(value), float(us)]
        for loop, curves in growths.items()
        for c in curves
        for value, us in zip(c.values, c.time_us, strict=True)
    ]
    numbers = Table(
        f"time over {over}", ["loop", "kernel and form", over, "time (us)"], rows, folded=True
    )
    caption = f"Time of the tube over {over}; thin: growth in proportion from the first point."
    return Figure(panels, legend, caption, numbers)


def _paint_growth(
    canvas: Canvas, *, curves: Sequence[GrowthCurve], styles: Mapping[str, tuple[str, Dashes]],
    words: tuple[str, str], logarithmic: bool,
) -> None:  # fmt: skip
    axes: Axes = canvas.add_subplot()
    for c in curves:
        colour, dashes = styles[c.series]
        axes.plot(c.values, c.time_us, color=colour, linestyle=dashes, marker="o", markersize=4.0)
        if c.values:
            straight = [c.time_us[0] * value / c.values[0] for value in c.values]
            axes.plot(c.values, straight, color=INK, linewidth=0.8, alpha=0.5)
    if logarithmic:
        _logarithmic(axes)
        values = sorted({value for c in curves for value in c.values})
        axes.set_xticks(values, [f"{value:g}" for value in values])
        axes.xaxis.set_minor_locator(NullLocator())
    else:
        axes.set_ylim(bottom=0.0)
        axes.set_xlim(left=0.0)
    axes.set_title(words[0])
    axes.set_xlabel(words[1] + (", log scale" if logarithmic else ""))
    axes.set_ylabel("time (us)" + (", log scale" if logarithmic else ""))
