"""On the vehicle: load a bundle, ask it, decide. Standard library and ctypes only."""

from workbench.runtime.bundle import Bundle, load_bundle
from workbench.runtime.decision import Action, Decision
from workbench.runtime.monitor import Monitor
from workbench.runtime.observation import Observation, Person
from workbench.runtime.path import PathTable

__all__ = [
    "Action",
    "Bundle",
    "Decision",
    "Monitor",
    "Observation",
    "PathTable",
    "Person",
    "load_bundle",
]
