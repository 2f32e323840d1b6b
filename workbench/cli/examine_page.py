"""The page that `workbench examine` writes."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from workbench import __version__
from workbench.claims import Rigor
from workbench.cli.analysis_options import command_line
from workbench.cli.analysis_results import growth_section
from workbench.cli.examine import VERDICTS, Outcome
from workbench.report.curves import Growth, Origin
from workbench.report.page import Claim, Claims, Page, Section
from workbench.report.tables import Table


def examination_page(
    args: argparse.Namespace, outcome: Outcome, *, lead: Sequence[str], coverage: Table
) -> Page:
    """The whole page."""
    return Page(
        f"Cross-examination of a learned bound for {outcome.subject.name}",
        lead,
        [
            Section("What is claimed", [Claims(_claims(outcome))]),
            growth_section(_curves(outcome), outcome.subject.system.ode),
            Section("Coverage", [coverage]),
        ],
        __version__,
        command_line("examine", args),
    )


def _curves(outcome: Outcome) -> list[Growth]:
    found, grade = outcome.found, Rigor.SAMPLED
    curves = [
        Growth(
            "sampled and driven",
            Origin.SAMPLES,
            grade,
            found.times,
            found.driven,
            error=outcome.error,
        ),
        Growth(
            "learned",
            Origin.LEARNED,
            grade,
            found.times,
            found.learned,
            finding=VERDICTS[found.verdict.name],
        ),
    ]
    for name, curve in zip(outcome.methods, found.proved, strict=True):
        curves.append(Growth(name, Origin.PROVED, curve.rigor, found.times, curve.half_widths))
    return curves


def _claims(outcome: Outcome) -> list[Claim]:
    learned = outcome.learned
    proved = zip(outcome.methods, outcome.found.proved, strict=True)
    return [
        Claim(f"{learned.norm}. Condition: {learned.condition}.", learned.rigor),
        *(Claim(f"{name}. Condition: {curve.condition}.", curve.rigor) for name, curve in proved),
    ]
