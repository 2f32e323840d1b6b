"""Vehicle models and closed loops as CasADi expressions with named, unit-carrying signals."""

from workbench.models.bicycle import PathBicycle, PathFrame, PlaneBicycle, PlaneFrame
from workbench.models.closed_loop import ClosedLoop, Disturbance, EstimationError
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode, System, system_from_casadi

__all__ = [
    "ClosedLoop",
    "Disturbance",
    "EstimationError",
    "Ode",
    "PathBicycle",
    "PathFrame",
    "PlaneBicycle",
    "PlaneFrame",
    "Ranged",
    "Signal",
    "System",
    "system_from_casadi",
]
