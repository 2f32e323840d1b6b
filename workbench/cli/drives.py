"""`workbench drives`: closed-loop runs of simulated cars as tables, for `conform`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.common import add_output_option, output_folder, write_text
from workbench.cli.output import Progress, emit
from workbench.cli.simulate_subject import (
    add_rig_options,
    chosen_rig,
    chosen_scenario,
    chosen_vehicle,
    require_rig_options,
    require_steerable,
)
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.simulation.conformance.driven_runs import DrivenRun
    from workbench.simulation.scenarios.scenario import Scenario

HELP: Final = (
    "Drives scenarios with the core that runs on the vehicle, over CAN frames in virtual time, and "
    "writes where the car truly was and what its controller's integrals were, as runs.csv and "
    "paths.csv. Every seed draws other actuators and other errors of the sensors. A log of the "
    "monitor in place of a scenario is replayed, and gives what its decisions were told. "
    "vehicle.toml is the file of the simulated car."
)
EXAMPLE: Final = """\
workbench drives nobody_s_bend crossing_straight --seeds 1 20 --out out/drives
workbench drives my_scenario.toml --vehicle shuttle.toml --plant multi-body --seeds 1 5
workbench drives log/drive.mcap --bundle out/bundle --out out/logged
"""
_PLANTS: Final = ("bicycle", "single-track", "multi-body")
_LOGS: Final = (".mcap", ".blf", ".asc", ".log")


def configure(parser: argparse.ArgumentParser) -> None:
    """Which scenarios, which car, how often."""
    parser.add_argument(
        "subjects", nargs="+", metavar="SCENARIO",
        help="names of the library, TOML files, CommonRoad XML, or logs of the monitor",
    )  # fmt: skip
    add_rig_options(
        parser, bundle="built for driving (default: it is built); of logs, the one that made them"
    )
    parser.add_argument(
        "--plant", choices=_PLANTS, default="single-track", help="(default: single-track)"
    )
    parser.add_argument(
        "--seeds", type=int, nargs=2, default=(1, 4), metavar=("FIRST", "LAST"),
        help="one drive per scenario and seed (default: 1 4)",
    )  # fmt: skip
    parser.add_argument(
        "--policy", choices=("both", "LookAhead", "FailSafe"), default="FailSafe",
        help="who decides (default: FailSafe)",
    )  # fmt: skip
    add_output_option(parser, default="out/drives")


def run(args: argparse.Namespace) -> int:
    """Drive, and write both tables."""
    from workbench.simulation.conformance.driven_runs import runs_tables
    from workbench.simulation.simulated import simulated_path

    require_rig_options(args)
    first, last = args.seeds
    if not 0 <= first <= last:
        raise InputError(f"--seeds: expected 0 <= FIRST <= LAST, got {first} and {last}")
    logs = [Path(name) for name in args.subjects if Path(name).suffix in _LOGS]
    names = [name for name in args.subjects if Path(name).suffix not in _LOGS]
    stems = [Path(name).stem for name in args.subjects]
    twice = sorted({stem for stem in stems if stems.count(stem) > 1})
    if twice:
        raise InputError(
            f"SCENARIO: expected every name once, got {', '.join(twice)} twice; a run is known "
            "by its name"
        )
    scenes = [chosen_scenario(name) for name in names]
    for scene, _ in scenes:
        require_steerable(scene, chosen_vehicle(args))
    runs = _logged(args, logs) if logs else []
    runs += _driven(args, [scene for scene, _ in scenes], range(first, last + 1)) if names else []
    with output_folder(args.out) as out:
        for name, text in runs_tables(runs).items():
            write_text(out / name, text)
        if names:
            text = (args.vehicle or simulated_path()).read_text(encoding="utf-8")
            write_text(out / "vehicle.toml", text)
    tracked = sum(int(each.tracking.sum()) for each in runs)
    notes = [note for _, of_scene in scenes for note in of_scene]
    said = f"{len(runs)} runs, {tracked} instants under TRACK: {args.out}/runs.csv"
    data = {
        "out": str(args.out), "runs": len(runs), "tracked_instants": tracked, "notes": notes,
    }  # fmt: skip
    emit(args, "\n".join([said, *notes]), data)
    return 0


def _logged(args: argparse.Namespace, logs: list[Path]) -> list[DrivenRun]:
    from workbench.runtime import load_bundle
    from workbench.simulation.conformance.log_runs import run_from_log

    if args.bundle is None:
        raise InputError(f"--bundle: expected the bundle that made {logs[0]}, got none; add it")
    bundle = load_bundle(args.bundle)
    return [run_from_log(file, bundle) for file in logs]


def _driven(args: argparse.Namespace, scenes: list[Scenario], seeds: range) -> list[DrivenRun]:
    from workbench.runtime import Deciding
    from workbench.simulation.bus_drive import Recorded
    from workbench.simulation.conformance.bus_runs import driven_run
    from workbench.simulation.rig import Trial

    rig, runs = chosen_rig(args), []
    reference_mps = rig.vehicle.operation.reference_speed_mps
    with Progress("drives", len(scenes) * len(seeds)) as bar:
        for scene in scenes:
            for seed in seeds:
                driven = rig.on_bus(
                    Trial(scene, args.plant, seed), deciding=Deciding(args.policy),
                    recorded=Recorded(pages=False),
                )  # fmt: skip
                name = f"{scene.name} {args.plant} {seed}"
                runs.append(driven_run(name, driven, scene, reference_speed_mps=reference_mps))
                bar.advance()
    return runs
