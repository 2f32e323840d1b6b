"""Turns of a drive that made no decision, as a page shows them: what was sent, and which fault."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from workbench.claims import Verdict
from workbench.models.vehicle_sections import Geometry
from workbench.simulation.bus_drive import Instant, sent_in
from workbench.simulation.frames import Frame, PersonFrame, Point, drawable

_SILENT_S: Final = 0.25
"""Decisions come every 0.1 s; after so long without one a turn stands for itself."""
_EVERY_S: Final = 0.09


def undecided(
    instants: Sequence[Instant], shape: Geometry, route: tuple[Point, ...]
) -> tuple[Frame, ...]:
    """A frame (`decided` is False) for turns that found a fault which no decision before named, and
    for every tenth of a second of a time without decisions; route: corners of the path, m."""
    return tuple(_frame(each, shape, route) for each in _told(instants))


def _told(instants: Sequence[Instant]) -> Iterator[Instant]:
    named: frozenset[str] = frozenset()
    last_s, wait_s = 0.0, _SILENT_S
    for each in instants:
        found = frozenset(each.faults)
        if each.observation is not None:
            named, last_s, wait_s = found, each.t_s, _SILENT_S
        elif found - named or each.t_s - last_s >= wait_s:
            named, last_s, wait_s = found, each.t_s, _EVERY_S
            yield each


def fault_words(instant: Instant) -> tuple[str, ...]:
    """What was found wrong, as "NAME: detail"."""
    return tuple(
        f"{name}: {detail}" for name, detail in zip(instant.faults, instant.details, strict=True)
    )


def _frame(instant: Instant, shape: Geometry, route: tuple[Point, ...]) -> Frame:
    motion, found = instant.motion, fault_words(instant)
    return Frame(
        t_s=instant.t_s, x_m=motion.x_m, y_m=motion.y_m, heading=motion.heading,
        front_m=shape.front_m, rear_m=shape.rear_m, half_width_m=shape.half_width_m,
        speed_mps=motion.speed_mps, verdict=Verdict.INVALID, action="",
        reason=f"no decision was made, the state is {instant.state.name}; people are drawn where "
        "they truly are",
        clearance_m=None, path=route, sent=sent_in(instant.state), violations=found, decided=False,
        people=tuple(
            PersonFrame(p.name, p.x_m, p.y_m, p.body_radius_m) for p in instant.people
            if drawable((p.x_m, p.y_m))
        ),
    )  # fmt: skip
