"""Several scenarios or the whole library by `workbench simulate`: expected beside found."""

from __future__ import annotations

import argparse
import contextlib
import functools
import itertools
import multiprocessing
import tempfile
import time
from collections.abc import Generator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

from workbench.cli.analysis_options import text_table
from workbench.cli.output import Progress, emit
from workbench.cli.simulate import EVERY, PLANTS, POLICIES
from workbench.cli.simulate_localiser import built_localiser, ranging_of
from workbench.cli.simulate_subject import (
    chosen_rig,
    chosen_scenario,
    chosen_vehicle,
    expected_of,
    require_steerable,
)

if TYPE_CHECKING:
    from workbench.runtime.localiser.folder import Built
    from workbench.simulation.rig import Rig
    from workbench.simulation.told_scores import ToldScores


@final
@dataclass(frozen=True, slots=True)
class Task:
    """One drive: where the bundle and the vehicle file are, and the localiser, None for none; and
    what drives what."""

    bundle: Path
    vehicle: Path
    localiser: Path | None
    scenario: str
    plant: str
    policy: str
    seed: int
    desk: bool


@final
@dataclass(frozen=True, slots=True)
class Row:
    """What came of one drive; faster: than real time, without building; told: by its localiser."""

    scenario: str
    plant: str
    policy: str
    expected: str
    found: str
    as_expected: bool
    faster: float
    told: ToldScores | None = None


def drive_many(args: argparse.Namespace) -> int:
    """Drive all of them and print the table; 1 where one is not as expected."""
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.simulation.scenarios.shipped import library
    from workbench.simulation.simulated import simulated_path

    names = library() if args.all else tuple(dict.fromkeys(args.scenario))
    vehicle = chosen_vehicle(args)
    for name in names:
        require_steerable(chosen_scenario(name)[0], vehicle)
    plant = args.plant or (EVERY if args.all else "single-track")
    plants = PLANTS if plant == EVERY else (plant,)
    policies = POLICIES if args.policy == EVERY else (args.policy,)
    drives = list(itertools.product(names, plants, policies))
    with (
        tempfile.TemporaryDirectory(prefix="workbench-") as place,
        Progress("simulate", len(drives) + 1) as bar,
    ):
        folder = args.bundle or Path(place) / "bundle"
        chosen_rig(args, folder, ranged=args.localiser)
        localiser = Path(place) / "localiser" if args.localiser else None
        if localiser is not None:
            built_localiser(args, localiser)
        bar.advance()
        tasks = [
            Task(folder, args.vehicle or simulated_path(), localiser, name, plant, policy,
                 args.seed, args.desk)
            for name, plant, policy in drives
        ]  # fmt: skip
        rows = []
        with contextlib.closing(_rows(tasks, args.jobs)) as coming:
            for row in coming:
                rows.append(row)
                bar.advance()
    order = {drive: k for k, drive in enumerate(drives)}
    rows.sort(key=lambda row: order[row.scenario, row.plant, row.policy])
    _say(args, rows)
    return DONE if all(row.as_expected for row in rows) else CLAIM_FAILS


def row_of(task: Task) -> Row:
    """Drive it; in whatever process."""
    from workbench.runtime import Deciding
    from workbench.simulation.bus_drive import Recorded
    from workbench.simulation.bus_world import BusSetting
    from workbench.simulation.rig import Trial, outcome_on_bus
    from workbench.simulation.told_scores import ToldScores

    scenario, _ = chosen_scenario(task.scenario)
    told: ToldScores | None = None
    rig, deciding = _rig(task.bundle, task.vehicle), Deciding(task.policy)
    trial, begun_s = Trial(scenario, task.plant, task.seed), time.monotonic()
    if task.desk:
        outcome = rig.at_desk(trial, rig.monitor(deciding))
    else:
        ranging = None if task.localiser is None else ranging_of(_localiser(task.localiser))
        driven = rig.on_bus(
            trial, deciding=deciding, setting=BusSetting(rig.settings.maker, ranging=ranging),
            recorded=Recorded(pages=False),
        )  # fmt: skip
        outcome, told = outcome_on_bus(driven, scenario), ToldScores.of(driven.told)
    expected = expected_of(scenario, task.policy)
    return Row(
        task.scenario, task.plant, task.policy, expected.value, outcome.story,
        outcome.is_as(expected), scenario.duration_s / (time.monotonic() - begun_s), told,
    )  # fmt: skip


@functools.cache
def _rig(bundle: Path, vehicle: Path) -> Rig:
    """Loaded once in each process."""
    from workbench.runtime import load_bundle
    from workbench.simulation.rig import Rig

    return Rig(load_bundle(bundle), chosen_vehicle(argparse.Namespace(vehicle=vehicle)))


@functools.cache
def _localiser(folder: Path) -> Built:
    """Loaded once in each process."""
    from workbench.runtime.localiser.folder import load_localiser

    return load_localiser(folder, public_key=None)


def _rows(tasks: list[Task], jobs: int) -> Generator[Row]:
    """As they come; what is still driven when nobody waits for it any more is ended at once."""
    if jobs == 1:
        yield from map(row_of, tasks)
        return
    # What a forked process would inherit here are threads of libraries that it does not have.
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(min(jobs, len(tasks)), mp_context=context)
    try:
        for future in as_completed([pool.submit(row_of, task) for task in tasks]):
            yield future.result()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for each in set(multiprocessing.active_children()) - others:
            each.terminate()
        raise
    pool.shutdown()


def _say(args: argparse.Namespace, rows: list[Row]) -> None:
    headings = ["scenario", "plant", "policy", "expected", "as expected", "found"]
    if args.localiser:
        headings += ["place off, 95 % and most, m", "radius, 95 % and most, m", "held"]
    cells: list[list[str | int | float | None]] = [
        [
            row.scenario,
            row.plant,
            row.policy,
            row.expected,
            "yes" if row.as_expected else "NO",
            row.found,
            *(_told(row.told) if args.localiser else ()),
        ]
        for row in rows
    ]
    good = sum(row.as_expected for row in rows)
    pace = sum(row.faster for row in rows) / len(rows)
    ending = (
        f"{good} of {len(rows)} drives are as expected; on average {pace:.1f} "
        "times as fast as real time, each in one process"
    )
    data = {"seed": args.seed, "as_expected": good, "rows": rows}
    emit(args, f"{text_table(headings, cells)}\n\n{ending}", data)


def _told(scores: ToldScores | None) -> tuple[str, str, str]:
    """What the localiser told, and how true it was."""
    if scores is None:
        return "", "", "no set"
    error, radius = scores.error_m, scores.radius_m
    return (
        f"{error.most:.3f}, {error.worst:.3f}", f"{radius.most:.3f}, {radius.worst:.3f}",
        f"{100 * scores.holding:.4g} %",
    )  # fmt: skip
