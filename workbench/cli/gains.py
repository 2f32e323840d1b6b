"""`workbench gains`: what a vehicle's gains do to poles, margins and the tube."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

from workbench.cli.analysis_options import (
    Subject,
    add_file_option,
    add_time_options,
    check_steps,
    text_table,
    writable_file,
)
from workbench.cli.common import add_vehicle_option, chosen_vehicle, writable_folder
from workbench.cli.gains_options import add_gain_options, changed_vehicle, check_gain_options
from workbench.cli.gains_robust import add_robust, run_robust
from workbench.cli.gains_sweep import add_sweep, run_sweep
from workbench.cli.output import emit, warn
from workbench.cli.reach import half_width_text, tube_data

if TYPE_CHECKING:
    from workbench.models.control_view import Margins, QuickStudy
    from workbench.models.vehicle import Vehicle
    from workbench.report.curves import TubeCurves

HELP = (
    "Shows poles and margins of a vehicle's TRACK loop, linearised on a straight path at reference "
    "speed, and the tube of the full loop. With --full also margins over speed, exact stability "
    "maps, and the loop at samples with delay and jitter; --plot draws all of it. Warns, and names "
    "the poles, when the gains make the loop unstable; the exit status stays 0 then. `sweep` and "
    "`recommend` (see their --help) score many gains by a study file and decide; `robust` is about "
    "cars that differ from the vehicle file."
)
EXAMPLE = """\
workbench gains --quick
workbench gains --quick --vehicle my_shuttle.toml --json
workbench gains --kp 0.3 --kd 1.5 --no-tube --plot out/gains.html
workbench gains --full --speeds 0.5 5 --rate 20 --jitter 0.004 --csv out/gains
workbench gains sweep studies/steering_gains.toml --out out/steering-gains --jobs 2
workbench gains recommend --out out/steering-gains
workbench gains robust --wheelbase 1.7 1.8 --speed-scale 0.97 1.03 --delay 0 0.05
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Vehicle, gains, depth of the study, the tube's time grid, and the files to write."""
    add_vehicle_option(parser)
    parser.add_argument(
        "--quick",
        action="store_true",
        default=True,
        help="poles, margins and one tube for the gains as they are (this is the default)",
    )
    parser.add_argument("--full", action="store_true", help="the full study as well")
    add_gain_options(parser)
    parser.add_argument(
        "--no-tube", action="store_true", help="leave the tube out; it takes longest"
    )
    add_time_options(parser, step_s=0.05)
    add_file_option(parser, "--plot", text="write the full study as a page")
    parser.add_argument(
        "--csv", type=Path, metavar="DIR", help="write the full study's numbers, one file per table"
    )
    add_robust(add_sweep(parser))


def run(args: argparse.Namespace) -> int:
    """Show the study; warnings go to standard error. The sub-commands do their own work."""
    if args.work == "robust":
        return run_robust(args)
    if args.work is not None:
        return run_sweep(args)
    args.full = bool(args.full or args.plot or args.csv)
    check_steps(args)
    check_gain_options(args)
    writable_file(args.plot, "--plot")
    vehicle = changed_vehicle(args, chosen_vehicle(args))
    if args.csv:
        writable_folder(args.csv)
    from workbench.models.control_view import quick_study

    quick = quick_study(vehicle)
    tube = None if args.no_tube else _Tube.of(args, vehicle)
    texts, data = [_quick_text(quick)], _data(quick)
    if tube is not None:
        texts.append(tube.text)
        data |= {"tube": tube.data}
    if args.full:
        text, more = _full(args, vehicle, quick, tube)
        texts.append(text)
        data |= more
    emit(args, "\n\n".join(texts), data)
    for warning in quick.warnings:
        warn(warning)
    if tube is not None and tube.ended:
        warn(f"{tube.ended}; the gains, a large initial set or a long step can be the cause")
    return 0


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Tube:
    """The tube as text, as data and as curves (None where it has no step); ended: where too
    early."""

    text: str
    data: dict[str, object]
    curves: TubeCurves | None
    ended: str

    @classmethod
    def of(cls, args: argparse.Namespace, vehicle: Vehicle) -> _Tube:
        from workbench.cli.analysis_results import ending, tube_curves, tube_of
        from workbench.models.bicycle import PathFrame

        loop = vehicle.closed_loop(vehicle.track(), PathFrame(0.0, 0.0))
        subject = Subject(vehicle.name, loop, vehicle.initial_set, vehicle.operation.region)
        tube = tube_of(subject, horizon_s=args.horizon, step_s=args.step)
        text = "\n".join(
            [
                "half widths of the set of reachable states",
                half_width_text(subject, tube, horizon_s=args.horizon),
                ending(tube),
            ]
        )
        return cls(
            text,
            tube_data(tube, horizon_s=args.horizon),
            tube_curves(tube, loop.ode) if len(tube.lower) else None,
            "" if tube.complete else ending(tube),
        )


def _full(
    args: argparse.Namespace, vehicle: Vehicle, quick: QuickStudy, tube: _Tube | None
) -> tuple[str, dict[str, object]]:
    """Text and data of the full study; writes its files."""
    from workbench.cli.gains_study import (
        full_study,
        study_data,
        study_text,
        write_gains_page,
        write_tables,
    )

    study = full_study(args, vehicle)
    files: list[Path] = []
    if args.csv:
        files += write_tables(args.csv, study)
    if args.plot:
        write_gains_page(args, study, quick, tube.curves if tube else None)
        files.append(args.plot)
    said = [study_text(study), *(f"wrote {each}" for each in (args.plot, args.csv) if each)]
    return "\n".join(said), {"study": study_data(study), "files": files}


def _quick_text(study: QuickStudy) -> str:
    return "\n".join(
        [
            f"{study.vehicle} on a straight path at {study.speed_mps:g} m/s: "
            f"{study.verdict.message}",
            "",
            _pole_text(study),
            "",
            _margin_text(study),
        ]
    )


def _pole_text(study: QuickStudy) -> str:
    return text_table(
        ["pole (1/s)", "imaginary", "time constant (s)", "damping"],
        [
            [
                pole.real,
                pole.imag,
                -1.0 / pole.real if pole.real < 0.0 else None,
                -pole.real / abs(pole) if abs(pole) > 0.0 else None,
            ]
            for pole in study.poles
        ],
    )


def _margin_text(study: QuickStudy) -> str:
    def row(name: str, found: Margins) -> list[str | int | float | None]:
        phase = found.phase_margin_deg
        return [
            name,
            found.gain_margin,
            phase if math.isfinite(phase) else None,
            found.delay_margin_s,
            found.crossover_radps,
        ]

    headings = [
        "loop",
        "gain margin (factor)",
        "phase margin (deg)",
        "delay margin (s)",
        "crossover (rad/s)",
    ]
    rows = [row("steering", study.steering_margins), row("speed", study.speed_margins)]
    if not study.verdict.stable:
        note = ["(margins mean nothing for an unstable loop)"]
    elif min(study.steering_margins.gain_margin, study.speed_margins.gain_margin) < 1.0:
        note = ["(a gain margin below 1: the loop gain may fall to this share, and no further)"]
    else:
        note = []
    return "\n".join([text_table(headings, rows), *note])


def _data(study: QuickStudy) -> dict[str, object]:
    def poles(values: tuple[complex, ...]) -> list[dict[str, float]]:
        return [{"real": pole.real, "imaginary": pole.imag} for pole in values]

    return {
        "name": study.vehicle,
        "speed_mps": study.speed_mps,
        "stable": study.verdict.stable,
        "poles": poles(study.poles),
        "poles_not_stable": poles(study.verdict.offending),
        "steering_margins": study.steering_margins,
        "speed_margins": study.speed_margins,
        "warnings": study.warnings,
    }
