"""The report of a simulated drive: what was decided, what came of it, and what was needless."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

from workbench.claims import Assumption
from workbench.report.demo import decision_blocks
from workbench.report.page import Assumptions, Block, Notice, Page, Paragraph, Section
from workbench.report.simulation_levels import failures_table, level_timeline
from workbench.report.simulation_plots import DriveCurves, drive_figure
from workbench.report.tables import Table
from workbench.report.timeline import summary_table
from workbench.simulation.frames import Frame


@final
@dataclass(frozen=True, slots=True)
class SimulationReport:
    """What one drive through a scenario found.

    title, story: of the scenario; lead: the outcome in plain sentences; frames: decisions in time
    order; levels: names of the nested sets, the largest first; curves: the drive over time;
    numbers: tables of figures; settings: what was simulated; notes: what a reader must know;
    assumptions: those of the bundle.
    """

    title: str
    story: str
    lead: tuple[str, ...]
    frames: tuple[Frame, ...]
    levels: tuple[str, ...]
    curves: DriveCurves
    numbers: tuple[Table, ...]
    settings: Table
    notes: tuple[str, ...]
    assumptions: tuple[Assumption, ...]


def simulation_page(report: SimulationReport, *, version: str, command: str) -> Page:
    """The page of a drive.

    version: of workbench; command: the command line that made it. Raises InputError when there are
    no frames.
    """
    notes = tuple(Notice("Note.", text) for text in report.notes)
    sections = (
        Section("What happens", (Paragraph(report.story), Paragraph(_NUMBERED), *notes)),
        Section("The drive, decision by decision", decision_blocks(report.frames)),
        Section("Verdicts by confidence level", _levels(report)),
        Section("The drive over time", (drive_figure(report.curves),)),
        Section("Numbers", (*report.numbers, summary_table(report.frames))),
        Section("Settings", (report.settings,)),
        Section("Assumptions behind every SAFE", (Assumptions(report.assumptions),)),
    )
    return Page(f"Simulation: {report.title}", report.lead, sections, version, command)


_NUMBERED: Final = (
    "The monitor knows people by the numbers of their tracks, 0 for whoever was measured first; "
    "numbers from 60000 on are somebody whom it assumes where nobody can be seen."
)


def _levels(report: SimulationReport) -> tuple[Block, ...]:
    return (
        Paragraph(
            "The car's state is known as nested sets; the sets of people are the same for all. "
            "Each set is judged for three tubes: TRACK over the horizon (track), TRACK and then "
            "BRAKE to standstill (stop), BRAKE alone (brake). The largest set decides. Where not "
            "even brake is SAFE, the person in the way is alerted."
        ),
        level_timeline(report.frames, report.levels),
        failures_table(report.frames),
    )
