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
from workbench.report.drawing import (
    BLUE,
    GREEN,
    HATCHES,
    INK,
    ORANGE,
    VERMILLION,
    Figure,
    Key,
    svg_panel,
)
from workbench.report.page import Notice, Page, Section
from workbench.report.tables import Table
from workbench.simulation.campaign.tallies import Tally

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

    @classmethod
    def of(cls, tally: Tally) -> Bar:
        """What a survey counted."""
        rate = tally.needless
        shares = tally.standing, tally.avoidable / tally.runs
        return cls(tally.plant, tally.contender, (rate.per_km, rate.low, rate.high), *shares)


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
        width_in=4.6, height_in=_height_in(report.bars),
    )  # fmt: skip
    caption = (
        "Needless stops per km with 95 % bootstrap intervals; no bar: no stop, or never set off, "
        "which is no merit."
    )
    return Figure((panel,), _legend(report.bars), caption, _numbers(report.bars), wide=True)


def _numbers(bars: Sequence[Bar]) -> Table:
    headings = (
        "plant", "who drives", "needless stops (1/km)", "from (1/km)", "to (1/km)",
        "time at standstill (1)", "runs with an avoidable contact (1)",
    )  # fmt: skip
    rows = [
        (
            bar.plant, bar.contender,
            *(None if math.isnan(value) else value for value in bar.needless_per_km),
            bar.standing, bar.avoidable,
        )
        for bar in bars
    ]  # fmt: skip
    return Table("what the pictures show", headings, rows, folded=True)


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
        "First: share of the time at standstill. Second: share of runs with an avoidable contact."
    )
    return Figure(panels, _legend(report.bars), caption)


def _height_in(bars: Sequence[Bar]) -> float:
    return 0.9 + 0.2 * len(bars) + 0.12 * len({bar.contender for bar in bars})


def _legend(bars: Sequence[Bar]) -> tuple[Key, ...]:
    return tuple(
        Key(plant, _look(k)[0], filled=True, hatch=_look(k)[1])
        for k, plant in enumerate(_plants(bars))
    )


def _look(plant: int) -> tuple[str, str]:
    """Colour and pattern of a plant's bars."""
    return _COLOURS[plant % len(_COLOURS)], HATCHES[plant % len(HATCHES)]


def _plants(bars: Sequence[Bar]) -> list[str]:
    return list(dict.fromkeys(bar.plant for bar in bars))


def _places(bars: Sequence[Bar], axes: Axes) -> list[tuple[Bar, float, float, int]]:
    """Bars with their place, thickness and plant; the contenders' names on the axis."""
    plants, names = _plants(bars), list(dict.fromkeys(bar.contender for bar in bars))
    thick = 0.8 / len(plants)
    axes.set_yticks([-float(k) for k in range(len(names))], names, fontsize=8)
    found = []
    for bar in bars:
        k = plants.index(bar.plant)
        place = -names.index(bar.contender) - (k - 0.5 * (len(plants) - 1)) * thick
        found.append((bar, place, thick, k))
    return found


def _paint_needless(canvas: Canvas, bars: Sequence[Bar]) -> None:
    axes: Axes = canvas.add_subplot()
    for bar, place, thick, plant in _places(bars, axes):
        value, low, high = bar.needless_per_km
        if math.isnan(value):
            continue
        _bar(axes, place, value, thick, plant)
        axes.plot([low, high], [place, place], color=INK, lw=1.4)
    axes.set_xlim(left=0.0)
    axes.set_xlabel("needless stops (1/km)")


def _bar(axes: Axes, place: float, value: float, thick: float, plant: int) -> None:
    colour, hatch = _look(plant)
    axes.barh(
        place, value, height=0.9 * thick, facecolor=colour, edgecolor=INK, lw=0, hatch=hatch,
        alpha=0.7,
    )  # fmt: skip


def _paint_share(canvas: Canvas, bars: Sequence[Bar], name: str) -> None:
    axes: Axes = canvas.add_subplot()
    for bar, place, thick, plant in _places(bars, axes):
        _bar(axes, place, getattr(bar, name), thick, plant)
    top = max(getattr(bar, name) for bar in bars)
    axes.set_xlim(0.0, max(1.05 * top, 0.01))
    axes.set_xlabel({"standing": "share of the time (1)", "avoidable": "share of runs (1)"}[name])
