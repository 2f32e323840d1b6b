"""The paper's figure of results: one decision of each of its four scenarios, from above."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Circle, Patch, Polygon

from workbench.report.drawing import (
    BLUE,
    DASHES,
    GREEN,
    INK,
    SKY,
    VERMILLION,
    Figure,
    Key,
    svg_panel,
    thinned,
)
from workbench.report.plane import corners
from workbench.report.tables import Table
from workbench.simulation.frames import Rectangle, drawable
from workbench.simulation.paper.panels import Panel

CONFIDENCES: Final = ("high", "medium", "low")
_SHADES: Final = ((0.06, 0.45), (0.08, 0.7), (0.10, 1.0))
"""Fill and edge of each nested tube, the largest first."""
_TRACK: Final = (GREEN, "-")
_BRAKE: Final = (VERMILLION, "--")
_DRAWN: Final = 7
"""Of a tube's rows."""
_BESIDE_M: Final = 1.5
_WIDTH_IN, _HEIGHT_IN = 4.7, 4.0


def results_figure(panels: Sequence[Panel]) -> Figure:
    """The four decisions; green where TRACK was decided, red and dashed where BRAKE was."""
    pictures = tuple(
        svg_panel(
            partial(_paint_alone, panel=each), label=f"{each.title}, {_said(each)}",
            width_in=_WIDTH_IN, height_in=_HEIGHT_IN,
        )
        for each in panels
    )  # fmt: skip
    caption = (
        "One decision of each scenario, seen from above: the first BRAKE of the moving car, or, "
        "where it never brakes, the first decision with somebody within 9 m. Nested, from "
        f"the outermost and palest: tubes of {_shares(panels)}; each is the ground that the body "
        f"may cover, drawn at {_DRAWN} of its instants."
    )
    rows = [
        (each.title, each.t_s, each.speed_mps, "TRACK" if each.tracks else "BRAKE",
         *(verdict.value for verdict in each.verdicts), *(round(s, 2) for s in each.proved_s))
        for each in panels
    ]  # fmt: skip
    headings = (
        "scenario", "at (s)", "speed (m/s)", "decided",
        *(f"{name} confidence" for name in CONFIDENCES),
        *(f"tube to (s), {name}" for name in CONFIDENCES),
    )  # fmt: skip
    return Figure(
        pictures, _LEGEND, caption, Table("the four decisions", headings, rows, folded=True)
    )


def results_picture(panels: Sequence[Panel]) -> Canvas:
    """The four panels on one canvas, for a file."""
    with matplotlib.rc_context({"font.size": 9.0, "text.parse_math": False}):
        canvas = Canvas(figsize=(10.4, 9.4), layout="constrained", facecolor="white")
        for each, axes in zip(panels, canvas.subplots(2, 2).flat, strict=True):
            _paint(axes, each, ink="black")
            axes.set_title(f"{each.title}\n{_said(each)}", fontsize=9.0)
        nested = [
            Patch(facecolor=("black", 0.3 * fill), edgecolor=("black", edge),
                  label=f"tube of {name} confidence")
            for name, (fill, edge) in zip(CONFIDENCES, _SHADES, strict=True)
        ]  # fmt: skip
        handles = [*(key.handle() for key in _LEGEND), *nested]
        canvas.legend(
            handles=handles, loc="outside lower center", ncols=3, handlelength=3.5, frameon=False
        )
    return canvas


def _shares(panels: Sequence[Panel]) -> str:
    """The nested sets, in words."""
    return ", ".join(
        f"{name} confidence ({100.0 * share:.0f} % of the measured set's radii)"
        for name, share in zip(CONFIDENCES, panels[0].shares, strict=True)
    )


_LEGEND: Final = (
    Key("path", INK, "7 3"),
    Key("car, and its way so far", INK),
    *(
        Key(f"where TRACK may take the car; {decided} was decided", colour, DASHES[dashes])
        for decided, (colour, dashes) in (("TRACK", _TRACK), ("BRAKE", _BRAKE))
    ),
    Key("person as measured so far", BLUE, mark="o"),
    Key("where the person truly went", BLUE, "2 3"),
    Key("predicted for the person", SKY, filled=True),
)  # fmt: skip


def _said(panel: Panel) -> str:
    """The title's second line: what was decided, and what each nested set says."""
    decided = "TRACK" if panel.tracks else "BRAKE"
    words = ", ".join(
        f"{name} {verdict.value}"
        for name, verdict in zip(CONFIDENCES, panel.verdicts, strict=False)
    )
    return f"{decided} at {panel.t_s:.1f} s ({words})"


def _paint_alone(canvas: Canvas, *, panel: Panel) -> None:
    axes: Axes = canvas.add_subplot()
    _paint(axes, panel, ink=INK)
    axes.set_title(f"{panel.title}\n{_said(panel)}", fontsize=9.0)


def _paint(axes: Axes, panel: Panel, *, ink: str) -> None:
    axes.plot(*zip(*panel.path, strict=True), color=ink, linestyle="--", linewidth=0.9)
    axes.plot(*zip(*panel.travelled, strict=True), color=ink, linewidth=1.0, alpha=0.7)
    for tube, (fill, edge) in zip(panel.tubes, _SHADES, strict=True):
        _paint_tube(axes, tube, _TRACK if panel.tracks else _BRAKE, (fill, edge))
    body = Polygon(corners(panel.body), facecolor="none", edgecolor=ink, linewidth=1.8, zorder=4.0)
    axes.add_patch(body)
    for way in panel.true_way:
        axes.plot(*zip(*way, strict=True), color=BLUE, linewidth=0.9, linestyle=":")
    for x, y, radius in filter(drawable, panel.predicted):
        axes.add_patch(Circle((x, y), radius, facecolor=(SKY, 0.10), edgecolor=(SKY, 0.9)))
    for track in panel.seen:
        if track:
            axes.plot(*zip(*track, strict=True), color=BLUE, linewidth=1.3, zorder=3.0)
            axes.plot(*track[-1], color=BLUE, marker="o", markersize=6, zorder=5.0)
    left, right, low, high = _limits(panel)
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _paint_tube(
    axes: Axes, tube: Sequence[Rectangle], style: tuple[str, str], shades: tuple[float, float]
) -> None:
    """A few rectangles from now to the end, so that the nested ones can be told apart."""
    (colour, dashes), (fill, edge) = style, shades
    shapes = [shape for shape in tube if drawable(shape)]
    for k in thinned(len(shapes), _DRAWN):
        axes.add_patch(
            Polygon(
                corners(shapes[k]), facecolor=(colour, fill), edgecolor=(colour, edge),
                linewidth=0.4 + 0.8 * edge, linestyle=dashes,
            )
        )  # fmt: skip


def _limits(panel: Panel) -> tuple[float, float, float, float]:
    """Around car, tubes and what is predicted."""
    points = [*corners(panel.body)]
    for tube in panel.tubes:
        for shape in filter(drawable, tube):
            points += corners(shape)
    for x, y, radius in filter(drawable, panel.predicted):
        points += [(x - radius, y - radius), (x + radius, y + radius)]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return (
        min(xs) - _BESIDE_M, max(xs) + _BESIDE_M, min(ys) - _BESIDE_M, max(ys) + _BESIDE_M,
    )  # fmt: skip
