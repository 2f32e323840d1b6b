"""A CommonRoad file as checked elements: no entities, finite numbers, clear refusals."""

from __future__ import annotations

import gzip
import math
import zlib
from pathlib import Path
from typing import Final, NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from workbench.errors import InputError
from workbench.simulation.frames import Point

Element = ElementTree.Element
_VERSIONS: Final = ("2018b", "2020a")
_LARGEST_BYTES: Final = 64 * 2**20


def read_xml(path: Path) -> Element:
    """The root of a file, plain or gzip.

    A document type, and with it every entity, is refused before anything is expanded, as is what is
    larger than 64 MiB. Raises InputError for these, for a file that is missing or broken and for
    what is not a CommonRoad scenario of the versions 2018b or 2020a.
    """
    content = _content(path)
    guard = expat.ParserCreate()
    guard.StartDoctypeDeclHandler = _refuse_doctype
    try:
        guard.Parse(content, True)
        root = ElementTree.fromstring(content)
    except (expat.ExpatError, ElementTree.ParseError, ValueError, LookupError) as fault:
        if isinstance(fault, InputError):
            raise InputError(f"{path}: {fault}") from None
        raise InputError(f"{path}: expected XML, but: {fault}") from None
    version = root.get("commonRoadVersion", "none")
    if root.tag != "commonRoad" or version not in _VERSIONS:
        raise InputError(
            f"{path}: expected <commonRoad> of version {' or '.join(_VERSIONS)}, got "
            f"<{root.tag}> of version {version}; convert it with CommonRoad's own tools"
        )
    return root


def _content(path: Path) -> bytes:
    try:
        if path.suffix != ".gz":
            with path.open("rb") as plain:
                content = plain.read(_LARGEST_BYTES + 1)
        else:
            with gzip.open(path) as packed:
                content = packed.read(_LARGEST_BYTES + 1)
    except (OSError, EOFError, zlib.error) as fault:
        raise InputError(
            f"{path}: expected a CommonRoad scenario, .xml or .xml.gz, that can be read, got: "
            f"{getattr(fault, 'strerror', None) or fault}"
        ) from None
    if len(content) > _LARGEST_BYTES:
        raise InputError(f"{path}: expected at most 64 MiB of XML; take a part of the scenario")
    return content


def _refuse_doctype(*_: object) -> NoReturn:
    raise InputError("a document type (<!DOCTYPE>) is not accepted: its entities could be anything")


def child(element: Element, tag: str) -> Element:
    """The only child of a tag; InputError where there is none, or several."""
    found = element.findall(tag)
    if len(found) != 1:
        raise InputError(f"{label(element)}: expected one <{tag}>, got {len(found)}")
    return found[0]


def number(element: Element, tag: str) -> float:
    """A child's text as a finite number."""
    text = (child(element, tag).text or "").strip()
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{label(element)} <{tag}>: expected a finite number, got {text!r}")
    return value


def exact(element: Element, tag: str) -> float:
    """A child's value, which must be <exact>: intervals are not taken for numbers."""
    value = child(element, tag)
    if value.find("exact") is None:
        raise InputError(
            f"{label(element)} <{tag}>: expected <exact>, got an interval; uncertain states are "
            "not imported"
        )
    return number(value, "exact")


def point(element: Element) -> Point:
    """<x> and <y>, m."""
    return number(element, "x"), number(element, "y")


def position(state: Element) -> Point:
    """A state's position, which must be a point."""
    place = child(state, "position")
    if place.find("point") is None:
        raise InputError(
            f"{label(state)} <position>: expected <point>, got an area; uncertain states are not "
            "imported"
        )
    return point(child(place, "point"))


def label(element: Element) -> str:
    """How a message names an element."""
    known = element.get("id")
    return f"<{element.tag}>" if known is None else f"<{element.tag} id={known!r}>"
