"""Pictures of measured motion against tubes: how far off, how wide, whose windows are inside."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.report.curves import Values, require_shape
from workbench.report.drawing import (
    BLUE,
    GREEN,
    HATCHES,
    INK,
    VERMILLION,
    Figure,
    Key,
    svg_panel,
)
from workbench.report.page import Notice, Page, Section
from workbench.report.tables import Table


@final
@dataclass(frozen=True, slots=True)
class ConformanceReport:
    """One fit, judged on other recordings.

    times_s (K+1,); outputs: names with units; deviation, half_width (W, K+1, m): of the windows of
    other recordings, against the middles of their tubes; recordings: names, with the share of
    windows inside (R,) and its interval (R, 2).
    """

    title: str
    lead: tuple[str, ...]
    times_s: Values
    outputs: tuple[str, ...]
    deviation: Values
    half_width: Values
    recordings: tuple[str, ...]
    share: Values
    tables: tuple[Table, ...]
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        windows = len(self.deviation)
        shape = (windows, len(self.times_s), len(self.outputs))
        require_shape("deviations", self.deviation, shape)
        require_shape("half widths", self.half_width, shape)
        require_shape("shares", self.share, (len(self.recordings),))


def conformance_page(report: ConformanceReport, *, version: str, command: str) -> Page:
    """The page of one fit; version and command say what made it."""
    sections = (
        Section("Figures", report.tables),
        Section("Motion against tubes", (deviation_figure(report), ratio_figure(report))),
        Section("Recording by recording", (share_figure(report),)),
        Section("How to read this", tuple(Notice("Note.", note) for note in report.notes)),
    )
    return Page(report.title, report.lead, sections, version, command)


def deviation_figure(report: ConformanceReport) -> Figure:
    """Per output: every window's deviation, and the half widths of the tubes."""
    panels = tuple(
        svg_panel(partial(_paint_output, report=report, column=k), label=f"{name} over time")
        for k, name in enumerate(report.outputs)
    )
    legend = (
        Key("deviation of a window, inside its tube", BLUE),
        Key("deviation of a window that leaves its tube", VERMILLION, "7 3"),
        Key("half widths, least to largest; the line is their mean", GREEN, filled=True),
    )
    caption = (
        "Windows of recordings that were not fitted to: distance of the measured motion from the "
        "tube's middle, and the tube's half width. Every window has a tube of its own, so that a "
        "curve below the band's upper edge may still be outside."
    )
    return Figure(panels, legend, caption, _numbers(report))


def _numbers(report: ConformanceReport) -> Table:
    headings = ["time (s)"]
    for name in report.outputs:
        headings += [f"{name}: largest deviation", "half width, least", "mean", "largest"]
    columns = [
        column
        for far, half in zip(report.deviation.T, report.half_width.T, strict=True)
        for column in (
            np.nanmax(far, 1), np.nanmin(half, 1), np.nanmean(half, 1), np.nanmax(half, 1)
        )
    ]  # fmt: skip
    rows = np.stack([report.times_s, *columns], axis=1).tolist()
    return Table("deviations and half widths over time", headings, rows, folded=True)


def ratio_figure(report: ConformanceReport) -> Figure:
    """Largest deviation over half width of each window, over time."""
    panel = svg_panel(
        partial(_paint_ratio, report=report), label="Deviation over half width", width_in=4.6,
        height_in=2.8,
    )  # fmt: skip
    legend = (
        Key("a window", BLUE),
        Key("outside", VERMILLION, "7 3"),
        Key("the tube's border", INK),
    )
    caption = (
        "The largest of the outputs' deviations over half widths, window by window; above 1 the "
        "measured motion is outside. Near 0 the tube is much wider than needed there."
    )
    return Figure((panel,), legend, caption, wide=True)


def share_figure(report: ConformanceReport) -> Figure:
    """Share of windows inside, by recording."""
    panel = svg_panel(
        partial(_paint_share, report=report), label="Share of windows inside by recording",
        width_in=4.6, height_in=0.8 + 0.28 * len(report.recordings),
    )  # fmt: skip
    legend = (
        Key("fitted to", GREEN, filled=True, hatch=HATCHES[1]),
        Key("other recordings", BLUE, filled=True),
    )
    caption = "Share of each recording's windows that are inside their tubes at every instant."
    rows = [
        (name.removesuffix("*"), "yes" if name.endswith("*") else "no", float(share))
        for name, share in zip(report.recordings, report.share, strict=True)
    ]
    numbers = Table("windows inside", ("recording", "fitted to", "share (1)"), rows, folded=True)
    return Figure((panel,), legend, caption, numbers, wide=True)


def _outside(report: ConformanceReport) -> Values:
    return np.asarray(np.nanmax(report.deviation / report.half_width, axis=2))


def _paint_output(canvas: Canvas, report: ConformanceReport, column: int) -> None:
    axes: Axes = canvas.add_subplot()
    half, times = report.half_width[:, :, column], report.times_s
    axes.fill_between(times, np.nanmin(half, 0), np.nanmax(half, 0), color=GREEN, alpha=0.25, lw=0)
    axes.plot(times, np.nanmean(half, axis=0), color=GREEN, lw=1.4)
    for curve, ratio in zip(report.deviation[:, :, column], _outside(report), strict=True):
        axes.plot(times, curve, lw=0.7, **_look(ratio))
    axes.set_xlabel("time (s)")
    axes.set_ylabel(report.outputs[column])
    axes.set_ylim(bottom=0.0)


def _look(ratio: Values) -> dict[str, Any]:
    """Of a window's curve, by its deviation over half width."""
    outside = float(ratio.max()) > 1.0
    return {"color": VERMILLION, "ls": "--"} if outside else {"color": BLUE, "ls": "-"}


def _paint_ratio(canvas: Canvas, report: ConformanceReport) -> None:
    axes: Axes = canvas.add_subplot()
    for ratio in _outside(report):
        axes.plot(report.times_s, ratio, lw=0.7, **_look(ratio))
    axes.axhline(1.0, color=INK, lw=1.4)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("deviation / half width (1)")
    axes.set_ylim(bottom=0.0)


def _paint_share(canvas: Canvas, report: ConformanceReport) -> None:
    axes: Axes = canvas.add_subplot()
    places = np.arange(len(report.recordings))[::-1]
    fitted = [name.endswith("*") for name in report.recordings]
    axes.barh(
        places, report.share, color=[GREEN if each else BLUE for each in fitted], edgecolor=INK,
        hatch=[HATCHES[each] for each in fitted], lw=0, alpha=0.7, height=0.7,
    )  # fmt: skip
    axes.set_yticks(places, [name.removesuffix("*") for name in report.recordings], fontsize=8)
    axes.set_xlim(0.0, 1.0)
    axes.set_xlabel("share of windows inside (1)")
