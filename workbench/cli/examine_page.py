"""The page that `workbench examine` writes."""

from __future__ import annotations

import argparse

import numpy as np

from workbench import __version__
from workbench.claims import Rigor
from workbench.cli.analysis_options import command_line
from workbench.cli.examine_text import (
    COVERAGE,
    PROVED,
    VERDICTS,
    Outcome,
    coverage_rows,
    doubts,
    lead,
    proved_rows,
    tightness_headings,
    tightness_rows,
)
from workbench.report.curves import Growth, Origin
from workbench.report.figures import comparison_table, growth_figure
from workbench.report.page import Claim, Claims, Page, Paragraph, Section
from workbench.report.tables import Table

_ABOUT = (
    "How far a run may be from the one that starts in the middle of the set: what sampled and "
    "searched runs reach, what validated runs reach for certain, and the bounds."
)
_CLOSE = (
    "Only the learned bound, what is reached, and the proved bounds that are at most three times "
    "as large in every state."
)
_AT_MOST = 3.0
_ABOUT_PAIRS = (
    "How far two runs of the set may be apart: what sampled and searched pairs reach, and the "
    "bounds. What validated runs reach for certain is the distance from the middle run."
)


def examination_page(args: argparse.Namespace, outcome: Outcome) -> Page:
    """The whole page."""
    curves, names = _curves(outcome), outcome.found.names
    tables = [Table("pairs within the bound", COVERAGE, coverage_rows(outcome.found))]
    if outcome.found.proved:
        tables.append(Table("proved bounds", PROVED, proved_rows(outcome)))
    tight = Table(
        "bound over the largest distance reached, mean over time (1 is perfect)",
        tightness_headings(outcome),
        tightness_rows(outcome),
    )
    return Page(
        f"Cross-examination of a learned bound for {outcome.title}",
        [*lead(outcome), *doubts(outcome)],
        [
            Section("What is claimed", [Claims(_claims(outcome))]),
            Section("Coverage", [tables[0]]),
            Section(
                "Growth over time",
                [
                    Paragraph(_ABOUT_PAIRS if args.any_centre else _ABOUT),
                    growth_figure(curves, names=names, units=outcome.units),
                    comparison_table(curves, names=names),
                ],
            ),
            Section(
                "The same from close by",
                [
                    Paragraph(_CLOSE),
                    growth_figure(_close(curves), names=names, units=outcome.units),
                ],
            ),
            Section("Tightness", [*tables[1:], tight]),
        ],
        __version__,
        command_line("examine", args, repeated=("start", "radius")),
    )


def _curves(outcome: Outcome) -> list[Growth]:
    found, grade = outcome.found, Rigor.SAMPLED
    curves = [
        Growth(
            "sampled and searched", Origin.SAMPLES, grade, found.times, found.driven,
            error=outcome.error,
        ),
        Growth("sampled", Origin.SAMPLES, grade, found.times, found.sampled),
        Growth(
            "learned", Origin.LEARNED, grade, found.times, found.learned,
            finding=VERDICTS[found.verdict.name],
        ),
    ]  # fmt: skip
    if outcome.beside is not None and outcome.beside.inner is not None:
        times, reached = outcome.beside.inner
        curves.append(Growth("reached for certain", Origin.REACHED, Rigor.ENCLOSED, times, reached))
    for name, curve in zip(outcome.methods, found.proved, strict=True):
        known = np.isfinite(curve.half_widths)
        rows = np.where(known, curve.half_widths, np.nan)
        until_s = found.times[np.flatnonzero(known.all(axis=1))[-1]]
        ended = "" if known.all() else f"proved up to {until_s:g} s"
        curves.append(Growth(name, Origin.PROVED, curve.rigor, found.times, rows, finding=ended))
    return curves


def _close(curves: list[Growth]) -> list[Growth]:
    """Without the proved bounds that grow far beyond what is reached."""
    reached = curves[0].half_widths.max(axis=0)
    return [
        curve
        for curve in curves
        if curve.origin is not Origin.PROVED
        or bool(np.all(curve.half_widths.max(axis=0) <= _AT_MOST * reached))
    ]


def _claims(outcome: Outcome) -> list[Claim]:
    learned = outcome.learned
    proved = zip(outcome.methods, outcome.found.proved, strict=True)
    return [
        Claim(f"{learned.norm}. Condition: {learned.condition}.", learned.rigor),
        *(Claim(f"{name}. Condition: {curve.condition}.", curve.rigor) for name, curve in proved),
    ]
