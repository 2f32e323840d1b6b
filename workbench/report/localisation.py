"""Pictures of where the car is known to be: its way with the sets, and how wide they are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from workbench.report.curves import Values, require_shape
from workbench.report.drawing import (
    BLUE,
    DASHES,
    GREEN,
    INK,
    ORANGE,
    SKY,
    VERMILLION,
    Figure,
    Key,
    svg_panel,
    thinned,
)
from workbench.report.page import Notice, Page, Section
from workbench.report.tables import Table

_BOXES = 60
_MAGNIFIED = 10
_WIDTHS = (("x", "m", BLUE, "-"), ("y", "m", GREEN, "--"), ("heading", "rad", VERMILLION, "-."))
_ROWS = 400


@final
@dataclass(frozen=True, slots=True)
class LocalisationReport:
    """One drive.

    t_s (k,): reports with a set; middle, radius (k, 3): of x, y (m) and heading (rad) of the
    largest set, level its confidence; all_s (n,): every report, valid (n,) whether it had a set;
    beacons (b, 2) m and their names; truth (m, 2): where the car really was, (0, 2) if unknown.
    """

    title: str
    lead: tuple[str, ...]
    t_s: Values
    middle: Values
    radius: Values
    level: float
    all_s: Values
    valid: Values
    beacon_names: tuple[str, ...]
    beacons: Values
    truth: Values
    tables: tuple[Table, ...]
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        require_shape("middles", self.middle, (len(self.t_s), 3))
        require_shape("half-widths", self.radius, (len(self.t_s), 3))
        require_shape("validity", self.valid, (len(self.all_s),))
        require_shape("beacons", self.beacons, (len(self.beacon_names), 2))


def localisation_page(report: LocalisationReport, *, version: str, command: str) -> Page:
    """The page of one drive; version and command say what made it."""
    notes = tuple(Notice("Note.", note) for note in report.notes)
    sections = (
        Section("The drive", (plan_figure(report), width_figure(report))),
        Section("Numbers", report.tables),
        Section("How to read this", notes),
    )
    return Page(report.title, report.lead, sections, version, command)


def plan_figure(report: LocalisationReport) -> Figure:
    """From above: the way, some of the sets, the beacons."""
    panel = svg_panel(
        partial(_paint_plan, report=report), label="The drive seen from above", width_in=4.6,
        height_in=3.8,
    )  # fmt: skip
    legend = [
        Key("middle of the set", BLUE),
        Key(f"set of x and y, {_MAGNIFIED} times as large", SKY, filled=True),
        Key("beacon", ORANGE, mark="^"),
    ]
    legend += [Key("true way", INK, "2 3")] if len(report.truth) else []
    caption = (
        "Way of the middle of the rear axle. Boxes hold x and y, jointly with heading, steering "
        f"and speed, with probability {100 * report.level:g} %; some {_BOXES} of them are drawn, "
        f"{_MAGNIFIED} times as large as they are."
    )
    return Figure((panel,), tuple(legend), caption, _numbers(report), wide=True)


def _numbers(report: LocalisationReport) -> Table:
    headings = (
        "time (s)", "x (m)", "y (m)", "heading (rad)", "half-width of x (m)", "of y (m)",
        "of heading (rad)",
    )  # fmt: skip
    rows = np.column_stack([report.t_s, report.middle, report.radius])
    chosen = list(thinned(len(rows), _ROWS))
    return Table("the sets over time", headings, rows[chosen].tolist(), folded=True)


def width_figure(report: LocalisationReport) -> Figure:
    """Half-widths over time."""
    panel = svg_panel(
        partial(_paint_widths, report=report), label="Half-widths over time", width_in=4.6,
        height_in=4.4,
    )  # fmt: skip
    legend = tuple(Key(name, colour, DASHES[dashes]) for name, _, colour, dashes in _WIDTHS)
    caption = (
        f"Half-widths of the {100 * report.level:g} % set over time. Where no curve is drawn, "
        "there is no set: the place or the heading is not known."
    )
    return Figure((panel,), legend, caption, wide=True)


def _paint_plan(canvas: Canvas, report: LocalisationReport) -> None:
    axes: Axes = canvas.add_subplot()
    for k in range(0, len(report.t_s), max(len(report.t_s) // _BOXES, 1)):
        (x, y, _), (dx, dy, _) = report.middle[k], _MAGNIFIED * report.radius[k]
        axes.add_patch(Rectangle((x - dx, y - dy), 2 * dx, 2 * dy, color=SKY, alpha=0.5, lw=0))
    if len(report.truth):
        axes.plot(*report.truth.T, color=INK, ls=(0, (2, 3)), lw=0.9)
    for part in _stretches(report):
        axes.plot(*report.middle[part, :2].T, color=BLUE, lw=1.2)
    axes.plot(*report.beacons.T, color=ORANGE, ls="", marker="^", ms=7)
    for name, (x, y) in zip(report.beacon_names, report.beacons, strict=True):
        axes.annotate(name, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=7)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _paint_widths(canvas: Canvas, report: LocalisationReport) -> None:
    place, heading = canvas.subplots(2, 1, sharex=True)
    for k, (_, unit, colour, dashes) in enumerate(_WIDTHS):
        axes: Axes = place if unit == "m" else heading
        for part in _stretches(report):
            axes.plot(report.t_s[part], report.radius[part, k], color=colour, ls=dashes, lw=1.2)
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(f"half-width ({unit})")
    heading.set_xlim(float(report.all_s[0]), float(report.all_s[-1]))
    heading.set_xlabel("time (s)")


def _stretches(report: LocalisationReport) -> list[NDArray[np.intp]]:
    """Indices of the sets, cut where there was none in between."""
    numbers = np.flatnonzero(report.valid)
    cuts = np.flatnonzero(np.diff(numbers) > 1) + 1
    return [part for part in np.split(np.arange(len(numbers)), cuts) if len(part)]
