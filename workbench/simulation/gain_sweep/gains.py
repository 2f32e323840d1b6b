"""The gains that a sweep may vary: where the vehicle file and the loop have them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

from workbench.models.vehicle import Vehicle

Gains = dict[str, float]
"""By the names of `GAINS`, all of them."""
STEERING: Final = "steering_pid"
SPEED: Final = "speed_pid"


@final
@dataclass(frozen=True, slots=True)
class Gain:
    """name: in a study; words, unit: for people; section, key: in a vehicle file; parameter: of the
    closed loop."""

    name: str
    words: str
    unit: str
    section: str
    key: str
    parameter: str

    @property
    def label(self) -> str:
        """Words with the unit in brackets."""
        return f"{self.words} ({self.unit})"


GAINS: Final = {
    each.name: each
    for each in (
        Gain("look-ahead", "look-ahead l", "m", STEERING, "look_ahead_m", "look_ahead"),
        Gain(
            "kp", "kp", "rad/(s m)", STEERING, "proportional_radps_per_m",
            "steering_gain_proportional",
        ),
        Gain(
            "ki", "ki", "rad/(s² m)", STEERING, "integral_radps_per_ms", "steering_gain_integral"
        ),
        Gain("kd", "kd", "rad/m", STEERING, "derivative_rad_per_m", "steering_gain_derivative"),
        Gain("speed-kp", "speed kp", "1/s", SPEED, "proportional_per_s", "speed_gain_proportional"),
        Gain("speed-ki", "speed ki", "1/s²", SPEED, "integral_per_s2", "speed_gain_integral"),
    )
}  # fmt: skip
"""By name, as a study has it."""


def own_gains(vehicle: Vehicle) -> Gains:
    """The vehicle file's, by name."""
    return {
        name: float(getattr(getattr(vehicle, each.section), each.key))
        for name, each in GAINS.items()
    }


def with_gains(vehicle: Vehicle, gains: Mapping[str, float], speed_mps: float) -> Vehicle:
    """The vehicle with these gains by name, others as they are, and this reference speed."""
    sections = {
        section: dataclasses.replace(
            getattr(vehicle, section),
            **{GAINS[n].key: value for n, value in gains.items() if GAINS[n].section == section},
        )
        for section in (STEERING, SPEED)
    }
    operation = dataclasses.replace(vehicle.operation, reference_speed_mps=speed_mps)
    return dataclasses.replace(
        vehicle, steering_pid=sections[STEERING], speed_pid=sections[SPEED], operation=operation
    )


def as_parameters(gains: Mapping[str, float]) -> dict[str, float]:
    """By the names of the loop's parameters."""
    return {GAINS[name].parameter: value for name, value in gains.items()}
