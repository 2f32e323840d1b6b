"""A player for recorded decisions: the scene from above, moved through time by a slider."""

from __future__ import annotations

import json
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar, final

from workbench.claims import Verdict
from workbench.report.drawing import VERDICT_COLOURS, thinned
from workbench.report.page import asset, escaped
from workbench.report.plane import nearest
from workbench.report.timeline import require_frames
from workbench.simulation.frames import Disc, Frame, PersonFrame, Point, Rectangle, drawable

_VERDICTS = tuple(Verdict)
# Of each guard: now, and on the way to a stop.
_GUARDS = 3
# Of each person's goals: the likeliest.
_WANTED = 3
T = TypeVar("T", bound=Hashable)


@final
@dataclass(frozen=True, slots=True)
class Detail:
    """How much of each decision is kept for drawing."""

    frames: int
    rectangles: int
    discs: int
    people: int


# Tried in turn until the scene fits its budget; the player says what was left out.
_DETAILS = (
    Detail(frames=1200, rectangles=21, discs=11, people=40),
    Detail(frames=1200, rectangles=15, discs=7, people=40),
    Detail(frames=700, rectangles=11, discs=5, people=40),
    Detail(frames=400, rectangles=8, discs=4, people=30),
    Detail(frames=200, rectangles=6, discs=3, people=20),
)


@final
@dataclass(frozen=True, slots=True)
class Scene:
    """The player as a block of a page.

    frames: decisions in time order; caption: what is shown; budget_bytes: largest size of the data
    in the page, kept by drawing fewer rectangles, discs, decisions and far people.
    Raises InputError when there are no frames or time runs backwards.
    """

    frames: Sequence[Frame]
    caption: str
    budget_bytes: int = 3_000_000

    def __post_init__(self) -> None:
        require_frames(self.frames)

    def html(self) -> str:
        """The block as HTML."""
        data, count = _fitting(self.frames, self.budget_bytes)
        # "<" would let a name close the script element; JSON has another way to write it.
        inert = data.replace("<", "\\u003c")
        return (
            _MARKUP.format(caption=escaped(self.caption), last=count - 1, data=inert)
            + f"<script>{asset('scene.js')}</script>"
        )


_MARKUP = """<div class="scene" role="group" aria-label="Scene player">
<canvas class="view" role="img" aria-label="{caption}"></canvas>
<canvas class="strip" aria-hidden="true"></canvas>
<input type="range" class="scrubber" min="0" max="{last}" value="0" step="1" aria-label="Decision">
<div class="controls"><button type="button" class="play" aria-pressed="false">Play</button>
<button type="button" class="back" aria-label="Previous decision">◀</button>
<button type="button" class="ahead" aria-label="Next decision">▶</button>
<label>Pace <select class="pace"><option value="0.25">¼×</option>
<option value="1" selected>1×</option><option value="4">4×</option></select></label>
<button type="button" class="closer" aria-label="Zoom in">+</button>
<button type="button" class="wider" aria-label="Zoom out">−</button>
<label>Show <select class="shown"><option value="0" selected>both policies</option>
<option value="1">LookAhead</option><option value="2">FailSafe</option></select></label>
<label><input type="checkbox" class="follow" checked> follow the car</label></div>
<dl class="readout"><div><dt>time</dt><dd class="time">–</dd></div>
<div><dt>verdict</dt><dd><span class="badge verdict">–</span></dd></div>
<div><dt>action</dt><dd class="action">–</dd></div>
<div><dt>sent</dt><dd class="sent">–</dd></div>
<div><dt>speed</dt><dd class="speed">–</dd></div>
<div><dt>proved clearance</dt><dd class="clearance">–</dd></div>
<div><dt>people</dt><dd class="people">–</dd></div>
<div class="reason"><dt>reason</dt><dd class="why">–</dd></div>
<div class="reason"><dt>each policy</dt><dd class="policies">–</dd></div>
<div class="reason"><dt>nested sets, the largest first</dt><dd class="levels">–</dd></div>
<div class="reason"><dt>what people want</dt><dd class="wanted">–</dd></div>
<div class="reason"><dt>violations and alert</dt><dd class="named">–</dd></div></dl>
<p class="key">{caption} Outline with arrow: the car. Dashed line: the path. Filled boxes:
where the car can be in TRACK, up to the horizon or the end of the proof, coloured by what LookAhead
says; bold empty boxes: in TRACK and then BRAKE to standstill, coloured by what FailSafe says (a few
of many boxes). Blue: people now, and the discs predicted; dotted: where their guard lets them be;
an arrow at the edge: somebody outside of the picture.
<span class="left-out"></span> Keys: space plays and stops, ← and → step,
Home and End jump, + and − zoom.</p>
<noscript><p class="notice">The player needs JavaScript; the pictures do not.</p></noscript>
<script type="application/json" class="frames">{data}</script></div>"""


def _fitting(frames: Sequence[Frame], budget_bytes: int) -> tuple[str, int]:
    """JSON at the finest detail that fits (the coarsest if none does), and its number of frames."""
    text, count = "", 0
    for detail in _DETAILS:
        text, count = scene_json(frames, detail), min(len(frames), detail.frames)
        if len(text.encode()) <= budget_bytes:
            break
    return text, count


@final
class _Pool(Generic[T]):
    """Distinct values in order of first use."""

    def __init__(self) -> None:
        self.known: dict[T, int] = {}

    def index(self, value: T) -> int:
        return self.known.setdefault(value, len(self.known))


def scene_json(frames: Sequence[Frame], detail: Detail) -> str:
    """The frames as compact JSON: lengths in cm, angles in mrad, runs of numbers as differences.

    Texts and paths are pooled, as most decisions share them. People beyond `detail.people` nearest
    to the car are left out of the drawing; `n` keeps their true number.
    """
    texts, paths = _Pool[str](), _Pool[tuple[Point, ...]]()
    chosen = [frames[index] for index in thinned(len(frames), detail.frames)]
    rows = [
        _seen_row(frame, detail, texts)
        | _said_row(frame, texts)
        | {"l": paths.index(frame.path), "o": _rectangles(frame.occupancy, detail.rectangles),
           "h": _rectangles(frame.stop_occupancy, detail.rectangles)}
        for frame in chosen
    ]  # fmt: skip
    content = {
        "verdicts": [[verdict.value, VERDICT_COLOURS[verdict]] for verdict in _VERDICTS],
        "total": len(frames),
        "texts": list(texts.known),
        "paths": [_differences(map(_cm, path)) for path in paths.known],
        "frames": rows,
    }
    return json.dumps(content, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def _seen_row(frame: Frame, detail: Detail, texts: _Pool[str]) -> dict[str, object]:
    """Car and people of one decision."""
    near = nearest(frame)[: detail.people]
    return {
        "t": round(frame.t_s, 3),
        "c": [*_cm((frame.x_m, frame.y_m)), round(1000.0 * frame.heading)],
        "b": _cm((frame.front_m, frame.rear_m, frame.half_width_m)),
        "s": round(frame.speed_mps, 2),
        "n": len(frame.people),
        "p": [[texts.index(person.name), *_seen(person, detail.discs)] for person in near],
        "g": [_discs(person.guarded, _GUARDS) for person in near],
        "i": [
            [[texts.index(goal), round(100.0 * chance)] for goal, chance in person.wanted[:_WANTED]]
            for person in near
        ],
    }


def _said_row(frame: Frame, texts: _Pool[str]) -> dict[str, object]:
    """What was said and sent: v, a, r, d decided; q policies; m nested sets; w, z warnings; u where
    nothing was decided."""
    return {
        "v": _VERDICTS.index(frame.verdict),
        "a": texts.index(frame.action),
        "r": texts.index(frame.reason),
        "d": None if frame.clearance_m is None else round(frame.clearance_m, 2),
        "e": texts.index(frame.sent),
        "q": [
            [texts.index(each.policy), _VERDICTS.index(each.verdict), texts.index(each.action),
             texts.index(each.reason)]
            for each in frame.policies
        ],
        "m": [[texts.index(m.tube), *map(_VERDICTS.index, m.verdicts)] for m in frame.levels],
        "w": [texts.index(text) for text in frame.violations],
        "z": None if frame.alert is None else texts.index(frame.alert),
        **({} if frame.decided else {"u": 1}),
    }  # fmt: skip


def _cm(values: Iterable[float]) -> list[int]:
    return [round(100.0 * value) for value in values]


def _differences(rows: Iterable[Sequence[int]]) -> list[int]:
    """Rows of equal length, one after the other, each as its difference from the one before."""
    flat: list[int] = []
    before: Sequence[int] | None = None
    for row in rows:
        flat += row if before is None else [a - b for a, b in zip(row, before, strict=True)]
        before = row
    return flat


def _rectangles(occupancy: Sequence[Rectangle], limit: int) -> list[int]:
    shapes = [shape for shape in occupancy if drawable(shape)]
    chosen = [shapes[index] for index in thinned(len(shapes), limit)]
    return _differences(
        [*_cm((x, y)), round(1000.0 * heading), *_cm((length, width))]
        for x, y, heading, length, width in chosen
    )


def _seen(person: PersonFrame, limit: int) -> list[int]:
    """The person now, and the discs predicted for them."""
    later = [disc for disc in person.predicted if drawable(disc)]
    chosen = [later[index] for index in thinned(len(later), limit)]
    return _differences(map(_cm, [(person.x_m, person.y_m, person.radius_m), *chosen]))


def _discs(shapes: Sequence[Disc], limit: int) -> list[int]:
    known = [shape for shape in shapes if drawable(shape)]
    return _differences(_cm(known[index]) for index in thinned(len(known), limit))
