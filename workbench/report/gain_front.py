"""The page of a sweep of gains: the front as a picture whose points lead to their numbers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, final

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.report.drawing import BLUE, INK, ORANGE, VERMILLION, Figure, Key, svg_panel
from workbench.report.page import Page, Section, escaped
from workbench.report.tables import Table, shown
from workbench.simulation.gain_sweep.deciding import Point, Verdict, shown_figures
from workbench.simulation.gain_sweep.figures import figure
from workbench.simulation.gain_sweep.gains import GAINS

_MOST_DRAWN: Final = 2000


@final
@dataclass(frozen=True, slots=True, eq=False)
class Card:
    """All that is known of one point, under an address that a picture can lead to; names: figures
    that are shown."""

    point: Point
    title: str
    names: tuple[str, ...]

    def html(self) -> str:
        """The block as HTML."""
        rows = [(GAINS[name].label, value) for name, value in self.point.gains.items()]
        rows += [(figure(name).label, self.point.figures[name]) for name in self.names]
        body = "".join(
            f'<tr><th scope="row">{escaped(label)}</th><td>{escaped(shown(value))}</td></tr>'
            for label, value in rows
        )
        return (
            f'<h3 id="point-{self.point.index}">{escaped(self.title)}</h3>'
            f"<table><tbody>{body}</tbody></table>"
        )


def front_page(
    title: str,
    lead: Sequence[str],
    found: Verdict,
    tables: tuple[Table, Table, Table],
    made_by: tuple[str, str],
) -> Page:
    """The page; tables: costs, front, all points; made_by: version and command."""
    costs, front, points = tables
    special = (found.best, found.present)
    cards = [
        Card(p, f"point {p.index}" + _word(found, p), tuple(shown_figures(found)))
        for p in dict.fromkeys([*(p for p in special if p), *found.front])
    ]
    sections = [Section("The front", [front_figure(found), front])]
    if costs.rows:
        sections.insert(0, Section("What it costs", [costs]))
    sections += [Section("Points, one by one", cards), Section("All numbers", [points])]
    return Page(title, lead, sections, *made_by)


def front_figure(found: Verdict) -> Figure:
    """A picture per pair of what is traded; a point of the front leads to its numbers."""
    trade = found.decision.trade
    pairs = list(itertools.combinations(trade, 2)) or [(trade[0], trade[0])]
    panels = tuple(
        svg_panel(
            partial(_paint, found=found, pair=pair),
            label=f"{figure(pair[1]).words} against {figure(pair[0]).words}",
            height_in=3.4,
        )
        for pair in pairs
    )
    legend = (
        Key("on the front", BLUE, mark="o"), Key("recommended", VERMILLION, mark="*"),
        Key("present gains", ORANGE, mark="s"), Key("others", INK, mark="."),
    )  # fmt: skip
    caption = (
        "Each point is one choice of gains with its worst value over all cases. Click a point of "
        "the front, the star or the square to go to its numbers. Choices without a value, whose "
        "tube or runs do not get there or which did not drive, are not drawn."
    )
    if _every(found) > 1:
        caption += f" Of the others one in {_every(found)} is drawn."
    return Figure(panels, legend, caption)


def _every(found: Verdict) -> int:
    """One of how many of the others is drawn."""
    return max(1, math.ceil(len(found.points) / _MOST_DRAWN))


def _paint(canvas: Canvas, *, found: Verdict, pair: tuple[str, str]) -> None:
    axes: Axes = canvas.add_subplot()
    named = [*found.front, found.present, *([found.best] if found.best else [])]
    others = [p for p in found.points if p not in named][:: _every(found)]
    _scatter(axes, others, pair, (INK, ".", 14.0))
    for point in found.front:
        _scatter(axes, [point], pair, (BLUE, "o", 42.0))
    _scatter(axes, [found.present], pair, (ORANGE, "s", 52.0))
    if found.best is not None:
        _scatter(axes, [found.best], pair, (VERMILLION, "*", 130.0))
    axes.set_xlabel(figure(pair[0]).label)
    axes.set_ylabel(figure(pair[1]).label)
    axes.grid(alpha=0.3)


def _scatter(
    axes: Axes, points: Sequence[Point], pair: tuple[str, str], style: tuple[str, str, float]
) -> None:
    colour, marker, size = style
    shown_points = [p for p in points if all(math.isfinite(p.figures[name]) for name in pair)]
    if not shown_points:
        return
    x, y = ([p.figures[name] for p in shown_points] for name in pair)
    dots = axes.scatter(x, y, s=size, color=colour, marker=marker)
    if marker != ".":
        dots.set_urls([f"#point-{p.index}" for p in shown_points])


def _word(found: Verdict, point: Point) -> str:
    words = [
        word
        for word, each in (("recommended", found.best), ("present gains", found.present))
        if point is each
    ]
    return f" ({', '.join(words)})" if words else ""
