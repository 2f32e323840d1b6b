"""The page that `workbench derive --plot` writes, and the table it shares with the terminal."""

from __future__ import annotations

import argparse
from typing import Final

import numpy as np

from workbench import __version__
from workbench.claims import Rigor
from workbench.cli.analysis_options import command_line
from workbench.cli.comparison import Compared, Family
from workbench.cli.recommendation import Outcome
from workbench.report.curves import Growth, Origin
from workbench.report.figures import comparison_table, growth_figure
from workbench.report.page import Block, Claim, Claims, Page, Paragraph, Section
from workbench.report.ratios import RatioCurve, ratio_figure
from workbench.report.tables import Cell, Table, shown
from workbench.sets import Box

HEADINGS: Final = [
    "method", "mean ratio", "proved to (s)", "rigor", "cost (s)", "condition", "derived",
]  # fmt: skip
_RATIOS: Final = (
    "mean ratio: bound over the largest distance of sampled runs, mean over time, then over the "
    "states, 1 would be perfect; condition: of the metric at the end, in units of the samples' "
    "spread"
)


def row(each: Compared) -> list[Cell]:
    """One method's line under `HEADINGS`."""
    return [
        each.name,
        each.score,
        each.until_s,
        each.rigor.name if each.rigor else "refused",
        each.cost_s,
        each.condition,
        each.family.value,
    ]


def told_box(box: Box) -> str:
    """Its sides in one line."""
    sides = zip(box.names, box.lower, box.upper, strict=True)
    return ", ".join(f"{name} [{shown(low)}, {shown(high)}]" for name, low, high in sides)


def comparison_page(args: argparse.Namespace, outcome: Outcome) -> Page:
    """The whole page."""
    setting, found = outcome.setting, outcome.found
    curves = [RatioCurve(e.name, e.family.value, e.over_time) for e in found if e.rigor]
    advice = [
        Paragraph(outcome.best.told("Recommended") + "."),
        Paragraph(outcome.best_formula.told("Recommended as a formula") + "."),
    ]
    side_by_side: list[Block] = [
        Table(_RATIOS, HEADINGS, [row(each) for each in found]),
        *(Paragraph(f"{each.name}: {each.refusal}") for each in found if each.refusal),
    ]
    claims = [Claim(f"{e.name}: {e.statement}.", e.rigor) for e in found if e.rigor]
    return Page(
        f"Bounds for {setting.subject.name}",
        [
            f"From the initial set {told_box(setting.subject.initial_set)}, over {args.horizon:g} "
            "s; distances from the run that starts in its middle.",
            f"Region of the formulas: {told_box(setting.region)}.",
            f"Staying in the region: {outcome.condition}.",
        ],
        [
            Section("Which one to use", advice),
            Section("Side by side", side_by_side),
            Section("Width over time", [ratio_figure(setting.samples.times_s, curves)]),
            Section("Growth over time", _growth_blocks(outcome)),
            Section("What is claimed", [Claims(claims)]),
        ],
        __version__,
        command_line("derive", args),
    )


def _growth_blocks(outcome: Outcome) -> list[Block]:
    """Half widths of the tightest method of each family, beside the samples."""
    samples, states = outcome.setting.samples, outcome.setting.subject.system.ode.states
    curves = [Growth("sampled", Origin.SAMPLES, Rigor.SAMPLED, samples.times_s, samples.distances)]
    for family in Family:
        members = [each for each in outcome.found if each.family is family and each.rigor]
        for each in sorted(members, key=lambda each: (each.score, -each.until_s))[:1]:
            values = np.where(np.isfinite(each.half_widths), each.half_widths, np.nan)
            curves.append(
                Growth(each.name, Origin.PROVED, each.rigor, samples.times_s, values)  # type: ignore[arg-type]
            )
    names, units = [s.name for s in states], [s.unit for s in states]
    return [
        Paragraph(
            "Bounds on the distance from the run that starts in the middle of the set: the "
            "tightest one over the region, along the trajectory, and of the initial set."
        ),
        growth_figure(curves, names=names, units=units),
        comparison_table(curves, names=names),
    ]
