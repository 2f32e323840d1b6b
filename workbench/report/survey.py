"""A survey's page: contacts, needless stops and time at standstill of everybody, side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, final

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.errors import InputError
from workbench.report.drawing import BLUE, GREEN, ORANGE, VERMILLION, Figure, Key, svg_panel
from workbench.report.page import Notice, Page, Section
from workbench.report.tables import Table

_COLOURS: Final = (BLUE, ORANGE, GREEN, VERMILLION)


@final
@dataclass(frozen=True, slots=True)
class Bar:
    """One contender on one plant: needless stops per km with their interval (NaN: went nowhere),
    share of time at standstill, and share of runs with an avoidable contact.
    """

    plant: str
    contender: str
    needless_per_km: tuple[float, float, float]
    standing: float
    avoidable: float


@final
@dataclass(frozen=True, slots=True)
class SurveyReport:
    """Title, sentences at the top, bars (at least one), tables, notes."""

    title: str
    lead: tuple[str, ...]
    bars: tuple[Bar, ...]
    tables: tuple[Table, ...]
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.bars:
            raise InputError("expected at least one bar, got none; survey at least one scenario")


def survey_page(report: SurveyReport, *, version: str, command: str) -> Page:
    """The page; version and command say what made it."""
    sections = (
        Section("By who drives", (needless_figure(report), share_figure(report))),
        Section("Figures", report.tables),
        Section("How to read this", tuple(Notice("Note.", note) for note in report.notes)),
    )
    return Page(report.title, report.lead, sections, version, command)


def needless_figure(report: SurveyReport) -> Figure:
    """Needless stops per km, with intervals."""
    panel = svg_panel(
        partial(_paint_needless, bars=report.bars), label="Needless stops per km",
        width_in=8.0, height_in=_height_in(report.bars),
    )  # fmt: skip
    caption = (
        "Needless stops per km with 95 % bootstrap intervals; no bar: it did not set off at all, "
        "which is no merit."
    )
    return Figure((panel,), _legend(report.bars), caption, wide=True)


def share_figure(report: SurveyReport) -> Figure:
    """Standing time and avoidable contacts."""
    panels = tuple(
        svg_panel(partial(_paint_share, bars=report.bars, name=name), label=label, height_in=height)
        for name, label in (
            ("standing", "Share of the time at standstill"),
            ("avoidable", "Share of runs with an avoidable contact"),
        )
        for height in (_height_in(report.bars),)
    )
    caption = (
        "Left: share of the time at standstill. Right: share of runs with an avoidable contact."
    )
    return Figure(panels, _legend(report.bars), caption)


def _height_in(bars: Sequence[Bar]) -> float:
    return 0.9 + 0.2 * len(bars) + 0.12 * len({bar.contender for bar in bars})


def _legend(bars: Sequence[Bar]) -> tuple[Key, ...]:
    return tuple(
        Key(plant, _COLOURS[k % len(_COLOURS)], filled=True)
        for k, plant in enumerate(_plants(bars))
    )


def _plants(bars: Sequence[Bar]) -> list[str]:
    return list(dict.fromkeys(bar.plant for bar in bars))


def _places(bars: Sequence[Bar], axes: Axes) -> list[tuple[Bar, float, float, str]]:
    """Bars with their place, thickness and colour; the contenders' names on the axis."""
    plants, names = _plants(bars), list(dict.fromkeys(bar.contender for bar in bars))
    thick = 0.8 / len(plants)
    axes.set_yticks([-float(k) for k in range(len(names))], names, fontsize=8)
    found = []
    for bar in bars:
        k = plants.index(bar.plant)
        place = -names.index(bar.contender) - (k - 0.5 * (len(plants) - 1)) * thick
        found.append((bar, place, thick, _COLOURS[k % len(_COLOURS)]))
    return found


def _paint_needless(canvas: Canvas, bars: Sequence[Bar]) -> None:
    axes: Axes = canvas.add_subplot()
    for bar, place, thick, colour in _places(bars, axes):
        value, low, high = bar.needless_per_km
        if math.isnan(value):
            continue
        axes.barh(place, value, height=0.9 * thick, color=colour, alpha=0.7)
        axes.plot([low, high], [place, place], color="black", lw=1.0)
    axes.set_xlim(left=0.0)
    axes.set_xlabel("needless stops per km")


def _paint_share(canvas: Canvas, bars: Sequence[Bar], name: str) -> None:
    axes: Axes = canvas.add_subplot()
    for bar, place, thick, colour in _places(bars, axes):
        axes.barh(place, getattr(bar, name), height=0.9 * thick, color=colour, alpha=0.7)
    top = max(getattr(bar, name) for bar in bars)
    axes.set_xlim(0.0, max(1.05 * top, 0.01))
    axes.set_xlabel({"standing": "share of the time", "avoidable": "share of runs"}[name])
