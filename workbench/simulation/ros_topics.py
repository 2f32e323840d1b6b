"""Which topics and fields of a ROS bag hold what a recording needs: a map in TOML."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from workbench.errors import InputError
from workbench.models.section_reading import as_number, as_table, as_text, require_keys

LOG_TIME: Final = "log"
"""Instead of a field: the time at which the bag took the message."""
_SHAPE: Final = ("front", "rear", "half_width", "wheelbase")


@final
@dataclass(frozen=True, slots=True)
class VehicleTopic:
    """Fields of the vehicle's messages, as paths with dots; t: a stamp, or LOG_TIME; heading: a
    number or a quaternion; further: optional columns of docs/data-format.md."""

    topic: str
    agent: str
    kind: str
    t: str
    x: str
    y: str
    heading: str
    v: str
    further: Mapping[str, str]


@final
@dataclass(frozen=True, slots=True)
class PeopleTopic:
    """Fields of messages about people. items: the field that lists them, None where a message is
    one person; agent, x, y: fields of one of them."""

    topic: str
    kind: str
    t: str
    items: str | None
    agent: str
    x: str
    y: str


@final
@dataclass(frozen=True, slots=True)
class TopicMap:
    """shape: metres by column of the table `shapes`; people: None for a recording without them;
    distro: whose message definitions a bag without its own is read by; definitions: of other
    messages, by type."""

    vehicle: VehicleTopic
    people: PeopleTopic | None
    shape: Mapping[str, float]
    distro: str
    definitions: Mapping[str, str]

    @classmethod
    def read(cls, path: Path) -> TopicMap:
        """The map in a file. Raises InputError that names what is wrong."""
        try:
            content = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise InputError(
                f"expected a topic map in TOML at {path}, got {error}; docs/logs.md shows one"
            ) from error
        where = str(path)
        optional = ("people", "distro", "definitions")
        require_keys(where, content, ("vehicle", "shape"), optional, what="section")
        people = content.get("people")
        definitions = as_table("definitions", content.get("definitions", {}))
        return cls(
            vehicle=_vehicle(as_table("vehicle", content["vehicle"])),
            people=None if people is None else _people(as_table("people", people)),
            shape=_shape(as_table("shape", content["shape"])),
            distro=as_text(where, "distro", {"distro": "latest"} | content),
            definitions={name: as_text("[definitions]", name, definitions) for name in definitions},
        )


def _vehicle(section: Mapping[str, object]) -> VehicleTopic:
    further = ("yaw_rate", "v_lat", "a")
    known = ("topic", "x", "y", "heading", "v")
    require_keys("[vehicle]", section, known, ("agent", "kind", "t", *further))
    section = {"agent": "vehicle", "kind": "car", "t": "header.stamp"} | dict(section)
    texts = {key: as_text("[vehicle]", key, section) for key in section}
    return VehicleTopic(
        **{key: text for key, text in texts.items() if key not in further},
        further={key: texts[key] for key in further if key in texts},
    )


def _people(section: Mapping[str, object]) -> PeopleTopic:
    required = ("topic", "agent", "x", "y")
    require_keys("[people]", section, required, ("kind", "t", "items"))
    section = {"kind": "ped", "t": "header.stamp"} | dict(section)
    texts = {key: as_text("[people]", key, section) for key in section}
    items = texts.pop("items", None)
    return PeopleTopic(items=items, **texts)


def _shape(section: Mapping[str, object]) -> Mapping[str, float]:
    require_keys("[shape]", section, _SHAPE)
    return {key: as_number("[shape]", key, section[key]) for key in _SHAPE}
