"""CSV tables, plain or gzip, whose errors name file, line and column."""

from __future__ import annotations

import csv
import gzip
import io
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench.errors import InputError


@final
@dataclass(frozen=True, slots=True)
class Row:
    """One data row and where it stands in its file."""

    path: Path
    line: int
    values: Mapping[str, str]

    def place(self, column: str) -> str:
        """File, line and column, for messages."""
        return f"{self.path}, line {self.line}, column {column!r}"

    def text(self, column: str) -> str:
        """The entry as written."""
        return self.values[column]

    def number(self, column: str) -> float:
        """The entry as a finite float; InputError otherwise."""
        try:
            value = float(self.values[column])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(
                f"{self.place(column)}: expected a finite number, got {self.values[column]!r}; "
                "correct the entry or remove the row"
            )
        return value


@final
@dataclass(frozen=True, slots=True)
class Table:
    """A CSV file with a header row, all entries still text."""

    path: Path
    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    @staticmethod
    def exists(folder: Path, stem: str) -> bool:
        """Is there `<stem>.csv.gz` or `<stem>.csv` in the folder?"""
        return any((folder / f"{stem}{ending}").is_file() for ending in (".csv.gz", ".csv"))

    @classmethod
    def read(cls, folder: Path, stem: str, required: tuple[str, ...]) -> Table:
        """Read `<stem>.csv.gz`, else `<stem>.csv`; extra columns are kept, missing ones refused."""
        path = _find(folder, stem)
        reader = csv.reader(io.StringIO(_content(path), newline=""))
        columns = tuple(name.strip() for name in next(reader, []))
        if not columns:
            raise InputError(
                f"{path} is empty; expected a header row with the columns {', '.join(required)}"
            )
        missing = [name for name in required if name not in columns]
        if missing:
            raise InputError(
                f"{path}: missing column{'s' if len(missing) > 1 else ''} {', '.join(missing)}; "
                f"expected {', '.join(required)}, got {', '.join(columns)}"
            )
        rows = []
        for entries in reader:
            if not entries:
                continue
            if len(entries) != len(columns):
                raise InputError(
                    f"{path}, line {reader.line_num}: expected {len(columns)} entries as in the "
                    f"header, got {len(entries)}; correct or remove the row"
                )
            rows.append(Row(path, reader.line_num, dict(zip(columns, entries, strict=True))))
        return cls(path, columns, tuple(rows))


def _find(folder: Path, stem: str) -> Path:
    for ending in (".csv.gz", ".csv"):
        if (folder / f"{stem}{ending}").is_file():
            return folder / f"{stem}{ending}"
    found = ", ".join(sorted(entry.name for entry in folder.iterdir())) or "nothing"
    raise InputError(
        f"{folder}: expected {stem}.csv.gz or {stem}.csv, the folder holds {found}; "
        "a table without rows is a file with only its header"
    )


def _content(path: Path) -> str:
    try:
        raw = path.read_bytes()
        return (gzip.decompress(raw) if path.suffix == ".gz" else raw).decode("utf-8-sig")
    except (EOFError, OSError, zlib.error) as fault:
        raise InputError(f"{path} cannot be read ({fault}); fetch it again") from fault
    except UnicodeDecodeError as fault:
        raise InputError(f"{path} is not UTF-8 text ({fault}); save it as UTF-8 CSV") from fault
