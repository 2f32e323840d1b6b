"""A survey's folder: a manifest, what is driven, and results in parts that are whole or missing.

manifest.json, vehicle.toml, sensors.toml, baselines.json
bundles/3s, bundles/5s                  by LookAhead's horizon
parts/PLANT/FIRST-LAST.parquet          rows of all contenders for these indices
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, final

from workbench import __version__
from workbench.errors import InputError
from workbench.models.vehicle import Vehicle, load_vehicle
from workbench.runtime import load_bundle
from workbench.simulation.campaign.contenders import LONG, horizons_s
from workbench.simulation.campaign.rows import Row
from workbench.simulation.campaign.sampled import DIMENSIONS, FAMILY
from workbench.simulation.rig import Rig
from workbench.simulation.simulated import build_rig, simulated_path, simulated_sensors

PART: Final = 16
"""Indices per part, at most."""
_NAME: Final = re.compile(r"(\d{7})-(\d{7})\.parquet")


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
        """Who drives a scenario."""
        return tuple(name for name in self.contenders if name != LONG or index < self.long_looks)


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
        text = (simulated_path() if vehicle is None else vehicle).read_text(encoding="utf-8")
        sensors = simulated_sensors()
        digest = hashlib.sha256(f"{text}\0{sensors}".encode()).hexdigest()
        wanted = Manifest(__version__, FAMILY, DIMENSIONS, seed, contenders, long_looks, digest)
        if self._manifest.exists():
            self._require(wanted)
            return wanted
        if self.folder.exists() and any(self.folder.iterdir()):
            raise InputError(
                f"{self.folder}: expected a survey's folder or an empty one, got other files; "
                "name another with --out"
            )
        write_whole(self.folder / "vehicle.toml", text)
        write_whole(self.folder / "sensors.toml", sensors)
        write_whole(self._manifest, json.dumps(dataclasses.asdict(wanted), indent=2) + "\n")
        return wanted

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
                build_rig(built, vehicle=self.vehicle(), horizon_s=horizon_s, sensors=sensors)
                built.rename(place)

    def rigs(self) -> dict[float, Rig]:
        """By the horizon of LookAhead, in s."""
        vehicle = self.vehicle()
        horizons = horizons_s(self.manifest().contenders)
        return {each: Rig(load_bundle(self._bundle(each)), vehicle) for each in horizons}

    def parameters(self) -> dict[str, dict[str, Any]]:
        """What was tuned, by plant; {} before."""
        path = self.folder / "baselines.json"
        if not path.exists():
            return {}
        found: dict[str, dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
        return found

    def keep_parameters(self, tuned: Mapping[str, object]) -> None:
        """Write what was tuned, by plant."""
        write_whole(self.folder / "baselines.json", json.dumps(tuned, indent=2) + "\n")

    def missing(self, plant: str, count: int) -> list[range]:
        """Indices below count that were not driven yet, in parts."""
        done: set[int] = set()
        for path in self._parts(plant):
            first, last = _named(path)
            done.update(range(first, last + 1))
        left = [k for k in range(count) if k not in done]
        parts: list[range] = []
        for k in left:
            if parts and parts[-1].stop == k and len(parts[-1]) < PART and k % PART:
                parts[-1] = range(parts[-1].start, k + 1)
            else:
                parts.append(range(k, k + 1))
        return parts

    def driven(self, plant: str) -> bool:
        """Whether there is any result for a plant."""
        return bool(self._parts(plant))

    def write(self, plant: str, indices: range, rows: Sequence[Row]) -> None:
        """One part, whole or not at all."""
        import pyarrow
        import pyarrow.parquet

        table = pyarrow.Table.from_pylist([dataclasses.asdict(row) for row in rows])
        name = f"{indices.start:07d}-{indices.stop - 1:07d}.parquet"
        with _replacing(self.folder / "parts" / plant / name) as beside:
            pyarrow.parquet.write_table(table, beside)

    def rows(self) -> list[Row]:
        """All that is there, by plant, index and contender."""
        import pyarrow.parquet

        found = []
        for place in sorted((self.folder / "parts").glob("*")):
            for path in self._parts(place.name):
                table = pyarrow.parquet.ParquetFile(path).read()
                found += [Row(**row) for row in table.to_pylist()]
        return found

    @property
    def _manifest(self) -> Path:
        return self.folder / "manifest.json"

    def _bundle(self, horizon_s: float) -> Path:
        return self.folder / "bundles" / f"{horizon_s:g}s"

    def _parts(self, plant: str) -> list[Path]:
        found = (self.folder / "parts" / plant).glob("*.parquet")
        return sorted(path for path in found if _NAME.fullmatch(path.name))

    def _require(self, wanted: Manifest) -> None:
        found = self.manifest()
        for each in dataclasses.fields(Manifest):
            is_, was = getattr(wanted, each.name), getattr(found, each.name)
            if is_ != was:
                raise InputError(
                    f"{self.folder}: expected the {each.name} it was begun with, {was!r}, got "
                    f"{is_!r}; results must not be mixed, so name another folder with --out"
                )


def _named(path: Path) -> tuple[int, int]:
    found = _NAME.fullmatch(path.name)
    assert found is not None, path
    return int(found[1]), int(found[2])


@contextlib.contextmanager
def _replacing(target: Path) -> Iterator[Path]:
    """A path beside the target, which takes its place where the block succeeds."""
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        yield beside
        os.replace(beside, target)
    finally:
        beside.unlink(missing_ok=True)


def write_whole(target: Path, text: str) -> None:
    """Text, whole or not at all; missing folders are made."""
    with _replacing(target) as beside:
        beside.write_text(text, encoding="utf-8")
