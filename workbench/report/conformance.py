"""Pictures of measured motion against tubes: how far off, how wide, whose windows are inside."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.report.curves import Values, require_shape
from workbench.report.drawing import BLUE, GREEN, ORANGE, VERMILLION, Figure, Key, svg_panel
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
        Key("deviation of a window that leaves its tube", VERMILLION),
        Key("half widths, least to largest; the line is their mean", GREEN, filled=True),
    )
    caption = (
        "Windows of recordings that were not fitted to: distance of the measured motion from the "
        "tube's middle, and the tube's half width. Every window has a tube of its own, so that a "
        "curve below the band's upper edge may still be outside."
    )
    return Figure(panels, legend, caption)


def ratio_figure(report: ConformanceReport) -> Figure:
    """Largest deviation over half width of each window, over time."""
    panel = svg_panel(
        partial(_paint_ratio, report=report), label="Deviation over half width", width_in=8.0,
        height_in=3.0,
    )  # fmt: skip
    legend = (Key("a window", BLUE), Key("outside", VERMILLION), Key("the tube's border", ORANGE))
    caption = (
        "The largest of the outputs' deviations over half widths, window by window; above 1 the "
        "measured motion is outside. Near 0 the tube is much wider than needed there."
    )
    return Figure((panel,), legend, caption, wide=True)


def share_figure(report: ConformanceReport) -> Figure:
    """Share of windows inside, by recording."""
    panel = svg_panel(
        partial(_paint_share, report=report), label="Share of windows inside by recording",
        width_in=8.0, height_in=0.8 + 0.28 * len(report.recordings),
    )  # fmt: skip
    legend = (Key("fitted to", GREEN, filled=True), Key("other recordings", BLUE, filled=True))
    caption = "Share of each recording's windows that are inside their tubes at every instant."
    return Figure((panel,), legend, caption, wide=True)


def _outside(report: ConformanceReport) -> Values:
    return np.asarray(np.nanmax(report.deviation / report.half_width, axis=2))


def _paint_output(canvas: Canvas, report: ConformanceReport, column: int) -> None:
    axes: Axes = canvas.add_subplot()
    half, times = report.half_width[:, :, column], report.times_s
    axes.fill_between(times, np.nanmin(half, 0), np.nanmax(half, 0), color=GREEN, alpha=0.25, lw=0)
    axes.plot(times, np.nanmean(half, axis=0), color=GREEN, lw=1.4)
    for curve, ratio in zip(report.deviation[:, :, column], _outside(report), strict=True):
        axes.plot(times, curve, color=VERMILLION if ratio.max() > 1.0 else BLUE, lw=0.7)
    axes.set_xlabel("time (s)")
    axes.set_ylabel(report.outputs[column])
    axes.set_ylim(bottom=0.0)


def _paint_ratio(canvas: Canvas, report: ConformanceReport) -> None:
    axes: Axes = canvas.add_subplot()
    for ratio in _outside(report):
        axes.plot(report.times_s, ratio, color=VERMILLION if ratio.max() > 1.0 else BLUE, lw=0.7)
    axes.axhline(1.0, color=ORANGE, lw=1.4)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("deviation / half width")
    axes.set_ylim(bottom=0.0)


def _paint_share(canvas: Canvas, report: ConformanceReport) -> None:
    axes: Axes = canvas.add_subplot()
    places = np.arange(len(report.recordings))[::-1]
    colours = [GREEN if name.endswith("*") else BLUE for name in report.recordings]
    axes.barh(places, report.share, color=colours, alpha=0.7, height=0.7)
    axes.set_yticks(places, [name.removesuffix("*") for name in report.recordings], fontsize=8)
    axes.set_xlim(0.0, 1.0)
    axes.set_xlabel("share of windows inside")
