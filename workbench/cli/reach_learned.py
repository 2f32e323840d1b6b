"""`workbench reach --learned`: the paper's own method, simulations bloated by a learned bound."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    Subject,
    check_whole_steps,
    command_line,
)
from workbench.cli.common import write_text
from workbench.cli.output import emit
from workbench.cli.tube_table import tube_csv
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.reach import ReachTube
    from workbench.sensitivity import Discrepancy

_RUNS: Final = 2000
_PLOTTED_RUNS: Final = 200
_ROUNDING: Final = 1e-9


def add_learned_option(parser: argparse.ArgumentParser) -> None:
    """Add `--learned`; `run_learned` reads it."""
    parser.add_argument(
        "--learned",
        type=Path,
        metavar="FILE",
        help="by the paper's method: simulate from the middle of every part of --parts, and bloat "
        "by the bound in FILE (`workbench learn --save`); nothing is proved",
    )


def run_learned(args: argparse.Namespace, subject: Subject, parts: Mapping[str, int]) -> int:
    """Compute and show; 0 when the tube reaches the horizon, 1 when not."""
    for option, given in (
        ("--switch-at", args.switch_at), ("--sampled", args.sampled), ("--unsure", args.unsure),
    ):  # fmt: skip
        if given:
            raise InputError(
                f"{option}: expected it without --learned, whose bound is of runs of the "
                "continuous loop without errors and disturbances; leave one of them out"
            )
    check_whole_steps(args)
    from workbench.cli.learned_file import load_learned
    from workbench.reach import LearnedTube, compute_tube

    learned = load_learned(args.learned, subject)
    tube = compute_tube(
        subject.system,
        initial_set=subject.initial_set,
        horizon_s=args.horizon,
        method=LearnedTube(learned, parts, args.step),
    )
    outside = leaving(subject, tube)
    if args.csv:
        write_text(args.csv, tube_csv(tube))
    facts = _facts(tube, learned, outside)
    if args.plot:
        _write_page(args, subject, tube, facts, outside)
    _show(args, subject, tube, facts, outside)
    return 0 if tube.complete else 1


def leaving(subject: Subject, tube: ReachTube) -> tuple[int, int]:
    """Of sampled runs (vertices, faces, inside of the initial set): how many leave the tube at some
    instant, and how many there were; none where the tube has no row."""
    import numpy as np

    from workbench.sensitivity.sampling import rollout, sample_initial_states

    steps = len(tube.lower)
    if not steps:
        return 0, 0
    step_s = float(tube.times[-1]) / steps
    box = subject.initial_set.reordered(subject.system.ode.names)
    states = sample_initial_states(box, count=_RUNS, seed=1)
    runs = rollout(subject.system, states, horizon_s=steps * step_s, step_s=step_s)
    slack = _ROUNDING * (np.abs(tube.lower_at) + np.abs(tube.upper_at))
    inside = (runs >= tube.lower_at - slack) & (runs <= tube.upper_at + slack)
    return int((~inside.all(axis=(1, 2))).sum()), len(runs)


def _facts(tube: ReachTube, learned: Discrepancy, outside: tuple[int, int]) -> list[str]:
    ends = f"{tube.times[-1]:.3f} s" + ("" if tube.complete else f" only ({tube.message})")
    return [
        f"tube: {tube.status.name}, {tube.rigor.name}, nothing is proved, up to {ends}",
        f"the bound: {learned.condition}",
        f"{outside[0]} of {outside[1]} sampled runs (vertices, faces and inside of the initial "
        "set) leave it at some instant",
    ]


def _show(
    args: argparse.Namespace, subject: Subject, tube: ReachTube, facts: list[str],
    outside: tuple[int, int],
) -> None:  # fmt: skip
    from workbench.cli.reach import half_width_text, tube_data

    written = [file for file in (args.csv, args.plot) if file]
    data = tube_data(tube, horizon_s=args.horizon)
    data["reaches_s"] = data.pop("proved_until_s")
    text = [
        f"{subject.name}: half widths of the paper's tube, by the learned bound of {args.learned}",
        half_width_text(subject, tube, horizon_s=args.horizon),
        *facts,
        *(f"wrote {file}" for file in written),
    ]
    counts = {"runs_outside": outside[0], "runs": outside[1]}
    emit(args, "\n".join(text), {"name": subject.name, **data, **counts, "files": written})


def _write_page(
    args: argparse.Namespace, subject: Subject, tube: ReachTube, facts: list[str],
    outside: tuple[int, int],
) -> None:  # fmt: skip
    from workbench import __version__
    from workbench.cli.analysis_results import sampled_runs, tube_curves
    from workbench.report.figures import tube_figure
    from workbench.report.page import Block, Claim, Claims, Notice, Page, Section, write_page

    blocks: list[Block] = [] if tube.complete else [Notice("The tube ends early.", facts[0])]
    if len(tube.lower):
        runs = sampled_runs(subject, horizon_s=args.horizon, count=_PLOTTED_RUNS, seed=1)
        blocks.append(tube_figure(tube_curves(tube, subject.system.ode), runs))
    statement = (
        f"{outside[1] - outside[0]} of {outside[1]} sampled runs stayed in it at its instants. "
        "Nothing more is claimed: the bound's statement is about pairs of which both ends are "
        "drawn, and the tube bounds the distance from runs that start in the middle of a region."
    )
    page = Page(
        f"The paper's tube of {subject.name}",
        facts,
        [
            Section("What is claimed", [Claims([Claim(statement, tube.rigor)])]),
            Section("The tube", blocks),
        ],
        __version__,
        command_line("reach", args),
    )
    write_page(Path(args.plot), page.html())
