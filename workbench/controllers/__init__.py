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
from workbench.controllers.sampling import IntegralStep, Jitter, Sampling, SentCommand
from workbench.controllers.symbols import Symbols

__all__ = [
    "Command",
    "Deviation",
    "IntegralStep",
    "Jitter",
    "Mode",
    "ModeAction",
    "PathFollowing",
    "Reading",
    "ReferenceZeroBrake",
    "Sampling",
    "SentCommand",
    "SpeedPid",
    "SteeringPid",
    "Symbols",
    "Track",
    "VehicleBrake",
]
