"""What a localiser tells those who watch: changes on stderr, counts once a second in a file."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, final

from workbench.errors import InputError
from workbench.runtime.localiser.core import LocaliserCore
from workbench.runtime.onboard.attending import say
from workbench.runtime.onboard.loop import Counts

if TYPE_CHECKING:
    from workbench.runtime.onboard.states import Request
    from workbench.runtime.onboard.turns import TurnResult

_EVERY_US: Final = 1_000_000


@final
class Journal:
    """`Surroundings` of the loop: never asks for anything.

    path: a new file for JSON lines, None for none; raises InputError where it cannot be made or is
    there already. A line that cannot be written is the last one that is tried. The file should lie
    on a disk that does not wait: what holds up the loop makes it silent.
    """

    def __init__(self, core: LocaliserCore, path: Path | None) -> None:
        self._core, self._file, self._due_us = core, -1, 0
        if path is None:
            return
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        try:
            self._file = os.open(path, flags, 0o644)
        except OSError as error:
            raise InputError(
                f"--log: expected a new file that can be written, got {path} ({error.strerror}); "
                "name another"
            ) from None

    def before(self) -> Sequence[Request]:
        """As `Surroundings.before`: nobody asks a localiser anything."""
        return ()

    def turned(self, result: TurnResult, counts: Counts) -> None:
        """As `Surroundings.turned`."""
        for event in result.events:
            say(f"{result.at_us / 1e6:.3f} s: {event}")
        if self._file < 0 or (result.at_us < self._due_us and not result.events):
            return
        self._due_us = result.at_us + _EVERY_US
        self._write(json.dumps(self._line(result.at_us, counts)) + "\n")

    def close(self) -> None:
        """Let go of the file."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _line(self, at_us: int, counts: Counts) -> dict[str, Any]:
        core = self._core
        tally = dataclasses.asdict(core.tally)
        tally["begun"] = {why.name: count for why, count in core.tally.begun.items()}
        return {
            "at_s": at_us / 1e6,
            "said": core.said.name,
            "ranges": core.ranges.used,
            "ranges_refused": {why.name: count for why, count in core.ranges.counts.items()},
            **tally,
            "loop": dataclasses.asdict(counts),
        }

    def _write(self, text: str) -> None:
        try:
            os.write(self._file, text.encode())
        except OSError as error:
            say(f"ALERT: LOG_LOST: {error.strerror}")
            self.close()
