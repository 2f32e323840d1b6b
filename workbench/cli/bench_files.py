"""What `workbench bench` writes: tables into documents, by the marks in them, and one page."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import add_file_option, command_line, writable_file
from workbench.cli.common import marked, write_text
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.report.page import Page

PICTURED: Final = ("online", "decision")
"""The boards with pictures for the page."""
BOARDS: Final = (*PICTURED, "intent", "onboard")
"""The boards with tables for a document."""


def marks(board: str) -> tuple[str, str]:
    """The lines of a document between which this board's tables stand."""
    return (
        f"<!-- figures of the {board} board: begin -->",
        f"<!-- figures of the {board} board: end -->",
    )


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_file_option(
        parser,
        "--plot",
        text="write a page with the pictures of the boards `online` and `decision`: width, proved "
        "share and growth against time",
    )
    parser.add_argument(
        "--into",
        action="append",
        type=Path,
        default=[],
        metavar="FILE",
        help="put a board's tables into this document, between the marks of the board `online`, "
        "`decision`, `intent` or `onboard` that it holds (can be given more than once)",
    )


def check(args: argparse.Namespace, boards: Sequence[str]) -> None:
    """Refuse files that nothing would be written to, before any work."""
    drawn = [board for board in PICTURED if board in boards]
    if args.plot is not None and not drawn:
        raise InputError(
            f"--plot: expected the board `online` or `decision` to be measured, got "
            f"{', '.join(boards)}; add --board online"
        )
    writable_file(args.plot, "--plot")
    taken: dict[Path, str] = {} if args.plot is None else {args.plot.resolve(): "--plot"}
    for path in args.into:
        if path.resolve() in taken:
            raise InputError(
                f"expected different files for {taken[path.resolve()]} and --into, got {path} for "
                "both; rename one of them"
            )
        taken[path.resolve()] = "--into"
        writable_file(path, "--into")
        board = _board_of(path)
        if board not in boards:
            raise InputError(
                f"--into: expected the board `{board}`, whose marks {path} holds, to be measured, "
                f"got {', '.join(boards)}; add --board {board}"
            )


def write(args: argparse.Namespace, texts: Mapping[str, str], pages: Sequence[Page]) -> None:
    """The documents and the page that were asked for; texts: by board; pages: one per board."""
    command = this_command(args)
    if args.plot is not None:
        from workbench.report.page import write_page

        write_page(args.plot, _joined(pages).html())
    for path in args.into:
        board = _board_of(path)
        begin, end = marks(board)
        before, after = marked(path, begin, end)
        body = f"\n\nMade with\n\n```console\n$ {command}\n```\n\n```text\n{texts[board]}\n```\n\n"
        write_text(path, before + begin + body + end + after)


def this_command(args: argparse.Namespace) -> str:
    """The command line that makes the same figures again."""
    return command_line("bench", args, repeated=("only", "board", "into"))


def _joined(pages: Sequence[Page]) -> Page:
    """All of them as one page."""
    from workbench.report.page import Page

    first = pages[0]
    return Page(
        " and ".join([first.title, *(page.title.lower() for page in pages[1:])]),
        [sentence for page in pages for sentence in page.lead],
        [section for page in pages for section in page.sections],
        first.version,
        first.command,
    )


def _board_of(path: Path) -> str:
    """The board whose marks the document holds; InputError unless they are there once."""
    for board in BOARDS[1:]:
        try:
            marked(path, *marks(board))
        except InputError:
            continue
        return board
    marked(path, *marks(BOARDS[0]))
    return BOARDS[0]
