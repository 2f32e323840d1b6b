"""What `workbench reproduce paper` drives and measures."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

from workbench.cli.output import Progress
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.bench.paper_times import PaperTimes, TimedKernels, TimedStart
    from workbench.models.vehicle import Vehicle
    from workbench.simulation.paper.accuracy import AccuracyRow
    from workbench.simulation.paper.panels import Panel
    from workbench.simulation.paper.replayed import ReplayedRun
    from workbench.simulation.paper.tubes import KernelTubes
    from workbench.simulation.rig import Rig, Trial

FIRST_SEED: Final = 1000
"""Figures of a vehicle file are fitted to runs of lower seeds."""
FIT_SEED: Final = 1_000_000
"""First seed of the runs that the nested sets are fitted to; so many are never judged."""
SCENARIOS: Final = ("paper_alongside_simulation", "paper_alongside_vehicle")
PLANTS: Final = ("single-track", "multi-body")
PLAIN: Final = "the paper's model: bicycle and controller alone"
FITTED: Final = "with N and W of the vehicle file"
HELD: Final = "with N and W, reference speed held (as on the vehicle)"
LEARNED: Final = "the paper's method: learned beta, regions simulated (SAMPLED)"
_PANEL_HORIZON_S: Final = 3.0
_STARTS, _STARTS_QUICK = 60, 6
_VALIDATED, _VALIDATED_QUICK = 1, 0
_QUICK_S: Final = 13.0


@final
@dataclass(frozen=True, slots=True)
class Found:
    """All that was measured. shares: of the measured set's radii, High, Med and Low; learned: what
    the learned beta rests on, in words."""

    times: PaperTimes
    accuracy: tuple[AccuracyRow, ...]
    panels: tuple[Panel, ...]
    runs: tuple[ReplayedRun, ...]
    seeds: tuple[int, ...]
    scenarios: tuple[str, ...]
    plants: tuple[str, ...]
    shares: tuple[float, ...]
    learned: str

    @property
    def least(self) -> float:
        """Of the tubes with N and W: the smallest share of contained steps, of decisions at speed
        and of those at any; 0 where there is nothing to count."""
        from workbench.simulation.paper.accuracy import STARTS

        shares = [
            row.least
            for row in self.accuracy
            if row.method == FITTED and row.starts in (STARTS[0].name, STARTS[-1].name)
        ]
        return min((share for share in shares if share is not None), default=0.0)

    @property
    def outside(self) -> int:
        """Steps at which the car was outside of a tube with N and W that had not ended, at any
        speed, T and confidence; several T count a step more than once."""
        from workbench.simulation.paper.accuracy import STARTS

        return sum(
            cell.outside
            for row in self.accuracy
            if (row.method, row.starts) == (FITTED, STARTS[-1].name)
            for cell in row.cells
            if cell is not None
        )


def measured(args: argparse.Namespace) -> Found:
    """Build, drive, compare, time. Raises InputError without a C compiler, without the extra
    `commonroad` where its plant is asked for, and for a vehicle that cannot drive."""
    from workbench.simulation.paper.accuracy import CONFIDENCES, accuracy_rows
    from workbench.simulation.paper.confidences import THIRDS
    from workbench.simulation.paper.tubes import KernelTubes, certain, loaded
    from workbench.simulation.simulated import build_rig

    trials = _trials(args, FIRST_SEED)
    vehicle = _vehicle(args)
    with Progress("building the kernels", 4) as bar:
        rig = build_rig(vehicle=vehicle)
        bar.advance()
        kernels = _kernels(args, vehicle, bar)
    bundle = loaded(kernels.files)
    assert kernels.learned is not None, "made in _kernels"
    learned = loaded(kernels.learned)
    held = KernelTubes(bundle, vehicle, unsure=True, title=HELD)
    methods = (
        KernelTubes(bundle, vehicle, unsure=False, title=PLAIN), _ramping(vehicle, bar), held,
        KernelTubes(learned, vehicle, unsure=False, title=LEARNED),
    )  # fmt: skip
    shares = THIRDS if args.thirds else _fitted(args, rig)
    runs = _replays(rig, trials, shares, what="drives")
    with Progress("tubes against drives", len(runs) * len(methods) * len(CONFIDENCES)) as bar:
        accuracy = accuracy_rows(runs, methods, advance=bar.advance)
    panels = _panels(args, _with_levels(vehicle, shares), held)
    times = _times(args, kernels, certain(bundle, vehicle), runs, held)
    statement = next(
        each.evidence for each in learned.manifest.assumptions if each.name == "learned bound"
    )
    return Found(
        times, accuracy, panels, runs, tuple(trial.seed for trial in trials),
        tuple(dict.fromkeys(trial.scenario.name for trial in trials)),
        tuple(dict.fromkeys(trial.plant for trial in trials)), shares, statement,
    )  # fmt: skip


def _with_levels(vehicle: Vehicle, shares: Sequence[float]) -> Rig:
    """A rig with nested sets of these shares."""
    from workbench.runtime.contents import NestedLevel
    from workbench.simulation.paper.accuracy import CONFIDENCES
    from workbench.simulation.simulated import build_rig

    named = zip(CONFIDENCES, shares, strict=True)
    return build_rig(vehicle=vehicle, levels=tuple(NestedLevel(*each) for each in named))


def _vehicle(args: argparse.Namespace) -> Vehicle:
    """The file asked for, or the shipped one."""
    from workbench.cli.simulate_subject import chosen_vehicle

    vehicle = chosen_vehicle(args)
    if vehicle.drive_by_wire is None:
        raise InputError(
            f"--vehicle: expected a file with [drive_by_wire], since it is driven, got "
            f"{args.vehicle} without; `workbench new drive NAME` writes one to edit"
        )
    return vehicle


def _ramping(vehicle: Vehicle, bar: Progress) -> KernelTubes:
    """Tubes with N and W of a loop whose reference speed is on its way."""
    from workbench.simulation.paper.accuracy import HORIZONS_S
    from workbench.simulation.paper.tubes import KernelTubes, paper_bundle, paper_spec

    spec = paper_spec(vehicle, max(HORIZONS_S), ramps=True)
    found = KernelTubes(paper_bundle(spec), spec.vehicle, unsure=True, title=FITTED)
    bar.advance()
    return found


def _kernels(args: argparse.Namespace, vehicle: Vehicle, bar: Progress) -> TimedKernels:
    """With TRACK as it is proved, and as the paper's method has it."""
    from workbench.bench.paper_times import TimedKernels
    from workbench.codegen.bundle import bundle_files
    from workbench.simulation.paper.accuracy import HORIZONS_S
    from workbench.simulation.paper.learned import PAIRS, PAIRS_QUICK, learned_spec
    from workbench.simulation.paper.tubes import paper_spec

    spec = paper_spec(vehicle, max(HORIZONS_S))
    files = bundle_files(spec)
    bar.advance()
    pairs = PAIRS_QUICK if args.quick else PAIRS
    learned = bundle_files(learned_spec(vehicle, horizon_s=max(HORIZONS_S), pairs=pairs))
    bar.advance()
    return TimedKernels(spec, files, learned)


def _trials(args: argparse.Namespace, first_seed: int) -> tuple[Trial, ...]:
    """Every plant in every scenario, as often as asked. No two scenarios share a seed: with one,
    two in which nobody is in the way would be one drive."""
    import dataclasses

    from workbench.simulation.plants.make import PLANTS as KNOWN
    from workbench.simulation.rig import Trial
    from workbench.simulation.scenarios.shipped import named

    plants = args.plant or (PLANTS[:1] if args.quick else PLANTS)
    unknown = [plant for plant in plants if plant not in KNOWN]
    if unknown:
        raise InputError(f"--plant: expected one of {', '.join(KNOWN)}, got {unknown[0]!r}")
    names = args.scenario or (SCENARIOS[-1:] if args.quick else SCENARIOS)
    scenarios = [named(name) for name in names]
    if args.quick:
        scenarios = [
            dataclasses.replace(each, duration_s=min(each.duration_s, _QUICK_S))
            for each in scenarios
        ]
    return tuple(
        Trial(scenario, plant, first_seed + k * args.seeds + drive)
        for plant in dict.fromkeys(plants)
        for k, scenario in enumerate(scenarios)
        for drive in range(args.seeds)
    )


def _fitted(args: argparse.Namespace, rig: Rig) -> tuple[float, ...]:
    """Sizes of the nested sets, by as many other drives as are judged."""
    from workbench.simulation.paper.confidences import TRIED, fitted

    return fitted(_replays(rig, _trials(args, FIT_SEED), TRIED, what="drives to fit the sets to"))


def _replays(
    rig: Rig, trials: tuple[Trial, ...], shares: Sequence[float], *, what: str
) -> tuple[ReplayedRun, ...]:
    from workbench.simulation.paper.replayed import replay

    with Progress(what, sum(int(trial.scenario.duration_s) for trial in trials)) as bar:
        return tuple(replay(rig, trial, shares=shares, advance=bar.advance) for trial in trials)


def _panels(args: argparse.Namespace, rig: Rig, tubes: KernelTubes) -> tuple[Panel, ...]:
    """The four scenarios, on one plant; the rig's nested sets are drawn and judged."""
    from workbench.simulation.paper.panels import PANELS, panel
    from workbench.simulation.rig import Trial
    from workbench.simulation.scenarios.shipped import named

    plant = (args.plant or PLANTS)[0]
    drawn = []
    with Progress("the four scenarios", len(PANELS)) as bar:
        for name in PANELS:
            trial = Trial(named(name), plant, FIRST_SEED)
            drawn.append(panel(rig, trial, tubes, horizon_s=_PANEL_HORIZON_S))
            bar.advance()
    return tuple(drawn)


def _times(
    args: argparse.Namespace, kernels: TimedKernels, sure: Mapping[str, Sequence[float]],
    runs: tuple[ReplayedRun, ...], tubes: KernelTubes,
) -> PaperTimes:  # fmt: skip
    from workbench.bench.paper_times import paper_times
    from workbench.simulation.paper.accuracy import HORIZONS_S

    starts = timed_starts(runs, tubes, count=_STARTS_QUICK if args.quick else _STARTS)
    validated = _VALIDATED_QUICK if args.quick else _VALIDATED
    units = 4 * len(HORIZONS_S) + bool(validated)
    with Progress("time of three nested sets", units) as bar:
        return paper_times(
            kernels, starts, horizons_s=HORIZONS_S, certain=sure, validated=validated,
            advance=bar.advance,
        )  # fmt: skip


def timed_starts(
    runs: tuple[ReplayedRun, ...], tubes: KernelTubes, *, count: int
) -> tuple[TimedStart, ...]:
    """Decisions at speed, evenly spread over all runs."""
    from workbench.bench.paper_times import TimedStart
    from workbench.report.drawing import thinned
    from workbench.simulation.paper.accuracy import AT_SPEED_MPS

    at_speed = [
        (run, asked)
        for run in runs
        for asked in run.asked
        if run.speed_mps[asked.turn] >= AT_SPEED_MPS
    ]
    found = []
    for k in thinned(len(at_speed), count):
        run, asked = at_speed[k]
        table, station_m = run.path, asked.sets[0].center[0]
        node = min(max(int((station_m - table.start_m) / table.spacing_m), 0),
                   len(table.curvature_lower) - 1)  # fmt: skip
        bend = 0.5 * (table.curvature_lower[node] + table.curvature_upper[node])
        queries = tuple(tubes.query(table, asked, level) for level in range(len(asked.sets)))
        found.append(TimedStart(asked.sets, queries, asked.reference_speed_mps, bend))
    return tuple(found)
