"""`workbench reach --sampled`: the PID as it runs on the car, beside the continuous one."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    Subject,
    command_line,
    shown_instants,
    text_table,
)
from workbench.cli.common import write_text
from workbench.cli.output import emit
from workbench.cli.reach_switch import Run, tube_by
from workbench.cli.sampling_options import chosen_sampling, chosen_sent
from workbench.cli.tube_table import limits_data, limits_text, tube_csv

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from workbench.reach import ReachTube

    Array = NDArray[np.float64]

# Differences below this share of the width are its rounding.
_ROUNDING: Final = 1e-10


def run_sampled(args: argparse.Namespace, subject: Subject, parts: Mapping[str, int]) -> int:
    """Compute both tubes and show them; 0 when both reach the horizon, 1 when not."""
    from workbench.reach import ValidatedTube
    from workbench.reach.sampled_data.tube import SampledTube

    sampling = chosen_sampling(args)
    sent = chosen_sent(args, subject, sampling)
    step_s = min(sampling.period_s, args.horizon)
    run = Run(subject, args.horizon, parts, rows=math.ceil(args.horizon / step_s))
    sampled = tube_by(
        lambda each_row: SampledTube(sampling, sent, degree=2, each_row=each_row), run
    )
    continuous = tube_by(lambda each_row: ValidatedTube(step_s, each_row=each_row), run)
    if args.csv:
        write_text(args.csv, tube_csv(sampled))
    if args.plot:
        _write_page(args, subject, sampled, continuous)
    _show(args, subject, sampled, continuous)
    return 0 if sampled.complete and continuous.complete else 1


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
        "sampling": chosen_sampling(args),
        "sent": chosen_sent(args, subject, chosen_sampling(args)),
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
    sampling = chosen_sampling(args)
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
