"""`workbench gains`: what a vehicle's gains do to poles, margins and the tube."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from workbench.cli.analysis_options import (
    Subject,
    add_time_options,
    check_steps,
    text_table,
)
from workbench.cli.common import add_vehicle_option, chosen_vehicle
from workbench.cli.output import emit, warn
from workbench.cli.reach import half_width_text, tube_data

if TYPE_CHECKING:
    from workbench.models.control_view import Margins, QuickStudy

HELP = (
    "Shows poles and margins of a vehicle's TRACK loop, linearised on a straight path at reference "
    "speed, and the tube of the full loop. Warns, and names the poles, when the gains make it "
    "unstable; the exit status stays 0 then."
)
EXAMPLE = """\
workbench gains --quick
workbench gains --quick --vehicle my_shuttle.toml --json
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Vehicle, depth of the study, and the tube's time grid."""
    add_vehicle_option(parser)
    parser.add_argument(
        "--quick",
        action="store_true",
        default=True,
        help="poles, margins and one tube for the gains as they are (this is the default)",
    )
    add_time_options(parser, step_s=0.05)


def run(args: argparse.Namespace) -> int:
    """Show the study; warnings go to standard error."""
    check_steps(args)
    vehicle = chosen_vehicle(args)
    from workbench.cli.analysis_results import ending, tube_of
    from workbench.models.bicycle import PathFrame
    from workbench.models.control_view import quick_study

    study = quick_study(vehicle)
    loop = vehicle.closed_loop(vehicle.track(), PathFrame(0.0, 0.0))
    subject = Subject(vehicle.name, loop, vehicle.initial_set, vehicle.operation.region)
    tube = tube_of(subject, horizon_s=args.horizon, step_s=args.step)
    text = "\n".join(
        [
            f"{study.vehicle} on a straight path at {study.speed_mps:g} m/s: "
            f"{study.verdict.message}",
            "",
            _pole_text(study),
            "",
            _margin_text(study),
            "",
            "half widths of the set of reachable states",
            half_width_text(subject, tube, horizon_s=args.horizon),
            ending(tube),
        ]
    )
    emit(args, text, _data(study) | {"tube": tube_data(tube, horizon_s=args.horizon)})
    for warning in study.warnings:
        warn(warning)
    if not tube.complete:
        warn(f"{ending(tube)}; the gains, a large initial set or a long step can be the cause")
    return 0


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
