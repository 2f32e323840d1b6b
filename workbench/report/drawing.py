"""Panels of inline SVG that follow the page's colours and refer to nothing outside the page."""

from __future__ import annotations

import hashlib
import io
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import final

import matplotlib
from matplotlib.figure import Figure as Canvas

from workbench.claims import Verdict
from workbench.report.page import escaped
from workbench.report.tables import Table

ORANGE, SKY, GREEN, YELLOW = "#E69F00", "#56B4E9", "#009E73", "#F0E442"
BLUE, VERMILLION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
# Drawn in this colour, replaced by `currentColor`, so that axes and text follow light and dark.
INK = "#010203"
VERDICT_COLOURS = {Verdict.SAFE: GREEN, Verdict.UNPROVED: ORANGE, Verdict.INVALID: PURPLE}

_STYLE: dict[str, object] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "workbench",
    "text.parse_math": False,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 10.0,
    "axes.titlesize": 10.0,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": INK,
    "grid.alpha": 0.15,
    "grid.linewidth": 0.6,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "axes.unicode_minus": True,
}
_NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


@final
@dataclass(frozen=True, slots=True)
class Key:
    """One entry of a legend: a line or patch of a colour and what it stands for."""

    label: str
    colour: str
    dashes: str = ""
    filled: bool = False

    def html(self) -> str:
        """The block as HTML."""
        colour = self.colour.replace(INK, "currentColor")
        if self.filled:
            mark = f'<rect x="1" y="2" width="24" height="10" fill="{colour}" fill-opacity=".7"/>'
        else:
            mark = (
                f'<line x1="1" y1="7" x2="25" y2="7" stroke="{colour}" stroke-width="2.5" '
                f'stroke-dasharray="{self.dashes}"/>'
            )
        picture = f'<svg width="26" height="14" aria-hidden="true">{mark}</svg>'
        return f"<li>{picture} {escaped(self.label)}</li>"


@final
@dataclass(frozen=True, slots=True)
class Figure:
    """Pictures that share a legend and a caption, and the numbers behind them.

    panels: SVG texts, laid out side by side as the screen allows; wide: one picture over the whole
    width; numbers: the table that is folded below the pictures.
    """

    panels: tuple[str, ...]
    legend: tuple[Key, ...]
    caption: str
    numbers: Table | None = None
    wide: bool = False

    def html(self) -> str:
        """The block as HTML."""
        keys = "".join(key.html() for key in self.legend)
        pictures = "".join(f'<div class="panel">{panel}</div>' for panel in self.panels)
        layout = "panels wide" if self.wide else "panels"
        numbers = self.numbers.html() if self.numbers else ""
        return (
            f'<figure><ul class="legend">{keys}</ul><div class="{layout}">{pictures}</div>'
            f"<figcaption>{escaped(self.caption)}</figcaption></figure>{numbers}"
        )


def svg_panel(
    paint: Callable[[Canvas], None], *, label: str, width_in: float = 4.4, height_in: float = 2.7
) -> str:
    """What `paint` draws on an empty canvas, as SVG text for inside an HTML page.

    label: what a screen reader says; width_in, height_in: size in inches at which 10 pt text is
    10 pt; the page scales it. The same drawing gives the same text.
    """
    stream = io.StringIO()
    with matplotlib.rc_context(_STYLE), warnings.catch_warnings():  # type: ignore[arg-type]
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        canvas = Canvas(figsize=(width_in, height_in), layout="constrained")
        paint(canvas)
        canvas.savefig(stream, format="svg", metadata=_NO_METADATA)
    box = f"0 0 {72.0 * width_in:g} {72.0 * height_in:g}"
    opening = f'<svg viewBox="{box}" role="img" aria-label="{escaped(label)}">'
    return opening + _inlined(stream.getvalue())


def _inlined(svg: str) -> str:
    """The content of an SVG file, without its opening tag, cleaned for an HTML page."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\sd="([^"]*)"', _rounded, svg)
    svg = svg.replace("'DejaVu Sans'", "sans-serif").replace(INK, "currentColor")
    svg = _own_ids(svg)
    return re.sub(r"\n\s*", "\n", svg[svg.index(">") + 1 :]).strip()


def _rounded(match: re.Match[str]) -> str:
    short = re.sub(r"-?\d+\.\d+", lambda number: f"{float(number.group()):.2f}", match.group(1))
    return ' d="' + " ".join(short.split()) + '"'


def _own_ids(svg: str) -> str:
    """Ids that no other picture on the page shares; those nobody refers to are dropped."""
    referenced = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', svg))
    prefix = hashlib.sha256(svg.encode()).hexdigest()[:8]

    def renamed(match: re.Match[str]) -> str:
        name = match.group(1)
        return f' id="{prefix}{name}"' if name in referenced else ""

    svg = re.sub(r'\sid="([^"]*)"', renamed, svg)
    return re.sub(r'(url\(#|href="#)', rf"\g<1>{prefix}", svg)


def thinned(count: int, limit: int) -> Sequence[int]:
    """At most `limit` (at least 2) indices of 0..count-1, evenly spread, first and last included.

    >>> list(thinned(10, 4))
    [0, 3, 6, 9]
    """
    if count <= limit:
        return range(count)
    return sorted({round(k * (count - 1) / (limit - 1)) for k in range(limit)})
