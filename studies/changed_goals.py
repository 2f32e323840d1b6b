"""Somebody walking beside the road changes their mind, in front of a car that a monitor drives.

People turn across to a goal of the set, or to one that is not in it, or stop and turn back; they
are measured ten times a second within 0.1 m, and keep to the limits of the vehicle file. Without a
monitor every car meets those who turn across. With FailSafe, alone or beside LookAhead, no moving
car touches anybody, whatever is believed of their goals; LookAhead alone has no such guarantee.
Run with Python (extra `analysis`); an argument names the picture, a second one how many seeds.
It prints the tables of docs/people-intent.md, and fails when the claim does.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from workbench.codegen import MonitorSpec, build_bundle
from workbench.estimation.goals import Goal
from workbench.estimation.guard_shipped import shipped_guards
from workbench.estimation.intent_cloud import FilterSettings, NumpyUpdate
from workbench.estimation.motion_filter import MotionNumbers
from workbench.estimation.motion_parameters import MotionParameters, shipped_motion
from workbench.estimation.people_estimator import Bodies, EstimatorSettings, PeopleEstimator
from workbench.estimation.people_guards import FittedGuards, Guards
from workbench.estimation.person_intents import EveryIntent, Forwarding, MostLikelyIntent
from workbench.models.vehicle import Vehicle, gem_e2
from workbench.runtime import Bundle, Deciding, Monitor, MotionLimits, load_bundle
from workbench.simulation.changing_minds import ROAD, Change, Mind, Way, measured, mind
from workbench.simulation.clock import SetClock
from workbench.simulation.crossing import Crossing, Localisation
from workbench.simulation.mind_outcomes import Outcome, unwatched_m
from workbench.simulation.obeying import TIMING, simulate
from workbench.simulation.people import PeopleModel, PersonModel
from workbench.simulation.people_sources import EstimatedPeople, PeopleSource, StraightPeople

# Specification
SEEDS = 20
NOISE_M = 0.1
CLEARANCE_M = 0.2
RELEASE_STEPS = 5
HORIZON_S, STEP_S = 3.0, 0.05

# The monitor's side: a body, errors of places within the noise, and no others.
BODY_M = 0.3
ON_FOOT = PersonModel(BODY_M, NOISE_M, NOISE_M, 0.0, 2.5, 0.1, 0.5, 0.5, 1.0, "generated")
MODELS = PeopleModel(ON_FOOT, ON_FOOT)
THRESHOLD, LEVEL = 0.26, 0.9
CONSTANT_RADIUS_M = 0.5
TOLD_UNTIL_S = 4.0
HEADROOM = 1.2


@dataclass(frozen=True)
class Setup:
    """Who decides, and what is told: forwarding None is straight on, at the velocity of now."""

    name: str
    deciding: Deciding
    forwarding: Forwarding | None
    guards: Guards

    @property
    def promised(self) -> bool:
        """Does FailSafe decide on limits to which these people keep?"""
        fitted = isinstance(self.guards, FittedGuards)
        return self.deciding is not Deciding.LOOK_AHEAD and not fitted


Results = dict[str, dict[Change, list[Outcome]]]


def setups(vehicle: Vehicle, motion: MotionParameters) -> tuple[Setup, ...]:
    """Both policies, either alone, and what they can be told."""
    every = EveryIntent(motion, THRESHOLD, LEVEL, TOLD_UNTIL_S)
    likeliest = MostLikelyIntent(motion, CONSTANT_RADIUS_M, TOLD_UNTIL_S)
    limits = MODELS.guards(limits_of(vehicle))
    fitted = FittedGuards(shipped_guards())
    ahead, safe = Deciding.LOOK_AHEAD, Deciding.FAIL_SAFE
    return (
        Setup("both: every intent, assumed limits", Deciding.BOTH, every, limits),
        Setup("FailSafe alone: assumed limits", safe, every, limits),
        Setup("FailSafe alone: fitted guard", safe, every, fitted),
        Setup("LookAhead alone: every intent", ahead, every, limits),
        Setup(f"LookAhead alone: the likeliest, {CONSTANT_RADIUS_M:g} m", ahead, likeliest, limits),
        Setup("LookAhead alone: straight on", ahead, None, limits),
    )


def limits_of(vehicle: Vehicle) -> MotionLimits:
    """What nobody exceeds, from the vehicle file."""
    return MotionLimits(vehicle.guard.speed_max_mps, vehicle.guard.accel_max_mps2)


def estimator(setup: Setup, forwarding: Forwarding, goals: tuple[Goal, ...]) -> PeopleEstimator:
    """Errors uniform in a disc have half its radius as their deviation in x and in y."""
    numbers = MotionNumbers(0.5 * NOISE_M, *shipped_motion().numbers.row[1:])
    return PeopleEstimator(
        EstimatorSettings(
            goals=goals,
            intents=FilterSettings.chosen(),
            update=NumpyUpdate(),
            motion=numbers,
            forwarding=forwarding,
            guards=setup.guards,
            bodies=Bodies(BODY_M, BODY_M, NOISE_M),
            max_age_s=ON_FOOT.max_age_s,
            gone_age_s=ON_FOOT.gone_age_s,
            headroom=HEADROOM,
            seed=1,
        )
    )


def people_of(setup: Setup, crossing: Crossing, scene: Mind, seed: int) -> PeopleSource:
    """What the monitor is told, from noisy measurements alone."""
    seen = (measured(scene.walker.track(scene.duration_s), noise_m=NOISE_M, seed=seed),)
    if setup.forwarding is None:
        return StraightPeople(seen, MODELS, crossing.limits)
    return EstimatedPeople(seen, estimator(setup, setup.forwarding, scene.goals), notes=("", ""))


def drive(bundle: Bundle, vehicle: Vehicle, setup: Setup, scene: Mind, seed: int) -> Outcome:
    """One run in the loop, from standstill, and what came of it."""
    crossing = Crossing(
        vehicle, ROAD, (scene.walker,), Localisation.assumed(), MODELS, 80.0, 0.0,
        scene.duration_s, seed,
    )  # fmt: skip
    clock = SetClock()
    monitor = Monitor(
        bundle, crossing.path_table(), release_steps=RELEASE_STEPS,
        clearance_required_m=CLEARANCE_M, timing=TIMING, deciding=setup.deciding, clock=clock,
    )  # fmt: skip
    people = people_of(setup, crossing, scene, seed)
    result = simulate(crossing, monitor, clock=clock, people=people)
    return Outcome.of(result, scene, body_m=BODY_M, clear_m=CLEARANCE_M)


def analyse(vehicle: Vehicle, bundle: Bundle, seeds: int) -> Results:
    """Every setup in every scene; without a monitor, every car meets those who turn across."""
    way, found = Way.of(vehicle), {}
    scenes = {change: [mind(change, vehicle, way, k) for k in range(seeds)] for change in Change}
    for change, those in scenes.items():
        for scene in those:
            away_m = unwatched_m(vehicle, way, scene, body_m=BODY_M)
            assert (away_m < 0.0) == (change is not Change.STAYS), f"{change}: {away_m:.2f} m"
    for setup in setups(vehicle, shipped_motion()):
        found[setup.name] = {
            change: [drive(bundle, vehicle, setup, scene, k) for k, scene in enumerate(those)]
            for change, those in scenes.items()
        }
    return found


def check(vehicle: Vehicle, results: Results) -> str:
    """Assert the claim and return it in words."""
    nearest_m, hits = math.inf, []
    for setup in setups(vehicle, shipped_motion()):
        runs = [run for those in results[setup.name].values() for run in those]
        if setup.promised:
            nearest_m = min(nearest_m, *(run.nearest_m for run in runs))
            assert nearest_m >= CLEARANCE_M, f"{setup.name}: {nearest_m:.2f} m"
            assert not any(run.broken for run in runs), f"{setup.name}: a person broke the limits"
        else:
            hit = sum(run.nearest_m < 0.0 for run in runs)
            hits.append(f"{setup.name} {hit} of {len(runs)}")
    return (
        "all people stay inside the limits; no moving car of FailSafe, alone or with LookAhead, "
        f"comes nearer than {nearest_m:.2f} m; collisions without that promise: {'; '.join(hits)}"
    )


def tables(results: Results) -> str:
    """In Markdown: when the right goal leads, then what came of every setup in every scene."""
    lines = ["| the person | seeds | noticed | median | 90 % |", "| --- | --- | --- | --- | --- |"]
    runs = [run for those in next(iter(results.values())).values() for run in those]
    for story in dict.fromkeys(run.story for run in runs):
        waits = sorted(r.wait_s for r in runs if r.story == story and r.wait_s is not None)
        share = sum(map(math.isfinite, waits)) / len(waits)
        middle, late = (_waited(waits[math.ceil(q * len(waits)) - 1]) for q in (0.5, 0.9))
        lines.append(f"| {story} | {len(waits)} | {share:.0%} | {middle} | {late} |")
    lines += ["", "| deciding, told | the person | collisions | nearest | stops | needless | way |"]
    lines += ["| --- " * 7 + "|"]
    for name, changes in results.items():
        lines += [f"| {name} | {change.value} | {_row(runs)} |" for change, runs in changes.items()]
    return "\n".join(lines)


def _waited(wait_s: float) -> str:
    return f"{wait_s:.1f} s" if math.isfinite(wait_s) else "never"


def _row(runs: Sequence[Outcome]) -> str:
    hit, stops = sum(run.nearest_m < 0.0 for run in runs), sum(run.stops for run in runs)
    nearest_m = min(run.nearest_m for run in runs)
    needless = sum(run.needless for run in runs) / stops if stops else 0.0
    way_m = sum(run.way_m for run in runs) / len(runs)
    return (
        f"{hit} of {len(runs)} | {nearest_m:.2f} m | {stops / len(runs):.1f} | {needless:.0%} | "
        f"{way_m:.1f} m"
    )


def plot(results: Results, file: Path) -> None:
    """Smallest distance of every run, a column of dots for every setup."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(8.0, 4.2), layout="constrained")
    colours, marks = ("C3", "C0", "0.5"), ("o", "s", "^")
    for row, changes in enumerate(results.values()):
        for k, (change, runs) in enumerate(changes.items()):
            axes.plot(
                [min(run.nearest_m, 8.0) for run in runs], [row + 0.2 * (k - 1)] * len(runs),
                color=colours[k], marker=marks[k], linestyle="none", markersize=4, alpha=0.7,
                label=None if row else change.value,
            )  # fmt: skip
    axes.axvline(0.0, color="k", linewidth=1.0)
    axes.set_yticks(range(len(results)), list(results))
    axes.invert_yaxis()
    axes.set_xlabel("smallest distance of the moving car to the person (m); below 0 they collide")
    axes.legend(loc="upper center", bbox_to_anchor=(0.3, -0.16), fontsize="small", frameon=False)
    figure.savefig(file, dpi=150)
    pyplot.close(figure)


def main(picture: Path | None, seeds: int = SEEDS) -> str:
    """Model, analysis, claim, tables, plot."""
    vehicle = gem_e2()
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        spec = MonitorSpec(vehicle, HORIZON_S, STEP_S)
        bundle = load_bundle(build_bundle(spec, Path(folder) / "bundle"))
    results = analyse(vehicle, bundle, seeds)
    claim = check(vehicle, results)
    if picture is not None:
        plot(results, picture)
    return f"{tables(results)}\n\n{claim}"


if __name__ == "__main__":
    print(
        main(
            Path(sys.argv[1]) if len(sys.argv) > 1 else None,
            int(sys.argv[2]) if len(sys.argv) > 2 else SEEDS,
        )
    )
