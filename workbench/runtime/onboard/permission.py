"""The monitor among the turns: when it is asked, by which clock, and what it learns of faults."""

from __future__ import annotations

from collections.abc import Callable
from typing import final

from workbench.runtime.bundle import Bundle
from workbench.runtime.decision import Decision
from workbench.runtime.monitor import Monitor
from workbench.runtime.observation import Observation
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.times import seconds
from workbench.runtime.path import PathTable
from workbench.runtime.policies import Deciding, Turn


@final
class _TwoInstants:
    """The monitor's clock during one decision: when it began, then when it ended, read once."""

    def __init__(self, at_us: int) -> None:
        self._begun_us = at_us
        self._read: Callable[[], int] | None = None
        self._asked = True
        self.ended_us: int | None = None

    def begin(self, at_us: int, read: Callable[[], int]) -> None:
        """A decision begins; `read` tells when it has ended."""
        self._begun_us, self._read = at_us, read
        self._asked, self.ended_us = False, None

    def end(self) -> int:
        """When it ended."""
        if self.ended_us is None:
            assert self._read is not None, "only asked in a decision"
            self.ended_us = self._read()
        return self.ended_us

    def __call__(self) -> float:
        if self._read is None or not self._asked:
            self._asked = True
            return seconds(self._begun_us)
        return seconds(self.end())


@final
class Permission:
    """Asks a `Monitor`, a new one whenever driving begins or ends.

    Only while we drive does the car do what the monitor says, which `FailSafe` rests on; otherwise
    `LookAhead` decides, for the log and for those who are warned. Instants are fed in, so that the
    same numbers give the same bits.
    """

    def __init__(self, bundle: Bundle, path: PathTable, settings: OnboardSettings) -> None:
        self._bundle, self._path, self._settings = bundle, path, settings
        self._clock: _TwoInstants
        self._drives = False
        self._monitor = self._new(0, station_m=settings.start_station_m)

    def begin(self, at_us: int, *, drives: bool, station_m: float | None) -> None:
        """From now on the car follows (drives) or does not; station_m: where it is, if known."""
        self._drives = drives
        self._monitor = self._new(at_us, station_m=station_m)

    def decide(
        self, observation: Observation, at_us: int, read: Callable[[], int]
    ) -> tuple[Decision, int]:
        """The decision and when it ended (us); read: the clock, asked once."""
        self._clock.begin(at_us, read)
        decision = self._monitor.step(observation)
        return decision, self._clock.end()

    def turn(self, at_us: int) -> Turn:
        """What may be sent now."""
        return self._monitor.turn(seconds(at_us))

    def hold(self, at_us: int) -> None:
        """BRAKE is sent now, whatever the monitor says."""
        self._monitor.hold(seconds(at_us))

    def _new(self, at_us: int, *, station_m: float | None) -> Monitor:
        self._clock = _TwoInstants(at_us)
        settings = self._settings
        return Monitor(
            self._bundle,
            self._path,
            release_steps=settings.release_steps,
            clearance_required_m=settings.clearance_required_m,
            timing=settings.timing,
            deciding=None if self._drives else Deciding.LOOK_AHEAD,
            start_station_m=station_m,
            clock=self._clock,
        )
