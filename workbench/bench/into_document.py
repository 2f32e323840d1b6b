"""Tables in Markdown, and their place between two marks of a document."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from workbench.errors import InputError


def markdown(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """One line per row, under the headings."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (headings, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(headings), *lines[1:]])


def put_between(path: Path, marks: tuple[str, str], text: str) -> None:
    """Replace what stands between the marks. InputError unless each stands there once."""
    document = path.read_text(encoding="utf-8")
    begin, end = marks
    if document.count(begin) != 1 or document.count(end) != 1:
        raise InputError(f"--into: expected the lines {begin} and {end} once each in {path}")
    before, _, rest = document.partition(begin)
    after = rest.partition(end)[2]
    path.write_text(f"{before}{begin}\n\n{text}\n\n{end}{after}", encoding="utf-8")
