"""`workbench derive`: every bound on the spread of a closed loop, side by side."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    Subject,
    add_file_option,
    add_subject_options,
    add_time_options,
    check_steps,
    chosen_subject,
    count,
    separate_files,
    shown_instants,
    text_table,
    writable_file,
)
from workbench.cli.certificate import add_certificate_option
from workbench.cli.output import Progress, emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.analysis_results import Array
    from workbench.cli.comparison import Compared, Sampled
    from workbench.cli.recommendation import Outcome

HELP = (
    "Compares every bound on how far trajectories spread: formulas over a region, bounds along the "
    "trajectory, and tubes of the initial set, against sampled runs; and recommends one. Exit "
    "status 1 when a method refuses, or when the proved tube does not show that trajectories stay "
    "in the region to the end. A bound that explodes is a finding: its ratio is ∞."
)
EXAMPLE = """\
workbench derive
workbench derive --over tube --plot out/growth.html
workbench derive --system b1 --method metric blocks local-metric local-blocks --json
"""

# Written out because `--help` has to work without the analysis extra.
METHODS: Final = (
    "norm-max", "norm-sum", "norm-euclidean", "growth-matrix", "metric", "blocks",
    "local-norm-max", "local-norm-sum", "local-norm-euclidean", "local-growth", "local-metric",
    "local-blocks", "local-lagrangian",
    "sensitivity-linear", "sensitivity-quadratic",
)  # fmt: skip
_SAMPLES: Final = 1000
_SEED: Final = 1
_MOST_CELLS: Final = 100_000
# Instants that mean the same time differ by their rounding only.
_SAME_S: Final = 1e-9


def configure(parser: argparse.ArgumentParser) -> None:
    """Loop, region, time grid, methods, effort, and the page to write."""
    add_subject_options(parser)
    parser.add_argument(
        "--over",
        choices=("operation", "tube"),
        help="region of the formulas: the vehicle's operating region, or the hull of the tube "
        "(default: operation; for a benchmark loop, which has none, tube)",
    )
    add_time_options(parser, step_s=0.05)
    parser.add_argument(
        "--method",
        nargs="+",
        choices=METHODS,
        default=list(METHODS),
        metavar="NAME",
        help=f"methods to compare, among {', '.join(METHODS)} (default: all)",
    )
    parser.add_argument(
        "--cells",
        type=count,
        default=64,
        metavar="N",
        help="split the region into about N cells for the Jacobian (default: 64)",
    )
    add_file_option(parser, "--plot", text="write a page with the comparison")
    add_certificate_option(parser)


def run(args: argparse.Namespace) -> int:
    """Compare and show; 0 when no method refused and the condition is shown, 1 when not."""
    check_steps(args)
    separate_files(args, "plot", "certificate")
    _check_effort(args)
    writable_file(args.plot, "--plot")
    writable_file(args.certificate, "--certificate")
    subject = chosen_subject(args)
    if args.over == "operation" and subject.region is None:
        raise InputError(
            f"--over operation: expected a vehicle, and {subject.name} has no operating region; "
            "use --over tube"
        )
    outcome = _outcome(args, subject)
    if args.plot:
        from workbench.cli.comparison_page import comparison_page
        from workbench.report.page import write_page

        write_page(Path(args.plot), comparison_page(args, outcome).html())
    written, certified = _certified(args, outcome) if args.certificate else (True, None)
    text = "\n".join([_text(args, outcome), *([certified] if certified else [])])
    emit(args, text, _data(args, outcome) | {"certificate": certified})
    refused = any(each.refusal for each in outcome.found)
    return 0 if outcome.holds and written and not refused else 1


def _check_effort(args: argparse.Namespace) -> None:
    """Raise InputError where cells would not fit in memory, or no method gives a certificate."""
    if args.cells > _MOST_CELLS:
        raise InputError(f"--cells: expected at most {_MOST_CELLS}, got {args.cells}; give fewer")
    from workbench.cli.methods import REGION

    if args.certificate and not set(args.method) & set(REGION):
        raise InputError(
            f"--certificate: expected one of the methods over the region in --method, "
            f"{', '.join(REGION)}, got {', '.join(args.method)}; add one, such as blocks"
        )


def _certified(args: argparse.Namespace, outcome: Outcome) -> tuple[bool, str]:
    """Write the tightest formula as a certificate; whether it was, and what to say."""
    from workbench.cli.certificate import write_certificate

    bounds = [each for each in outcome.found if each.bound is not None]
    best = min(bounds, key=lambda each: each.score, default=None)
    if best is None or best.bound is None:
        return False, "no certificate: no method over the region gives a bound"
    initial_set = outcome.setting.subject.initial_set
    try:
        slack = write_certificate(
            args.certificate,
            outcome.setting.subject.system,
            best.bound,
            initial_radius=dict(zip(initial_set.names, initial_set.radius, strict=True)),
            instants_s=shown_instants(args.horizon),
        )
    except InputError as error:
        return False, f"no certificate for {best.name}: {error}"
    raised = f", its rates raised by the share {slack:g}" if slack else ""
    return True, (
        f"wrote {args.certificate}: {best.name}{raised}; `workbench check {args.certificate}` "
        "verifies it"
    )


def _outcome(args: argparse.Namespace, subject: Subject) -> Outcome:
    from workbench.cli.analysis_results import curve_times, first_exit, hull_of
    from workbench.cli.comparison import Setting, compared, sampled
    from workbench.cli.recommendation import Outcome, recommended, recommended_over_region
    from workbench.reach import ValidatedTube

    with Progress("tube", 1):
        started_s = time.perf_counter()
        tube = ValidatedTube(args.step).tube(
            subject.system, initial_set=subject.initial_set, horizon_s=args.horizon
        )
        cost_s = time.perf_counter() - started_s
    own = subject.region if args.over != "tube" else None
    region = own or hull_of(tube)
    left = first_exit(tube, region)
    if not tube.complete:
        condition = "not shown, as the tube ends early"
    elif left:
        condition = f"not shown for this initial set: {left}"
    else:
        condition = f"shown by the tube ({tube.rigor.name}) for trajectories from the initial set"
    times_s = _all_times(curve_times(args.horizon), shown_instants(args.horizon))
    samples = sampled(subject, times_s, count=_SAMPLES, seed=_SEED)
    setting = Setting(subject, samples, region, args.cells, args.step, tube, cost_s)
    found = compared(setting, args.method)
    holds = tube.complete and not left
    return Outcome(
        setting, found, condition, holds,
        recommended(found, condition_holds=holds),
        recommended_over_region(found, condition_holds=holds),
    )  # fmt: skip


def _all_times(curve_s: Array, instants_s: tuple[float, ...]) -> Array:
    """The instants of the curves with those of the tables among them."""
    import numpy as np

    more = [t for t in instants_s if np.abs(curve_s - t).min() > _SAME_S]
    return np.sort(np.append(curve_s, more))


def _rows_at(samples: Sampled, instants_s: tuple[float, ...]) -> list[int]:
    import numpy as np

    return [int(np.argmin(np.abs(samples.times_s - t))) for t in instants_s]


def _text(args: argparse.Namespace, outcome: Outcome) -> str:
    from workbench.cli.analysis_results import ending
    from workbench.cli.comparison_page import HEADINGS, row, told_box

    setting, states = outcome.setting, outcome.setting.subject.system.ode.states
    end = setting.samples.distances[-1]
    ratio_rows: list[list[str | int | float | None]] = [
        [each.name, *(float(value) for value in each.ratios[-1])]
        for each in outcome.found
        if each.rigor
    ]
    return "\n".join(
        [
            f"{setting.subject.name}: bounds on the distance from the run that starts in the "
            "middle, over the largest",
            f"distance of {_SAMPLES} sampled runs (mean: over time, then over the states)",
            "",
            text_table(HEADINGS, [row(each) for each in outcome.found]),
            *(f"{each.name}: {each.refusal}" for each in outcome.found if each.refusal),
            "",
            f"ratio at {args.horizon:g} s",
            text_table(
                ["method", *(state.name for state in states)],
                [*ratio_rows, ["sampled distance", *(float(value) for value in end)]],
            ),
            "",
            f"region of the formulas: {told_box(setting.region)}",
            f"staying in the region: {outcome.condition}",
            ending(setting.tube),
            outcome.best.told("recommended"),
            outcome.best_formula.told("recommended as a formula"),
            *([f"wrote {args.plot}"] if args.plot else []),
        ]
    )


def _data(args: argparse.Namespace, outcome: Outcome) -> dict[str, object]:
    from workbench.cli.reach import tube_data

    setting, subject = outcome.setting, outcome.setting.subject
    instants_s = shown_instants(args.horizon)
    rows = _rows_at(setting.samples, instants_s)
    initial_set, region = subject.initial_set, setting.region
    return {
        "name": subject.name,
        "horizon_s": args.horizon,
        "states": [{"name": s.name, "unit": s.unit} for s in subject.system.ode.states],
        "instants_s": instants_s,
        "initial_set": {name: initial_set.interval(name) for name in initial_set.names},
        "region": {name: region.interval(name) for name in region.names},
        "condition_shown": outcome.holds,
        "condition": outcome.condition,
        "bounds": [_bound_data(each, rows) for each in outcome.found],
        "sampled": setting.samples.distances[rows],
        "tube": tube_data(setting.tube, horizon_s=args.horizon) | {"cost_s": setting.tube_cost_s},
        "recommended": {"method": outcome.best.method, "reason": outcome.best.reason},
        "recommended_formula": {
            "method": outcome.best_formula.method,
            "reason": outcome.best_formula.reason,
        },
        "plot": args.plot,
    }


def _bound_data(each: Compared, rows: list[int]) -> dict[str, object]:
    return {
        "method": each.name,
        "derived": each.family.value,
        "rigor": each.rigor,
        "refusal": each.refusal or None,
        "statement": each.statement or None,
        "proved_until_s": each.until_s,
        "half_widths": each.half_widths[rows],
        "ratios": each.ratios[rows],
        "mean_ratios": each.mean_ratios,
        "mean_ratio": each.score,
        "condition": each.condition,
        "cost_s": each.cost_s,
    }
