"""On the vehicle: load a bundle, ask it, decide. Standard library and ctypes only."""

from workbench.runtime.bundle import Bundle, load_bundle
from workbench.runtime.decision import Action, Decision
from workbench.runtime.monitor import Monitor
from workbench.runtime.observation import Observation, ObservedPerson, Person
from workbench.runtime.path import PathTable
from workbench.runtime.person_guard import Disc, Guard, MotionLimits
from workbench.runtime.policies import Deciding, Timing, Watched

__all__ = [
    "Action",
    "Bundle",
    "Deciding",
    "Decision",
    "Disc",
    "Guard",
    "Monitor",
    "MotionLimits",
    "Observation",
    "ObservedPerson",
    "PathTable",
    "Person",
    "Timing",
    "Watched",
    "load_bundle",
]
