"""The scenarios that come with this package."""

from __future__ import annotations

import difflib
from typing import Final

from workbench.errors import InputError
from workbench.simulation.scenarios.scenario import Scenario
from workbench.simulation.scenarios.scenario_file import LIBRARY, load_scenario

_MOST: Final = 5


def library() -> tuple[str, ...]:
    """Names of the shipped scenarios, in order."""
    return tuple(sorted(file.stem for file in LIBRARY.glob("*.toml")))


def named(name: str) -> Scenario:
    """A shipped scenario; raises InputError for a name that is not in the library."""
    if name not in library():
        raise InputError(
            f"expected the name of a scenario (`workbench simulate --list` has all), got {name!r}"
            f"{suggestion(name)}"
        )
    return load_scenario(LIBRARY / f"{name}.toml")


def suggestion(name: str) -> str:
    """The names that this one may be meant for, as the end of a message; empty for none: those that
    begin with it, or else the most similar ones, small letters or large."""
    names, name = library(), name.lower()
    near = [each for each in names if each.startswith(name)] or difflib.get_close_matches(
        name, names
    )
    return f"; did you mean {' or '.join(near[:_MOST])}?" if name and near else ""
