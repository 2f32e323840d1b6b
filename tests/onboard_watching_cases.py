"""A watch that has received what a test says, and what it sees."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from onboard_core_bench import framed
from onboard_core_cases import SETTINGS
from onboard_intakes import INTEGRALS, PLACE, WALKER, crowd_frames
from runtime_fixture import fake_manifest

from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.states import Mode, Standing, State
from workbench.runtime.onboard.watching import Sight, Watch
from workbench.runtime.path import PathTable
from workbench.runtime.protocols import Refusal, localisation_frames

S = 1_000_000
BINS, SPACING_M, START_M = 80, 0.5, -10.0
# Straight, as far as its curvature is known: bin j has the middle (j + 1) / 32768.
PATH = PathTable(
    START_M,
    SPACING_M,
    tuple(START_M + SPACING_M * j for j in range(BINS + 1)),
    (0.0,) * (BINS + 1),
    (0.0,) * (BINS + 1),
    tuple(-(j + 1) / 32768 for j in range(BINS)),
    tuple(3 * (j + 1) / 32768 for j in range(BINS)),
)
LIMITS = replace(
    SETTINGS.limits, speed_step_mps=0.25, accel_mps2=12.0, wheel_step_rad=0.25,
    wheel_rate_radps=16.0,
)  # fmt: skip
DISARMED, TRACKING = (Standing(each, 0) for each in (State.DISARMED, State.TRACKING))


def watching(mode: Mode = Mode.DRIVE, path: PathTable = PATH, **changed: Any) -> Watch:
    settings: OnboardSettings = replace(SETTINGS, limits=LIMITS, **changed)
    return Watch(fake_manifest(), path, settings, mode=mode)


def with_speed(watch: Watch, value: float, at_us: int) -> float | None:
    """The speed that is believed after this report."""
    told = {"VEHICLE_SPEED": value, "VEHICLE_SPEED_VALID": 1}
    watch.receive(*framed("VEHICLE_SPEED_RPT", told), at_us)
    report = watch.intake.reports.get("VEHICLE_SPEED_RPT")
    return None if report is None else report.values["VEHICLE_SPEED"]


def with_wheel(watch: Watch, value: float, at_us: int) -> float | None:
    """The steering wheel's angle that is believed after this report."""
    told = {"MANUAL_INPUT": 0.0, "COMMANDED_VALUE": 0.0, "OUTPUT_VALUE": value}
    watch.receive(*framed("STEERING_RPT_1", told), at_us)
    report = watch.intake.reports.get("STEERING_RPT_1")
    return None if report is None else report.values["OUTPUT_VALUE"]


def with_place(watch: Watch, at_us: int, **changed: Any) -> None:
    place = replace(PLACE, **({"stamp_s": at_us / 1e6, "y_m": 0.0, "heading_rad": 0.0} | changed))
    frames = localisation_frames(place)
    assert not isinstance(frames, Refusal)
    for each in frames:
        watch.receive(*each, at_us)


def with_people(watch: Watch, at_us: int, number: int = 7) -> None:
    for each in crowd_frames(number, at_us / 1e6, WALKER):
        watch.receive(*each, at_us)


def seeing(
    speed_mps: float = 1.0, at_us: int = S, *, path: PathTable = PATH, place: Any = None,
    **changed: Any,
) -> Watch:  # fmt: skip
    """Everything that an observation needs; the car's x is 1 m, its y 0.6 m if not said."""
    watch = watching(path=path, **changed)
    said = {"x_m": 1.0, "y_m": 0.6, "heading_rad": 0.1, "speed_mps": speed_mps} | (place or {})
    with_place(watch, at_us, **said)
    with_people(watch, at_us)
    assert with_speed(watch, speed_mps, at_us) == speed_mps
    with_wheel(watch, 0.5, at_us)
    return watch


def look(watch: Watch, at_us: int, standing: Standing = DISARMED) -> Sight:
    return watch.look(at_us, standing, INTEGRALS)


def told(sight: Sight, fault: Fault) -> Found | None:
    found = [each for each in sight.found if each.fault is fault]
    assert len(found) <= 1
    return found[0] if found else None
