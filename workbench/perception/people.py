"""From detections to what the monitor is told: sightings, tracks, and people assumed unseen."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.estimation.ranging import (
    Edge,
    RangingAnswer,
    RangingStatus,
    Sight,
    on_ground,
    ranged,
)
from workbench.estimation.ranging_frames import disc_in_global
from workbench.perception.detections import Detection, detect
from workbench.perception.images import Frame
from workbench.perception.network import Network
from workbench.perception.tracks import Sighting, TrackLimits, Tracks
from workbench.perception.unseen import Unseen, View, edges, shadow, watched_disc
from workbench.runtime.observation import ObservedPerson
from workbench.runtime.onboard.dead_reckoning import Pose
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import FOREVER_S, PersonTube, TubeKind
from workbench.runtime.policies.cycle import Watched
from workbench.runtime.protocols.people import PersonKind

_OUTWARD: Final = 1.0 + 2.0**-50


@final
@dataclass(frozen=True, slots=True)
class Placed:
    """One frame on the ground.

    answers: where each detection is that is somebody, None for things; sightings: whoever has a
    bounded position, and whose detections they are; edges: of the view; shadows: what each
    detection hides, None: nothing that is looked at.
    """

    seen: tuple[Detection, ...]
    answers: tuple[RangingAnswer | None, ...]
    sightings: tuple[Sighting, ...]
    whose: tuple[int, ...]
    edges: tuple[Unseen, Unseen]
    shadows: tuple[Unseen | None, ...]

    @property
    def hidden(self) -> tuple[Disc, ...]:
        """Discs in which somebody unseen may be: edges of the view first, then shadows."""
        regions = (*self.edges, *(each for each in self.shadows if each is not None))
        return tuple(disc for region in regions for disc in region.discs)

    @property
    def unplaced(self) -> tuple[str, ...]:
        """Why somebody who is seen has no position. While that is not empty the list of people is
        not complete and must not be sent."""
        return tuple(
            f"{detection.label} at {_pixels(detection)}: {found.reason}"
            for detection, found in zip(self.seen, self.answers, strict=True)
            if found is not None and found.status is RangingStatus.CONTRADICTION
        )


@final
@dataclass(frozen=True, slots=True)
class Around:
    """What one frame says: boxes on the ground, tracks, everybody for the monitor, and what that
    does not cover."""

    name: str
    t_s: float
    pose: Pose
    placed: Placed
    tracks: Tracks
    people: tuple[ObservedPerson, ...]
    watched: Watched
    limits: tuple[str, ...]


@final
@dataclass(frozen=True, slots=True)
class Looking:
    """confidence, overlap: of the network (`Network.candidates`); view: what it is relied on for;
    limits: of tracks, and of how people move."""

    confidence: float
    overlap: float
    view: View
    limits: TrackLimits


def look(
    network: Network,
    frames: Iterable[Frame],
    sight: Sight,
    *,
    pose_at: Callable[[float], Pose],
    looking: Looking,
) -> Iterator[Around]:
    """Everybody around the vehicle, frame by frame.

    pose_at: the vehicle's pose at the time of a frame, as intervals that hold it. The answers to a
    frame use that frame and earlier ones. Raises InputError for a frame of another size than the
    camera's, whose pixels mean other directions.
    """
    tracks = Tracks(looking.limits)
    for frame in frames:
        _require_size(frame, sight)
        pose = pose_at(frame.t_s)
        seen = detect(
            network,
            frame.image,
            confidence=looking.confidence,
            overlap=looking.overlap,
            edge_px=sight.camera.boxes.edge_px,
        )
        placed = place(sight, seen, looking.view, pose=pose)
        hidden = placed.hidden if looking.view.assumed else ()
        tracks = tracks.after(placed.sightings, at_s=frame.t_s)
        yield Around(
            frame.name,
            frame.t_s,
            pose,
            placed,
            tracks,
            observed_people(sight, tracks, hidden, stamp_s=frame.t_s),
            watched_disc(sight.camera, looking.view, pose=pose),
            looking.view.limits(sight.camera),
        )


def place(sight: Sight, seen: Sequence[Detection], view: View, *, pose: Pose) -> Placed:
    """Positions of people, and everything that they and other boxes hide, edges of the view too.

    Somebody whose box shows no farthest position is somewhere in what their box hides from their
    nearest position on, up to half a width beyond a hidden edge: their shadow stands for them.
    """
    sightings, whose = [], []
    answers: list[RangingAnswer | None] = []
    shadows = []
    for number, detection in enumerate(seen):
        box, kind, found = detection.box, detection.kind, None
        if kind is None:
            from_m, pad_m = _nearest_of_thing(sight, detection, view), 0.0
        else:
            shape = sight.camera.on_foot
            if kind is not PersonKind.ON_FOOT:
                shape = sight.camera.on_wheels
            found = ranged(sight, box, shape=shape)
            from_m, pad_m = _nearest_of(found), 0.5 * shape.width_m[1] + shape.middle_m
            if found.ahead_m is not None and found.beside_m is not None:
                disc = disc_in_global(sight.camera, found.ahead_m, found.beside_m, pose=pose)
                sightings.append(Sighting(kind, disc))
                whose.append(number)
        answers.append(found)
        shadows.append(shadow(sight, box, view, from_m=from_m, pad_m=pad_m, pose=pose))
    borders = edges(sight, view, pose=pose)
    return Placed(
        tuple(seen), tuple(answers), tuple(sightings), tuple(whose), borders, tuple(shadows)
    )


def observed_people(
    sight: Sight,
    tracks: Tracks,
    hidden: Sequence[Disc],
    *,
    stamp_s: float,
    intents: Mapping[int, tuple[PersonTube, ...]] | None = None,
) -> tuple[ObservedPerson, ...]:
    """Everybody tracked, and one assumed person in each disc where nobody can be seen.

    A disc for the monitor contains the whole body: body_m is added. intents: predicted tubes by
    track; who has none is predicted to do anything within their limits, as are the assumed, who
    have the wider limits of both kinds. More than 32 people are for the monitor to refuse.
    """
    camera, limits = sight.camera, tracks.limits
    found = []
    for track in tracks.people:
        on_foot = track.kind is PersonKind.ON_FOOT
        body_m = (camera.on_foot if on_foot else camera.on_wheels).body_m
        guard = dataclasses.replace(
            track.guard,
            at_s=track.guard.at_s - stamp_s,
            position=_with_body(track.guard.position, body_m),
        )
        intent = (intents or {}).get(track.number) or (_anything(guard),)
        found.append(ObservedPerson(f"{track.number}", intent, guard))
    widest = MotionLimits(
        max(limits.on_foot.speed_mps, limits.on_wheels.speed_mps),
        max(limits.on_foot.acceleration_mps2, limits.on_wheels.acceleration_mps2),
    )
    body_m = max(camera.on_foot.body_m, camera.on_wheels.body_m)
    for k, disc in enumerate(hidden):
        anything = Disc(0.0, 0.0, widest.speed_mps)
        guard = Guard(0.0, _with_body(disc, body_m), anything, widest)
        found.append(ObservedPerson(f"unseen-{k}", (_anything(guard),), guard, assumed=True))
    return tuple(found)


def _anything(guard: Guard) -> PersonTube:
    tube = guard_disc(guard, from_s=min(guard.at_s, 0.0), until_s=FOREVER_S)
    return dataclasses.replace(tube, kind=TubeKind.INTENT)


def _with_body(disc: Disc, body_m: float) -> Disc:
    return Disc(disc.x, disc.y, (disc.radius + body_m) * _OUTWARD)


def _nearest_of(found: RangingAnswer) -> float:
    if found.ahead_m is not None:
        return found.ahead_m[0]
    ends = [route[0] for route in (found.by_width_m, found.by_contact_m) if route is not None]
    return min(ends) if found.status is RangingStatus.CONTRADICTION else max(ends)


def _nearest_of_thing(sight: Sight, detection: Detection, view: View) -> float:
    """Of something that stands on the ground, where its lower edge is seen; else nearest of all."""
    if Edge.BOTTOM in detection.box.hidden:
        return view.near_m
    boxes, lens = sight.camera.boxes, sight.camera.lens
    error_px = math.nextafter(boxes.contact_px + lens.residual_px, math.inf)
    columns = (
        sight.column(detection.box.right_px, error_px)[0],
        sight.column(detection.box.left_px, error_px)[1],
    )
    ground = on_ground(sight, sight.row(detection.box.bottom_px, error_px), columns)
    return view.near_m if ground is None else ground[0]


def _require_size(frame: Frame, sight: Sight) -> None:
    size_px = (frame.image.shape[1], frame.image.shape[0])
    if size_px != sight.camera.size_px:
        wide, high = sight.camera.size_px
        raise InputError(
            f"{frame.name}: expected an image of {wide} x {high} pixels, as the camera file says, "
            f"got {size_px[0]} x {size_px[1]}; its directions would be wrong"
        )


def _pixels(detection: Detection) -> str:
    box = detection.box
    return f"({0.5 * (box.left_px + box.right_px):.0f}, {box.bottom_px:.0f}) px"
