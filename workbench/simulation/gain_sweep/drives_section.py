"""Which scenarios the finalists of a study drive: its section [drives]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.models.section_reading import as_numbers, require_keys
from workbench.models.vehicle import Vehicle
from workbench.simulation.plants.make import PLANTS
from workbench.simulation.scenarios.scenario import Expected
from workbench.simulation.scenarios.shipped import library, named

POLICIES: Final = {"LookAhead 3 s": "LookAhead", "FailSafe": "FailSafe", "both": "both"}
"""Name in a survey -> name in a scenario's expectations."""
LIBRARY: Final = "library"
"""All of it but what the policy cannot prevent: stories that expect a contact of it."""
_WHERE: Final = "[drives]"
_MOST: Final = 100


@final
@dataclass(frozen=True, slots=True)
class Drives:
    """Scenarios of the shipped library by name, plant, policy, seeds; finalists: how many points of
    the front drive beside the present gains."""

    scenarios: tuple[str, ...]
    plant: str
    policy: str
    seeds: tuple[int, ...]
    finalists: int

    @property
    def count(self) -> int:
        """Drives of each point."""
        return len(self.scenarios) * len(self.seeds)

    def drive(self, number: int) -> tuple[str, int]:
        """Scenario and seed of a drive by its number, 0 to `count` - 1."""
        scenario, seed = divmod(number, len(self.seeds))
        return self.scenarios[scenario], self.seeds[seed]


def drives_section(table: Mapping[str, object]) -> Drives:
    """Read and check it. Raises InputError that says what to mend."""
    require_keys(_WHERE, table, ("scenarios", "finalists"), ("plant", "policy", "seeds"))
    seeds = _whole("seeds", table.get("seeds", [1]), least=0)
    if len(set(seeds)) < len(seeds):
        raise InputError(f"{_WHERE} seeds: expected each once, got {list(seeds)}")
    (finalists,) = _whole("finalists", [table["finalists"]], least=1)
    if finalists > _MOST:
        raise InputError(f"{_WHERE} finalists: expected at most {_MOST}, got {finalists}")
    policy = _one_of("policy", table.get("policy", "both"), tuple(POLICIES))
    return Drives(
        _scenarios(table["scenarios"], POLICIES[policy]),
        _one_of("plant", table.get("plant", "bicycle"), PLANTS),
        policy, seeds, finalists,
    )  # fmt: skip


def check_drives(vehicle: Vehicle) -> None:
    """Raise InputError on a vehicle that cannot drive in the simulation."""
    if vehicle.drive_by_wire is None:
        raise InputError(
            "[drives]: expected a vehicle file with [drive_by_wire], which the simulated car "
            f"obeys, got {vehicle.name!r} without; add that section, or leave [drives] out"
        )


def _scenarios(value: object, policy: str) -> tuple[str, ...]:
    if value == LIBRARY:
        every = (named(name) for name in library())
        return tuple(e.name for e in every if e.expected.get(policy) is not Expected.COLLIDES)
    if not isinstance(value, list) or not value or len(set(map(str, value))) < len(value):
        raise InputError(
            f'{_WHERE} scenarios: expected "{LIBRARY}", or a list of names, each once, '
            f"got {value!r}"
        )
    try:
        return tuple(named(str(name)).name for name in value)
    except InputError as error:
        raise InputError(f"{_WHERE} scenarios: {error}") from None


def _whole(key: str, value: object, *, least: int) -> tuple[int, ...]:
    numbers = as_numbers(_WHERE, key, value)
    if not numbers or any(x != int(x) or x < least for x in numbers):
        raise InputError(
            f"{_WHERE} {key}: expected whole numbers >= {least}, got {[f'{x:g}' for x in numbers]}"
        )
    return tuple(int(x) for x in numbers)


def _one_of(key: str, value: object, known: tuple[str, ...]) -> str:
    if value not in known:
        raise InputError(f"{_WHERE} {key}: expected one of {', '.join(known)}, got {value!r}")
    return str(value)
