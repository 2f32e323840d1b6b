"""`workbench demo`: the whole chain on one vehicle, from the symbolic loop to a page of
decisions."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

from workbench import __version__
from workbench.cli.common import (
    CLEARANCE_REQUIRED_M,
    MONITOR_STEP_S,
    RELEASE_STEPS,
    add_output_option,
    add_vehicle_option,
    chosen_vehicle,
    output_folder,
)
from workbench.cli.output import Progress, emit, warn

if TYPE_CHECKING:
    from workbench.cli.analysis_options import Subject
    from workbench.models.vehicle import Vehicle
    from workbench.reach import ReachTube
    from workbench.report.curves import Growth
    from workbench.report.demo import DemoReport
    from workbench.runtime import Bundle
    from workbench.sensitivity import Discrepancy, Examination, ProvedEnvelope
    from workbench.simulation.crossing import CrossingResult

HELP = (
    "Derives a bound for a vehicle's closed loop, learns one from runs, holds the two against each "
    "other, compiles a monitor, drives it through a generated crossing and writes report.html."
)
EXAMPLE = """\
workbench demo
workbench demo --vehicle my_shuttle.toml --out out/my_demo
"""
_HORIZON_S = 3.0
# Tube and runs share one grid: coarser runs err by more than the tube has slack where the loop is
# linear, and would look like an escape.
_STEP_S = MONITOR_STEP_S
_PAIRS = 400
_SAMPLES = 2000
_SEED = 1


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_vehicle_option(parser)
    add_output_option(parser, default="out/demo")


def run(args: argparse.Namespace) -> int:
    """Run the chain and report; every stage is a step of the progress bar."""
    from workbench.models.control_view import quick_study

    vehicle = chosen_vehicle(args)
    for text in quick_study(vehicle).warnings:
        warn(text)
    with output_folder(args.out) as out:
        found, report = _chain(vehicle, out)
    tube = found.tube
    if not tube.complete:
        warn(f"the tube is not complete ({tube.message}); proved bounds are left out")
    text = "\n".join([*report.lead, f"report: {out / 'report.html'}"])
    emit(args, text, _data(found.examination, found.crossing, tube, out))
    return 0 if tube.complete else 1


def _chain(vehicle: Vehicle, out: Path) -> tuple[_Findings, DemoReport]:
    from workbench.report.demo import demo_page
    from workbench.report.page import write_page

    subject = _subject(vehicle)
    with Progress("demo", 6) as bar:
        tube = _tube(subject)
        bar.advance()
        proved = _proved(subject, tube)
        bar.advance()
        learned = _learned(subject)
        examination = _examined(subject, tube, learned, proved)
        bar.advance()
        bundle = _bundle(vehicle, out)
        bar.advance()
        crossing = _crossing(vehicle, bundle)
        bar.advance()
        found = _Findings(subject, tube, learned, examination, tuple(proved), bundle, crossing)
        report = _report(found)
        page = demo_page(report, version=__version__, command="workbench demo")
        write_page(out / "report.html", page.html())
        bar.advance()
    return found, report


@final
@dataclass(frozen=True, slots=True)
class _Findings:
    subject: Subject
    tube: ReachTube
    learned: Discrepancy
    examination: Examination
    proved: tuple[str, ...]
    bundle: Bundle
    crossing: CrossingResult


def _subject(vehicle: Vehicle) -> Subject:
    from workbench.cli.analysis_options import Subject
    from workbench.models.bicycle import PathFrame

    loop = vehicle.closed_loop(vehicle.track(), PathFrame(0.0, 0.0))
    return Subject(vehicle.name, loop, vehicle.initial_set, vehicle.operation.region)


def _tube(subject: Subject) -> ReachTube:
    from workbench.reach import ValidatedTube, compute_tube

    return compute_tube(
        subject.system,
        initial_set=subject.initial_set,
        horizon_s=_HORIZON_S,
        method=ValidatedTube(_STEP_S),
    )


def _proved(subject: Subject, tube: ReachTube) -> dict[str, Discrepancy | ProvedEnvelope]:
    """The tube itself, and discrepancies over its hull; nothing when the tube is not complete."""
    from workbench.cli.analysis_results import envelope_of, hull_of
    from workbench.sensitivity import (
        GrowthMatrix,
        Inputs,
        Norm,
        WeightedNorm,
        derive_discrepancy,
    )
    from workbench.sensitivity.discrepancy import DerivationMethod
    from workbench.sensitivity.sampling import instants

    if not tube.complete:
        return {}
    methods: dict[str, DerivationMethod] = {
        "weighted norm": WeightedNorm(Norm.MAX, None, 64, Inputs.SHARED),
        "growth matrix": GrowthMatrix(64, Inputs.SHARED),
    }
    found: dict[str, Discrepancy | ProvedEnvelope] = {
        "validated tube": envelope_of(subject, tube, instants(_HORIZON_S, _STEP_S))
    }
    for name, method in methods.items():
        found[name] = derive_discrepancy(
            subject.system, region=hull_of(tube), horizon_s=_HORIZON_S, method=method
        )
    return found


def _learned(subject: Subject) -> Discrepancy:
    from workbench.sensitivity import LearnedExponential, learn_discrepancy

    return learn_discrepancy(
        subject.system,
        initial_set=subject.initial_set,
        horizon_s=_HORIZON_S,
        method=LearnedExponential(pairs=_PAIRS, seed=_SEED, step_s=_STEP_S, delta=1e-6),
    )


def _examined(
    subject: Subject,
    tube: ReachTube,
    learned: Discrepancy,
    proved: dict[str, Discrepancy | ProvedEnvelope],
) -> Examination:
    from workbench.sensitivity import Examiner, cross_examine

    return cross_examine(
        subject.system,
        initial_set=subject.initial_set,
        horizon_s=_HORIZON_S,
        learned=learned,
        proved=list(proved.values()),
        method=Examiner(
            samples=_SAMPLES,
            seed=_SEED + 1,
            step_s=_STEP_S,
            goals_per_coordinate=2,
            rounds=10,
            any_centre=False,
            stays_in_region=tube.rigor,
        ),
    )


def _bundle(vehicle: Vehicle, out: Path) -> Bundle:
    from workbench.codegen import MonitorSpec, build_bundle
    from workbench.runtime import load_bundle

    return load_bundle(build_bundle(MonitorSpec(vehicle, _HORIZON_S, _STEP_S), out / "bundle"))


def _crossing(vehicle: Vehicle, bundle: Bundle) -> CrossingResult:
    from workbench.runtime import Monitor
    from workbench.simulation.crossing import Crossing, simulate

    crossing = Crossing.standard(vehicle, seed=_SEED)
    monitor = Monitor(
        bundle, crossing.path_table(), release_steps=RELEASE_STEPS,
        clearance_required_m=CLEARANCE_REQUIRED_M,
    )  # fmt: skip
    return simulate(crossing, monitor)


def _report(found: _Findings) -> DemoReport:
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
        samples=sampled_runs(found.subject, horizon_s=_HORIZON_S, count=200, seed=_SEED),
        growths=_growths(found),
        frames=tuple(entry.frame for entry in found.crossing.entries),
        numbers=(),
        assumptions=found.bundle.manifest.assumptions,
    )


def _growths(found: _Findings) -> tuple[Growth, ...]:
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
            error=integration_error(found.subject, horizon_s=_HORIZON_S, step_s=_STEP_S),
        ),
        Growth(
            "learned",
            Origin.LEARNED,
            found.learned.rigor,
            times,
            examination.learned,
            finding=verdict,
            detail=f"{_PAIRS} pairs",
        ),
        *(
            Growth(name, Origin.PROVED, curve.rigor, times, curve.half_widths)
            for name, curve in zip(found.proved, examination.proved, strict=True)
        ),
    )


def _data(
    examination: Examination, crossing: CrossingResult, tube: ReachTube, out: Path
) -> dict[str, object]:
    measures = crossing.measures
    return {
        "tube_status": tube.status.name,
        "tube_rigor": tube.rigor.name,
        "half_width_at_end": dict(zip(tube.names, tube.half_width_at()[-1].tolist(), strict=True)),
        "learned_verdict": examination.verdict.value,
        "queries": measures.queries,
        "braked_share": measures.braked_share,
        "decision_median_s": measures.decision_median_s,
        "decision_p99_s": measures.decision_p99_s,
        "report": str(out / "report.html"),
    }
