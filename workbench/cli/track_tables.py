"""What `workbench track` keeps of each image, and the tables that it writes."""

from __future__ import annotations

import csv
import enum
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

if TYPE_CHECKING:
    from workbench.models.vehicle_sections import Geometry
    from workbench.perception.people import Around, Placed
    from workbench.perception.tracks import Track
    from workbench.runtime.onboard.dead_reckoning import Pose
    from workbench.runtime.person_guard import Disc

FILES: Final = ("peds.csv", "tracks.csv", "detections.csv", "vehicles.csv", "shapes.csv")
_Cell = str | int | float
_VEHICLE: Final = "vehicle"
# The reference point of the data layout (docs/data-format.md).
_REFERENCE_AHEAD_M: Final = 0.3
_PEOPLE_COLUMNS: Final = ("recording", "agent", "kind", "t", "x", "y")
_TRACK_COLUMNS: Final = (
    "recording", "t", "agent", "state", "kind", "x", "y", "radius", "vx", "vy", "v_radius",
    "seen", "where",
)  # fmt: skip
_BOX_COLUMNS: Final = (
    "recording", "t", "image", "box", "agent", "label", "kind", "score", "left", "top", "right",
    "bottom", "hidden", "status", "ahead_low", "ahead_high", "beside_low", "beside_high", "reason",
)  # fmt: skip
_VEHICLE_COLUMNS: Final = ("recording", "agent", "kind", "t", "x", "y", "heading", "v")
_SHAPE_COLUMNS: Final = ("recording", "agent", "front", "rear", "half_width", "wheelbase")


@final
class State(enum.Enum):
    """born: seen for the first time; seen; unseen: not in this image, their disc grows; lost: given
    up at this image; assumed: nobody is seen there, and somebody may be."""

    BORN = "born"
    SEEN = "seen"
    UNSEEN = "unseen"
    LOST = "lost"
    ASSUMED = "assumed"


@final
@dataclass(frozen=True, slots=True)
class PersonNote:
    """Somebody at the time of one image. place, velocity: discs that hold theirs (m, m/s); seen: in
    how many images so far; where: what hides them, of assumed people."""

    agent: str
    state: State
    kind: str
    place: Disc
    velocity: Disc
    seen: int
    where: str = ""


@final
@dataclass(frozen=True, slots=True)
class Note:
    """What is kept of one image: people, a row of detections.csv per box, and who has no place."""

    name: str
    t_s: float
    pose: Pose
    people: tuple[PersonNote, ...]
    boxes: tuple[tuple[_Cell, ...], ...]
    unplaced: tuple[str, ...]


def noted(around: Around) -> Note:
    """The part of an answer that the tables and the summary need."""
    tracks = around.tracks
    people = [_of_track(track, around.t_s) for track in tracks.people]
    people += [_of_track(track, around.t_s, lost=True) for track in tracks.lost]
    return Note(
        around.name, around.t_s, around.pose, (*people, *_assumed(around)), tuple(_boxes(around)),
        tuple(_unplaced(around.placed)),
    )  # fmt: skip


def kind_of(wheels: bool) -> str:
    """The word of the data layout."""
    return "cyclist" if wheels else "ped"


def sure_places(notes: Iterable[Note], sure_m: float) -> Iterable[tuple[Note, PersonNote]]:
    """Whoever is seen within a disc of at most this radius: the centre is worth being called their
    place. The box of somebody half hidden says little of how far away they are."""
    for note in notes:
        for each in note.people:
            if each.state in (State.BORN, State.SEEN) and each.place.radius <= sure_m:
                yield note, each


def tables(
    recording: str, notes: Sequence[Note], shape: Geometry, *, sure_m: float
) -> dict[str, str]:
    """The files by name: people, tracks and detections, the vehicle's poses and shape."""
    kinds = {each.agent: each.kind for note in notes for each in note.people}
    people = [
        (recording, each.agent, kinds[each.agent], note.t_s, each.place.x, each.place.y)
        for note, each in sure_places(notes, sure_m)
    ]
    tracks = [
        (
            recording, note.t_s, each.agent, each.state.value, each.kind, each.place.x,
            each.place.y, each.place.radius, each.velocity.x, each.velocity.y,
            each.velocity.radius, each.seen, each.where,
        )
        for note in notes
        for each in note.people
    ]  # fmt: skip
    boxes = [(recording, note.t_s, note.name, *row) for note in notes for row in note.boxes]
    bumpers = (shape.front_m - _REFERENCE_AHEAD_M, shape.rear_m + _REFERENCE_AHEAD_M)
    texts = (
        _csv(_PEOPLE_COLUMNS, people),
        _csv(_TRACK_COLUMNS, tracks),
        _csv(_BOX_COLUMNS, boxes),
        _csv(_VEHICLE_COLUMNS, _driven(recording, notes)),
        _csv(
            _SHAPE_COLUMNS,
            [(recording, _VEHICLE, *bumpers, shape.half_width_m, shape.wheelbase_m)],
        ),
    )
    return dict(zip(FILES, texts, strict=True))


def middle_of(pose: Pose) -> tuple[float, float, float]:
    """The middles of its intervals."""
    x, y, heading = (0.5 * (low + high) for low, high in (pose.x, pose.y, pose.heading))
    return x, y, heading


def _csv(columns: Sequence[str], rows: Iterable[Sequence[_Cell]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *rows])
    return text.getvalue()


def _of_track(track: Track, t_s: float, *, lost: bool = False) -> PersonNote:
    from workbench.runtime.protocols.people import PersonKind

    if lost:
        state = State.LOST
    elif track.guard.at_s < t_s:
        state = State.UNSEEN
    else:
        state = State.BORN if track.seen == 1 else State.SEEN
    wheels = track.kind is not PersonKind.ON_FOOT
    place, velocity = track.place_at(t_s), track.velocity_at(t_s)
    return PersonNote(f"{track.number}", state, kind_of(wheels), place, velocity, track.seen)


def _assumed(around: Around) -> Iterable[PersonNote]:
    """Under the names that the monitor knows them by, without the body that it is told of."""
    placed = around.placed
    where = [name for name, edge in zip(("left edge", "right edge"), placed.edges, strict=True)
             for _ in edge.discs]  # fmt: skip
    where += [f"behind box {k}" for k, region in enumerate(placed.shadows) if region is not None
              for _ in region.discs]  # fmt: skip
    told = [person for person in around.people if person.assumed]
    for person, disc, why in zip(told, placed.hidden, where, strict=True):
        yield PersonNote(person.name, State.ASSUMED, "any", disc, person.guard.velocity, 0, why)


def _boxes(around: Around) -> Iterable[tuple[_Cell, ...]]:
    placed = around.placed
    agents = dict(zip(placed.whose, around.tracks.numbers, strict=True))
    for number, (each, found) in enumerate(zip(placed.seen, placed.answers, strict=True)):
        box = each.box
        hidden = " ".join(sorted(edge.value for edge in box.hidden))
        kind = "" if each.kind is None else kind_of(each.kind.name == "ON_WHEELS")
        ahead = ("", "") if found is None or found.ahead_m is None else found.ahead_m
        beside = ("", "") if found is None or found.beside_m is None else found.beside_m
        status, reason = ("", "") if found is None else (found.status.value, found.reason)
        yield (
            number, agents.get(number, ""), each.label, kind, each.confidence, box.left_px,
            box.top_px, box.right_px, box.bottom_px, hidden, status, *ahead, *beside, reason,
        )  # fmt: skip


def _unplaced(placed: Placed) -> Iterable[str]:
    for number, (each, found) in enumerate(zip(placed.seen, placed.answers, strict=True)):
        if found is not None and found.ahead_m is None:
            yield f"box {number}, {each.label}, {found.status.value}: {found.reason}"


def _driven(recording: str, notes: Sequence[Note]) -> Iterable[tuple[_Cell, ...]]:
    """The reference point at each image, and its speed along the heading by differences."""
    middles = [middle_of(note.pose) for note in notes]
    for k, (note, (x, y, heading)) in enumerate(zip(notes, middles, strict=True)):
        first, second = max(k - 1, 0), min(k + 1, len(notes) - 1)
        ahead = (math.cos(heading), math.sin(heading))
        span_s = notes[second].t_s - notes[first].t_s
        way = sum((middles[second][axis] - middles[first][axis]) * ahead[axis] for axis in (0, 1))
        yield (
            recording, _VEHICLE, "cart", note.t_s, x + _REFERENCE_AHEAD_M * ahead[0],
            y + _REFERENCE_AHEAD_M * ahead[1], heading, way / span_s if span_s > 0.0 else 0.0,
        )  # fmt: skip
