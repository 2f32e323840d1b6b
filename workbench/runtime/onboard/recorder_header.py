"""What a log must say once for a replay: which bundle, mode, path and settings it was made with."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, final

from workbench.errors import InputError
from workbench.runtime.path import PathTable

FORMAT: Final = 1
HEADER_FILE: Final = "run.json"


@final
@dataclass(frozen=True, slots=True)
class LogHeader:
    """manifest_sha256: of the bundle's manifest.json; mode, protocol: by name; path: that the core
    was given; settings: of the core, as plain values; outline_m: front, rear and half width of the
    body from the middle of the rear axle; started_unix_us: the wall clock at the core's 0, for
    readers only.
    """

    manifest_sha256: str
    mode: str
    protocol: str
    path: PathTable
    settings: Mapping[str, Any]
    outline_m: tuple[float, float, float]
    started_unix_us: int
    created_by: str

    def to_json(self) -> str:
        """As text; floats keep all their bits."""
        return json.dumps({"format": FORMAT} | asdict(self), allow_nan=False)

    @classmethod
    def from_json(cls, text: str, *, source: str) -> LogHeader:
        """The header that `to_json` wrote. Raises InputError, which names `source`."""
        try:
            content = json.loads(text)
            number = content.pop("format")
            if number != FORMAT:
                raise InputError(
                    f"{source}: expected a log of format {FORMAT}, got {number!r}; replay it with "
                    "the workbench that recorded it"
                )
            columns = content.pop("path")
            values: dict[str, Any] = {
                name: tuple(value) if isinstance(value, list) else value
                for name, value in columns.items()
            }
            path = PathTable(**values)
            return cls(path=path, **content | {"outline_m": tuple(content["outline_m"])})
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{source}: expected the header of a log, got {error!r}; take the run.json that "
                "was written beside the log"
            ) from error

    @classmethod
    def read(cls, path: Path) -> LogHeader:
        """The header in a file. Raises InputError."""
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(
                f"expected the header of a log at {path}, got {error}; take the {HEADER_FILE} that "
                "was written beside the log"
            ) from error
        return cls.from_json(text, source=str(path))
