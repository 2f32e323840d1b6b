"""Pictures of decisions: the plane from above at one of them, and all of them over time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import partial

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Circle, Polygon

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.report.drawing import (
    BLUE,
    INK,
    SKY,
    VERDICT_COLOURS,
    Figure,
    Key,
    svg_panel,
    thinned,
)
from workbench.report.tables import Cell, Table
from workbench.simulation.frames import Frame, PersonFrame, Point, Rectangle, drawable

_DRAWN_RECTANGLES = 30
_DRAWN_DISCS = 12
_TABLE_ROWS = 1000
_NAMED_PEOPLE = 6
_NEAR_M = 25.0
_LEVELS = {Verdict.INVALID: 0.0, Verdict.UNPROVED: 1.0, Verdict.SAFE: 2.0}
_MARKS = {Verdict.SAFE: "o", Verdict.UNPROVED: "s", Verdict.INVALID: "X"}


def corners(rectangle: Rectangle) -> tuple[Point, ...]:
    """The four corners of (centre x, centre y, heading, half length, half width), in turn."""
    x, y, heading, length, width = rectangle
    cos, sin = math.cos(heading), math.sin(heading)
    return tuple(
        (x + a * length * cos - b * width * sin, y + a * length * sin + b * width * cos)
        for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
    )


def body(frame: Frame) -> Rectangle:
    """The car's own outline at a decision."""
    ahead = 0.5 * (frame.front_m - frame.rear_m)
    return (
        frame.x_m + ahead * math.cos(frame.heading),
        frame.y_m + ahead * math.sin(frame.heading),
        frame.heading,
        0.5 * (frame.front_m + frame.rear_m),
        frame.half_width_m,
    )


def nearest(frame: Frame) -> list[PersonFrame]:
    """The people of a frame, nearest to the car's reference point first."""
    return sorted(frame.people, key=lambda p: math.hypot(p.x_m - frame.x_m, p.y_m - frame.y_m))


def plane_figure(frame: Frame, travelled: Sequence[Point] = ()) -> Figure:
    """The plane from above at one decision: path, car, swept occupancy, people and predictions.

    frame: the decision; travelled: positions (x, y) of the car so far, m.
    """
    width, height, limits = _extent(frame)
    label = f"Plane at {frame.t_s:.2f} s from above, verdict {frame.verdict.value}"
    panel = svg_panel(
        partial(_paint_plane, frame=frame, travelled=travelled, limits=limits),
        label=label,
        width_in=width,
        height_in=height,
    )
    legend = (
        Key("path", INK, "7 3"),
        Key("car now", INK),
        Key(
            f"where the car can be, verdict {frame.verdict.value}",
            VERDICT_COLOURS[frame.verdict],
            filled=True,
        ),
        Key("person and prediction", BLUE, filled=True),
    )
    caption = f"The decision at {frame.t_s:.2f} s. {frame.reason}"
    return Figure((panel,), legend, caption, _people_table(frame), wide=True)


def _extent(frame: Frame) -> tuple[float, float, tuple[float, float, float, float]]:
    """Size in inches and limits in metres of a picture that shows all that moves."""
    points = [*corners(body(frame))]
    for rectangle in filter(drawable, frame.occupancy):
        points += corners(rectangle)
    for person in frame.people:
        # The growing discs of people far away would shrink the car to a dot.
        for x, y, radius in ((person.x_m, person.y_m, person.radius_m), *person.predicted[-1:]):
            if math.hypot(x - frame.x_m, y - frame.y_m) < _NEAR_M:
                points += [(x - radius, y - radius), (x + radius, y + radius)]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    left, right, low, high = min(xs) - 1.0, max(xs) + 1.0, min(ys) - 1.0, max(ys) + 1.0
    span_x, span_y = right - left, high - low
    width = 4.6
    ratio = min(max(span_y / span_x, 0.35), 1.2)
    if span_y < ratio * span_x:
        low, high = (low + high) / 2 - ratio * span_x / 2, (low + high) / 2 + ratio * span_x / 2
    elif span_y > ratio * span_x:
        middle, half = (left + right) / 2, span_y / ratio / 2
        left, right = middle - half, middle + half
    return width, 0.6 + 0.88 * width * ratio, (left, right, low, high)


def _paint_plane(
    canvas: Canvas,
    *,
    frame: Frame,
    travelled: Sequence[Point],
    limits: tuple[float, float, float, float],
) -> None:
    axes: Axes = canvas.add_subplot()
    axes.set_xlim(limits[0], limits[1])
    axes.set_ylim(limits[2], limits[3])
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    if frame.path:
        axes.plot(*zip(*frame.path, strict=True), color=INK, linestyle="--", linewidth=1.0)
    if travelled:
        axes.plot(*zip(*travelled, strict=True), color=INK, linewidth=1.0, alpha=0.6)
    colour = VERDICT_COLOURS[frame.verdict]
    shapes = [shape for shape in frame.occupancy if drawable(shape)]
    for index in thinned(len(shapes), _DRAWN_RECTANGLES):
        shape = corners(shapes[index])
        axes.add_patch(
            Polygon(shape, facecolor=(colour, 0.08), edgecolor=(colour, 0.8), linewidth=0.7)
        )
    outline = corners(body(frame))
    axes.add_patch(Polygon(outline, facecolor="none", edgecolor=INK, linewidth=1.8))
    for rank, person in enumerate(nearest(frame)):
        discs = [disc for disc in person.predicted if drawable(disc)]
        for index in thinned(len(discs), _DRAWN_DISCS):
            x, y, radius = discs[index]
            axes.add_patch(Circle((x, y), radius, facecolor=(SKY, 0.1), edgecolor=(BLUE, 0.7)))
        spot = (person.x_m, person.y_m)
        axes.add_patch(Circle(spot, person.radius_m, facecolor=BLUE, edgecolor=INK, linewidth=0.8))
        if rank < _NAMED_PEOPLE:
            label = axes.annotate(person.name, spot, (6, 6), textcoords="offset points")
            # A long name must not squeeze the picture to make room for itself.
            label.set_in_layout(False)
            label.set_clip_on(True)


def _people_table(frame: Frame) -> Table:
    rows: list[list[Cell]] = [
        [person.name, person.x_m, person.y_m, person.radius_m] for person in frame.people
    ]
    headings = ["person", "x (m)", "y (m)", "radius now (m)"]
    return Table(f"people at {frame.t_s:.2f} s", headings, rows, folded=True)


def require_frames(frames: Sequence[Frame]) -> None:
    """Raise InputError unless there is at least one frame and time does not run backwards."""
    if not frames:
        raise InputError("expected at least one decision, got none; widen the time window")
    for before, after in itertools.pairwise(frames):
        if not after.t_s >= before.t_s:
            raise InputError(
                f"expected decisions in time order, got {after.t_s!r} s after {before.t_s!r} s; "
                "sort them"
            )


def verdict_timeline(frames: Sequence[Frame]) -> Figure:
    """Verdict, proved clearance and speed of every decision over time.

    frames: the decisions in time order. Raises InputError when there are none.
    """
    require_frames(frames)
    panel = svg_panel(
        partial(_paint_timeline, frames=frames),
        label="Verdict, clearance and speed over time",
        width_in=4.6,
        height_in=4.4,
    )
    legend = tuple(Key(verdict.value, VERDICT_COLOURS[verdict], filled=True) for verdict in Verdict)
    caption = (
        "One mark per decision. Only SAFE permits tracking; UNPROVED does not mean unsafe. "
        "Where no clearance is drawn, none was proved or nobody was there."
    )
    return Figure((panel,), legend, caption, decision_table(frames), wide=True)


def _paint_timeline(canvas: Canvas, *, frames: Sequence[Frame]) -> None:
    verdict_axes, clearance_axes, speed_axes = canvas.subplots(
        3, 1, sharex=True, height_ratios=(1.0, 1.2, 1.0)
    )
    for verdict, mark in _MARKS.items():
        chosen = [frame for frame in frames if frame.verdict is verdict]
        times = [frame.t_s for frame in chosen]
        clearances = [math.nan if f.clearance_m is None else f.clearance_m for f in chosen]
        style = {"color": VERDICT_COLOURS[verdict], "linestyle": "none", "marker": mark}
        verdict_axes.plot(times, [_LEVELS[verdict]] * len(times), markersize=4, **style)
        clearance_axes.plot(times, clearances, markersize=3.5, **style)
    verdict_axes.set_yticks(list(_LEVELS.values()), [level.value for level in _LEVELS])
    verdict_axes.set_ylim(-0.5, 2.5)
    verdict_axes.set_ylabel("verdict")
    clearance_axes.set_ylabel("proved\nclearance (m)")
    speed_axes.plot(
        [f.t_s for f in frames], [f.speed_mps for f in frames], color=INK, linewidth=1.3
    )
    speed_axes.set_ylim(bottom=0.0)
    speed_axes.set_ylabel("speed (m/s)")
    speed_axes.set_xlabel("time (s)")
    canvas.align_ylabels()


def decision_table(frames: Sequence[Frame]) -> Table:
    """The decisions, one row each; evenly spread ones where there are very many."""
    chosen = [frames[index] for index in thinned(len(frames), _TABLE_ROWS)]
    rows: list[list[Cell]] = [
        [f.t_s, f.verdict.value, f.action, f.clearance_m, f.speed_mps, len(f.people), f.reason]
        for f in chosen
    ]
    headings = ["time (s)", "verdict", "action", "clearance (m)", "speed (m/s)", "people", "reason"]
    return Table("decisions", headings, rows, folded=True)


def summary_table(frames: Sequence[Frame]) -> Table:
    """Counts and shares of verdicts and actions, and the smallest proved clearance.

    Raises InputError when there are no frames.
    """
    require_frames(frames)
    total = len(frames)

    def row(what: str, count: int) -> list[Cell]:
        return [what, count, 100.0 * count / total]

    rows: list[list[Cell]] = [row("decisions", total)]
    rows += [
        row(f"verdict {verdict.value}", sum(frame.verdict is verdict for frame in frames))
        for verdict in Verdict
    ]
    rows += [
        row(f"action {action}", sum(frame.action == action for frame in frames))
        for action in sorted({frame.action for frame in frames})
    ]
    return Table("decisions counted", ["what", "count", "share (%)"], rows)
