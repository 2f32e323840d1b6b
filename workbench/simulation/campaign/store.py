"""A survey's folder: a manifest, what is driven, and results in parts that are whole or missing.

manifest.json, vehicle.toml, sensors.toml, baselines.json
bundles/3s, bundles/5s                  by LookAhead's horizon
parts/PLANT/FIRST-LAST.parquet          rows of all contenders for these indices
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, final

from workbench import __version__
from workbench.errors import InputError
from workbench.models.vehicle import Vehicle, load_vehicle
from workbench.runtime import load_bundle
from workbench.simulation.campaign.contenders import LONG, horizons_s, judged
from workbench.simulation.campaign.parts import Parts, require_same, write_whole
from workbench.simulation.campaign.rows import PER_RUN, Row
from workbench.simulation.campaign.sampled import DIMENSIONS, FAMILY
from workbench.simulation.campaign.tuning import Tuned
from workbench.simulation.rig import Rig
from workbench.simulation.simulated import build_rig, simulated_path, simulated_sensors

_OURS: Final = ("vehicle.toml", "sensors.toml")


def _digest(vehicle: str, sensors: str) -> str:
    return hashlib.sha256(f"{vehicle}\0{sensors}".encode()).hexdigest()


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.exists() else ""


@final
@dataclasses.dataclass(frozen=True, slots=True)
class Manifest:
    """What must be the same for results to be summed: version of this package and of the family of
    scenarios, dimensions of its cube, seed, contenders, how many scenarios those who look far ahead
    drive (`LONG`), and the SHA-256 of vehicle and sensors."""

    version: str
    family: int
    dimensions: int
    seed: int
    contenders: tuple[str, ...]
    long_looks: int
    vehicle_sha256: str

    def drives(self, index: int) -> tuple[str, ...]:
        """Who drives a scenario: baselines only those that they are judged on."""
        return tuple(
            name for name in self.contenders
            if (index < self.long_looks if name == LONG else judged(name, index))
        )  # fmt: skip


@final
@dataclasses.dataclass(frozen=True, slots=True)
class Store:
    """A survey's folder."""

    folder: Path

    def begin(
        self,
        *,
        seed: int,
        contenders: tuple[str, ...],
        long_looks: int,
        vehicle: Path | None = None,
    ) -> Manifest:
        """Make it, or go on with one of the same manifest; vehicle: a file, None for the shipped
        one. Raises InputError where something else was surveyed here."""
        file = simulated_path() if vehicle is None else vehicle
        load_vehicle(file)  # Refuses what cannot be one before anything is written.
        text, sensors = file.read_text(encoding="utf-8"), simulated_sensors()
        digest = _digest(text, sensors)
        wanted = Manifest(__version__, FAMILY, DIMENSIONS, seed, contenders, long_looks, digest)
        if self._manifest.exists():
            require_same(self.folder, wanted, self.manifest())
            self._require_untouched(digest)
            return wanted
        if self.folder.exists() and {each.name for each in self.folder.iterdir()} - {*_OURS}:
            raise InputError(
                f"{self.folder}: expected a survey's folder or an empty one, got other files; "
                "name another with --out"
            )
        for name, content in zip(_OURS, (text, sensors), strict=True):
            write_whole(self.folder / name, content)
        write_whole(self._manifest, json.dumps(dataclasses.asdict(wanted), indent=2) + "\n")
        return wanted

    def _require_untouched(self, digest: str) -> None:
        """Raise InputError where vehicle or sensors are not what the folder was begun with."""
        stored = (_read(self.folder / name) for name in _OURS)
        if _digest(*stored) != digest:
            raise InputError(
                f"{self.folder}: expected {' and '.join(_OURS)} as the survey wrote them, and they "
                "were changed; put them back, or name another folder with --out"
            )

    def manifest(self) -> Manifest:
        """Of what is there; raises InputError for a folder that is not a survey's."""
        try:
            data = json.loads(self._manifest.read_text(encoding="utf-8"))
            return Manifest(**{**data, "contenders": tuple(data["contenders"])})
        except (OSError, ValueError, TypeError, KeyError) as fault:
            raise InputError(
                f"{self.folder}: expected a survey's folder with its manifest.json ({fault}); "
                "`workbench survey --out DIR` makes one"
            ) from fault

    def vehicle(self) -> Vehicle:
        """Who is driven."""
        return load_vehicle(self.folder / "vehicle.toml")

    def build(self) -> None:
        """Compile the bundles that are missing."""
        for horizon_s in horizons_s(self.manifest().contenders):
            place = self._bundle(horizon_s)
            if place.exists():
                continue
            place.parent.mkdir(parents=True, exist_ok=True)
            sensors = (self.folder / "sensors.toml").read_text(encoding="utf-8")
            with tempfile.TemporaryDirectory(dir=place.parent) as beside:
                built = Path(beside) / place.name
                build_rig(
                    built, vehicle=self.vehicle(), horizon_s=horizon_s, sensors=sensors,
                    deciding_alone=True,
                )  # fmt: skip
                built.rename(place)

    def rigs(self) -> dict[float, Rig]:
        """By the horizon of LookAhead, in s."""
        vehicle = self.vehicle()
        horizons = horizons_s(self.manifest().contenders)
        return {each: Rig(load_bundle(self._bundle(each)), vehicle) for each in horizons}

    def parameters(self) -> dict[str, dict[str, Any]]:
        """What was tuned, by plant; {} before. Raises InputError for a damaged file."""
        path = self.folder / "baselines.json"
        if not path.exists():
            return {}
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            return {
                plant: {name: dataclasses.asdict(Tuned(**each)) for name, each in tuned.items()}
                for plant, tuned in found.items()
            }
        except (OSError, ValueError, TypeError, AttributeError) as fault:
            raise InputError(
                f"{path}: expected what baselines were tuned to, got {fault}; put the file back, "
                "or name another folder with --out"
            ) from fault

    def keep_parameters(self, tuned: Mapping[str, object]) -> None:
        """Write what was tuned, by plant."""
        write_whole(self.folder / "baselines.json", json.dumps(tuned, indent=2) + "\n")

    def missing(self, plant: str, count: int) -> list[range]:
        """Indices below count that were not driven yet, in parts."""
        return self._parts(plant).missing(count)

    def driven(self, plant: str) -> bool:
        """Whether there is any result for a plant."""
        return bool(self._parts(plant).files())

    def write(self, plant: str, indices: range, rows: Sequence[Row]) -> None:
        """One part, whole or not at all."""
        self._parts(plant).write(indices, [dataclasses.asdict(row) for row in rows])

    def rows(self) -> list[Row]:
        """All that is there, by plant, index and contender; each once, where two surveys at the
        same time drove it twice."""
        places = sorted((self.folder / "parts").glob("*"))
        found = [row for place in places for row in self._parts(place.name).rows()]
        once = {tuple(row[name] for name in PER_RUN): row for row in found}
        return [Row(**row) for row in once.values()]

    @property
    def _manifest(self) -> Path:
        return self.folder / "manifest.json"

    def _bundle(self, horizon_s: float) -> Path:
        return self.folder / "bundles" / f"{horizon_s:g}s"

    def _parts(self, plant: str) -> Parts:
        return Parts(self.folder / "parts" / plant)
