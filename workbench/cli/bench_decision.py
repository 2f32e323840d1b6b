"""The board of the whole decision in `workbench bench`: its plan, page and document."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from workbench.cli import bench_online
from workbench.cli.analysis_options import command_line, count, separate_files, writable_file
from workbench.cli.common import marked, write_text

if TYPE_CHECKING:
    from workbench.bench.decision_board import DecisionBoard, DecisionPlan

BEGIN: Final = "<!-- figures of the decision board: begin -->"
END: Final = "<!-- figures of the decision board: end -->"

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


def check(args: argparse.Namespace, boards: Sequence[str]) -> None:
    """Refuse files that nothing would be written to, before any work."""
    if not _has_files(boards):
        bench_online.check(args, boards)
        return
    separate_files(args, "plot", "into")
    writable_file(args.plot, "--plot")
    writable_file(args.into, "--into")
    if args.into is not None:
        marked(args.into, BEGIN, END)


def _has_files(boards: Sequence[str]) -> bool:
    """Whether page and document are this board's: they are the online board's where that is."""
    return "decision" in boards and "online" not in boards


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


def told(args: argparse.Namespace, boards: Sequence[str], board: DecisionBoard) -> str:
    """The tables; also written to the files that were asked for."""
    from workbench.bench.decision_text import decision_text, summary_text

    text = "\n\n".join([decision_text(board), summary_text(board)])
    if _has_files(boards):
        _write_files(args, board, text)
    return text


def _write_files(args: argparse.Namespace, board: DecisionBoard, text: str) -> None:
    command = command_line("bench", args, repeated=("only", "board"))
    if args.plot is not None:
        from workbench.cli.bench_decision_page import decision_page
        from workbench.report.page import write_page

        write_page(args.plot, decision_page(board, command).html())
    if args.into is not None:
        before, after = marked(args.into, BEGIN, END)
        body = f"\n\nMade with\n\n```console\n$ {command}\n```\n\n```text\n{text}\n```\n\n"
        write_text(args.into, before + BEGIN + body + END + after)
