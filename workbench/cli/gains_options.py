"""Options of `workbench gains`: which gains, over which speeds and ranges, with which timing."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import count, number, positive
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.controllers.sampling import Sampling
    from workbench.models.gains.study import Effort
    from workbench.models.vehicle import Vehicle

# Written out because `--help` has to work without the analysis extra.
AXES: Final = ("speed", "look-ahead", "kp", "ki", "kd")
_UNITS: Final = {
    "speed": "m/s, instead of the reference speed",
    "look-ahead": "m",
    "kp": "rad/(s m)",
    "ki": "rad/(s^2 m)",
    "kd": "rad/m",
}
RATE_HZ, JITTER_S, DELAY_S = 30.0, 0.005, 0.05
_MOST_POINTS: Final = 401
_FULL_ONLY: Final = (
    "speeds", "range", "points", "rate", "jitter", "drift", "measured_dt", "measurement_delay",
    "actuation_delay",
)  # fmt: skip


def add_gain_options(parser: argparse.ArgumentParser) -> None:
    """Values of gains, and all that the full study takes."""
    for name in AXES:
        parser.add_argument(
            f"--{name}", type=number, metavar="X",
            help=f"this value in {_UNITS[name]} (default: the vehicle file's)",
        )  # fmt: skip
    parser.add_argument(
        "--speeds", nargs=2, type=positive, metavar=("LOW", "HIGH"),
        help="full study: speeds in m/s (default: 0.3 to the operating region's highest)",
    )  # fmt: skip
    parser.add_argument(
        "--range", nargs=3, action="append", metavar=("AXIS", "LOW", "HIGH"),
        help=f"full study: range of a map's axis, one of {', '.join(AXES)}; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--points", type=count, metavar="N", help="full study: lines per map (default: 61)"
    )
    _add_timing(parser)


def _add_timing(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--rate", type=positive, metavar="HZ",
        help=f"full study: samples per second (default: {RATE_HZ:g})",
    )  # fmt: skip
    parser.add_argument(
        "--jitter", type=number, metavar="S",
        help=f"full study: +- this, of each sample, in s (default: {JITTER_S:g})",
    )  # fmt: skip
    parser.add_argument(
        "--drift", action="store_true",
        help="full study: jitter adds up from sample to sample; else samples sit on a clock",
    )  # fmt: skip
    parser.add_argument(
        "--measured-dt", action="store_true",
        help="full study: integrals step by the time that really passed; else by the period",
    )  # fmt: skip
    for name, default in (("measurement", 0.0), ("actuation", DELAY_S)):
        parser.add_argument(
            f"--{name}-delay", nargs=2, type=number, metavar=("LOW", "HIGH"),
            help=f"full study: in s, each time anew (default: {default:g} {default:g})",
        )  # fmt: skip


def check_gain_options(args: argparse.Namespace) -> None:
    """Raise InputError on what cannot be, and on options that would do nothing."""
    if not args.full:
        given = [name for name in _FULL_ONLY if getattr(args, name) not in (None, False)]
        if given:
            raise InputError(
                f"--{given[0].replace('_', '-')}: expected --full, --plot or --csv beside it; "
                "add one"
            )
    if args.speeds is not None and not args.speeds[0] < args.speeds[1]:
        raise InputError(
            f"--speeds: expected LOW < HIGH, got {args.speeds[0]:g} {args.speeds[1]:g}; swap them"
        )
    if args.speed is not None and not args.speed > 0.0:
        raise InputError(f"--speed: expected a speed > 0 in m/s, got {args.speed:g}")
    if args.look_ahead is not None and args.look_ahead < 0.0:
        raise InputError(f"--look-ahead: expected a distance >= 0 in m, got {args.look_ahead:g}")
    if args.points is not None and not 2 <= args.points <= _MOST_POINTS:
        raise InputError(f"--points: expected 2 to {_MOST_POINTS}, got {args.points}")
    chosen_ranges(args)
    _check_timing(args)


def _check_timing(args: argparse.Namespace) -> None:
    period, jitter = 1.0 / (args.rate or RATE_HZ), _jitter(args)
    if not 0.0 <= jitter < period / 2.0:
        raise InputError(
            f"--jitter: expected 0 or more and less than half the period, {period / 2.0:.4g} s, "
            f"got {jitter:g}; lessen the jitter or the rate"
        )
    for name in ("measurement", "actuation"):
        low, high = getattr(args, f"{name}_delay") or (0.0, 0.0)
        if not 0.0 <= low <= high:
            raise InputError(
                f"--{name}-delay: expected 0 <= LOW <= HIGH, in s, got {low:g} {high:g}; "
                "give the shortest delay, then the longest"
            )


def _jitter(args: argparse.Namespace) -> float:
    return JITTER_S if args.jitter is None else float(args.jitter)


def changed_gains(args: argparse.Namespace) -> dict[str, float]:
    """The values given instead of the vehicle file's, by axis."""
    values = {name: getattr(args, name.replace("-", "_")) for name in AXES}
    return {name: float(value) for name, value in values.items() if value is not None}


def changed_vehicle(args: argparse.Namespace, vehicle: Vehicle) -> Vehicle:
    """The vehicle with the gains and the reference speed of the options."""
    import dataclasses

    given, now = changed_gains(args), vehicle.steering_pid
    gains = dataclasses.replace(
        now,
        proportional_radps_per_m=given.get("kp", now.proportional_radps_per_m),
        integral_radps_per_ms=given.get("ki", now.integral_radps_per_ms),
        derivative_rad_per_m=given.get("kd", now.derivative_rad_per_m),
        look_ahead_m=given.get("look-ahead", now.look_ahead_m),
    )
    operation = vehicle.operation
    if "speed" in given:
        operation = dataclasses.replace(operation, reference_speed_mps=given["speed"])
    return dataclasses.replace(vehicle, steering_pid=gains, operation=operation)


def chosen_ranges(args: argparse.Namespace) -> dict[str, tuple[float, float]]:
    """The maps' ranges that `--range` gives."""
    found: dict[str, tuple[float, float]] = {}
    for name, *ends in args.range or ():
        if name not in AXES:
            raise InputError(f"--range: expected AXIS, one of {', '.join(AXES)}, got {name!r}")
        try:
            low, high = (number(end) for end in ends)
        except argparse.ArgumentTypeError as error:
            raise InputError(f"--range {name}: {error}") from None
        if not low < high:
            raise InputError(
                f"--range {name}: expected LOW < HIGH, got {low:g} {high:g}; swap them"
            )
        if name == "look-ahead" and low < 0.0:
            raise InputError(f"--range look-ahead: expected distances >= 0 in m, got {low:g}")
        found[name] = (low, high)
    return found


def chosen_timing(args: argparse.Namespace) -> Sampling:
    """What the options say about the controller's samples."""
    from workbench.controllers.sampling import IntegralStep, Jitter, Sampling

    return Sampling(
        period_s=1.0 / (args.rate or RATE_HZ),
        jitter_s=_jitter(args),
        jitter=Jitter.DRIFT if args.drift else Jitter.CLOCK,
        measurement_delay_s=tuple(args.measurement_delay or (0.0, 0.0)),
        actuation_delay_s=tuple(args.actuation_delay or (DELAY_S, DELAY_S)),
        integral_step=IntegralStep.MEASURED if args.measured_dt else IntegralStep.NOMINAL,
    )


def chosen_effort(args: argparse.Namespace) -> Effort:
    """How many lines per map."""
    from workbench.models.gains.study import Effort

    return Effort() if args.points is None else Effort(points=args.points)
