"""People among what a network sees: who is on wheels, and which edges of a box are their own."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.estimation.ranging import BoundingBox, Edge
from workbench.perception.letterbox import Image
from workbench.perception.network import Network
from workbench.runtime.protocols.people import PersonKind

KINDS: Final[Mapping[str, PersonKind]] = {
    "person": PersonKind.ON_FOOT,
    "people": PersonKind.ON_FOOT,
    "pedestrian": PersonKind.ON_FOOT,
    "cyclist": PersonKind.ON_WHEELS,
    "bicyclist": PersonKind.ON_WHEELS,
    "rider": PersonKind.ON_WHEELS,
}
"""What classes are people, by name."""
RIDDEN: Final = frozenset({"bicycle", "motorcycle", "skateboard"})
"""Classes that put a person who overlaps them on wheels."""


@final
@dataclass(frozen=True, slots=True)
class Detection:
    """label: the network's class; kind: None for what is no person and may hide some."""

    label: str
    kind: PersonKind | None
    confidence: float
    box: BoundingBox


def detect(
    network: Network, image: Image, *, confidence: float, overlap: float, edge_px: float
) -> tuple[Detection, ...]:
    """All that the network sees, the best first; `confidence` and `overlap` as in `Network`.

    Boxes are cut at the image's borders; edge_px: how far a detected edge may be off, so that one
    this close to the border, or to another box, may not be the person's own. Raises InputError for
    a network without a class of people.
    """
    if not any(name in KINDS for name in network.names):
        raise InputError(
            f"expected a network with one of the classes {', '.join(KINDS)}, got "
            f"{', '.join(network.names[:12])}; rename its classes by names=..."
        )
    found = network.candidates(image, confidence=confidence, overlap=overlap)
    rows, columns = image.shape[:2]
    seen = []
    for box, score, number in zip(found.boxes, found.scores, found.classes, strict=True):
        left, right = (min(max(float(u), 0.0), float(columns)) for u in (box[0], box[2]))
        top, bottom = (min(max(float(v), 0.0), float(rows)) for v in (box[1], box[3]))
        if left < right and top < bottom:
            name = network.names[number]
            place = BoundingBox(left, top, right, bottom)
            seen.append(Detection(name, KINDS.get(name), float(score), place))
    return with_hidden_edges(with_riders(seen), size_px=(columns, rows), edge_px=edge_px)


def with_riders(seen: Sequence[Detection]) -> tuple[Detection, ...]:
    """People on foot whose box overlaps something that is ridden are on wheels.

    Their box then reaches down to the wheels, which touch the ground where feet do not. What they
    ride is no detection of its own any more. Somebody who stands before a parked bicycle becomes a
    rider too, whose limits are wider.
    """
    wheels = [each for each in seen if each.label in RIDDEN]
    ridden: set[int] = set()
    found = []
    for person in seen:
        if person.label in RIDDEN:
            continue
        under = [each for each in wheels if _touch(person.box, each.box)]
        if person.kind is not PersonKind.ON_FOOT or not under:
            found.append(person)
            continue
        ridden.update(id(each) for each in under)
        lowest = max([person.box.bottom_px, *(each.box.bottom_px for each in under)])
        box = dataclasses.replace(person.box, bottom_px=lowest)
        found.append(dataclasses.replace(person, kind=PersonKind.ON_WHEELS, box=box))
    return (*found, *(each for each in wheels if id(each) not in ridden))


def with_hidden_edges(
    seen: Sequence[Detection], *, size_px: tuple[int, int], edge_px: float
) -> tuple[Detection, ...]:
    """Each box with the edges that the image's border or another box may cut off.

    Whichever of two boxes is nearer: a box that is behind hides nothing, and calling an edge hidden
    only makes an answer wider.
    """
    return tuple(
        dataclasses.replace(
            each,
            box=dataclasses.replace(
                each.box,
                hidden=_cut(each.box, size_px, edge_px)
                | _covered(each.box, (o.box for o in seen if o is not each), edge_px),
            ),
        )
        for each in seen
    )


def _cut(box: BoundingBox, size_px: tuple[int, int], edge_px: float) -> frozenset[Edge]:
    at_border = {
        Edge.LEFT: box.left_px <= edge_px,
        Edge.RIGHT: box.right_px >= size_px[0] - edge_px,
        Edge.BOTTOM: box.bottom_px >= size_px[1] - edge_px,
    }
    return frozenset(edge for edge, cut in at_border.items() if cut)


def _covered(box: BoundingBox, others: Iterable[BoundingBox], edge_px: float) -> frozenset[Edge]:
    found = set()
    for other in others:
        beside = (other.left_px - edge_px, other.right_px + edge_px)
        above = (other.top_px - edge_px, other.bottom_px + edge_px)
        in_rows = above[0] <= box.bottom_px and box.top_px <= above[1]
        in_columns = beside[0] <= box.right_px and box.left_px <= beside[1]
        if in_rows and beside[0] <= box.left_px <= beside[1]:
            found.add(Edge.LEFT)
        if in_rows and beside[0] <= box.right_px <= beside[1]:
            found.add(Edge.RIGHT)
        if in_columns and above[0] <= box.bottom_px <= above[1]:
            found.add(Edge.BOTTOM)
    return frozenset(found)


def _touch(a: BoundingBox, b: BoundingBox) -> bool:
    beside = a.left_px < b.right_px and b.left_px < a.right_px
    return beside and a.top_px < b.bottom_px and b.top_px < a.bottom_px
