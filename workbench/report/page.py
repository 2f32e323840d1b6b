"""A report as one HTML file: blocks in, text out; everything inline, nothing fetched."""

from __future__ import annotations

import html
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Protocol, final

from workbench.claims import Assumption, Rigor
from workbench.errors import InputError


class Block(Protocol):
    """A piece of a page that can write itself as HTML with every foreign string escaped."""

    def html(self) -> str:
        """The block as HTML."""
        ...


def escaped(text: object) -> str:
    """`text` as HTML text that is also safe inside a quoted attribute."""
    return html.escape(str(text), quote=True)


def asset(name: str) -> str:
    """Text of a style sheet or script that ships beside this module."""
    return (files("workbench.report") / "assets" / name).read_text(encoding="utf-8")


@final
@dataclass(frozen=True, slots=True)
class Paragraph:
    """Plain text."""

    text: str

    def html(self) -> str:
        """The block as HTML."""
        return f"<p>{escaped(self.text)}</p>"


@final
@dataclass(frozen=True, slots=True)
class Notice:
    """Plain text that must not be overlooked, under a short bold title."""

    title: str
    text: str

    def html(self) -> str:
        """The block as HTML."""
        return (
            f'<p class="notice" role="note"><strong>{escaped(self.title)}</strong> '
            f"{escaped(self.text)}</p>"
        )


@final
@dataclass(frozen=True, slots=True)
class Section:
    """Blocks under a heading."""

    title: str
    blocks: Sequence[Block]

    def html(self) -> str:
        """The block as HTML."""
        return f"<h2>{escaped(self.title)}</h2>" + "".join(block.html() for block in self.blocks)


@final
@dataclass(frozen=True, slots=True)
class Claim:
    """A statement with the grade of its proof."""

    statement: str
    rigor: Rigor


MEANING = {
    Rigor.SAMPLED: "learned or tested on runs, not proved",
    Rigor.NUMERICAL: "sound argument, floating-point errors not proved",
    Rigor.ENCLOSED: "containment proved, rounding included",
}


@final
@dataclass(frozen=True, slots=True)
class Claims:
    """Claims, each with a badge of its Rigor, and what the badges mean."""

    claims: Sequence[Claim]

    def html(self) -> str:
        """The block as HTML."""
        items = "".join(
            f"<li>{badge(claim.rigor)} {escaped(claim.statement)}</li>" for claim in self.claims
        )
        used = sorted({claim.rigor for claim in self.claims})
        key = "; ".join(f"{rigor.name}: {MEANING[rigor]}" for rigor in used)
        return f'<ul class="claims">{items}</ul><p class="key">{escaped(key)}.</p>'


def badge(rigor: Rigor) -> str:
    """The Rigor's name in a coloured box (HTML)."""
    return f'<span class="badge {rigor.name.lower()}">{escaped(rigor.name)}</span>'


@final
@dataclass(frozen=True, slots=True)
class Assumptions:
    """The named premises under which a SAFE verdict holds, with their evidence."""

    assumptions: Sequence[Assumption]

    def html(self) -> str:
        """The block as HTML."""
        if not self.assumptions:
            return "<p>No assumptions were recorded.</p>"
        return "".join(
            f'<div class="assumption"><h3>{escaped(item.name)}</h3><p>{escaped(item.statement)}</p>'
            f'<p class="key">Evidence: {escaped(item.evidence or "none given")}</p></div>'
            for item in self.assumptions
        )


@final
@dataclass(frozen=True, slots=True)
class Page:
    """A whole report.

    title: heading; lead: what came out, in plain sentences; sections: in reading order;
    version: of the program that made the page; command: the command line that makes it again.
    """

    title: str
    lead: Sequence[str]
    sections: Sequence[Section]
    version: str
    command: str

    def html(self) -> str:
        """The page as the text of one self-contained file."""
        links = "".join(
            f'<li><a href="#s{index}">{escaped(section.title)}</a></li>'
            for index, section in enumerate(self.sections, 1)
        )
        body = "".join(
            f'<section id="s{index}">{section.html()}</section>'
            for index, section in enumerate(self.sections, 1)
        )
        lead = "".join(f"<p>{escaped(sentence)}</p>" for sentence in self.lead)
        return (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            '<link rel="icon" href="data:,">'
            f"<title>{escaped(self.title)}</title><style>{asset('page.css')}</style></head>"
            f'<body><header><h1>{escaped(self.title)}</h1><div class="lead">{lead}</div>'
            f'<nav aria-label="Sections"><ul>{links}</ul></nav></header><main>{body}</main>'
            f"<footer><p>Made by workbench {escaped(self.version)} with</p>"
            f"<pre>{escaped(self.command)}</pre></footer>"
            f"<script>{asset('page.js')}</script></body></html>\n"
        )


def write_page(path: Path, html_text: str) -> None:
    """Write a page so that `path` holds either its old content or the whole new one.

    path: the file; missing folders are made. Raises InputError where nothing can be written.
    """
    temporary: str | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(html_text)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(
            f"expected to write the report to {path}, got: {error.strerror or error}; "
            "name a folder that can be written to"
        ) from error
    finally:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
