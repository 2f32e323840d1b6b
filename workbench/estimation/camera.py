"""Camera files: lens, mounting, detector and people as intervals, read into one checked value."""

from __future__ import annotations

import importlib.resources
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar, final

from workbench.errors import InputError
from workbench.models.section_reading import (
    as_interval,
    as_number,
    as_numbers,
    as_table,
    as_text,
    read_file,
    require_keys,
)
from workbench.runtime.arc import Interval

_STEEPEST_RAD: Final = 1.0


@final
@dataclass(frozen=True, slots=True)
class Lens:
    """A pinhole behind rectified images: u = centre_x - focal_x (left / ahead), v = centre_y -
    focal_y (up / ahead), u to the right and v down; residual_px: how far that may be off (px)."""

    focal_x_px: Interval
    focal_y_px: Interval
    centre_x_px: Interval
    centre_y_px: Interval
    residual_px: float
    provenance: str

    def __post_init__(self) -> None:
        _require_ordered("lens", self)
        _require_positive("lens", focal_x_px=self.focal_x_px[0], focal_y_px=self.focal_y_px[0])
        _require_sizes("lens", residual_px=self.residual_px)


@final
@dataclass(frozen=True, slots=True)
class Mounting:
    """Where the camera is in the vehicle: turned by roll about x, then pitch about y, then yaw.

    forward_m, left_m from the middle of the rear axle, up_m above the flat ground on which people
    stand; pitch_rad > 0 looks down, yaw_rad > 0 to the left, roll_rad > 0 lifts the left side.
    """

    forward_m: Interval
    left_m: Interval
    up_m: Interval
    yaw_rad: Interval
    pitch_rad: Interval
    roll_rad: Interval
    provenance: str

    def __post_init__(self) -> None:
        _require_ordered("mounting", self)
        _require_positive("mounting", up_m=self.up_m[0])
        for name in ("pitch_rad", "roll_rad"):
            low, high = getattr(self, name)
            if not -_STEEPEST_RAD <= low <= high <= _STEEPEST_RAD:
                raise InputError(
                    f"[mounting] {name}: expected within +-{_STEEPEST_RAD} rad, got {[low, high]!r}"
                )


@final
@dataclass(frozen=True, slots=True)
class BoxErrors:
    """How far a detected box may be off (px): left and right edge, and the bottom edge."""

    edge_px: float
    contact_px: float
    provenance: str

    def __post_init__(self) -> None:
        _require_sizes("boxes", edge_px=self.edge_px, contact_px=self.contact_px)


@final
@dataclass(frozen=True, slots=True)
class Shape:
    """What is assumed of a person's silhouette (m), about the upright line through their position.

    width_m: of the silhouette, across the camera's axis; tallest_m: nobody is taller; middle_m: how
    far the silhouette's middle may be beside the line; contact_m: how far the point that touches
    the ground lowest in the image may be from the position; body_m: holds all of the person.
    """

    width_m: Interval
    tallest_m: float
    middle_m: float
    contact_m: float
    body_m: float
    provenance: str

    def __post_init__(self) -> None:
        _require_ordered("people", self)
        _require_positive("people", width_m=self.width_m[0], tallest_m=self.tallest_m)
        _require_sizes(
            "people", middle_m=self.middle_m, contact_m=self.contact_m, body_m=self.body_m
        )


@final
@dataclass(frozen=True, slots=True)
class Camera:
    """Everything that a person's position from a box rests on; size_px: width and height."""

    name: str
    size_px: tuple[int, int]
    provenance: str
    lens: Lens
    mounting: Mounting
    boxes: BoxErrors
    on_foot: Shape
    on_wheels: Shape


_Section = TypeVar("_Section", Lens, Mounting, BoxErrors, Shape)
_SECTIONS: Final = ("camera", "lens", "mounting", "boxes", "on_foot", "on_wheels")


def gem_e2_camera_path() -> Path:
    """The camera file shipped with this package."""
    package = importlib.resources.files("workbench.estimation")
    return Path(str(package / "data" / "camera_gem_e2.toml"))


def load_camera(path: str | Path) -> Camera:
    """Read and check a camera file.

    path: a TOML file with the sections and keys of the shipped one (`gem_e2_camera_path`). Raises
    InputError for a missing file, broken TOML, unknown or missing keys and values that cannot be.
    """
    return read_file(path, _camera, what="camera", shipped=gem_e2_camera_path())


def _camera(document: Mapping[str, object]) -> Camera:
    require_keys("the file", document, _SECTIONS, what="section")
    tables = {name: as_table(name, document[name]) for name in _SECTIONS}
    head = tables["camera"]
    require_keys("[camera]", head, ("name", "size_px", "provenance"))
    return Camera(
        name=as_text("[camera]", "name", head),
        size_px=_size(head["size_px"]),
        provenance=as_text("[camera]", "provenance", head),
        lens=_section(Lens, "lens", tables["lens"]),
        mounting=_section(Mounting, "mounting", tables["mounting"]),
        boxes=_section(BoxErrors, "boxes", tables["boxes"]),
        on_foot=_section(Shape, "on_foot", tables["on_foot"]),
        on_wheels=_section(Shape, "on_wheels", tables["on_wheels"]),
    )


def _section(kind: type[_Section], name: str, table: Mapping[str, object]) -> _Section:
    where = f"[{name}]"
    kinds = kind.__annotations__
    require_keys(where, table, kinds)
    values: dict[str, Any] = {}
    for key, annotation in kinds.items():
        if annotation == "str":
            values[key] = as_text(where, key, table)
        elif annotation == "float":
            values[key] = as_number(where, key, table[key])
        else:
            values[key] = as_interval(where, key, table[key])
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(str(error).replace("[people]", where)) from None


def _size(value: object) -> tuple[int, int]:
    numbers = as_numbers("[camera]", "size_px", value)
    if len(numbers) != 2 or not all(n >= 1.0 and n == math.floor(n) for n in numbers):
        raise InputError(
            f"[camera] size_px: expected [width, height] in whole pixels, got {value!r}"
        )
    return int(numbers[0]), int(numbers[1])


def _require_ordered(section: str, values: Lens | Mounting | Shape) -> None:
    for key, kind in type(values).__annotations__.items():
        if kind == "Interval":
            low, high = getattr(values, key)
            if not -math.inf < low <= high < math.inf:
                raise InputError(
                    f"[{section}] {key}: expected finite lowest <= highest, got {[low, high]!r}"
                )


def _require_positive(section: str, **lowest: float) -> None:
    for key, value in lowest.items():
        if not 0.0 < value < math.inf:
            raise InputError(f"[{section}] {key}: expected above 0, got {value!r}")


def _require_sizes(section: str, **values: float) -> None:
    for key, value in values.items():
        if not 0.0 <= value < math.inf:
            raise InputError(f"[{section}] {key}: expected a number >= 0, got {value!r}")
