"""The PACMod 2 unit of a simulated car: whether it obeys, what it was told, and what it reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, final

from workbench.runtime.protocols import Refusal, decode, encode, load_protocol

TIMEOUT_US: Final = 100_000
"""Without a command for so long it lets the car go."""
_PACMOD: Final = load_protocol("pacmod2")
_FORWARD: Final = 3

CanFrame = tuple[int, bytes]


@final
@dataclass(frozen=True, slots=True)
class Outputs:
    """What the car does at an instant: pedal ratios, steering-wheel angle (rad), speed (m/s)."""

    accelerator: float
    brake: float
    wheel_rad: float
    speed_mps: float


@final
@dataclass(slots=True)
class Pacmod2Unit:
    """Enabling as the vehicle's unit does it: it takes a 0 first, then a 1, and times out.

    told: the newest commands, by the names of their signals; they count while it is enabled.
    """

    enabled: bool = False
    told: dict[str, float] = field(default_factory=dict)
    _heard_us: int = -TIMEOUT_US
    _may_enable: bool = False

    def hear(self, identifier: int, data: bytes, at_us: int) -> None:
        """A frame of whoever commands the car; of others nothing is taken."""
        said = decode(_PACMOD, identifier, data)
        if isinstance(said, Refusal) or _PACMOD.by_id[identifier].sender != "WORKBENCH":
            return
        if said.message == "GLOBAL_CMD":
            self._heard_us = at_us
            enable = bool(said.values["PACMOD_ENABLE"])
            if enable and self._may_enable and not said.values["CLEAR_OVERRIDE"]:
                self.enabled = True
            self._may_enable = self._may_enable or not enable
            self.enabled = self.enabled and enable
        else:
            self.told.update(said.values)

    def commands(self, at_us: int) -> Mapping[str, float]:
        """What the car is to do at an instant; nothing while the unit is not enabled."""
        if self._silent(at_us):
            self.enabled = self._may_enable = False
        return self.told if self.enabled else {}

    def reports(self, outputs: Outputs, at_us: int) -> list[CanFrame]:
        """All reports that a monitor needs, as frames."""
        told = self.told if self.enabled else {}
        wheel = told.get("POSITION_VALUE", outputs.wheel_rad)
        pressed = {"BRAKE_ON_OFF": outputs.brake > 0.0}
        values: dict[str, Mapping[str, float]] = {
            "GLOBAL_RPT": {
                "PACMOD_STATUS": self.enabled, "OVERRIDE_STATUS": 0, "VEH_CAN_TIMEOUT": 0,
                "STR_CAN_TIMEOUT": 0, "BRK_CAN_TIMEOUT": 0, "USR_CAN_TIMEOUT": self._silent(at_us),
                "USR_CAN_READ_ERRORS": 0,
            },
            "ACCEL_RPT": _system(0.0, told.get("ACCEL_CMD", 0.0), outputs.accelerator),
            "BRAKE_RPT": _system(0.0, told.get("BRAKE_CMD", 0.0), outputs.brake) | pressed,
            "STEERING_RPT_1": _system(0.0, wheel, outputs.wheel_rad),
            "SHIFT_RPT": _system(_FORWARD, _FORWARD, _FORWARD),
            "VEHICLE_SPEED_RPT": {"VEHICLE_SPEED": outputs.speed_mps, "VEHICLE_SPEED_VALID": 1},
        }  # fmt: skip
        return [_framed(message, signals) for message, signals in values.items()]

    def _silent(self, at_us: int) -> bool:
        return at_us - self._heard_us > TIMEOUT_US


def maker_frame(maker: int | None) -> CanFrame:
    """The report that names the vehicle's maker."""
    return _framed("VIN_RPT", {"MFG_CODE": maker or 0, "MODEL_YEAR_CODE": ord("H")})


def _system(manual: float, commanded: float, output: float) -> dict[str, float]:
    return {"MANUAL_INPUT": manual, "COMMANDED_VALUE": commanded, "OUTPUT_VALUE": output}


def _framed(name: str, values: Mapping[str, float]) -> CanFrame:
    data = encode(_PACMOD, name, values)
    assert isinstance(data, bytes), data
    return _PACMOD.by_name[name].frame_id, data
