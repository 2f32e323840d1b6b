"""Start-up that refuses: one sentence and an exit status."""

from __future__ import annotations

import contextlib
import enum
from collections.abc import Iterator
from typing import final

from workbench.errors import InputError
from workbench.runtime.onboard.bus import BusFaultError


@final
class RefusedError(Exception):
    """Start-up ends here; the text is one sentence."""

    def __init__(self, status: enum.IntEnum, sentence: str) -> None:
        super().__init__(" ".join(sentence.split()))
        self.status = status


@contextlib.contextmanager
def refusing(status: enum.IntEnum) -> Iterator[None]:
    """What cannot be used inside ends the start-up with this status."""
    try:
        yield
    except InputError as error:
        raise RefusedError(status, str(error)) from error
    except BusFaultError as fault:
        raise RefusedError(status, f"the bus cannot be opened: {fault}") from fault
