"""What the vehicle's estimate is about, and how much of it is kept: the vehicle's own words."""

from workbench.runtime.localiser.states import HYPOTHESES, STATES, VEHICLE_STATES, WINDOW

__all__ = ["HYPOTHESES", "STATES", "VEHICLE_STATES", "WINDOW"]
