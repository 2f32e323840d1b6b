"""A picture of one decision: the plane from above."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Circle, Polygon

from workbench.claims import Verdict
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
_NAMED_PEOPLE = 6
_NEAR_M = 25.0


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
            f"where the car can be in TRACK, {_tracked(frame).value}",
            VERDICT_COLOURS[_tracked(frame)],
            filled=True,
        ),
        *(
            Key(f"TRACK, then BRAKE to standstill, {answer.policy} {answer.verdict.value}",
                VERDICT_COLOURS[answer.verdict])
            for answer in frame.policies[1:]
        ),
        Key("person and prediction", BLUE, mark="o"),
        *([Key("where the guard lets them be", BLUE, "2 4")] if _guarded(frame) else ()),
    )  # fmt: skip
    caption = f"The decision at {frame.t_s:.2f} s. {frame.reason}"
    return Figure((panel,), legend, caption, _people_table(frame), wide=True)


def _tracked(frame: Frame) -> Verdict:
    """What is said of TRACK: by the first policy, or by the only verdict there is."""
    return frame.policies[0].verdict if frame.policies else frame.verdict


def _guarded(frame: Frame) -> bool:
    return any(person.guarded for person in frame.people)


def _extent(frame: Frame) -> tuple[float, float, tuple[float, float, float, float]]:
    """Size in inches and limits in metres of a picture that shows all that moves."""
    points = [*corners(body(frame))]
    for rectangle in filter(drawable, (*frame.occupancy, *frame.stop_occupancy)):
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
    _paint_tube(axes, frame.occupancy, VERDICT_COLOURS[_tracked(frame)], fill=0.08)
    for answer in frame.policies[1:]:
        _paint_tube(axes, frame.stop_occupancy, VERDICT_COLOURS[answer.verdict], fill=0.0)
    outline = corners(body(frame))
    axes.add_patch(Polygon(outline, facecolor="none", edgecolor=INK, linewidth=1.8))
    for rank, person in enumerate(nearest(frame)):
        _paint_person(axes, person, named=rank < _NAMED_PEOPLE)


def _paint_tube(axes: Axes, occupancy: Sequence[Rectangle], colour: str, *, fill: float) -> None:
    """Filled boxes with thin edges, or bold empty ones."""
    shapes = [shape for shape in occupancy if drawable(shape)]
    for index in thinned(len(shapes), _DRAWN_RECTANGLES):
        axes.add_patch(
            Polygon(
                corners(shapes[index]),
                facecolor=(colour, fill),
                edgecolor=(colour, 0.8),
                linewidth=0.7 if fill else 1.4,
            )
        )


def _paint_person(axes: Axes, person: PersonFrame, *, named: bool) -> None:
    discs = [disc for disc in person.predicted if drawable(disc)]
    for index in thinned(len(discs), _DRAWN_DISCS):
        x, y, radius = discs[index]
        axes.add_patch(Circle((x, y), radius, facecolor=(SKY, 0.1), edgecolor=(BLUE, 0.7)))
    for x, y, radius in filter(drawable, person.guarded[-1:]):
        axes.add_patch(Circle((x, y), radius, facecolor="none", edgecolor=BLUE, linestyle=":"))
    spot = (person.x_m, person.y_m)
    axes.add_patch(Circle(spot, person.radius_m, facecolor=BLUE, edgecolor=INK, linewidth=0.8))
    if named:
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
