"""What speaks against the ways that were sent of people, who are then judged without. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from workbench.runtime.observation import Observation
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.way_tubes import NoWay, intended, old_since_us
from workbench.runtime.protocols import NoSet, SetFault

_DROPPED: Final = (SetFault.OUT_OF_ORDER, SetFault.REPEATED, SetFault.REGRESSED)
_MOST_NAMED: Final = 4


def found_in_intents(
    intake: Intake, seen: Observation | None, settings: OnboardSettings, now_us: int
) -> Iterator[Found]:
    """OUT_OF_ORDER and INTENTS_LOST; nothing as long as nobody sends ways.

    seen: the observation of now, if there is one. Nothing here brakes: whoever has no way is still
    judged, by their velocity and, as everybody is, by their guard.
    """
    stream = intake.ways
    if not stream.heard:
        return
    for fault in _DROPPED:
        count = stream.counts.faults.get(fault)
        last_us = None if count is None else count.last_us
        if last_us is not None and now_us - last_us <= settings.limits.report_age_us:
            yield Found(Fault.OUT_OF_ORDER, f"intents: {fault.value}", last_us)
    ways = stream.seen
    if isinstance(ways, NoSet):
        yield Found(Fault.INTENTS_LOST, "no whole set of the newest people yet", 0)
        return
    since_us = old_since_us(ways, settings.sensors)
    if now_us > since_us:
        yield Found(Fault.INTENTS_LOST, "the last set is too old", since_us)
        return
    without = []
    for person in () if seen is None else seen.people:
        tubes = intended(
            ways, int(person.name), person.guard, now_us=now_us, settings=settings.sensors
        )
        if isinstance(tubes, NoWay) and not person.assumed:
            without.append(f"track {person.name}: {tubes.value}")
    if without:
        more = ["..."] if len(without) > _MOST_NAMED else []
        detail = "; ".join([*without[:_MOST_NAMED], *more])
        yield Found(Fault.INTENTS_LOST, f"{len(without)} people, {detail}", ways.stamp_us[1])
