"""The clock of a run that is not in real time."""

from __future__ import annotations

from typing import final


@final
class SetClock:
    """Shows what the run sets it to: give it to the `Monitor` and to the run.

    A monitor that reads it says of instants and ages what the run says, and the same run gives the
    same log, however long the machine takes.
    """

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        """The instant that was set, s."""
        return self.now_s
