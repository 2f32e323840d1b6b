"""`workbench intent --score`: how well places are predicted, and how well the guard holds."""

from __future__ import annotations

import argparse
from typing import Final

from workbench.cli.output import Progress, emit

SCORES: Final = ("goals", "motion", "guard", "guard-shipped", "guard-violations")


def add_score_option(parser: argparse.ArgumentParser) -> None:
    """Add `--score`; `run_score` answers every choice but the first."""
    parser.add_argument(
        "--score",
        choices=SCORES,
        default=SCORES[0],
        help="goals: who goes where; motion: predicted places and radii beside constant velocity; "
        "guard: share of positions inside and area, fitted to the other recordings; "
        "guard-shipped: the same of the shipped guards; guard-violations: how often the guards of "
        "one person contradict each other (default: goals)",
    )
    parser.add_argument(
        "--fit-on",
        nargs="+",
        metavar="NAME",
        help="with --score guard: fit to these recordings (* and ? as in file names) and judge the "
        "others, as at a place that was never seen",
    )


def run_score(args: argparse.Namespace) -> int:
    """Print the table that `--score` names, of all recordings of the folder."""
    with Progress(f"scoring the {args.score}", 1):
        text, data = _motion(args) if args.score == "motion" else _guard(args)
    emit(args, text, data)
    return 0


def _motion(args: argparse.Namespace) -> tuple[str, dict[str, object]]:
    from workbench.estimation.motion_parameters import load_motion, shipped_motion
    from workbench.estimation.prediction_scores import score_motion

    motion = shipped_motion() if args.motion is None else load_motion(args.motion)
    scores = score_motion(args.folder, motion)
    return scores.text(), {"off": scores.off, "held": scores.held}


def _guard(args: argparse.Namespace) -> tuple[str, dict[str, object]]:
    from workbench.estimation.guard_scores import guard_lines, guard_table, guard_table_elsewhere
    from workbench.estimation.guard_shipped import shipped_guards
    from workbench.estimation.guard_violations import violation_lines, violation_table

    if args.score == "guard-violations":
        counts = violation_table(args.folder)
        return "\n".join(violation_lines(counts)), {"violations": counts}
    if args.fit_on:
        scores = guard_table_elsewhere(args.folder, args.fit_on)
    else:
        fit = shipped_guards() if args.score == "guard-shipped" else None
        scores = guard_table(args.folder, fit=fit)
    return "\n".join(guard_lines(scores)), {"guard": scores}
