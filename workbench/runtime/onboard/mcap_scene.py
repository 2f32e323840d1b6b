"""A turn as Foxglove draws it: path, body, tubes, people and where they may go."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from workbench.runtime.arc import Interval
from workbench.runtime.onboard.mcap_schemas import UNUSED_PRIMITIVES
from workbench.runtime.onboard.recorder_header import LogHeader
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import DiscPiece, PersonTube, TubeKind

FRAME: Final = "map"
_LINE_STRIP: Final = 0
_LINE_LIST: Final = 2
_COLORS: Final = {
    "path": (0.4, 0.4, 0.4, 1.0),
    "body": (0.0, 0.3, 0.8, 1.0),
    "track": (0.0, 0.6, 0.3, 0.6),
    "stop": (0.8, 0.5, 0.0, 0.6),
    "person": (0.8, 0.0, 0.2, 0.8),
    "intent": (0.6, 0.2, 0.7, 0.15),
    "guard": (0.8, 0.0, 0.2, 0.1),
}
_DRAWN_S: Final = (0.5, 1.0, 1.5, 2.0)
_POINT: Final = {"x": 0, "y": 0, "z": 0}
_POSE: Final = {"position": _POINT, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
_DISC_HEIGHT_M: Final = 0.02
# A drawing is replaced by the next decision's; without one it must not stay.
_LIFETIME: Final = {"sec": 1, "nsec": 0}
_FOREVER: Final = {"sec": 0, "nsec": 0}


def path_scene(header: LogHeader, time: Mapping[str, int]) -> dict[str, Any]:
    """The path, which stays."""
    points = zip(header.path.x, header.path.y, strict=True)
    return _scene([_entity("path", time, _FOREVER, lines=[_strip("path", points)])])


def turn_scene(
    record: Mapping[str, Any], header: LogHeader, time: Mapping[str, int]
) -> dict[str, Any]:
    """Body, tubes and people of a turn that decided; the body in the middle of its intervals."""
    rows = record["rows"]
    entities = [
        _entity("tube", time, _LIFETIME, lines=[
            _rectangles("track", rows["occupancy"]), _rectangles("stop", rows["stop_occupancy"])
        ])
    ]  # fmt: skip
    observation = record["observation"]
    if observation is not None:
        said = f"{record['state']} {record['decision']['action']}"
        entities.append(_body(observation, header, time, said))
        entities += [_person(person, time) for person in observation["people"]]
    return _scene(entities)


def _scene(entities: list[dict[str, Any]]) -> dict[str, Any]:
    return {"deletions": [], "entities": entities}


def _entity(
    name: str, time: Mapping[str, int], lifetime: Mapping[str, int], **drawn: list[dict[str, Any]]
) -> dict[str, Any]:
    nothing: dict[str, list[Any]] = {name: [] for name in UNUSED_PRIMITIVES}
    return {
        "timestamp": time, "frame_id": FRAME, "id": name, "lifetime": lifetime,
        "frame_locked": False, "metadata": [], "lines": [], "cylinders": [], "texts": [],
        **nothing, **drawn,
    }  # fmt: skip


def _body(
    observation: Mapping[str, Any], header: LogHeader, time: Mapping[str, int], said: str
) -> dict[str, Any]:
    x, y, heading = (_middle(observation[name]) for name in ("x", "y", "heading"))
    front, rear, half = header.outline_m
    corners = [(front, half), (-rear, half), (-rear, -half), (front, -half), (front, half)]
    cosine, sine = math.cos(heading), math.sin(heading)
    points = [(x + cosine * a - sine * b, y + sine * a + cosine * b) for a, b in corners]
    word = {
        "pose": _POSE | {"position": _point(x, y)}, "billboard": True, "font_size": 12,
        "scale_invariant": True, "color": _color("body"), "text": said,
    }  # fmt: skip
    return _entity("body", time, _LIFETIME, lines=[_strip("body", points)], texts=[word])


def _person(person: Mapping[str, Any], time: Mapping[str, int]) -> dict[str, Any]:
    guard = guard_of(person["guard"])
    now = guard_disc(guard, from_s=min(guard.at_s, 0.0), until_s=_DRAWN_S[-1])
    discs = [_disc("person", at) for at in discs_of(now, (0.0,))]
    discs += [_disc("guard", at) for at in discs_of(now, _DRAWN_S)]
    for tube in person["intent"]:
        discs += [_disc("intent", at) for at in discs_of(tube_of(tube), _DRAWN_S)]
    return _entity(f"person {person['name']}", time, _LIFETIME, cylinders=discs)


def guard_of(plain: Mapping[str, Any]) -> Guard:
    """The guard that was made plain."""
    limits = MotionLimits(**plain["limits"])
    return Guard(plain["at_s"], Disc(**plain["position"]), Disc(**plain["velocity"]), limits)


def tube_of(plain: Mapping[str, Any]) -> PersonTube:
    """The tube that was made plain."""
    bounds = tuple(tuple(DiscPiece(**piece) for piece in bound) for bound in plain["bounds"])
    return PersonTube(TubeKind[plain["kind"]], bounds, plain["until_s"])


def discs_of(tube: PersonTube, times_s: Sequence[float]) -> Iterator[tuple[float, float, float]]:
    """The smallest of the discs (x, y, radius) that hold at each time, as far as the tube does."""
    begins_s = max((bound[0].from_s for bound in tube.bounds), default=math.inf)
    for tau in times_s:
        if begins_s <= tau <= tube.until_s:
            yield min((_at(bound, tau) for bound in tube.bounds), key=lambda disc: disc[2])


def _at(bound: Sequence[DiscPiece], tau: float) -> tuple[float, float, float]:
    piece = [piece for piece in bound if piece.from_s <= tau][-1]
    s = tau - piece.from_s
    radius = piece.radius_m + piece.growth_mps * s + piece.growth2_mps2 * s * s / 2
    return piece.x_m + piece.vx_mps * s, piece.y_m + piece.vy_mps * s, max(0.0, radius)


def _disc(color: str, at: tuple[float, float, float]) -> dict[str, Any]:
    x, y, radius = at
    size = {"x": _mm(2 * radius), "y": _mm(2 * radius), "z": _DISC_HEIGHT_M}
    return {
        "pose": _POSE | {"position": _point(x, y)}, "size": size, "bottom_scale": 1, "top_scale": 1,
        "color": _color(color),
    }  # fmt: skip


def _rectangles(color: str, rows: Sequence[Sequence[float]]) -> dict[str, Any]:
    """Rectangles (centre x, y, heading, half length, half width) as one list of edges."""
    points: list[dict[str, float]] = []
    indices: list[int] = []
    for x, y, heading, length, width in rows:
        cosine, sine = math.cos(heading), math.sin(heading)
        first = len(points)
        for a, b in ((length, width), (-length, width), (-length, -width), (length, -width)):
            points.append(_point(x + cosine * a - sine * b, y + sine * a + cosine * b))
        indices += [first + k for k in (0, 1, 1, 2, 2, 3, 3, 0)]
    return _lines(color, _LINE_LIST, points) | {"indices": indices}


def _strip(
    color: str, points: Iterator[tuple[float, float]] | Sequence[tuple[float, float]]
) -> dict[str, Any]:
    return _lines(color, _LINE_STRIP, [_point(x, y) for x, y in points])


def _lines(color: str, kind: int, points: list[dict[str, float]]) -> dict[str, Any]:
    return {
        "type": kind, "pose": _POSE, "thickness": 2, "scale_invariant": True, "points": points,
        "color": _color(color), "colors": [], "indices": [],
    }  # fmt: skip


def _point(x: float, y: float) -> dict[str, float]:
    return {"x": _mm(x), "y": _mm(y), "z": 0.0}


def _mm(value: float) -> float:
    """To the millimetre; what is not finite cannot be drawn."""
    return round(value, 3) if math.isfinite(value) else 0.0


def _color(name: str) -> dict[str, float]:
    return dict(zip("rgba", _COLORS[name], strict=True))


def _middle(interval: Interval) -> float:
    return 0.5 * (interval[0] + interval[1])
