"""The distributions of the base install: what the vehicle's package needs, and what that needs."""

from __future__ import annotations

import importlib.metadata
import tomllib
from pathlib import Path
from typing import Final

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import workbench

NAME: Final = "reach-workbench"


def base_distributions() -> tuple[str, ...]:
    """Names, the workbench's own first; requirements of extras that nobody asks for are left out.

    What a distribution requires is read from its metadata here; one that is not installed is
    named, and what it requires is not known.
    """
    found: dict[str, None] = {NAME: None}
    waiting = [(Requirement(text), frozenset[str]()) for text in _own_requirements()]
    while waiting:
        wanted, extras_of_parent = waiting.pop(0)
        if not _applies(wanted, extras_of_parent):
            continue
        name = canonicalize_name(wanted.name)
        if name not in found:
            found[name] = None
            waiting += [(Requirement(text), frozenset(wanted.extras)) for text in _requires(name)]
    return tuple(found)


def _applies(wanted: Requirement, extras: frozenset[str]) -> bool:
    marker = wanted.marker
    return marker is None or any(marker.evaluate({"extra": extra}) for extra in (*extras, ""))


def _requires(name: str) -> list[str]:
    try:
        return importlib.metadata.requires(name) or []
    except importlib.metadata.PackageNotFoundError:
        return []


def _own_requirements() -> list[str]:
    """Of the installed workbench, else of the checkout it runs from."""
    try:
        return importlib.metadata.requires(NAME) or []
    except importlib.metadata.PackageNotFoundError:
        file = Path(workbench.__file__).resolve().parents[1] / "pyproject.toml"
        return list(tomllib.loads(file.read_text(encoding="utf-8"))["project"]["dependencies"])
