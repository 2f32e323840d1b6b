"""`workbench reproduce`: the paper's tables and figures from this project's own drives."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    command_line,
    count,
    number,
    percent,
    text_table,
    writable_file,
)
from workbench.cli.common import (
    add_output_option,
    marked,
    output_folder,
    replacing,
    write_text,
)
from workbench.cli.output import emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.reproduce_work import Found

HELP: Final = (
    "Repeats the paper's evaluation on simulated drives: Table I (time of three nested reach "
    "sets), Table II (how often they contain the car), the figure of results and the one of "
    "intents, with the paper's numbers beside. Exit status 1 when the tubes with N and W of the "
    "vehicle file contain less than asked."
)
EXAMPLE: Final = """\
workbench reproduce paper --quick
workbench reproduce paper --out out/paper
workbench reproduce paper --vehicle shuttle.toml --seeds 10 --require 0.995
"""
BEGIN: Final = "<!-- figures of the paper: begin -->"
END: Final = "<!-- figures of the paper: end -->"
RESULTS, INTENT = "paper-results.png", "paper-intent.png"
_SEEDS: Final = 4


def configure(parser: argparse.ArgumentParser) -> None:
    """What is repeated, with which vehicle, and how much of it."""
    from workbench.cli.reproduce_work import FIRST_SEED, PLANTS, SCENARIOS

    parser.add_argument("what", choices=("paper",), help="whose evaluation")
    parser.add_argument(
        "--vehicle", type=Path, metavar="FILE",
        help="vehicle file with [drive_by_wire] and fitted [uncertainty] (default: the simulated "
        "GEM e2 that is shipped)",
    )  # fmt: skip
    add_output_option(parser, default="out/paper")
    parser.add_argument(
        "--quick", action="store_true",
        help="one short drive on the first plant, few times: a first look, no result",
    )  # fmt: skip
    parser.add_argument(
        "--seeds", type=count, metavar="N",
        help="drives of each scenario and plant, no two of a plant with the same seed, from "
        f"{FIRST_SEED} on (default: {_SEEDS}; 1 with --quick)",
    )  # fmt: skip
    parser.add_argument(
        "--plant", action="append", default=[], metavar="NAME",
        help="only this plant (can be given more than once; default: " + ", ".join(PLANTS) + ")",
    )  # fmt: skip
    parser.add_argument(
        "--scenario", action="append", default=[], metavar="NAME",
        help="drive this scenario for Table II (can be given more than once; default: "
        + ", ".join(SCENARIOS) + ")",
    )  # fmt: skip
    parser.add_argument(
        "--thirds",
        action="store_true",
        help="nested sets of the whole, two thirds and one third of the measured set, instead of "
        "fitted to other drives",
    )
    parser.add_argument(
        "--require", type=number, default=0.999, metavar="SHARE",
        help="share of steps that the tubes with N and W must contain on every plant, at every T "
        "and confidence, of decisions at speed and of those at any (default: 0.999)",
    )  # fmt: skip
    parser.add_argument("--table", action="store_true", help="print the tables as Markdown")
    parser.add_argument(
        "--into", type=Path, metavar="FILE",
        help="put the main tables into this document, between its marks, and the pictures beside "
        "it, in the folder `pictures`",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Measure, write, print; 1 where the tubes contain less than asked."""
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.cli.reproduce_work import measured
    from workbench.simulation.paper.accuracy import AT_SPEED_MPS

    if not 0.0 <= args.require <= 1.0:
        raise InputError(f"--require: expected a share from 0 to 1, got {args.require:g}")
    if args.quick and args.seeds is not None:
        raise InputError("--seeds: expected without --quick, which drives once; leave one out")
    args.seeds = args.seeds or (1 if args.quick else _SEEDS)
    if args.into is not None:
        writable_file(args.into, "--into")
        marked(args.into, BEGIN, END)
    with output_folder(args.out) as folder:
        found = measured(args)
        _write(args, found, folder)
    if args.into is not None:
        _write_into(args, found, args.into)
    reached = found.least >= args.require
    ending = (
        f"the tubes with N and W contain at least {percent(found.least)} of the steps, at every T "
        f"and confidence, of decisions at any speed and at {AT_SPEED_MPS:g} m/s and more: "
        f"{'as' if reached else 'less than'} asked ({args.require:.2%}); {found.outside} steps "
        "were outside of one that had not ended"
    )
    emit(args, "\n\n".join([_text(args, found), ending, f"report: {args.out / 'report.html'}"]),
         {"times": found.times, "accuracy": found.accuracy, "least": found.least,
          "outside": found.outside,
          "required": args.require, "seeds": found.seeds, "scenarios": found.scenarios,
          "plants": found.plants, "shares": found.shares, "learned": found.learned,
          "report": str(args.out / "report.html")})  # fmt: skip
    return DONE if reached else CLAIM_FAILS


def sizes(found: Found) -> str:
    """Of the nested sets, in words."""
    high, medium, low = (f"{share:.2f}" for share in found.shares)
    return (
        f"High, medium and low confidence: {high}, {medium} and {low} of the measured set's radii"
    )


def this_command(args: argparse.Namespace) -> str:
    """The command line that makes the same again."""
    return command_line("reproduce", args, positional=("what",), repeated=("plant", "scenario"))


def _write(args: argparse.Namespace, found: Found, folder: Path) -> None:
    """Page, tables and pictures."""
    from workbench.cli.reproduce_page import paper_page
    from workbench.cli.reproduce_tables import accuracy_csv, times_csv
    from workbench.report.page import write_page

    write_text(folder / "table-1.csv", times_csv(found.times))
    write_text(folder / "table-2.csv", accuracy_csv(found))
    _write_pictures(found, folder)
    page = paper_page(found, command=this_command(args), require=args.require)
    write_page(folder / "report.html", page.html())


def _write_pictures(found: Found, folder: Path) -> None:
    from workbench.report.paper import results_picture
    from workbench.report.paper_intent import intent_picture

    pictures = {RESULTS: results_picture(found.panels), INTENT: intent_picture()}
    for name, canvas in pictures.items():
        with replacing(folder / name) as target:
            canvas.savefig(target, format="png", dpi=110, metadata={"Software": None})


def _markdown(found: Found) -> str:
    """All tables, without the machine that the times were taken on."""
    from workbench.cli.reproduce_tables import accuracy_tables, count_table, markdown, time_table
    from workbench.simulation.paper.accuracy import STARTS

    tables = [time_table(found.times)]
    for starts in (each.name for each in STARTS):
        tables += [*accuracy_tables(found, starts=starts), count_table(found, starts=starts)]
    return "\n\n".join(map(markdown, tables))


def _text(args: argparse.Namespace, found: Found) -> str:
    """For the terminal."""
    from workbench.cli.reproduce_tables import accuracy_tables, time_table
    from workbench.simulation.paper.accuracy import STARTS

    if args.table:
        return _markdown(found)
    tables = [time_table(found.times), *accuracy_tables(found, starts=STARTS[0].name)]
    shown = [
        f"{each.caption}\n{text_table(list(each.headings), [list(row) for row in each.rows])}"
        for each in tables
    ]
    return "\n\n".join([*shown, sizes(found)])


def _main_tables(found: Found) -> str:
    """Those that a reader of a document looks for; the page and the CSV files have all."""
    from workbench.cli.reproduce_tables import accuracy_tables, markdown, time_table
    from workbench.simulation.paper.accuracy import STARTS

    any_speed = accuracy_tables(found, starts=STARTS[-1].name)[0]
    tables = [time_table(found.times), *accuracy_tables(found, starts=STARTS[0].name), any_speed]
    return "\n\n".join(map(markdown, tables))


def _write_into(args: argparse.Namespace, found: Found, document: Path) -> None:
    """The main tables between the marks, the pictures beside the document."""
    before, after = marked(document, BEGIN, END)
    _write_pictures(found, document.parent / "pictures")
    pictures = "\n\n".join(
        f"![{title}](pictures/{name})"
        for title, name in (("The four scenarios", RESULTS), ("Somebody's intents", INTENT))
    )
    # Where the files went says nothing of how they came about.
    asked = argparse.Namespace(**vars(args) | {"into": None, "out": None})
    made = (
        f"Made with\n\n```console\n$ {this_command(asked)}\n```\n\nIts page and `table-2.csv` also "
        f"have what was counted, and more of decisions at any speed. {sizes(found)}."
    )
    body = f"\n\n{made}\n\n{_main_tables(found)}\n\n{pictures}\n\n"
    write_text(document, before + BEGIN + body + END + after)
