"""`workbench check`: verifies a certificate with the independent checker."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from workbench.checker.arithmetic import UnprovedError
from workbench.checker.claims import check
from workbench.cli.output import emit
from workbench.errors import InputError

HELP = (
    "Verifies a certificate that `workbench derive --certificate FILE` wrote, with a small checker "
    "that shares nothing with the code that derived the bound. Exit status 0 when the claim is "
    "proved, 1 when it is not, 2 when the file is no certificate."
)
EXAMPLE = """\
workbench check bound.json
workbench check bound.json --json
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """The file."""
    parser.add_argument("file", type=Path, metavar="FILE", help="certificate to verify")


def run(args: argparse.Namespace) -> int:
    """Verify and say what was proved."""
    data = args.file.read_bytes()
    started_s = time.perf_counter()
    try:
        statement, refusal = check(data), None
    except UnprovedError as error:
        statement, refusal = None, str(error)
    except ValueError as error:
        raise InputError(
            f"expected a certificate, got {args.file}: {error}; write one with "
            "`workbench derive --certificate FILE`"
        ) from error
    cost_s = time.perf_counter() - started_s
    text = f"proved: {statement}" if statement else f"not proved: {refusal}"
    facts = {"proved": refusal is None, "statement": statement, "refusal": refusal}
    emit(args, f"{text}\nchecked in {cost_s:.1f} s", facts | {"cost_s": cost_s})
    return 1 if refusal else 0
