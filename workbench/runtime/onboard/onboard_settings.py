"""What a core on board is set up with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.onboard.actuation import DriveByWire, Wanted
from workbench.runtime.onboard.limits import FaultLimits
from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.onboard.times import SEND_US, TURN_US, seconds
from workbench.runtime.policies import Timing

_MOST_MAKER = 2**24


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingErrors:
    """How far what the controller reads may be off, as the bundle's tubes have it: offset (m),
    heading error (rad), speed (m/s)."""

    offset_m: float
    heading_rad: float
    speed_mps: float

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise InputError(f"{name}: expected a finite number >= 0, got {value!r}")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class OnboardSettings:
    """Everything but the bundle, the path and the mode.

    timing: as `Monitor` takes it; its send_gap_s is also the longest time from the begin of a turn
    until the next one's frames are on the bus, and its latency_s the longest time of a decision.
    release_steps, clearance_required_m, start_station_m: see `Monitor`; reference_speed_mps: what
    TRACK follows. drive_by_wire: of the vehicle that the bundle was built for; sensors, limits:
    see there. reading: what the bundle's tubes grant the controller; gate: by how much an upstream
    controller may differ from ours, a part of the tubes' disturbance that nothing else uses
    (acceleration, steering rate). maker: code that the vehicle must report where it reports one,
    None for any. signed: whether the bundle's signature was verified before it was loaded.
    bundle_tag: first byte of the manifest's SHA-256.
    """

    timing: Timing
    release_steps: int
    clearance_required_m: float
    start_station_m: float | None
    reference_speed_mps: float
    drive_by_wire: DriveByWire
    sensors: SensorBounds
    limits: FaultLimits
    reading: ReadingErrors
    gate: Wanted
    maker: int | None
    signed: bool
    bundle_tag: int

    def __post_init__(self) -> None:
        if not 0.0 <= self.reference_speed_mps < math.inf:
            raise InputError(
                "reference_speed_mps: expected a finite speed >= 0, got "
                f"{self.reference_speed_mps!r}"
            )
        for name, gap_s in (
            ("timing.send_gap_s", self.timing.send_gap_s),
            ("drive_by_wire.turn_s", self.drive_by_wire.turn_s),
        ):
            if round(gap_s * 1e6) < TURN_US + SEND_US:
                raise InputError(
                    f"{name}: expected at least {seconds(TURN_US + SEND_US)!r} s, a turn and the "
                    f"sending of its frames, and the time of a decision beside, got {gap_s!r} s"
                )
        if self.drive_by_wire.turn_s > self.timing.send_gap_s:
            raise InputError(
                f"drive_by_wire.turn_s: expected at most timing.send_gap_s, "
                f"{self.timing.send_gap_s!r} s, after which no set of commands may come, got "
                f"{self.drive_by_wire.turn_s!r} s"
            )
        margins = (self.gate.acceleration_mps2, self.gate.steering_rate_radps)
        if not all(0.0 <= margin < math.inf for margin in margins):
            raise InputError(f"gate: expected finite margins >= 0, got {self.gate!r}")
        if not 0 <= self.bundle_tag < 256:
            raise InputError(f"bundle_tag: expected one byte, got {self.bundle_tag!r}")
        if self.maker is not None and not 0 <= self.maker < _MOST_MAKER:
            raise InputError(f"maker: expected three bytes or None, got {self.maker!r}")
        ages = (self.limits.localisation_age_us, self.limits.people_age_us)
        if ages != (self.sensors.localisation_age_us, self.sensors.people_age_us):
            raise InputError(
                "limits: expected the ages of sets that observations are made up to, "
                f"{(self.sensors.localisation_age_us, self.sensors.people_age_us)}, got {ages}"
            )
