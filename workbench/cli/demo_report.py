"""What the demo found, and the report of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

if TYPE_CHECKING:
    from workbench.cli.analysis_options import Subject
    from workbench.reach import ReachTube
    from workbench.report.curves import Growth
    from workbench.report.demo import DemoReport
    from workbench.runtime import Bundle
    from workbench.sensitivity import Discrepancy, Examination
    from workbench.simulation.obeying import CrossingResult


@final
@dataclass(frozen=True, slots=True)
class Findings:
    """proved: names of the proved bounds, as in the examination; pairs: the learned bound is fitted
    to; horizon_s, step_s, seed: of the runs that the report draws."""

    subject: Subject
    tube: ReachTube
    learned: Discrepancy
    examination: Examination
    proved: tuple[str, ...]
    bundle: Bundle
    crossing: CrossingResult
    pairs: int
    horizon_s: float
    step_s: float
    seed: int


def demo_report(found: Findings) -> DemoReport:
    """Claims, curves and decisions, ready for a page."""
    from workbench.claims import Rigor, weakest
    from workbench.cli.analysis_results import sampled_runs, tube_curves
    from workbench.report.demo import DemoReport
    from workbench.report.page import Claim

    tube, examination = found.tube, found.examination
    line = found.crossing.summary_line()
    lead = (
        f"{found.subject.name}: tube over {tube.times[-1]:g} s {tube.status.name}, rigor "
        f"{tube.rigor.name}.",
        f"Learned bound: {examination.verdict.value.replace('_', ' ').lower()}.",
        f"{line[0].upper()}{line[1:]}.",
    )
    reach = f"Every trajectory from the initial set stays in the tube up to {tube.times[-1]:g} s."
    # Not the bundle's own: where the car is on its path adds to what a decision rests on.
    decided = weakest(*(Rigor[entry.rigor] for entry in found.crossing.entries))
    claims = (
        Claim(reach, tube.rigor),
        Claim(f"Learned bound ({found.learned.condition})", found.learned.rigor),
        Claim("Monitor decisions, under the assumptions listed below", decided),
        *(
            Claim(f"{name}: {curve.condition}", curve.rigor)
            for name, curve in zip(found.proved, examination.proved, strict=True)
            if curve.rigor is not Rigor.SAMPLED
        ),
    )
    return DemoReport(
        lead=lead,
        claims=claims,
        tube=tube_curves(tube, found.subject.system.ode),
        samples=sampled_runs(found.subject, horizon_s=found.horizon_s, count=200, seed=found.seed),
        growths=_growths(found),
        frames=tuple(entry.frame for entry in found.crossing.entries),
        deciding=found.bundle.manifest.deciding,
        numbers=(),
        assumptions=found.bundle.manifest.assumptions,
    )


def _growths(found: Findings) -> tuple[Growth, ...]:
    from workbench.claims import Rigor
    from workbench.cli.analysis_results import integration_error
    from workbench.report.curves import Growth, Origin

    examination = found.examination
    times = examination.times
    verdict = examination.verdict.value.replace("_", " ").lower()
    return (
        Growth(
            "sampled",
            Origin.SAMPLES,
            Rigor.SAMPLED,
            times,
            examination.driven,
            error=integration_error(found.subject, horizon_s=found.horizon_s, step_s=found.step_s),
        ),
        Growth(
            "learned",
            Origin.LEARNED,
            found.learned.rigor,
            times,
            examination.learned,
            finding=verdict,
            detail=f"{found.pairs} pairs",
        ),
        *(
            Growth(name, Origin.PROVED, curve.rigor, times, curve.half_widths)
            for name, curve in zip(found.proved, examination.proved, strict=True)
        ),
    )
