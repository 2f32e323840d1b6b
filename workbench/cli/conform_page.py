"""The page of `workbench conform --plot`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench import __version__
from workbench.cli.analysis_options import command_line
from workbench.cli.conform import COUNT_HEADINGS, count_rows, ending, figures, interval_note

if TYPE_CHECKING:
    from workbench.cli.conform import Outcome
    from workbench.cli.conform_sources import Subject
    from workbench.report.tables import Table
    from workbench.simulation.conformance.verdict import Verdict

_NOTES: Final = (
    "The bounds are the least, by the stated cost, whose tubes contain the windows fitted to: a "
    "linear program on half widths to first order, then all bounds times one factor until proved "
    "tubes contain these windows. Containment of the measured motion is found by comparing, not "
    "proved: other motion of the same car may leave the tubes.",
    "Only instants are compared.",
    "Containment says little without the area: a tube over the whole street contains everything.",
)


def write_conform_page(args: argparse.Namespace, subject: Subject, outcome: Outcome) -> None:
    """Draw and write OUT/report.html."""
    import numpy as np

    from workbench.report.conformance import ConformanceReport, conformance_page
    from workbench.report.page import write_page

    verdict = outcome.verdict
    tubes = verdict.held_out_tubes
    counts = [(each.recording + mark, each)
              for mark, found in (("*", verdict.training), ("", verdict.held_out))
              for each in found.by_recording]  # fmt: skip
    last = [Path(name).name for name, _ in verdict.elsewhere]
    counts += [(f"{name if last.count(short) > 1 else short}: {each.recording}", each)
               for short, (name, found) in zip(last, verdict.elsewhere, strict=True)
               for each in found.by_recording]  # fmt: skip
    report = ConformanceReport(
        f"Tubes against the motion of {subject.source.resolve().name}",
        (
            subject.about(verdict),
            _sentence(verdict.said),
            _sentence(ending(verdict, args.require)),
        ),
        subject.candidate_of(verdict).measured.times_s,
        _labels(verdict),
        tubes.deviation,
        tubes.half_width,
        tuple(name for name, _ in counts),
        np.array([each.windows_inside / each.windows for _, each in counts]),
        _tables(outcome),
        (
            *_NOTES,
            f"In brackets: {interval_note(verdict)}. Windows of one drive resemble each other.",
            *([_sentence(outcome.lacking)] if outcome.lacking else []),
        ),
    )
    command = command_line("conform", args, positional=("source",))
    page = conformance_page(report, version=__version__, command=command)
    write_page(args.out / "report.html", page.html())


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _labels(verdict: Verdict) -> tuple[str, ...]:
    units = {state.name: state.unit for state in verdict.model.ode(verdict.fit.uncertainty).states}
    return tuple(f"{name.replace('_', ' ')} ({units[name]})" for name in verdict.model.outputs)


def _tables(outcome: Outcome) -> tuple[Table, ...]:
    from workbench.report.tables import Table

    verdict = outcome.verdict
    by_recording: list[list[str | int | float | None]] = [
        [each.recording, role, each.steps_inside, each.steps, each.windows_inside, each.windows,
         each.mean_area_m2]
        for role, found in (
            ("fitted to", verdict.training), ("other", verdict.held_out), *verdict.elsewhere
        )
        for each in found.by_recording
    ]  # fmt: skip
    return (
        Table("the fitted figures, as written into the vehicle file", ["key", "bound"],
              figures(outcome.section)),
        Table("containment with 95 % intervals, and area", COUNT_HEADINGS,
              count_rows(outcome)),
        Table("recording by recording",
              ["recording", "role", "steps inside", "steps", "windows inside", "windows",
               "mean area (m2)"], by_recording),
    )  # fmt: skip
