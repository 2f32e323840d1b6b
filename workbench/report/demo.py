"""The demo's report: the bounds, the tube they give, and the decisions made with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.claims import Assumption, Verdict
from workbench.report.curves import Growth, SampledRuns, TubeCurves
from workbench.report.figures import comparison_table, growth_figure, tube_figure
from workbench.report.page import Assumptions, Block, Claim, Claims, Page, Paragraph, Section
from workbench.report.plane import plane_figure
from workbench.report.scene import Scene
from workbench.report.tables import Table
from workbench.report.timeline import require_frames, summary_table, verdict_timeline
from workbench.simulation.frames import Frame


@final
@dataclass(frozen=True, slots=True)
class DemoReport:
    """What the demo found.

    lead: the outcome in plain sentences; claims: statements with their Rigor; tube, samples: the
    reach tube and runs inside it; growths: sampled, learned and proved half widths over time;
    frames: the decisions of the crossing scenario in time order; deciding: whose TRACK counted,
    "both" or a policy's name; numbers: more tables; assumptions: those of the bundle.
    """

    lead: tuple[str, ...]
    claims: tuple[Claim, ...]
    tube: TubeCurves
    samples: SampledRuns | None
    growths: tuple[Growth, ...]
    frames: tuple[Frame, ...]
    deciding: str
    numbers: tuple[Table, ...]
    assumptions: tuple[Assumption, ...]


def demo_page(report: DemoReport, *, version: str, command: str) -> Page:
    """The page of the demo.

    version: of workbench; command: the command line that made it. Raises InputError when there are
    no frames or shapes do not fit.
    """
    names, units = report.tube.names, report.tube.units
    bounds: tuple[Block, ...] = (
        Paragraph(
            "The same question answered several ways: how far can trajectories that start in the "
            "initial set spread? Samples give a lower limit, a learned bound is fitted to runs, "
            "a proved bound holds for every trajectory."
        ),
        comparison_table(report.growths, names=names),
        growth_figure(report.growths, names=names, units=units),
    )
    sections = (
        Section("What is claimed, and how strongly", (Claims(report.claims),)),
        Section("Learned and proved bounds side by side", bounds),
        Section("The reach tube", (tube_figure(report.tube, report.samples),)),
        Section("The crossing, decision by decision", _crossing(report)),
        Section("Numbers", (summary_table(report.frames), *report.numbers)),
        Section("Assumptions behind every SAFE", (Assumptions(report.assumptions),)),
    )
    return Page("Workbench demo", report.lead, sections, version, command)


def _crossing(report: DemoReport) -> tuple[Block, ...]:
    return (
        Paragraph(
            f"Deciding: {report.deciding}. A decision is made ten times a second; a sender that "
            "turns thirty times a second commands what was permitted, and BRAKE where no decision "
            "came in time. The car does what was sent. Where FailSafe decides, it starts at "
            "standstill, and a BRAKE is carried out until it stands again."
        ),
        *decision_blocks(report.frames),
    )


def decision_blocks(frames: Sequence[Frame]) -> tuple[Block, ...]:
    """What the policies ask, the player, the timeline and the most telling decision.

    Raises InputError when no frame is a decision.
    """
    caption = "The scene from above, as each decision saw it."
    moment = telling(frames)
    travelled = [(frame.x_m, frame.y_m) for frame in frames if frame.t_s <= moment.t_s]
    return (
        Paragraph(
            "LookAhead permits TRACK while TRACK over the horizon keeps clear of where people are "
            "expected to go. FailSafe permits it while TRACK for one more period, then BRAKE to "
            "standstill, keeps clear of everywhere they can be. Both are asked every time, for "
            "nested sets of states; if not even BRAKE is proved to keep clear, somebody is alerted."
        ),
        Scene(frames, caption),
        verdict_timeline(frames),
        plane_figure(moment, travelled),
    )


def telling(frames: Sequence[Frame]) -> Frame:
    """The first decision that is not SAFE, else the one with the smallest proved clearance.

    An INVALID one is chosen only where no UNPROVED one exists, as it has little to draw. Raises
    InputError when there are no decisions.
    """
    frames = [frame for frame in frames if frame.decided]
    require_frames(frames)
    for verdict in (Verdict.UNPROVED, Verdict.INVALID):
        for frame in frames:
            if frame.verdict is verdict:
                return frame
    with_clearance = [frame for frame in frames if frame.clearance_m is not None]
    return min(with_clearance or frames[:1], key=lambda frame: frame.clearance_m or 0.0)
