"""The report of a bundle run over a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from workbench.claims import Assumption
from workbench.report.demo import decision_blocks
from workbench.report.page import Assumptions, Notice, Page, Section
from workbench.report.tables import Table
from workbench.report.timeline import summary_table
from workbench.simulation.frames import Frame


@final
@dataclass(frozen=True, slots=True)
class ReplayReport:
    """What a replay found.

    recording: its name; summary: the one-line summary; frames: the decisions in time order;
    settings: what the replay was run with; numbers: more tables, such as times per decision;
    notes: what a reader must know, such as samples left out; assumptions: those of the bundle.
    """

    recording: str
    summary: str
    frames: tuple[Frame, ...]
    settings: Table
    numbers: tuple[Table, ...]
    notes: tuple[str, ...]
    assumptions: tuple[Assumption, ...]


def replay_page(report: ReplayReport, *, version: str, command: str) -> Page:
    """The page of a replay; it states that replay is open-loop.

    version: of workbench; command: the command line that made it. Raises InputError when there are
    no frames.
    """
    open_loop = Notice(
        "This replay is open-loop.",
        "The recorded car did not obey the monitor: after a decision to brake it drove on as "
        "recorded, and the people reacted to that. The counts below say how often the monitor "
        "would have braked at these moments, not how a drive under the monitor would have gone.",
    )
    notes = tuple(Notice("Note.", text) for text in report.notes)
    sections = (
        Section("How to read this", (open_loop, *notes)),
        Section("Decisions", decision_blocks(report.frames)),
        Section("Numbers", (summary_table(report.frames), *report.numbers)),
        Section("Settings", (report.settings,)),
        Section("Assumptions behind every SAFE", (Assumptions(report.assumptions),)),
    )
    return Page(f"Replay of {report.recording}", (report.summary,), sections, version, command)
