"""`workbench demo`: the whole chain on one vehicle, from the symbolic loop to a page of
decisions."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from workbench import __version__
from workbench.cli.common import (
    CLEARANCE_REQUIRED_M,
    MONITOR_STEP_S,
    RELEASE_STEPS,
    add_deciding_option,
    add_output_option,
    chosen_deciding,
    chosen_vehicle,
    output_folder,
)
from workbench.cli.output import Progress, emit, warn

if TYPE_CHECKING:
    from workbench.cli.analysis_options import Subject
    from workbench.cli.demo_report import Findings
    from workbench.models.vehicle import Vehicle
    from workbench.reach import ReachTube
    from workbench.report.demo import DemoReport
    from workbench.runtime import Bundle, Deciding
    from workbench.sensitivity import Discrepancy, Examination, ProvedEnvelope
    from workbench.simulation.obeying import CrossingResult

HELP = (
    "Derives a bound for a vehicle's closed loop, learns one from runs, holds the two against each "
    "other, compiles a monitor, drives it through a generated crossing and writes report.html."
)
EXAMPLE = """\
workbench demo
workbench demo --vehicle my_shuttle.toml --out out/my_demo
workbench demo --vehicle gem_e2 --out out/benchmark_gains
workbench demo --deciding LookAhead --out out/look_ahead
"""
_HORIZON_S = 3.0
# Tube and runs share one grid: coarser runs err by more than the tube has slack where the loop is
# linear, and would look like an escape.
_STEP_S = MONITOR_STEP_S
_PAIRS = 400
_SAMPLES = 2000
_SEED = 1
_BENCHMARK = "gem_e2"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--vehicle", type=Path, metavar="FILE",
        help=f"vehicle file, TOML, or {_BENCHMARK} for the one that is shipped with the "
        "benchmark's gains (default: the same GEM e2 with recommended gains)",
    )  # fmt: skip
    add_deciding_option(parser)
    add_output_option(parser, default="out/demo")


def run(args: argparse.Namespace) -> int:
    """Run the chain and report; every stage is a step of the progress bar."""
    from workbench.models.control_view import quick_study

    vehicle = _vehicle(args)
    for text in quick_study(vehicle).warnings:
        warn(text)
    with output_folder(args.out) as out:
        found, report = _chain(args, vehicle, out)
    tube = found.tube
    if not tube.complete:
        warn(f"the tube is not complete ({tube.message}); proved bounds are left out")
    text = "\n".join([*report.lead, f"report: {out / 'report.html'}"])
    emit(args, text, _data(found, out))
    return 0 if tube.complete else 1


def _vehicle(args: argparse.Namespace) -> Vehicle:
    """As `--vehicle` says; a file of that name comes before the shipped one."""
    from workbench.models.vehicle import gem_e2_path, gem_e2_recommended_path

    file: Path = gem_e2_recommended_path() if args.vehicle is None else args.vehicle
    if file == Path(_BENCHMARK) and not file.exists():
        file = gem_e2_path()
    return chosen_vehicle(argparse.Namespace(vehicle=file))


def _chain(args: argparse.Namespace, vehicle: Vehicle, out: Path) -> tuple[Findings, DemoReport]:
    from workbench.cli.analysis_options import command_line
    from workbench.cli.demo_report import Findings, demo_report
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
        bundle = _bundle(vehicle, chosen_deciding(args), out)
        bar.advance()
        crossing = _crossing(vehicle, bundle)
        bar.advance()
        found = Findings(
            subject, tube, learned, examination, tuple(proved), bundle, crossing,
            _PAIRS, _HORIZON_S, _STEP_S, _SEED,
        )  # fmt: skip
        report = demo_report(found)
        page = demo_page(report, version=__version__, command=command_line("demo", args))
        write_page(out / "report.html", page.html())
        bar.advance()
    return found, report


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
            starts=1,
            second_order_rounds=0,
            any_centre=False,
            closer=False,
            stays_in_region=tube.rigor,
        ),
    )


def _bundle(vehicle: Vehicle, deciding: Deciding, out: Path) -> Bundle:
    from workbench.codegen import MonitorSpec, build_bundle
    from workbench.runtime import load_bundle

    spec = MonitorSpec(vehicle, _HORIZON_S, _STEP_S, deciding=deciding)
    return load_bundle(build_bundle(spec, out / "bundle"))


def _crossing(vehicle: Vehicle, bundle: Bundle) -> CrossingResult:
    from workbench.runtime import Deciding, Monitor
    from workbench.simulation.clock import SetClock
    from workbench.simulation.crossing import Crossing
    from workbench.simulation.obeying import TIMING, simulate

    alone = bundle.manifest.deciding == Deciding.LOOK_AHEAD.value
    # The induction of FailSafe begins at standstill.
    start_speed_mps = vehicle.operation.reference_speed_mps if alone else 0.0
    crossing = Crossing.standard(vehicle, start_speed_mps=start_speed_mps, seed=_SEED)
    clock = SetClock()
    monitor = Monitor(
        bundle, crossing.path_table(), release_steps=RELEASE_STEPS,
        clearance_required_m=CLEARANCE_REQUIRED_M, timing=TIMING, clock=clock,
    )  # fmt: skip
    return simulate(crossing, monitor, clock=clock)


def _data(found: Findings, out: Path) -> dict[str, object]:
    tube, examination, measures = found.tube, found.examination, found.crossing.measures
    return {
        "tube_status": tube.status.name,
        "tube_rigor": tube.rigor.name,
        "half_width_at_end": dict(zip(tube.names, tube.half_width_at()[-1].tolist(), strict=True)),
        "learned_verdict": examination.verdict.value,
        "queries": measures.queries,
        "braked_share": measures.braked_share,
        "deciding": found.bundle.manifest.deciding,
        "safe_shares": dict(measures.safe_shares),
        "violations": dict(measures.violations),
        "alerts": measures.alerts,
        "smallest_separation_m": measures.closest.separation_m if measures.closest else None,
        "decision_median_s": measures.decision_median_s,
        "decision_p99_s": measures.decision_p99_s,
        "report": str(out / "report.html"),
    }
