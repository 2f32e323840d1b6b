"""How a control law asks its closed loop for symbols: no number is folded into the graph."""

from __future__ import annotations

from typing import Protocol

import casadi as ca


class Symbols(Protocol):
    """Declares named symbols; asking again for the same name gives the same symbol.

    Constants must enter as parameters: CasADi merges float literals with rounding, and the graph
    would then differ from the law it is written for before any enclosure is taken.
    """

    def parameter(self, name: str, unit: str, value: float) -> ca.SX:
        """An unknown constant with nominal `value` (in `unit`)."""

    def disturbance(
        self, name: str, unit: str, nominal: float, *, lower: float, upper: float
    ) -> ca.SX:
        """An arbitrary function of time with values in [lower, upper] (in `unit`)."""

    def state(self, name: str, unit: str) -> ca.SX:
        """A state of the loop; a state that the plant lacks is appended."""


def clip(value: ca.SX, lower: ca.SX, upper: ca.SX) -> ca.SX:
    """min(max(value, lower), upper), continuous in all three."""
    return ca.fmin(ca.fmax(value, lower), upper)
