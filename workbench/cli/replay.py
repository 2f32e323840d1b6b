"""`workbench replay`: run a monitor over a recorded drive and report what it decided."""

from __future__ import annotations

import argparse
import hashlib
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from workbench import __version__
from workbench.cli.build import add_grid_options
from workbench.cli.common import (
    add_output_option,
    add_vehicle_option,
    chosen_vehicle,
    writable_folder,
)
from workbench.cli.output import Progress, emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle
    from workbench.report.tables import Table
    from workbench.runtime import Bundle
    from workbench.simulation.replay import ReplayResult, ReplaySettings

HELP = (
    "Runs a monitor over one recording, sample by sample in time order, and writes replay.jsonl "
    "and "
    "report.html. Columns of the recordings: docs/data-format.md. Without --bundle one is built "
    "from "
    "the vehicle's gains and the recording's own shape (analysis extra)."
)
EXAMPLE = """\
workbench replay recordings/kitti --recording kitti_0000 --out out/replay
workbench replay recordings/kitti --recording kitti_0013 --bundle out/bundle
"""
# Verdicts in a row before a release; below five the decision chatters while somebody crosses.
_RELEASE_STEPS = 5
_CLEARANCE_M = 0.2
_GEOMETRY_TOLERANCE_M = 1e-3


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "folder", type=Path, metavar="FOLDER", help="folder with the recordings' CSV files"
    )
    parser.add_argument("--recording", required=True, metavar="NAME", help="name of the recording")
    parser.add_argument(
        "--agent", metavar="NAME", help="which vehicle, where a recording has several"
    )
    parser.add_argument(
        "--bundle", type=Path, metavar="DIR", help="bundle to run (default: build one)"
    )
    add_vehicle_option(parser)
    add_grid_options(parser)
    add_output_option(parser, default="out/replay")


def run(args: argparse.Namespace) -> int:
    """Replay, write log and report, print the summary."""
    from workbench.report.page import write_page
    from workbench.report.replay import ReplayReport, replay_page
    from workbench.runtime import Monitor
    from workbench.simulation.recording import load_recording
    from workbench.simulation.replay import ReplaySettings, replay, replay_path, replay_vehicle
    from workbench.simulation.runlog import write_log

    out = writable_folder(args.out)
    recording = load_recording(args.folder, args.recording, agent=args.agent)
    settings = ReplaySettings.instrumented_car()
    path = replay_path(recording, settings)
    vehicle = replay_vehicle(recording, chosen_vehicle(args), settings)
    bundle = _bundle(args, vehicle)
    monitor = Monitor(bundle, path, release_steps=_RELEASE_STEPS, clearance_required_m=_CLEARANCE_M)
    with Progress("replay", len(recording.vehicle)) as bar:

        def advance(_done: int, _total: int) -> None:
            bar.advance()

        result = replay(recording, monitor, settings=settings, progress=advance)
    table = _settings_table(bundle, settings)
    header = {
        "recording": recording.name,
        "settings": {str(row[0]): row[1] for row in table.rows},
        "notes": result.notes,
    }
    write_log(out / "replay.jsonl", header, result.entries)
    report = ReplayReport(
        recording.name, result.summary_line(), tuple(e.frame for e in result.entries), table,
        (), result.notes, bundle.manifest.assumptions,
    )  # fmt: skip
    command = f"workbench replay FOLDER --recording {recording.name}"
    write_page(
        out / "report.html", replay_page(report, version=__version__, command=command).html()
    )
    emit(args, f"{result.summary_line()}\nlog {out / 'replay.jsonl'}, report {out / 'report.html'}",
         _data(result, out))  # fmt: skip
    return 0


def _bundle(args: argparse.Namespace, vehicle: Vehicle) -> Bundle:
    from workbench.runtime import load_bundle

    if args.bundle is None:
        from workbench.codegen import MonitorSpec, build_bundle

        with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
            spec = MonitorSpec(vehicle, args.horizon, args.step)
            return load_bundle(build_bundle(spec, Path(folder) / "bundle"))
    bundle = load_bundle(args.bundle)
    built, driven = bundle.manifest.vehicle, vehicle.geometry
    for key in ("wheelbase_m", "front_m", "rear_m", "half_width_m"):
        have, want = getattr(built, key), getattr(driven, key)
        if abs(have - want) > _GEOMETRY_TOLERANCE_M:
            raise InputError(
                f"the bundle {args.bundle} is for {built.name} with {key} = {have:g}, the recorded "
                "car has "
                f"{want:g}; leave --bundle out to build one for it, or build one from a vehicle "
                "file with "
                "the recording's shape"
            )
    return bundle


def _settings_table(bundle: Bundle, settings: ReplaySettings) -> Table:
    from workbench.report.tables import Table

    manifest = bundle.manifest
    digest = hashlib.sha256(repr(manifest).encode()).hexdigest()[:16]
    errors = settings.errors
    rows = [
        ("bundle", f"{manifest.name}, manifest {digest}, {manifest.created_by}"),
        ("machine", manifest.machine),
        ("tube", f"{manifest.steps} steps of {manifest.step_s:g} s, rigor {manifest.rigor.name}"),
        ("wheelbase", f"{manifest.vehicle.wheelbase_m:g} m"),
        ("release", f"{_RELEASE_STEPS} SAFE in a row after braking"),
        ("clearance required", f"{_CLEARANCE_M:g} m"),
        ("speed limit", f"samples above {settings.speed_limit_mps:g} m/s are not judged"),
        ("state errors", ", ".join(f"{name} {getattr(errors, name):g}" for name in errors.__slots__
                                   if isinstance(getattr(errors, name), float))),
        ("people", f"constant velocity, growing radius ({settings.people.on_foot.provenance})"),
    ]  # fmt: skip
    return Table("What the replay was run with", ("setting", "value"), tuple(rows))


def _data(result: ReplayResult, out: Path) -> dict[str, object]:
    measures = result.measures
    closest = measures.closest
    return {
        "recording": result.recording,
        "queries": measures.queries,
        "braked_share": measures.braked_share,
        "verdicts": {verdict.value: count for verdict, count in measures.verdicts},
        "smallest_separation_m": closest.separation_m if closest else None,
        "smallest_clearance_m": measures.smallest_clearance_m,
        "decision_median_s": measures.decision_median_s,
        "decision_p99_s": measures.decision_p99_s,
        "samples_too_fast": result.too_fast,
        "log": str(out / "replay.jsonl"),
        "report": str(out / "report.html"),
    }
