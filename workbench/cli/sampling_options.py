"""Options of `workbench reach --sampled`: when the controller reads and acts, and what was sent."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import Subject, number, positive
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.controllers.sampling import Sampling, SentCommand
    from workbench.models.system import Ode

_RATE_HZ: Final = 30.0
_DELAY_S: Final = 0.05
_LONGEST_PERIOD_S: Final = 60.0
_MOST_PERIODS: Final = 20_000
_MOST_PERIODS_LATE: Final = 200
_DRIVEN: Final = ("steering", "speed")
# Options, the names that limits carry in a loop, and units.
_COMMANDS: Final = (
    ("STEERING_RATE", "steering_rate", "rad/s"),
    ("ACCELERATION", "acceleration", "m/s^2"),
)
_NEEDS_SAMPLED: Final = (
    "rate",
    "jitter",
    "drift",
    "measured_dt",
    "measurement_delay",
    "actuation_delay",
    "sent",
)


def add_sampling_options(parser: argparse.ArgumentParser) -> None:
    """Add `--sampled` and all that says when the controller reads and acts."""
    parser.add_argument(
        "--sampled",
        action="store_true",
        help="the PID as it runs on the car, at samples with held commands, beside the continuous "
        "one; rows then follow the period, not --step",
    )
    parser.add_argument(
        "--rate", type=positive, metavar="HZ", help=f"samples per second (default: {_RATE_HZ:g})"
    )
    parser.add_argument(
        "--jitter", type=number, metavar="S", help="+- this, of each sample, in s (default: 0)"
    )
    parser.add_argument(
        "--drift",
        action="store_true",
        help="jitter from sample to sample, so that it adds up; else samples sit on a clock",
    )
    parser.add_argument(
        "--measured-dt",
        action="store_true",
        help="integrals step by the time that really passed; else by the nominal period",
    )
    for name, default in (("measurement", 0.0), ("actuation", _DELAY_S)):
        parser.add_argument(
            f"--{name}-delay",
            nargs=2,
            type=number,
            metavar=("LOW", "HIGH"),
            help=f"in s, any value in between, each time anew (default: {default:g} {default:g})",
        )
    parser.add_argument(
        "--sent",
        nargs=2,
        type=number,
        metavar=("STEERING_RATE", "ACCELERATION"),
        help="the commands sent before t = 0, in rad/s and m/s^2 (default: what the controller "
        "asks for in the middle of the initial set)",
    )


def check_sampling(args: argparse.Namespace) -> None:
    """Raise InputError where sampling is described and not asked for, or asked for in vain."""
    given = [name for name in _NEEDS_SAMPLED if getattr(args, name) not in (None, False)]
    if given and not args.sampled:
        raise InputError(f"--{given[0].replace('_', '-')}: expected --sampled beside it; add it")
    if args.sampled and args.switch_at is not None:
        raise InputError("expected --sampled or --switch-at, got both; leave one of them out")
    if args.sampled:
        _check_times(args)


def _check_times(args: argparse.Namespace) -> None:
    """What `Sampling` refuses too, in the words of the options, and runs that would not end."""
    rate_hz, jitter_s = args.rate or _RATE_HZ, args.jitter or 0.0
    if rate_hz * _LONGEST_PERIOD_S < 1.0:
        raise InputError(
            f"--rate: expected a period of at most {_LONGEST_PERIOD_S:g} s, got {rate_hz:g} Hz; "
            "give a higher rate"
        )
    if not 0.0 <= jitter_s < 0.5 / rate_hz:
        raise InputError(
            f"--jitter: expected 0 or more and less than half the period, {0.5 / rate_hz:.4g} s, "
            f"got {jitter_s:g}; lessen the jitter or the rate"
        )
    if args.drift and not jitter_s:
        raise InputError("--drift: expected --jitter beside it, got none; add it, or leave it out")
    delays = [args.measurement_delay or (0.0, 0.0), args.actuation_delay or (_DELAY_S, _DELAY_S)]
    for name, (low, high) in zip(("measurement", "actuation"), delays, strict=True):
        if not 0.0 <= low <= high:
            raise InputError(
                f"--{name}-delay: expected 0 <= LOW <= HIGH, in s, got {low:g} {high:g}; "
                "give the shortest delay, then the longest"
            )
    late_s = sum(high for _, high in delays)
    for what, time_s, most in (
        ("the horizon", args.horizon, _MOST_PERIODS),
        ("both delays", late_s, _MOST_PERIODS_LATE),
    ):
        if rate_hz * time_s > most:
            raise InputError(
                f"expected at most {most} periods in {what}, got {rate_hz * time_s:.4g} at --rate "
                f"{rate_hz:g}; lower the rate, or shorten the time"
            )


def chosen_sampling(args: argparse.Namespace) -> Sampling:
    """What the options say about timing."""
    from workbench.controllers.sampling import IntegralStep, Jitter, Sampling

    return Sampling(
        period_s=1.0 / (args.rate or _RATE_HZ),
        jitter_s=args.jitter or 0.0,
        jitter=Jitter.DRIFT if args.drift else Jitter.CLOCK,
        measurement_delay_s=tuple(args.measurement_delay or (0.0, 0.0)),
        actuation_delay_s=tuple(args.actuation_delay or (_DELAY_S, _DELAY_S)),
        integral_step=IntegralStep.MEASURED if args.measured_dt else IntegralStep.NOMINAL,
    )


def chosen_sent(
    args: argparse.Namespace, subject: Subject, sampling: Sampling
) -> tuple[SentCommand, ...]:
    """The commands sent before t = 0. Raises InputError on some that no actuator follows."""
    from workbench.controllers.sampling import SentCommand

    ode = subject.system.ode
    if args.sent is not None:
        _check_sent(args.sent, ode)
        return (SentCommand.exactly(*args.sent),) * sampling.commands_sent
    center = list(subject.initial_set.reordered(ode.names).center)
    nominal = [disturbance.nominal for disturbance in ode.disturbances]
    rates = ode.function()(center, ode.parameter_values(), nominal).full().ravel()
    command = SentCommand.exactly(*(float(rates[ode.names.index(n)]) for n in _DRIVEN))
    return (command,) * sampling.commands_sent


def _check_sent(sent: list[float], ode: Ode) -> None:
    limits = {parameter.name: parameter for parameter in ode.parameters}
    for value, (what, name, unit) in zip(sent, _COMMANDS, strict=True):
        low, high = limits.get(f"{name}_min"), limits.get(f"{name}_max")
        least, most = low.lower if low else -math.inf, high.upper if high else math.inf
        if not least <= value <= most:
            raise InputError(
                f"--sent: expected {what} within the actuator's limits, {least:g} to {most:g} "
                f"{unit}, got {value:g}; give what was really sent before t = 0"
            )
