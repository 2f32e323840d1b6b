"""What commands print: a result as text or JSON on standard output, progress on standard error."""

from __future__ import annotations

import argparse
import dataclasses
import enum
import json
import math
import os
import sys
import time
from collections.abc import Mapping
from types import TracebackType
from typing import Final, Self, TextIO, final

from workbench.cli.interruption import check

_BAR_WIDTH: Final = 30
_SECONDS_BETWEEN_DRAWINGS: Final = 0.1
_SECONDS_BETWEEN_LINES: Final = 5.0


def emit(args: argparse.Namespace, text: str, data: object) -> None:
    """Print `text`, or with `--json` print `data` as one JSON document instead.

    Raises KeyboardInterrupt after a Ctrl-C that was lost on its way: the result may be spoilt.
    """
    check()
    print(json.dumps(plain(data), indent=2, allow_nan=False) if args.json else text)


def warn(text: str) -> None:
    """Print one line of warning to standard error, where it disturbs no JSON reader."""
    print(f"warning: {text}", file=sys.stderr)


def plain(data: object) -> object:
    """`data` in terms that JSON knows.

    NaN and infinities become null, enumeration members their names, dataclasses and mappings
    objects, sequences and arrays lists, paths strings. Raises TypeError for anything else.
    """
    if isinstance(data, enum.Enum):
        return data.name
    if data is None or isinstance(data, bool | int | str):
        return data
    if isinstance(data, float):
        return float(data) if math.isfinite(data) else None
    if dataclasses.is_dataclass(data) and not isinstance(data, type):
        return {field.name: plain(getattr(data, field.name)) for field in dataclasses.fields(data)}
    if isinstance(data, Mapping):
        return {str(plain(key)): plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple | set | frozenset):
        return [plain(item) for item in data]
    if isinstance(data, os.PathLike):
        return os.fspath(data)
    if hasattr(data, "tolist"):  # NumPy scalars and arrays, without importing NumPy
        return plain(data.tolist())
    raise TypeError(f"expected data that JSON can hold, got {type(data).__name__}")


@final
class Progress:
    """A bar with percent and elapsed time on standard error, for the duration of a `with` block.

    label: what is under way; total: number of steps, at least 1. On a terminal the bar is redrawn
    in place; elsewhere one plain line is written every five seconds and one at the end.
    """

    def __init__(self, label: str, total: int, *, stream: TextIO | None = None) -> None:
        if total < 1:
            raise ValueError(f"expected at least 1 step, got {total}")
        self._label = label
        self._total = total
        self._stream = sys.stderr if stream is None else stream
        self._in_place = self._stream.isatty()
        self._done = 0
        self._started_s = self._drawn_s = time.monotonic()

    def __enter__(self) -> Self:
        if self._in_place:
            self._draw()
        return self

    def advance(self, steps: int = 1) -> None:
        """Count `steps` more as done. Raises KeyboardInterrupt after a Ctrl-C that was lost."""
        check()
        self._done = min(self._done + steps, self._total)
        pause_s = _SECONDS_BETWEEN_DRAWINGS if self._in_place else _SECONDS_BETWEEN_LINES
        if time.monotonic() - self._drawn_s >= pause_s:
            self._draw()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._done = self._total
        self._draw()
        if self._in_place:
            self._stream.write("\n")
            self._stream.flush()

    def _draw(self) -> None:
        self._drawn_s = time.monotonic()
        elapsed_s = self._drawn_s - self._started_s
        share = self._done / self._total
        figures = f"{share:4.0%} {elapsed_s:6.1f} s"
        if self._in_place:
            filled = round(share * _BAR_WIDTH)
            bar = "#" * filled + "." * (_BAR_WIDTH - filled)
            self._stream.write(f"\r{self._label} [{bar}] {figures}")
        else:
            self._stream.write(f"{self._label}: {figures}\n")
        self._stream.flush()
