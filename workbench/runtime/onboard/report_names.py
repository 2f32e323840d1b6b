"""Which message and signal of a protocol reports what: speed, steering, pedals, gear, state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime.protocols import Protocol


@final
@dataclass(frozen=True, slots=True)
class Place:
    """One signal of one message."""

    message: str
    signal: str


@final
@dataclass(frozen=True, slots=True)
class SystemPlaces:
    """What one by-wire system reports: the driver's input, what was commanded, what is put out."""

    manual: Place
    commanded: Place
    output: Place

    @classmethod
    def of(cls, message: str) -> SystemPlaces:
        """The three signals of a PACMod system report, alike in all of its protocols."""
        names = ("MANUAL_INPUT", "COMMANDED_VALUE", "OUTPUT_VALUE")
        return cls(*(Place(message, name) for name in names))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ReportNames:
    """Where a vehicle's protocol reports what.

    speed: m/s as the table has it; steering: steering wheel, rad; accelerator, brake: ratios;
    gear: a choice, `forward` the one for driving. enabled: all 1 while by-wire control is on;
    overridden: any 1 once the driver has taken over; faulty: any 1 means a fault; unheard: 1 while
    our own commands are missed, which is usual before the first one. yaw_rate: rad/s, where it is
    reported at all (not by a GEM); identity: of the maker; stopped: 1 with the emergency stop
    pressed.
    """

    speed: Place
    steering: SystemPlaces
    accelerator: SystemPlaces
    brake: SystemPlaces
    gear: SystemPlaces
    forward: int
    enabled: tuple[Place, ...]
    overridden: tuple[Place, ...]
    faulty: tuple[Place, ...]
    unheard: Place
    yaw_rate: Place | None
    identity: Place | None
    stopped: Place | None

    @property
    def needed(self) -> tuple[str, ...]:
        """Messages without which the vehicle's state is not known, each once."""
        systems = (self.steering, self.accelerator, self.brake, self.gear)
        places = (self.speed, *(s.output for s in systems), *self.enabled, *self.overridden)
        return tuple(dict.fromkeys(place.message for place in places))


_SPEED: Final = Place("VEHICLE_SPEED_RPT", "VEHICLE_SPEED")
_FORWARD: Final = 3
_PACMOD2: Final = ReportNames(
    speed=_SPEED,
    steering=SystemPlaces.of("STEERING_RPT_1"),
    accelerator=SystemPlaces.of("ACCEL_RPT"),
    brake=SystemPlaces.of("BRAKE_RPT"),
    gear=SystemPlaces.of("SHIFT_RPT"),
    forward=_FORWARD,
    enabled=(Place("GLOBAL_RPT", "PACMOD_STATUS"),),
    overridden=(Place("GLOBAL_RPT", "OVERRIDE_STATUS"),),
    faulty=tuple(Place("GLOBAL_RPT", f"{bus}_CAN_TIMEOUT") for bus in ("VEH", "STR", "BRK")),
    unheard=Place("GLOBAL_RPT", "USR_CAN_TIMEOUT"),
    yaw_rate=Place("YAW_RATE_RPT", "YAW_RATE"),
    identity=Place("VIN_RPT", "MFG_CODE"),
    stopped=None,
)
_DRIVEN: Final = ("ACCEL_RPT", "BRAKE_RPT", "STEERING_RPT")
_FLAGS: Final = (
    "COMMAND_OUTPUT_FAULT", "INPUT_OUTPUT_FAULT", "OUTPUT_REPORTED_FAULT", "PACMOD_FAULT",
    "VEHICLE_FAULT",
)  # fmt: skip
_GLOBAL_FLAGS: Final = (
    "STR_CAN_TIMEOUT", "BRK_CAN_TIMEOUT", "SUBSYSTEM_TIMEOUT", "VEH_CAN_TIMEOUT", "SYSTEM_FAULT",
    "CONFIG_FAULT",
)  # fmt: skip


def _pacmod3(yaw_rate: Place, stopped: Place | None, flags: tuple[str, ...]) -> ReportNames:
    """Every system is enabled for itself, and says itself whether it is overridden or at fault."""
    return ReportNames(
        speed=_SPEED,
        steering=SystemPlaces.of("STEERING_RPT"),
        accelerator=SystemPlaces.of("ACCEL_RPT"),
        brake=SystemPlaces.of("BRAKE_RPT"),
        gear=SystemPlaces.of("SHIFT_RPT"),
        forward=_FORWARD,
        enabled=tuple(Place(message, "ENABLED") for message in _DRIVEN),
        overridden=tuple(
            Place(message, "OVERRIDE_ACTIVE") for message in ("GLOBAL_RPT", *_DRIVEN, "SHIFT_RPT")
        ),
        faulty=(
            *(Place("GLOBAL_RPT", flag) for flag in _GLOBAL_FLAGS),
            *(Place(message, flag) for message in _DRIVEN for flag in flags),
        ),
        unheard=Place("GLOBAL_RPT", "USR_CAN_TIMEOUT"),
        yaw_rate=yaw_rate,
        identity=None,
        stopped=stopped,
    )


REPORT_NAMES: Final[Mapping[str, ReportNames]] = {
    "pacmod2": _PACMOD2,
    "pacmod3": _pacmod3(
        Place("ANG_VEL_RPT", "YAW_VEL"),
        Place("ESTOP_RPT", "ESTOP"),
        (*_FLAGS, "COMMAND_TIMEOUT"),
    ),
    "pacmod3_3_4": _pacmod3(Place("YAW_RATE_RPT", "YAW_RATE"), None, _FLAGS),
}
"""By the protocol's name."""


def report_names(protocol: Protocol) -> ReportNames:
    """Where this protocol reports what; raises InputError for one that is no vehicle's."""
    if protocol.name not in REPORT_NAMES:
        raise InputError(
            f"expected a vehicle's protocol out of {', '.join(REPORT_NAMES)}, got {protocol.name!r}"
        )
    return REPORT_NAMES[protocol.name]
