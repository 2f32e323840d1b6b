"""`workbench replay`: run a monitor over a recorded drive, or over a log of the vehicle's."""

from __future__ import annotations

import argparse
import hashlib
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from workbench import __version__
from workbench.cli.analysis_options import command_line
from workbench.cli.build import add_grid_options, check_grid
from workbench.cli.common import (
    CLEARANCE_REQUIRED_M,
    MONITOR_STEP_S,
    RELEASE_STEPS,
    add_output_option,
    add_vehicle_option,
    chosen_vehicle,
    output_folder,
)
from workbench.cli.output import Progress, emit
from workbench.cli.replay_people import add_people_options, chosen_people, require_people_options
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle
    from workbench.report.tables import Table
    from workbench.runtime import Bundle, Timing
    from workbench.runtime.manifest import Manifest
    from workbench.runtime.path import PathTable
    from workbench.simulation.people_sources import PeopleSource
    from workbench.simulation.recording import Recording
    from workbench.simulation.replay import ReplayResult, ReplaySettings

HELP = (
    "A folder of recordings: runs a monitor over one of them, sample by sample in time order, and "
    "writes replay.jsonl and report.html. Columns of the recordings: docs/data-format.md. Without "
    "--bundle one is built from the vehicle's gains and the recording's own shape. LookAhead "
    "decides, whatever the bundle names: the recorded car does not obey, so FailSafe is only asked "
    "beside. Needs the analysis extra with or without --bundle, to read recordings and to draw the "
    "report. A log of workbench-monitor (.mcap, .blf, .asc, candump's .log): gives a core what the "
    "one on the vehicle got, and holds every decision and frame against the log; exit status 1 "
    "where they differ; needs the base install only. With --topics a ROS 1 or 2 bag is a "
    "recording. Both: docs/logs.md."
)
EXAMPLE = """\
workbench replay recordings/kitti --recording kitti_0000 --out out/replay
workbench replay recordings/kitti --recording kitti_0013 --bundle out/bundle
workbench replay drive/monitor.mcap --bundle out/bundle
workbench replay recordings/kitti --recording kitti_0016 --people intents --guard fitted
workbench replay elsewhere/candump.log --bundle out/bundle --run drive/run.json
workbench replay drive.bag --topics topics.toml --out out/replay
"""
_DEFAULT_OUT = "out/replay"
_GEOMETRY_TOLERANCE_M = 1e-3


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "subject",
        type=Path,
        metavar="FOLDER|LOG|BAG",
        help="folder with the recordings' CSV files, a log, or a ROS bag",
    )
    parser.add_argument("--recording", metavar="NAME", help="name of the recording")
    parser.add_argument(
        "--agent", metavar="NAME", help="which vehicle, where a recording has several"
    )
    parser.add_argument(
        "--bundle", type=Path, metavar="DIR", help="bundle to run (default: build one)"
    )
    parser.add_argument(
        "--topics", type=Path, metavar="FILE", help="which topics of a ROS bag to take, TOML"
    )
    parser.add_argument(
        "--run",
        type=Path,
        metavar="FILE",
        help="the run.json of a log that it does not lie beside",
    )
    add_people_options(parser)
    add_vehicle_option(parser)
    add_grid_options(parser)
    # Not given: told apart from given, because a bundle brings its own.
    parser.set_defaults(horizon=None, step=None)
    add_output_option(parser, default=_DEFAULT_OUT)


def run(args: argparse.Namespace) -> int:
    """Check the input, then replay, write log and report, and print the summary."""
    from workbench.cli.replay_subject import is_log, recording_of, require_log_options

    if is_log(args):
        from workbench.cli.replay_log import replay_log

        require_log_options(args, default_out=Path(_DEFAULT_OUT))
        return replay_log(args)
    require_people_options(args)
    _complete_grid(args)
    return _run_recording(args, recording_of(args))


def _run_recording(args: argparse.Namespace, recording: Recording) -> int:
    from workbench.simulation.replay import replay_path, replay_timing, replay_vehicle

    base = chosen_vehicle(args)
    settings = _settings(base)
    path = replay_path(recording, settings)
    vehicle = replay_vehicle(recording, base, settings)
    given = None if args.bundle is None else _given_bundle(args.bundle, vehicle)
    with output_folder(args.out) as out:
        bundle = given or _built_bundle(args, vehicle)
        people = chosen_people(args, recording, settings, bundle)
        result = _replayed(recording, (path, people), bundle, settings)
        table = _settings_table(bundle, settings, replay_timing(recording), people)
        _write(args, out, result, table, bundle)
    emit(args, f"{result.summary_line()}\nlog {out / 'replay.jsonl'}, report {out / 'report.html'}",
         _data(result, out))  # fmt: skip
    return 0


def _complete_grid(args: argparse.Namespace) -> None:
    """Fill in the grid of a bundle that is to be built; one that is given has its own."""
    if args.bundle is None:
        args.horizon = 3.0 if args.horizon is None else args.horizon
        args.step = MONITOR_STEP_S if args.step is None else args.step
        check_grid(args)
    elif args.horizon is not None or args.step is not None:
        raise InputError(
            "--bundle: expected neither --horizon nor --step beside it, the bundle was built with "
            "its own; leave them out, or leave --bundle out to build one"
        )


def _settings(vehicle: Vehicle) -> ReplaySettings:
    from workbench.runtime import MotionLimits
    from workbench.simulation.replay import ReplaySettings

    guard = vehicle.guard
    return ReplaySettings.instrumented_car(MotionLimits(guard.speed_max_mps, guard.accel_max_mps2))


def _replayed(
    recording: Recording,
    scene: tuple[PathTable, PeopleSource | None],
    bundle: Bundle,
    settings: ReplaySettings,
) -> ReplayResult:
    """scene: the path, and where people come from."""
    from workbench.runtime import Deciding, Monitor
    from workbench.simulation.clock import SetClock
    from workbench.simulation.replay import replay, replay_timing

    (path, people), clock = scene, SetClock()
    monitor = Monitor(
        bundle, path, release_steps=RELEASE_STEPS, clearance_required_m=CLEARANCE_REQUIRED_M,
        timing=replay_timing(recording), deciding=Deciding.LOOK_AHEAD, clock=clock,
    )  # fmt: skip
    with Progress("replay", len(recording.vehicle)) as bar:

        def advance(_done: int, _total: int) -> None:
            bar.advance()

        return replay(
            recording, monitor, clock=clock, settings=settings, people=people, progress=advance
        )


def _write(
    args: argparse.Namespace, out: Path, result: ReplayResult, table: Table, bundle: Bundle
) -> None:
    from workbench.report.page import write_page
    from workbench.report.replay import ReplayReport, replay_page
    from workbench.simulation.replay import OPEN_LOOP
    from workbench.simulation.runlog import write_log

    # The page says on its own, and first of all, that replay is open-loop.
    notes = tuple(note for note in result.notes if note != OPEN_LOOP)
    header = {
        "recording": result.recording,
        "settings": {str(row[0]): row[1] for row in table.rows},
        "notes": result.notes,
        "levels": {level.name: level.share for level in bundle.manifest.levels},
    }
    write_log(out / "replay.jsonl", header, result.entries)
    report = ReplayReport(
        result.recording, result.summary_line(), tuple(e.frame for e in result.entries), table,
        (), notes, bundle.manifest.assumptions,
    )  # fmt: skip
    command = command_line("replay", args, positional=("subject",))
    write_page(
        out / "report.html", replay_page(report, version=__version__, command=command).html()
    )


def _built_bundle(args: argparse.Namespace, vehicle: Vehicle) -> Bundle:
    from workbench.codegen import MonitorSpec, build_bundle
    from workbench.runtime import load_bundle

    spec = MonitorSpec(vehicle, args.horizon, args.step)
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        return load_bundle(build_bundle(spec, Path(folder) / "bundle"))


def _given_bundle(folder: Path, vehicle: Vehicle) -> Bundle:
    from workbench.runtime import load_bundle

    bundle = load_bundle(folder)
    built, driven = bundle.manifest.vehicle, vehicle.geometry
    for key in ("wheelbase_m", "front_m", "rear_m", "half_width_m"):
        have, want = getattr(built, key), getattr(driven, key)
        if abs(have - want) > _GEOMETRY_TOLERANCE_M:
            raise InputError(
                f"the bundle {folder} is for {built.name} with {key} = {have:g}, the recorded "
                "car has "
                f"{want:g}; leave --bundle out to build one for it, or build one from a vehicle "
                "file with "
                "the recording's shape"
            )
    return bundle


def _settings_table(
    bundle: Bundle, settings: ReplaySettings, timing: Timing, people: PeopleSource | None
) -> Table:
    from workbench.report.tables import Table

    manifest = bundle.manifest
    digest = hashlib.sha256(repr(manifest).encode()).hexdigest()[:16]
    errors = settings.errors
    rows = [
        ("bundle", f"{manifest.name}, manifest {digest}, {manifest.created_by}"),
        ("machine", manifest.machine),
        ("tube", f"{manifest.steps} steps of {manifest.step_s:g} s, rigor {manifest.rigor.name}"),
        ("nested sets", ", ".join(f"{level.name} ({level.share:.3g})" for level in manifest.levels)
         + f"; {manifest.deciding_level} decides"),
        ("deciding policy", f"LookAhead (the bundle names {manifest.deciding})"),
        ("times", f"period {timing.period_s:g} s, check {timing.latency_s:g} s, "
         f"sender {timing.send_gap_s:.3g} s"),
        ("standstill", f"within the tube from up to {_stopped_mps(manifest, timing):.1f} m/s; from "
         "more, FailSafe proves nothing, and everybody is alerted"),
        ("wheelbase", f"{manifest.vehicle.wheelbase_m:g} m"),
        ("release", f"{RELEASE_STEPS} SAFE in a row after braking"),
        ("clearance required", f"{CLEARANCE_REQUIRED_M:g} m"),
        ("speed limit", f"samples above {settings.speed_limit_mps:g} m/s are not judged"),
        ("state errors", ", ".join(f"{name} {getattr(errors, name):g}" for name in errors.__slots__
                                   if isinstance(getattr(errors, name), float))),
        ("people", _told(people) or
         f"constant velocity, growing radius ({settings.people.on_foot.provenance})"),
        ("guard", f"{people.guard_note if people else _limits(settings)}; beyond what is watched "
         f"{manifest.guard_speed_max_mps:g} m/s"),
        ("watched", f"everybody within {settings.watched_m:g} m is taken to be recorded"),
    ]  # fmt: skip
    return Table("What the replay was run with", ("setting", "value"), tuple(rows))


def _told(people: PeopleSource | None) -> str:
    return "" if people is None else people.intent_note


def _limits(settings: ReplaySettings) -> str:
    return (
        f"{settings.limits.speed_mps:g} m/s on foot, "
        f"{settings.people.on_wheels.unseen_speed_mps:g} m/s on wheels, "
        f"{settings.limits.acceleration_mps2:g} m/s^2"
    )


def _stopped_mps(manifest: Manifest, timing: Timing) -> float:
    """The speed from which TRACK until the last switch, then BRAKE ends with the horizon."""
    brake = manifest.brake
    until_s = timing.switch_s[1] + brake.delay_s + brake.build_up_s
    return max(manifest.horizon_s - until_s, 0.0) * brake.deceleration_min_mps2


def _data(result: ReplayResult, out: Path) -> dict[str, object]:
    measures = result.measures
    closest = measures.closest
    return {
        "recording": result.recording,
        "queries": measures.queries,
        "braked_share": measures.braked_share,
        "verdicts": {verdict.value: count for verdict, count in measures.verdicts},
        "safe_shares": dict(measures.safe_shares),
        "violations": dict(measures.violations),
        "alerts": measures.alerts,
        "smallest_separation_m": closest.separation_m if closest else None,
        "smallest_clearance_m": measures.smallest_clearance_m,
        "decision_median_s": measures.decision_median_s,
        "decision_p99_s": measures.decision_p99_s,
        "samples_too_fast": result.too_fast,
        "log": str(out / "replay.jsonl"),
        "report": str(out / "report.html"),
    }
