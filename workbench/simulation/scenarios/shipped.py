"""The scenarios that come with this package."""

from __future__ import annotations

from workbench.errors import InputError
from workbench.simulation.scenarios.scenario import Scenario
from workbench.simulation.scenarios.scenario_file import LIBRARY, load_scenario


def library() -> tuple[str, ...]:
    """Names of the shipped scenarios, in order."""
    return tuple(sorted(file.stem for file in LIBRARY.glob("*.toml")))


def named(name: str) -> Scenario:
    """A shipped scenario; raises InputError for a name that is not in the library."""
    if name not in library():
        raise InputError(f"no scenario {name!r}; expected one of {', '.join(library())}")
    return load_scenario(LIBRARY / f"{name}.toml")
