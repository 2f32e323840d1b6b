"""A folder of pairs drawn so far: blocks that are whole or missing, and what they were drawn from.

manifest.json: the recipe; pairs/00000012.npy: block 12 as (2, N, K+1, n), both ends of N pairs.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.learning.pairs import PairRuns

_FORMAT: Final = "drawn pairs 1"


@final
@dataclass(frozen=True, slots=True)
class PairStore:
    """Blocks of one recipe. Made by `opened`."""

    folder: Path

    @classmethod
    def opened(cls, folder: Path, recipe: Mapping[str, object]) -> PairStore:
        """Begin a folder, or go on with one of the same recipe (JSON values by name).

        Raises InputError where the folder holds something else or cannot be written.
        """
        store = cls(folder)
        wanted = json.loads(json.dumps({"format": _FORMAT, **recipe}))
        manifest = folder / "manifest.json"
        try:
            if manifest.exists():
                store._require(wanted)
                (folder / "pairs").mkdir(exist_ok=True)
                store._clear()
                return store
            if folder.exists() and any(folder.iterdir()):
                raise InputError(
                    f"{folder}: expected a folder of drawn pairs or an empty one, got other files; "
                    "name another with --resume"
                )
            folder.mkdir(parents=True, exist_ok=True)
            text = json.dumps(wanted, indent=2, sort_keys=True) + "\n"
            _write(manifest, text.encode())
            # After the manifest: a folder that has only that is one to go on with.
            (folder / "pairs").mkdir()
        except OSError as error:
            raise InputError(
                f"{folder}: expected a folder that can be written ({error.strerror}); name another "
                "with --resume, or change its permissions"
            ) from error
        return store

    def read(self, number: int, count: int) -> PairRuns | None:
        """The first `count` pairs of a block; None where they are not there."""
        try:
            both = np.load(self._path(number), allow_pickle=False)
            if both.ndim != 4 or len(both) != 2:
                raise ValueError(f"it holds an array of shape {both.shape}")
        except FileNotFoundError:
            return None
        except (OSError, EOFError, ValueError) as error:
            raise InputError(
                f"{self._path(number)}: expected a block of pairs as it was written ({error}); "
                "delete this file, it is then drawn again"
            ) from error
        if both.shape[1] < count:
            return None
        return PairRuns(both[0, :count], both[1, :count])

    def holds(self, number: int) -> bool:
        """Is there such a block, whatever its size?"""
        return self._path(number).exists()

    def write(self, number: int, runs: PairRuns) -> None:
        """One block, whole or not at all."""
        target = self._path(number)
        beside = target.with_name(f".{target.name}.{os.getpid()}.part")
        try:
            with beside.open("wb") as file:
                np.save(file, np.stack([runs.first, runs.second]), allow_pickle=False)
            os.replace(beside, target)
        except OSError as error:
            raise InputError(
                f"{target}: expected a file that can be written ({error.strerror}); make room, "
                "then go on with the same --resume"
            ) from error
        finally:
            with contextlib.suppress(OSError):
                beside.unlink(missing_ok=True)

    def _path(self, number: int) -> Path:
        return self.folder / "pairs" / f"{number:08d}.npy"

    def _clear(self) -> None:
        """Take away what processes that are gone left half written."""
        for part in (self.folder / "pairs").glob(".*.part"):
            process = part.name.split(".")[-2]
            if process.isdigit() and not _alive(int(process)):
                part.unlink(missing_ok=True)

    def _require(self, wanted: dict[str, object]) -> None:
        manifest = self.folder / "manifest.json"
        try:
            found = json.loads(manifest.read_text(encoding="utf-8"))
        except ValueError as error:
            raise InputError(f"{manifest}: expected JSON ({error}); name another folder") from error
        if found == wanted:
            return
        if not isinstance(found, dict):
            raise InputError(f"{manifest}: expected drawn pairs, got other JSON")
        key = next(k for k in {**wanted, **found} if wanted.get(k) != found.get(k))
        raise InputError(
            f"{self.folder}: expected pairs of the same {key}, {wanted.get(key)!r}, got those of "
            f"{found.get(key)!r}; pairs must not be mixed, so name another folder with --resume"
        )


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True


def _write(target: Path, data: bytes) -> None:
    beside = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        beside.write_bytes(data)
        os.replace(beside, target)
    finally:
        beside.unlink(missing_ok=True)
