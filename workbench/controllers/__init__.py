"""Control laws as CasADi expressions: steering and speed PID, TRACK and the two BRAKE modes."""

from workbench.controllers.modes import (
    Mode,
    ModeAction,
    Reading,
    ReferenceZeroBrake,
    Track,
    VehicleBrake,
)
from workbench.controllers.pid import Command, Deviation, PathFollowing, SpeedPid, SteeringPid
from workbench.controllers.symbols import Symbols

__all__ = [
    "Command",
    "Deviation",
    "Mode",
    "ModeAction",
    "PathFollowing",
    "Reading",
    "ReferenceZeroBrake",
    "SpeedPid",
    "SteeringPid",
    "Symbols",
    "Track",
    "VehicleBrake",
]
