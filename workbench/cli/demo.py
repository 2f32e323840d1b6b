"""`workbench demo`: the whole chain on one vehicle, from the symbolic loop to a page of
decisions."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

from workbench import __version__
from workbench.cli.common import (
    add_output_option,
    add_vehicle_option,
    chosen_vehicle,
    writable_folder,
)
from workbench.cli.output import Progress, emit

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle
    from workbench.reach import ReachTube
    from workbench.report.curves import Growth
    from workbench.report.demo import DemoReport
    from workbench.runtime import Bundle
    from workbench.sensitivity import Discrepancy, Examination
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
_TUBE_STEP_S = 0.025
# Runs are integrated on the tube's own grid: a coarser one errs by more than the tube has slack
# where the loop is linear, and would look like an escape.
_GRID_S = _TUBE_STEP_S
_PAIRS = 400
_SAMPLES = 2000
_SEED = 1
_RELEASE_STEPS = 5
_CLEARANCE_M = 0.2
_PROVED = ("sensitivity + remainder", "weighted norm", "growth matrix")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_vehicle_option(parser)
    add_output_option(parser, default="out/demo")


def run(args: argparse.Namespace) -> int:
    """Run the chain and report; every stage is a step of the progress bar."""
    from workbench.report.demo import demo_page
    from workbench.report.page import write_page

    out = writable_folder(args.out)
    vehicle = chosen_vehicle(args)
    with Progress("demo", 6) as bar:
        tube = _tube(vehicle)
        bar.advance()
        proved = _proved(vehicle, tube)
        bar.advance()
        learned = _learned(vehicle)
        examination = _examined(vehicle, tube, learned, proved)
        bar.advance()
        bundle = _bundle(vehicle, out)
        bar.advance()
        crossing = _crossing(vehicle, bundle)
        bar.advance()
        report = _report(_Findings(vehicle, tube, learned, examination, bundle, crossing))
        page = demo_page(report, version=__version__, command="workbench demo")
        write_page(out / "report.html", page.html())
        bar.advance()
    text = "\n".join([*report.lead, f"report: {out / 'report.html'}"])
    emit(args, text, _data(examination, crossing, tube, out))
    return 0


@final
@dataclass(frozen=True, slots=True)
class _Findings:
    vehicle: Vehicle
    tube: ReachTube
    learned: Discrepancy
    examination: Examination
    bundle: Bundle
    crossing: CrossingResult


def _loop(vehicle: Vehicle):  # type: ignore[no-untyped-def]
    from workbench.models.bicycle import PathFrame

    return vehicle.closed_loop(vehicle.track(), PathFrame(0.0, 0.0))


def _tube(vehicle: Vehicle) -> ReachTube:
    from workbench.reach import SensitivityTube, compute_tube

    return compute_tube(
        _loop(vehicle), initial_set=vehicle.initial_set, horizon_s=_HORIZON_S,
        method=SensitivityTube(step_s=_TUBE_STEP_S),
    )  # fmt: skip


def _proved(vehicle: Vehicle, tube: ReachTube) -> list[Discrepancy]:
    """Discrepancies over the hull of the tube, in which all its trajectories stay."""
    from workbench.sensitivity import GrowthMatrix, Norm, WeightedNorm, derive_discrepancy
    from workbench.sets import Box

    hull = Box(tube.names, tuple(tube.lower.min(axis=0)), tuple(tube.upper.max(axis=0)))
    methods = (WeightedNorm(norm=Norm.MAX, weights=None, cells=64), GrowthMatrix(cells=64))
    return [
        derive_discrepancy(_loop(vehicle), region=hull, horizon_s=_HORIZON_S, method=method)
        for method in methods
    ]


def _learned(vehicle: Vehicle) -> Discrepancy:
    from workbench.sensitivity import LearnedExponential, learn_discrepancy

    return learn_discrepancy(
        _loop(vehicle), initial_set=vehicle.initial_set, horizon_s=_HORIZON_S,
        method=LearnedExponential(pairs=_PAIRS, seed=_SEED, step_s=_GRID_S, delta=1e-6),
    )  # fmt: skip


def _examined(
    vehicle: Vehicle, tube: ReachTube, learned: Discrepancy, proved: list[Discrepancy]
) -> Examination:
    import numpy as np

    from workbench.sensitivity import Examiner, ProvedEnvelope, cross_examine
    from workbench.sensitivity.sampling import rollout

    # The examination measures distances from the run of the set's centre, about which a tube need
    # not be symmetric: the larger side counts.
    center = np.array([vehicle.initial_set.center])
    end_s = float(tube.times[-1])
    nominal = rollout(_loop(vehicle), center, horizon_s=end_s, step_s=_TUBE_STEP_S)[0]
    half = np.maximum(tube.upper_at - nominal, nominal - tube.lower_at)

    def half_widths(t_s: float) -> list[float]:
        return [float(np.interp(t_s, tube.times, half[:, i])) for i in range(half.shape[1])]

    envelope = ProvedEnvelope(
        _PROVED[0], half_widths, tube.rigor, "trajectories from the initial set"
    )
    return cross_examine(
        _loop(vehicle), initial_set=vehicle.initial_set, horizon_s=_HORIZON_S, learned=learned,
        proved=[envelope, *proved],
        method=Examiner(samples=_SAMPLES, seed=_SEED + 1, step_s=_GRID_S, goals_per_coordinate=2,
                        rounds=10, any_centre=False),
    )  # fmt: skip


def _bundle(vehicle: Vehicle, out: Path) -> Bundle:
    from workbench.codegen import MonitorSpec, build_bundle
    from workbench.runtime import load_bundle

    return load_bundle(build_bundle(MonitorSpec(vehicle, _HORIZON_S, 0.025), out / "bundle"))


def _crossing(vehicle: Vehicle, bundle: Bundle) -> CrossingResult:
    from workbench.runtime import Monitor
    from workbench.simulation.crossing import Crossing, simulate

    crossing = Crossing.standard(vehicle, seed=_SEED)
    monitor = Monitor(
        bundle, crossing.path_table(), release_steps=_RELEASE_STEPS,
        clearance_required_m=_CLEARANCE_M,
    )  # fmt: skip
    return simulate(crossing, monitor)


def _report(found: _Findings) -> DemoReport:
    from workbench.claims import Rigor
    from workbench.report.curves import TubeCurves
    from workbench.report.demo import DemoReport
    from workbench.report.page import Claim

    tube, examination = found.tube, found.examination
    states = _loop(found.vehicle).ode.states
    units = tuple(state.unit for state in states)
    lead = (
        f"{found.vehicle.name}: tube over {tube.times[-1]:g} s {tube.status.name}, rigor "
        f"{tube.rigor.name}.",
        f"Learned bound: {examination.verdict.value.replace('_', ' ').lower()}.",
        f"Crossing: {found.crossing.summary_line()}.",
    )
    claims = (
        Claim("Every trajectory from the initial set stays in the tube.", tube.rigor),
        Claim(f"Learned bound ({found.learned.condition})", found.learned.rigor),
        Claim("Monitor decisions, under the assumptions listed below", found.bundle.manifest.rigor),
        *(Claim(f"{curve.name}: {curve.condition}", curve.rigor)
          for curve in examination.proved if curve.rigor is Rigor.ENCLOSED),
    )  # fmt: skip
    curves = TubeCurves(
        tube.names, units, tube.times, tube.lower, tube.upper, tube.lower_at, tube.upper_at,
        tube.rigor,
    )  # fmt: skip
    return DemoReport(
        lead=lead, claims=claims, tube=curves, samples=_samples(found.vehicle),
        growths=_growths(examination, found.learned),
        frames=tuple(entry.frame for entry in found.crossing.entries), numbers=(),
        assumptions=found.bundle.manifest.assumptions,
    )  # fmt: skip


def _samples(vehicle: Vehicle):  # type: ignore[no-untyped-def]
    from workbench.report.curves import SampledRuns
    from workbench.sensitivity.sampling import instants, rollout, sample_initial_states

    starts = sample_initial_states(vehicle.initial_set, count=200, seed=_SEED)
    runs = rollout(_loop(vehicle), starts, horizon_s=_HORIZON_S, step_s=_GRID_S)
    return SampledRuns(instants(_HORIZON_S, _GRID_S), runs)


def _growths(examination: Examination, learned: Discrepancy) -> tuple[Growth, ...]:
    from workbench.claims import Rigor
    from workbench.report.curves import Growth, Origin

    times = examination.times
    verdict = examination.verdict.value.replace("_", " ").lower()
    return (
        Growth("sampled", Origin.SAMPLES, Rigor.SAMPLED, times, examination.driven,
               detail="with gradient search"),
        Growth("learned", Origin.LEARNED, learned.rigor, times, examination.learned,
               finding=verdict, detail=f"{_PAIRS} pairs"),
        *(Growth(label, Origin.PROVED, curve.rigor, times, curve.half_widths)
          for label, curve in zip(_PROVED, examination.proved, strict=True)),
    )  # fmt: skip


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
