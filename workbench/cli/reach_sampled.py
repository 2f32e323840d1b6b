"""`workbench reach --sampled`: the PID as it runs on the car, beside the continuous one."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    Subject,
    command_line,
    number,
    positive,
    shown_instants,
    text_table,
)
from workbench.cli.common import write_text
from workbench.cli.output import emit
from workbench.cli.reach_switch import tube_by
from workbench.cli.tube_table import limits_data, limits_text, tube_csv
from workbench.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from workbench.controllers.sampling import Sampling, SentCommand
    from workbench.reach import ReachTube

    Array = NDArray[np.float64]

_RATE_HZ: Final = 30.0
_DELAY_S: Final = 0.05
_LONGEST_PERIOD_S: Final = 60.0
_MOST_PERIODS: Final = 20_000
_MOST_PERIODS_LATE: Final = 200
# Differences below this share of the width are its rounding.
_ROUNDING: Final = 1e-10
_DRIVEN: Final = ("steering", "speed")
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


def run_sampled(args: argparse.Namespace, subject: Subject, parts: Mapping[str, int]) -> int:
    """Compute both tubes and show them; 0 when both reach the horizon, 1 when not."""
    from workbench.reach import ValidatedTube
    from workbench.reach.sampled_data.tube import SampledTube

    sampling = _sampling(args)
    sent = _sent(args, subject, sampling)
    sampled = tube_by(
        SampledTube(sampling, sent, degree=2), subject, horizon_s=args.horizon, parts=parts
    )
    step_s = min(sampling.period_s, args.horizon)
    continuous = tube_by(ValidatedTube(step_s), subject, horizon_s=args.horizon, parts=parts)
    if args.csv:
        write_text(args.csv, tube_csv(sampled))
    if args.plot:
        _write_page(args, subject, sampled, continuous)
    _show(args, subject, sampled, continuous)
    return 0 if sampled.complete and continuous.complete else 1


def _sampling(args: argparse.Namespace) -> Sampling:
    from workbench.controllers.sampling import IntegralStep, Jitter, Sampling

    return Sampling(
        period_s=1.0 / (args.rate or _RATE_HZ),
        jitter_s=args.jitter or 0.0,
        jitter=Jitter.DRIFT if args.drift else Jitter.CLOCK,
        measurement_delay_s=tuple(args.measurement_delay or (0.0, 0.0)),
        actuation_delay_s=tuple(args.actuation_delay or (_DELAY_S, _DELAY_S)),
        integral_step=IntegralStep.MEASURED if args.measured_dt else IntegralStep.NOMINAL,
    )


def _sent(
    args: argparse.Namespace, subject: Subject, sampling: Sampling
) -> tuple[SentCommand, ...]:
    from workbench.controllers.sampling import SentCommand

    if args.sent is not None:
        return (SentCommand.exactly(*args.sent),) * sampling.commands_sent
    ode = subject.system.ode
    center = list(subject.initial_set.reordered(ode.names).center)
    nominal = [disturbance.nominal for disturbance in ode.disturbances]
    rates = ode.function()(center, ode.parameter_values(), nominal).full().ravel()
    command = SentCommand.exactly(*(float(rates[ode.names.index(n)]) for n in _DRIVEN))
    return (command,) * sampling.commands_sent


def _show(
    args: argparse.Namespace, subject: Subject, sampled: ReachTube, continuous: ReachTube
) -> None:
    import numpy as np

    from workbench.cli.analysis_results import half_widths
    from workbench.cli.reach import tube_data

    times = (0.0, *shown_instants(args.horizon))
    wide, narrow = (half_widths(tube, np.array(times)) for tube in (sampled, continuous))
    rows = _rows(subject, wide, narrow)
    written = [file for file in (args.csv, args.plot) if file]
    text = "\n".join(
        [
            f"{subject.name}: half widths of the set of reachable states, {_words(args)}",
            text_table(["state", "unit", "PID", *(f"{t:g} s" for t in times)], rows),
            *_facts(sampled, continuous),
            *(f"wrote {file}" for file in written),
        ]
    )
    data = {
        "name": subject.name,
        "sampling": _sampling(args),
        "sent": _sent(args, subject, _sampling(args)),
        **tube_data(sampled, horizon_s=args.horizon),
        "continuous": tube_data(continuous, horizon_s=args.horizon),
        "difference": wide - narrow,
        **limits_data(sampled),
        "files": written,
    }
    emit(args, text, data)


def _facts(sampled: ReachTube, continuous: ReachTube) -> list[str]:
    """How both tubes end, and what they prove about limits."""
    from workbench.cli.analysis_results import ending

    return [
        f"{name} {line}"
        for name, tube in (("sampled", sampled), ("continuous", continuous))
        for line in (ending(tube), *limits_text(tube))
    ]


def _rows(subject: Subject, wide: Array, narrow: Array) -> list[list[str | int | float | None]]:
    """Three lines per state: both half widths and their difference."""
    import numpy as np

    rows: list[list[str | int | float | None]] = []
    difference = np.where(np.abs(wide - narrow) > _ROUNDING * wide, wide - narrow, 0.0)
    tubes = (("sampled", wide), ("continuous", narrow), ("difference", difference))
    for i, state in enumerate(subject.system.ode.states):
        for label, values in tubes:
            named = (state.name, state.unit) if label == "sampled" else ("", "")
            rows.append([*named, label, *(float(v) for v in values[:, i])])
    return rows


def _words(args: argparse.Namespace) -> str:
    sampling = _sampling(args)
    shake = f", {sampling.jitter.value} within +-{sampling.jitter_s:g} s" if args.jitter else ""
    delays = [
        f"{name} delay {low:g} to {high:g} s" if low < high else f"{name} delay {low:g} s"
        for name, (low, high) in (
            ("measurement", sampling.measurement_delay_s),
            ("actuation", sampling.actuation_delay_s),
        )
    ]
    return f"sampled at {1.0 / sampling.period_s:g} Hz{shake}, {', '.join(delays)}"


def _write_page(
    args: argparse.Namespace, subject: Subject, sampled: ReachTube, continuous: ReachTube
) -> None:
    import numpy as np

    from workbench import __version__
    from workbench.cli.analysis_results import half_widths, tube_curves
    from workbench.report.figures import tube_figure
    from workbench.report.page import Block, Claim, Claims, Page, Section, write_page
    from workbench.report.widths import Widths, width_figure

    ode = subject.system.ode
    until = min(sampled.times[-1], continuous.times[-1])
    times = np.array([t for t in sampled.times if t <= until])
    blocks: list[Block] = []
    if len(sampled.lower) and len(continuous.lower):
        first, second = (
            Widths(label, tube.rigor, times, half_widths(tube, times))
            for label, tube in (("sampled PID", sampled), ("continuous PID", continuous))
        )
        units = [state.unit for state in ode.states]
        blocks.append(width_figure(first, second, names=ode.names, units=units))
    statement = (
        f"Every trajectory from the initial set under the PID {_words(args)}, stays in the tube up "
        f"to {sampled.times[-1]:g} s."
    )
    tubes: list[Block] = [tube_figure(tube_curves(sampled, ode))] if len(sampled.lower) else []
    page = Page(
        f"Sampled and continuous PID of {subject.name}",
        [f"{line[0].upper()}{line[1:]}." for line in _facts(sampled, continuous)],
        [
            Section("What is claimed", [Claims([Claim(statement, sampled.rigor)])]),
            Section("Widths side by side", blocks),
            Section("The tube of the sampled PID", tubes),
        ],
        __version__,
        command_line("reach", args),
    )
    write_page(Path(args.plot), page.html())
