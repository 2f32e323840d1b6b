"""`workbench check`: verifies a certificate with the independent checker."""

from __future__ import annotations

import argparse
import json
import time
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from pathlib import Path
from typing import Any, Final

from workbench.checker.arithmetic import UnprovedError
from workbench.checker.claims import FORMAT, check
from workbench.cli.analysis_options import text_table
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
# The checker refuses this size by name; a device or a pipe may never end.
_ENOUGH_BYTES: Final = 2**24 + 1
_LONGEST: Final = 200
_LONGEST_NAME, _MOST_INSTANTS, _DIGITS = 40, 8, 4


def configure(parser: argparse.ArgumentParser) -> None:
    """The file."""
    parser.add_argument("file", type=Path, metavar="FILE", help="certificate to verify")


def run(args: argparse.Namespace) -> int:
    """Verify and say what was proved."""
    try:
        with args.file.open("rb") as stream:
            data = stream.read(_ENOUGH_BYTES)
    except OSError as error:
        raise InputError(
            f"expected a certificate, got {args.file} ({error.strerror}); write one with "
            "`workbench derive --certificate FILE`"
        ) from error
    started_s = time.perf_counter()
    try:
        statement, refusal = check(data), None
    except UnprovedError as error:
        statement, refusal = None, str(error)
    except ValueError as error:
        raise InputError(
            f"expected a certificate, got {args.file}: {_reason(data, error)}; write one with "
            "`workbench derive --certificate FILE`"
        ) from error
    cost_s = time.perf_counter() - started_s
    text = f"proved: {statement}\n\n{_figures(data)}" if statement else f"not proved: {refusal}"
    facts = {"proved": refusal is None, "statement": statement, "refusal": refusal}
    emit(args, f"{text}\nchecked in {cost_s:.1f} s", facts | {"cost_s": cost_s})
    return 1 if refusal else 0


def _reason(data: bytes, error: ValueError) -> str:
    """Why the checker refuses a file, in a user's words where the file is none of its own."""
    if isinstance(error, json.JSONDecodeError | UnicodeDecodeError):
        return f"it is not JSON ({error})"
    said = str(error) if len(str(error)) <= _LONGEST else f"{str(error)[:_LONGEST]} ..."
    try:
        file = json.loads(data)
    except (ValueError, RecursionError):
        return said
    form = file.get("format") if isinstance(file, dict) else None
    if form == FORMAT:
        return said
    given = f"its format is {str(form)[:40]!r}" if form else "it has no format"
    return f"{given}, and this checker reads {FORMAT!r}"


def _figures(data: bytes) -> str:
    """What a proved file claims, per state, to four digits.

    Premises are rounded inward and results outward, so that what is shown follows from what is
    proved (a decimal number stands for its nearest double, as in the file). Names are the file's
    own words, shown so that none can add a line or a command to the terminal.
    """
    file = json.loads(data)
    names = [_plain(name) for name in file["model"]["states"]]
    return {"spread": _spread, "tube": _tube}[file["kind"]](names, file["claim"])


def _spread(states: list[str], claim: Any) -> str:
    """Region, initial distance, and the widths at the first and last instants."""
    instants = claim["instants"]
    if len(instants) > _MOST_INSTANTS:
        instants = [*instants[: _MOST_INSTANTS - 1], instants[-1]]
    headings = ["state", "region from", "to", "initial"]
    headings += [f"width at {each['time_s']:.15g} s" for each in instants]
    rows = [
        [name, *_inward(side), _rounded(claim["initial"][i], ROUND_FLOOR)]
        + [_rounded(each["widths"][i], ROUND_CEILING) for each in instants]
        for i, (name, side) in enumerate(zip(states, claim["region"], strict=True))
    ]
    return text_table(headings, rows)


def _tube(states: list[str], claim: Any) -> str:
    """The initial set and the set at the last instant."""
    headings = ["state", "initial from", "to", f"at {claim['times_s'][-1]:.15g} s from", "to"]
    ends = zip(states, claim["initial"], claim["instants"][-1], strict=True)
    rows = [
        [name, *_inward(first), _rounded(last[0], ROUND_FLOOR), _rounded(last[1], ROUND_CEILING)]
        for name, first, last in ends
    ]
    return text_table(headings, rows)


def _plain(name: str) -> str:
    short = name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]} ..."
    return short if short.isprintable() and short.strip() else ascii(short)


def _inward(side: list[float] | None) -> list[float | None]:
    if side is None or side[0] == side[1]:
        return [None, None] if side is None else [*side]
    return [_rounded(side[0], ROUND_CEILING), _rounded(side[1], ROUND_FLOOR)]


def _rounded(value: float, direction: str) -> float:
    return float(Context(prec=_DIGITS, rounding=direction).create_decimal(repr(float(value))))
