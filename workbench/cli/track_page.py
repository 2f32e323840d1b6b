"""The page of `workbench track --plot`: small copies of images with boxes, and the plan beside."""

from __future__ import annotations

import argparse
import io
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

from workbench import __version__
from workbench.cli.analysis_options import command_line
from workbench.cli.track_summary import Summary
from workbench.cli.track_tables import Note, PersonNote, State, middle_of, sure_places
from workbench.estimation.camera import Camera
from workbench.estimation.outward import middle
from workbench.estimation.ranging import Sight
from workbench.perception.images import Frame
from workbench.perception.people import Around
from workbench.perception.poses import STANDING
from workbench.perception.unseen import Unseen, View, edges
from workbench.report.drawing import thinned
from workbench.report.footage import COLOURS, DrawnPerson, Footage, Glimpse, MarkedBox, Point
from workbench.report.page import Block, Notice, Page, Paragraph, Section
from workbench.report.tables import Table

if TYPE_CHECKING:
    from workbench.runtime.person_guard import Disc

_MOST_DRAWN: Final = 48
_WIDEST_PX: Final = 560
_JPEG_QUALITY: Final = 72
_TRAIL: Final = 60
_CAPTION: Final = (
    "Left: what the network saw; a dashed side may not be the person's own. Right: from above, in "
    "the frame of the vehicle. Coloured discs hold the position of who is followed, dashed ones of "
    "who was not seen in this image; the short line is the velocity over one second. Light grey: "
    "beside the view; darker: behind boxes. Dotted discs: somebody is assumed there."
)


@final
class Album:
    """Collects what is drawn, image by image: `take` before an image is looked at, `mark` after."""

    def __init__(self, sight: Sight, view: View, count: int, *, sure_m: float) -> None:
        self.sight, self.view, self._sure_m = sight, view, sure_m
        self.glimpses: list[Glimpse] = []
        self.total = 0
        self.notes: list[Note] = []
        self._chosen = frozenset(thinned(count, _MOST_DRAWN))
        self._jpeg: bytes | None = None
        self._trails: dict[str, list[Point]] = {}

    def take(self, frame: Frame) -> None:
        """Keep a small copy of the image if it is one of those drawn."""
        self._jpeg = _small(frame) if self.total in self._chosen else None
        self.total += 1

    def mark(self, around: Around, note: Note) -> None:
        """Add what was made of the image that was taken last."""
        self.notes.append(note)
        for _, each in sure_places([note], self._sure_m):
            self._trails.setdefault(each.agent, []).append((each.place.x, each.place.y))
        if self._jpeg is None:
            return
        frame = _VehicleFrame(*middle_of(note.pose))
        camera, placed = self.sight.camera, around.placed
        numbers = dict(zip(placed.whose, around.tracks.numbers, strict=True))
        regions = [region for region in placed.shadows if region is not None]
        self.glimpses.append(
            Glimpse(
                note.t_s,
                note.name,
                self._jpeg,
                tuple(_boxes(around, numbers, camera.size_px)),
                tuple(self._person(each, frame) for each in note.people if _drawn(each)),
                tuple(_polygon(region, camera) for region in regions),
                tuple(
                    frame.disc(each.place) for each in note.people if each.state is State.ASSUMED
                ),
                note.unplaced,
            )
        )

    def _person(self, note: PersonNote, frame: _VehicleFrame) -> DrawnPerson:
        trail = tuple(frame.point(*at) for at in self._trails.get(note.agent, [])[-_TRAIL:])
        velocity = frame.turned(note.velocity.x, note.velocity.y)
        seen = note.state in (State.BORN, State.SEEN)
        return DrawnPerson(
            note.agent, _colour(int(note.agent)), frame.disc(note.place), velocity, trail, seen
        )


def page_text(args: argparse.Namespace, album: Album, summary: Summary) -> str:
    """The page as HTML."""
    camera = album.sight.camera
    left, right = edges(album.sight, album.view, pose=STANDING)
    view = (*_side(left, camera), *reversed(_side(right, camera)))
    mounting = camera.mounting
    eye = (middle(mounting.forward_m), middle(mounting.left_m))
    player = Footage(album.glimpses, view, eye, album.total, _CAPTION)
    lead = (
        f"{summary.images} images, {summary.boxes_of_people} boxes of people, {summary.begun} "
        f"tracks, {summary.confirmed} of them seen in {summary.confirmed_after} images or more.",
    )
    sections = (
        Section("Images and plan", (player,)),
        Section("Tracks", (_track_table(album.notes), _unplaced(album.notes))),
        Section(
            "This holds as long as", tuple(Notice("Limit.", limit) for limit in summary.limits)
        ),
    )
    command = command_line("track", args, positional=("images",))
    title = f"People in {summary.recording}"
    return Page(title, lead, sections, __version__, command).html()


@final
@dataclass(frozen=True, slots=True)
class _VehicleFrame:
    """Global places as the vehicle at this pose sees them: x ahead, y to the left."""

    x: float
    y: float
    heading: float

    def turned(self, x: float, y: float) -> Point:
        c, s = math.cos(self.heading), math.sin(self.heading)
        return c * x + s * y, c * y - s * x

    def point(self, x: float, y: float) -> Point:
        return self.turned(x - self.x, y - self.y)

    def disc(self, disc: Disc) -> tuple[float, float, float]:
        return (*self.point(disc.x, disc.y), disc.radius)


def _small(frame: Frame) -> bytes:
    import PIL.Image

    image = PIL.Image.fromarray(frame.image)
    image.thumbnail((_WIDEST_PX, _WIDEST_PX))
    stream = io.BytesIO()
    image.save(stream, format="JPEG", quality=_JPEG_QUALITY)
    return stream.getvalue()


def _colour(number: int) -> str:
    return COLOURS[(number - 1) % len(COLOURS)]


def _drawn(note: PersonNote) -> bool:
    return note.state in (State.BORN, State.SEEN, State.UNSEEN)


def _boxes(
    around: Around, numbers: Mapping[int, int], size_px: tuple[int, int]
) -> Iterable[MarkedBox]:
    wide, high = size_px
    for k, each in enumerate(around.placed.seen):
        box, number = each.box, numbers.get(k)
        corners = (box.left_px / wide, box.top_px / high, box.right_px / wide, box.bottom_px / high)
        who = "?" if number is None and each.kind is not None else number
        text = " ".join(str(word) for word in (who, each.label, f"{each.confidence:.2f}")
                        if word is not None)  # fmt: skip
        colour = None if number is None else _colour(number)
        yield MarkedBox(corners, text, colour, tuple(sorted(edge.value for edge in box.hidden)))


def _polygon(region: Unseen, camera: Camera) -> tuple[Point, ...]:
    """The region itself in the vehicle's frame, for the middle of the mounting."""
    (near, far), (low, high), pad = region.ahead_m, region.sides, region.pad_m
    corners = [(near, near * low - pad), (far, far * low - pad),
               (far, far * high + pad), (near, near * high + pad)]  # fmt: skip
    return tuple(_in_vehicle(camera, *corner) for corner in corners)


def _side(edge: Unseen, camera: Camera) -> tuple[Point, Point]:
    """The near and the far end of an edge of the view."""
    ratio = middle(edge.sides)
    near, far = (_in_vehicle(camera, ahead, ahead * ratio) for ahead in edge.ahead_m)
    return near, far


def _in_vehicle(camera: Camera, ahead: float, beside: float) -> Point:
    mounting = camera.mounting
    c, s = math.cos(middle(mounting.yaw_rad)), math.sin(middle(mounting.yaw_rad))
    x, y = c * ahead - s * beside, s * ahead + c * beside
    return x + middle(mounting.forward_m), y + middle(mounting.left_m)


def _track_table(notes: Iterable[Note]) -> Table:
    told: dict[str, list[tuple[float, PersonNote]]] = {}
    for note in notes:
        for each in note.people:
            if each.state is not State.ASSUMED:
                told.setdefault(each.agent, []).append((note.t_s, each))
    rows = []
    for agent, own in told.items():
        seen_s = [t_s for t_s, each in own if each.state in (State.BORN, State.SEEN)]
        last = own[-1][1]
        given_up = own[-1][0] if last.state is State.LOST else None
        widest = max(each.place.radius for _, each in own if each.state is not State.LOST)
        rows.append((agent, last.kind, seen_s[0], seen_s[-1], last.seen, given_up, widest))
    headings = ("track", "kind", "first seen (s)", "last seen (s)", "images", "given up (s)",
                "largest radius (m)")  # fmt: skip
    return Table("Tracks", headings, rows)


def _unplaced(notes: Iterable[Note]) -> Block:
    rows = [(note.t_s, note.name, why) for note in notes for why in note.unplaced]
    if not rows:
        return Paragraph("Every box of a person has a place.")
    return Table(
        "Boxes of people without a place", ("time (s)", "image", "why"), rows, folded=len(rows) > 8
    )
