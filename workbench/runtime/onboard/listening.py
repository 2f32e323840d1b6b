"""Before anything is sent: what a bus carries, so that the wrong one is noticed."""

from __future__ import annotations

from typing import Final

from workbench.runtime.onboard.bus import Bus
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.loop import MonotonicClock
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.protocols import load_protocol

LISTENED_US: Final = 1_200_000
"""So long at least, that what comes once a second is heard, and another protocol's reports are."""
_WAIT_US: Final = 50_000


def listened(bus: Bus, settings: OnboardSettings, *, wait_us: int) -> Intake:
    """What came within LISTENED_US, or within wait_us if reports are still missing then.

    Nothing is sent. Raises BusFaultError.
    """
    protocol = load_protocol(settings.drive_by_wire.protocol)
    seen = Intake(protocol, load_protocol("workbench"), stamps=settings.sensors.stamps)
    clock = MonotonicClock()
    while (now_us := clock.now_us()) <= max(LISTENED_US, wait_us):
        complete = all(name in seen.reports for name in seen.names.needed)
        if complete and now_us > LISTENED_US:
            break
        heard = bus.receive(_WAIT_US)
        if heard is not None and heard.error is None:
            seen.receive(heard.identifier, heard.data, clock.now_us())
    return seen
