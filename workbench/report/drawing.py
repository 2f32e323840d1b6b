"""Panels of inline SVG that follow the page's colours and refer to nothing outside the page."""

from __future__ import annotations

import contextlib
import hashlib
import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import matplotlib
from matplotlib.artist import Artist
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from workbench.claims import Verdict
from workbench.report import keys
from workbench.report.page import escaped
from workbench.report.tables import Table

ORANGE, SKY, GREEN, YELLOW = "#E69F00", "#56B4E9", "#009E73", "#F0E442"
BLUE, VERMILLION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
# Drawn in this colour, replaced by `currentColor`, so that axes and text follow light and dark.
INK = "#010203"
PALETTE = (BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY, YELLOW)
"""Okabe and Ito's colours, which colour-blind readers can tell apart, the darkest first."""
Dashes = str | tuple[float, tuple[float, ...]]
DASHES: Final[Mapping[Dashes, str]] = {
    "-": "",
    "--": "7 3",
    "-.": "8 3 2 3",
    ":": "2 3",
    (0.0, (9.0, 3.0)): "18 5",
    (0.0, (6.0, 2.0, 1.0, 2.0, 1.0, 2.0)): "9 2 2 2 2 2",
    (0.0, (3.0, 1.0)): "4 1.5",
    (0.0, (1.0, 4.0)): "2 6",
}
"""Of lines: as Matplotlib takes them, and as a legend draws them."""
STYLES: Final = tuple(zip((*PALETTE, INK), DASHES, strict=True))
"""A colour and dashes per line of a picture: each differs from all others in both."""
HATCHES = ("", "///", "xxx", "...")
"""Of areas that differ in colour, so that they also differ without it."""
VERDICT_COLOURS = {Verdict.SAFE: GREEN, Verdict.UNPROVED: ORANGE, Verdict.INVALID: PURPLE}
VERDICT_HATCHES = dict(zip(VERDICT_COLOURS, HATCHES, strict=False))
VERDICT_MARKS = {Verdict.SAFE: "o", Verdict.UNPROVED: "s", Verdict.INVALID: "X"}

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
    "hatch.color": INK,
    "hatch.linewidth": 0.6,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.facecolor": "none",
    "axes.unicode_minus": True,
}
Paint = Callable[[Canvas], None]
_NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


@final
@dataclass(frozen=True, slots=True)
class Key:
    """One entry of a legend: what a line, mark or patch stands for.

    dashes: of the line, as SVG writes them; filled: a patch instead, hatch: with this pattern;
    mark: a mark of matplotlib's instead. Raises InputError on hatches and marks without a picture.
    """

    label: str
    colour: str
    dashes: str = ""
    filled: bool = False
    mark: str = ""
    hatch: str = ""

    def __post_init__(self) -> None:
        self.sample()  # Refuses what it cannot draw.

    def handle(self) -> Artist:
        """The picture beside the words, for a legend on a canvas."""
        colour = self.colour.replace(INK, "black")
        if self.filled:
            return Patch(facecolor=colour, hatch=self.hatch or None, label=self.label)
        dashes = tuple(map(float, self.dashes.split()))
        return Line2D(
            [], [], color=colour, linestyle=(0.0, dashes) if dashes else "-",
            marker=self.mark or None, label=self.label,
        )  # fmt: skip

    def sample(self) -> str:
        """The picture beside the words, as the inside of an SVG."""
        colour = self.colour.replace(INK, "currentColor")
        if self.mark:
            return keys.mark(colour, self.mark)
        return keys.patch(colour, self.hatch) if self.filled else keys.line(colour, self.dashes)

    def html(self) -> str:
        """The block as HTML."""
        picture = f'<svg width="26" height="14" aria-hidden="true">{self.sample()}</svg>'
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


@final
class Panel(str):
    """One picture: SVG text for inside an HTML page that remembers how it was drawn.

    paint: draws on an empty canvas; size_in: width and height in inches; label: what a screen
    reader says.
    """

    __slots__ = ("label", "paint", "size_in")

    paint: Paint
    size_in: tuple[float, float]
    label: str


def svg_panel(paint: Paint, *, label: str, width_in: float = 4.4, height_in: float = 2.7) -> Panel:
    """What `paint` draws on an empty canvas, as SVG text for inside an HTML page.

    label: what a screen reader says; width_in, height_in: size in inches at which 10 pt text is
    10 pt; the page scales it. The same drawing gives the same text.
    """
    stream = io.StringIO()
    with drawing_style(background="none"):
        canvas = Canvas(figsize=(width_in, height_in), layout="constrained")
        paint(canvas)
        canvas.savefig(stream, format="svg", metadata=_NO_METADATA)
    box = f"0 0 {72.0 * width_in:g} {72.0 * height_in:g}"
    opening = f'<svg viewBox="{box}" role="img" aria-label="{escaped(label)}">'
    panel = Panel(opening + _inlined(stream.getvalue()))
    panel.paint, panel.size_in, panel.label = paint, (width_in, height_in), label
    return panel


@contextlib.contextmanager
def drawing_style(*, background: str) -> Iterator[None]:
    """Matplotlib's settings while a panel is drawn; background: a colour, or "none"."""
    style: Any = {**_STYLE, "figure.facecolor": background, "savefig.facecolor": background}
    with matplotlib.rc_context(style), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


def _inlined(svg: str) -> str:
    """The content of an SVG file, without its opening tag, cleaned for an HTML page."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\sd="([^"]*)"', _rounded, svg)
    svg = svg.replace("'DejaVu Sans'", "sans-serif").replace(INK, "currentColor")
    # Matplotlib's links open a new window; these lead to another part of the same page.
    svg = _own_ids(svg.replace(' target="_blank"', ""))
    return re.sub(r"\n\s*", "\n", svg[svg.index(">") + 1 :]).strip()


def _rounded(match: re.Match[str]) -> str:
    short = re.sub(r"-?\d+\.\d+", lambda number: f"{float(number.group()):.2f}", match.group(1))
    return ' d="' + " ".join(short.split()) + '"'


def _own_ids(svg: str) -> str:
    """Ids that no other picture on the page shares; those nobody refers to are dropped."""
    own = set(re.findall(r'\sid="([^"]*)"', svg))
    referenced = own & set(re.findall(r'(?:url\(#|href="#)([^)"]+)', svg))
    prefix = hashlib.sha256(svg.encode()).hexdigest()[:8]

    def renamed(match: re.Match[str]) -> str:
        name = match.group(1)
        return f' id="{prefix}{name}"' if name in referenced else ""

    svg = re.sub(r'\sid="([^"]*)"', renamed, svg)
    # A link out of the picture, to another part of the page, keeps its address.
    led = re.compile(r'(url\(#|href="#)([^)"]+)')
    return led.sub(lambda m: m[1] + prefix * (m[2] in own) + m[2], svg)


def thinned(count: int, limit: int) -> Sequence[int]:
    """At most `limit` (at least 2) indices of 0..count-1, evenly spread, first and last included.

    >>> list(thinned(10, 4))
    [0, 3, 6, 9]
    """
    if count <= limit:
        return range(count)
    return sorted({round(k * (count - 1) / (limit - 1)) for k in range(limit)})
