"""Intakes that hold what a test needs, and frames to give them."""

from __future__ import annotations

import dataclasses

from onboard_sensors import BOUNDS, OWN, pacmod2_reports

from workbench.runtime.observation import Observation
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.observing import Integrals, NotObserved, Unobserved, observe
from workbench.runtime.protocols import (
    Localised,
    PersonKind,
    Refusal,
    SentPerson,
    load_protocol,
    localisation_frames,
    people_frames,
)

PACMOD3 = load_protocol("pacmod3")
PLACE = Localised(1, 1.0, 2.0, 3.0, 0.5, 1.0, 0.1, 0.1, 0.01, 0.1)
WALKER = SentPerson(3, PersonKind.ON_FOOT, 9.0, 2.0, 0.4, 1.0, 0.0, 0.1, 0.1)
INTEGRALS = Integrals((0.0, 0.0), (0.0, 0.0), 2.8)


def intake(vehicle: str = "pacmod2") -> Intake:
    return Intake(load_protocol(vehicle), OWN, stamps=BOUNDS.stamps)


def place_frames(number: int, stamp_s: float) -> list[tuple[int, bytes]]:
    frames = localisation_frames(dataclasses.replace(PLACE, number=number, stamp_s=stamp_s))
    assert not isinstance(frames, Refusal)
    return list(frames)


def crowd_frames(
    number: int, stamp_s: float, *people: SentPerson, watched_radius_m: float = 30.0
) -> list[tuple[int, bytes]]:
    frames = people_frames(
        people, number=number, stamp_s=stamp_s, watched_radius_m=watched_radius_m
    )
    assert not isinstance(frames, Refusal)
    return list(frames)


def give(to: Intake, frames: list[tuple[int, bytes]], at_us: int) -> None:
    for identifier, data in frames:
        to.receive(identifier, data, at_us)


def filled() -> Intake:
    """Everything that an observation needs, at 1 s."""
    found = intake()
    give(found, place_frames(1, 1.0), 1_000_000)
    give(found, crowd_frames(1, 1.0, WALKER), 1_000_000)
    give(found, pacmod2_reports(speed_mps=1.0, wheel_rad=0.2), 1_000_000)
    return found


def observed(found: Intake, now_us: int) -> Observation | NotObserved:
    return observe(found, now_us=now_us, integrals=INTEGRALS, settings=BOUNDS)


def why_not(found: Intake, now_us: int) -> Unobserved:
    seen = observed(found, now_us)
    assert isinstance(seen, NotObserved)
    assert str(seen).startswith(seen.fault.value)
    return seen.fault
