"""Rows by index in Parquet files that are whole or missing, so that work goes on where it ended."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, final

from workbench.errors import InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

PART: Final = 16
"""Indices per part, at most, unless told."""
_NAME: Final = re.compile(r"(\d{7})-(\d{7})\.parquet")


@final
@dataclass(frozen=True, slots=True)
class Parts:
    """FIRST-LAST.parquet in a folder: all rows of these indices; most: indices per part."""

    folder: Path
    most: int = PART

    def files(self) -> list[Path]:
        """What is there, by index."""
        found = self.folder.glob("*.parquet")
        return sorted(path for path in found if _NAME.fullmatch(path.name))

    def missing(self, count: int) -> list[range]:
        """Indices below count that are not there, in parts."""
        done: set[int] = set()
        for path in self.files():
            first, last = _named(path)
            done.update(range(first, last + 1))
        parts: list[range] = []
        for k in (k for k in range(count) if k not in done):
            if parts and parts[-1].stop == k and len(parts[-1]) < self.most and k % self.most:
                parts[-1] = range(parts[-1].start, k + 1)
            else:
                parts.append(range(k, k + 1))
        return parts

    def write(self, indices: range, rows: Sequence[Mapping[str, Any]]) -> None:
        """One part, whole or not at all."""
        import pyarrow
        import pyarrow.parquet

        table = pyarrow.Table.from_pylist([dict(row) for row in rows])
        name = f"{indices.start:07d}-{indices.stop - 1:07d}.parquet"
        with replacing(self.folder / name) as beside:
            pyarrow.parquet.write_table(table, beside)

    def rows(self) -> list[dict[str, Any]]:
        """All that is there, in the order of the indices."""
        import pyarrow.parquet

        found: list[dict[str, Any]] = []
        for path in self.files():
            try:
                found += pyarrow.parquet.ParquetFile(path).read().to_pylist()
            except (OSError, pyarrow.ArrowException) as fault:
                raise InputError(
                    f"{path}: expected results as a Parquet file, got {fault}; delete it, and the "
                    "same command makes it again"
                ) from fault
        return found


def _named(path: Path) -> tuple[int, int]:
    found = _NAME.fullmatch(path.name)
    assert found is not None, path
    return int(found[1]), int(found[2])


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A path beside the target, which takes its place where the block succeeds."""
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        yield beside
        os.replace(beside, target)
    finally:
        beside.unlink(missing_ok=True)


def write_whole(target: Path, content: str | bytes) -> None:
    """Text or bytes, whole or not at all; missing folders are made."""
    data = content.encode("utf-8") if isinstance(content, str) else content
    with replacing(target) as beside:
        beside.write_bytes(data)


def require_same(folder: Path, wanted: DataclassInstance, found: DataclassInstance) -> None:
    """Raise InputError where a folder was begun with something else; both of the same class."""
    for each in dataclasses.fields(wanted):
        is_, was = getattr(wanted, each.name), getattr(found, each.name)
        if is_ != was:
            raise InputError(
                f"{folder}: expected the {each.name} it was begun with, {was!r}, got {is_!r}; "
                "results must not be mixed, so name another folder with --out"
            )
