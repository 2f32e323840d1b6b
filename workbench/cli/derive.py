"""`workbench derive`: proved bounds on the spread of a closed loop, side by side."""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, final

from workbench.cli.analysis_options import (
    Subject,
    add_file_option,
    add_subject_options,
    add_time_options,
    check_steps,
    chosen_subject,
    command_line,
    count,
    shown_instants,
    text_table,
    writable_file,
)
from workbench.cli.output import emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.analysis_results import Array, Derived
    from workbench.reach import ReachTube
    from workbench.sets import Box

HELP = (
    "Derives proved bounds on how far trajectories spread: every discrepancy there is, over a "
    "region, and the sensitivity tube from the initial set. Exit status 1 when a bound cannot be "
    "derived, or when the tube does not show that trajectories stay in the region to the end."
)
EXAMPLE = """\
workbench derive
workbench derive --over tube --plot out/growth.html
workbench derive --system b1 --horizon 2 --json
"""

_SAMPLES: Final = 1000
_SEED: Final = 1


def configure(parser: argparse.ArgumentParser) -> None:
    """Loop, region, time grid, effort, and the page to write."""
    add_subject_options(parser)
    parser.add_argument(
        "--over",
        choices=("operation", "tube"),
        help="region of the bounds: the vehicle's operating region, or the hull of the tube "
        "(default: operation; for a benchmark loop, which has none, tube)",
    )
    add_time_options(parser, step_s=0.02)
    parser.add_argument(
        "--cells",
        type=count,
        default=256,
        metavar="N",
        help="split the region into about N cells for the Jacobian (default: 256)",
    )
    add_file_option(parser, "--plot", text="write a page with growth over time beside samples")


@final
@dataclass(frozen=True, slots=True)
class _Outcome:
    """All that was found; `condition` says whether the tube shows the bounds' condition."""

    subject: Subject
    region: Box
    tube: ReachTube
    tube_cost_s: float
    bounds: list[Derived]
    condition: str
    holds: bool


def run(args: argparse.Namespace) -> int:
    """Derive and show; 0 when every bound is there and its condition shown, 1 when not."""
    check_steps(args)
    writable_file(args.plot, "--plot")
    subject = chosen_subject(args)
    if args.over == "operation" and subject.region is None:
        raise InputError(
            f"--over operation: expected a vehicle, and {subject.name} has no operating region; "
            "use --over tube"
        )
    outcome = _outcome(args, subject)
    if args.plot:
        _write_page(args, outcome)
    emit(args, _text(args, outcome), _data(args, outcome))
    return 0 if outcome.holds and all(each.bound for each in outcome.bounds) else 1


def _outcome(args: argparse.Namespace, subject: Subject) -> _Outcome:
    from workbench.cli.analysis_results import derived, first_exit, hull_of, tube_of

    started_s = time.perf_counter()
    tube = tube_of(subject, horizon_s=args.horizon, step_s=args.step)
    tube_cost_s = time.perf_counter() - started_s
    own = subject.region if args.over != "tube" else None
    region = own or hull_of(tube)
    left = first_exit(tube, region)
    if not tube.complete:
        condition = "not shown, as the tube ends early"
    elif left:
        condition = f"not shown for this initial set: {left}"
    else:
        condition = f"shown by the tube ({tube.rigor.name}) for trajectories from the initial set"
    bounds = derived(subject, region, horizon_s=args.horizon, cells=args.cells)
    holds = tube.complete and not left
    return _Outcome(subject, region, tube, tube_cost_s, bounds, condition, holds)


def _told(region: Box) -> str:
    sides = zip(region.names, region.lower, region.upper, strict=True)
    return ", ".join(f"{name} [{low:.4g}, {high:.4g}]" for name, low, high in sides)


def _sampled(subject: Subject, times_s: Array) -> Array:
    from workbench.cli.analysis_results import sampled_distances

    return sampled_distances(subject, times_s, count=_SAMPLES, seed=_SEED)


def _text(args: argparse.Namespace, outcome: _Outcome) -> str:
    import numpy as np

    from workbench.claims import Rigor
    from workbench.cli.analysis_results import (
        centre_run,
        distance_table,
        distances_from,
        ending,
        radii,
    )

    subject, tube = outcome.subject, outcome.tube
    times = np.array(shown_instants(args.horizon))
    columns = {
        "sampled": (Rigor.SAMPLED, _sampled(subject, times)),
        "tube": (tube.rigor, distances_from(centre_run(subject, times), tube, times)),
    }
    rows: list[list[str | int | float | None]] = [
        [f"sensitivity tube, step {args.step:g} s", tube.rigor.name, outcome.tube_cost_s]
    ]
    for each in outcome.bounds:
        if each.bound:
            columns[each.method] = (each.bound.rigor, radii(each.bound, subject, times))
        rows.append([each.method, each.bound.rigor.name if each.bound else "none", each.cost_s])
    return "\n".join(
        [
            f"{subject.name}: bounds on the distance from the run that starts in the middle",
            "",
            text_table(["method", "rigor", "cost (s)"], rows),
            *(f"{each.method}: {each.refusal}" for each in outcome.bounds if each.refusal),
            "",
            distance_table(subject.system.ode, times, columns),
            "",
            f"region: {_told(outcome.region)}",
            f"staying in the region: {outcome.condition}",
            ending(tube),
            *([f"wrote {args.plot}"] if args.plot else []),
        ]
    )


def _data(args: argparse.Namespace, outcome: _Outcome) -> dict[str, object]:
    import numpy as np

    from workbench.cli.analysis_results import radii
    from workbench.cli.reach import tube_data

    subject, times = outcome.subject, np.array(shown_instants(args.horizon))
    initial_set, region = subject.initial_set, outcome.region
    return {
        "name": subject.name,
        "horizon_s": args.horizon,
        "states": [{"name": s.name, "unit": s.unit} for s in subject.system.ode.states],
        "instants_s": times,
        "initial_set": {name: initial_set.interval(name) for name in initial_set.names},
        "region": {name: region.interval(name) for name in region.names},
        "condition_shown": outcome.holds,
        "condition": outcome.condition,
        "bounds": [
            {
                "method": each.method,
                "rigor": each.bound.rigor if each.bound else None,
                "refusal": each.refusal or None,
                "norm": each.bound.norm if each.bound else None,
                "half_widths": radii(each.bound, subject, times) if each.bound else None,
                "cost_s": each.cost_s,
            }
            for each in outcome.bounds
        ],
        "sampled": _sampled(subject, times),
        "tube": tube_data(outcome.tube, horizon_s=args.horizon) | {"cost_s": outcome.tube_cost_s},
        "plot": args.plot,
    }


def _write_page(args: argparse.Namespace, outcome: _Outcome) -> None:
    from workbench import __version__
    from workbench.cli.analysis_results import curve_times, growth_section, growths
    from workbench.report.page import Claim, Claims, Page, Section, write_page

    subject, tube = outcome.subject, outcome.tube
    ode, times = subject.system.ode, curve_times(args.horizon)
    curves = growths(
        subject, times, reached=_sampled(subject, times), tube=tube, bounds=outcome.bounds
    )
    claims = [
        Claim(f"{each.method}: {each.bound.norm}. It holds when {each.bound.condition}.",
              each.bound.rigor)
        for each in outcome.bounds
        if each.bound
    ]  # fmt: skip
    claims.append(Claim(f"The sensitivity tube holds up to {tube.times[-1]:g} s.", tube.rigor))
    page = Page(
        f"Proved bounds for {subject.name}",
        [f"Staying in the region: {outcome.condition}."],
        [
            Section("What is claimed", [Claims(claims)]),
            growth_section(curves, ode),
        ],
        __version__,
        command_line("derive", args),
    )
    write_page(Path(args.plot), page.html())
