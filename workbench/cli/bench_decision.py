"""The board of the whole decision in `workbench bench`: its options and plan."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import count

if TYPE_CHECKING:
    from workbench.bench.decision_board import DecisionBoard, DecisionPlan

PEOPLE: Final = (0, 1, 2, 4, 8, 16, 32)
HORIZONS_S: Final = (1.0, 2.0, 3.0, 4.0, 5.0)
BUDGETS: Final = (150, 180, 200, 225, 250, 275, 300, 400, 600, 1000)
_CALLS: Final = 100_000
_CALLS_QUICK: Final = 3_000
_BUDGETS_QUICK: Final = (150, 180, 200, 225, 250, 300, 1000)
_PLAIN: Final = 300


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of this board."""
    parser.add_argument(
        "--calls",
        type=count,
        metavar="N",
        help=f"whole decisions to time (default: {_CALLS}, with --quick {_CALLS_QUICK})",
    )


def plan(args: argparse.Namespace, seed: int) -> DecisionPlan:
    """What is measured: much, or with --quick little."""
    from workbench.bench.decision_board import DecisionPlan

    quick = args.quick
    return DecisionPlan(
        calls=args.calls or (_CALLS_QUICK if quick else _CALLS),
        sweep_calls=1_000 if quick else 10_000,
        budgets=_BUDGETS_QUICK if quick else BUDGETS,
        inputs=args.inputs or (2_000 if quick else 100_000),
        plain=_PLAIN,
        rounds=20 if quick else 200,
        people=PEOPLE,
        horizons_s=HORIZONS_S,
        slow=3 if quick else 10,
        stepped=2 if quick else 10,
        seed=seed,
    )


def measure(args: argparse.Namespace, *, seed: int) -> DecisionBoard:
    """The board, with progress."""
    from workbench.bench.decision_board import decision_board
    from workbench.cli.output import Progress

    wanted = plan(args, seed)
    with Progress("whole decision", wanted.units_of_work) as progress:
        return decision_board(wanted, advance=progress.advance)
