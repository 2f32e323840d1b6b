"""A player for images and what was made of them: boxes in the image, and the plan beside it."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.report.drawing import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, YELLOW
from workbench.report.page import asset, escaped

Point = tuple[float, float]

COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, YELLOW)
"""Of tracks, by their number."""


@final
@dataclass(frozen=True, slots=True)
class MarkedBox:
    """A box in the image, in shares of its width and height: left, top, right, bottom; text; colour
    of a track, None: of nobody who is followed; hidden: the sides that are not its own."""

    corners: tuple[float, float, float, float]
    text: str
    colour: str | None
    hidden: tuple[str, ...]


@final
@dataclass(frozen=True, slots=True)
class DrawnPerson:
    """Somebody on the plan, in the vehicle's frame (x ahead, y to the left; m).

    place: centre and radius; velocity: the middle of its disc (m/s); trail: earlier centres; seen:
    in this image.
    """

    text: str
    colour: str
    place: tuple[float, float, float]
    velocity: Point
    trail: tuple[Point, ...]
    seen: bool


@final
@dataclass(frozen=True, slots=True)
class Glimpse:
    """One image (JPEG) with its boxes, and the plan at its time, in the vehicle's frame.

    shadows: polygons behind boxes; assumed: centre and radius of discs in which somebody is
    assumed; notes: who has no place, and why.
    """

    t_s: float
    name: str
    jpeg: bytes
    boxes: tuple[MarkedBox, ...]
    people: tuple[DrawnPerson, ...]
    shadows: tuple[tuple[Point, ...], ...]
    assumed: tuple[tuple[float, float, float], ...]
    notes: tuple[str, ...]


@final
@dataclass(frozen=True, slots=True)
class Footage:
    """The player as a block of a page.

    glimpses: in the order of time; view: polygon of what the detector is relied on for, and eye:
    the camera, both in the vehicle's frame; total: images there were. Raises InputError for none.
    """

    glimpses: Sequence[Glimpse]
    view: tuple[Point, ...]
    eye: Point
    total: int
    caption: str

    def __post_init__(self) -> None:
        if not self.glimpses:
            raise InputError("expected at least one image to draw, got none")

    def html(self) -> str:
        """The block as HTML."""
        # "<" would let a name close the script element; JSON has another way to write it.
        data = json.dumps(self._content(), separators=(",", ":"), allow_nan=False)
        return (
            _MARKUP.format(
                caption=escaped(self.caption), last=len(self.glimpses) - 1,
                data=data.replace("<", "\\u003c"),
            )
            + f"<script>{asset('footage.js')}</script>"
        )  # fmt: skip

    def _content(self) -> dict[str, object]:
        return {
            "total": self.total,
            "view": [_cm(each) for each in self.view],
            "eye": _cm(self.eye),
            "frames": [_row(each) for each in self.glimpses],
        }


_MARKUP = """<div class="scene footage" role="group" aria-label="Player of images">
<div class="panels" style="grid-template-columns:repeat(auto-fit,minmax(min(20rem,100%),1fr))">
<canvas class="view seen" role="img" aria-label="Image with boxes"></canvas>
<canvas class="view plan" role="img" aria-label="Plan from above"></canvas></div>
<input type="range" class="scrubber" min="0" max="{last}" value="0" step="1" aria-label="Image">
<div class="controls"><button type="button" class="play" aria-pressed="false">Play</button>
<button type="button" class="back" aria-label="Previous image">◀</button>
<button type="button" class="ahead" aria-label="Next image">▶</button>
<button type="button" class="closer" aria-label="Zoom in">+</button>
<button type="button" class="wider" aria-label="Zoom out">−</button>
<label><input type="checkbox" class="unseen" checked> unseen regions</label></div>
<dl class="readout"><div><dt>time</dt><dd class="time">–</dd></div>
<div><dt>image</dt><dd class="image">–</dd></div>
<div><dt>boxes</dt><dd class="boxes">–</dd></div>
<div><dt>tracks</dt><dd class="tracks">–</dd></div>
<div><dt>assumed people</dt><dd class="assumed">–</dd></div>
<div class="reason"><dt>without a place</dt><dd class="why">–</dd></div></dl>
<p class="key">{caption} <span class="left-out"></span> Keys: space plays and stops, ← and → step,
Home and End jump, + and − zoom.</p>
<noscript><p class="notice">The player needs JavaScript; the tables do not.</p></noscript>
<script type="application/json" class="frames">{data}</script></div>"""


def _row(glimpse: Glimpse) -> dict[str, object]:
    """Lengths in cm, shares of the image in ten-thousandths."""
    jpeg = base64.b64encode(glimpse.jpeg).decode("ascii")
    return {
        "t": round(glimpse.t_s, 4),
        "n": glimpse.name,
        "i": f"data:image/jpeg;base64,{jpeg}",
        "b": [
            {"c": [round(1e4 * share) for share in box.corners], "s": box.text, "k": box.colour,
             "h": list(box.hidden)}
            for box in glimpse.boxes
        ],
        "p": [
            {"s": each.text, "k": each.colour, "d": _cm(each.place), "v": _cm(each.velocity),
             "w": [_cm(point) for point in each.trail], "o": each.seen}
            for each in glimpse.people
        ],
        "u": [[_cm(point) for point in polygon] for polygon in glimpse.shadows],
        "a": [_cm(disc) for disc in glimpse.assumed],
        "y": list(glimpse.notes),
    }  # fmt: skip


def _cm(values: Sequence[float]) -> list[int]:
    return [round(100.0 * value) for value in values]
