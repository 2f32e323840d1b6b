"""The pointwise alternative: bounds on realised less commanded motion at every instant.

Where a trace keeps to pointwise bounds in every state, every tube with these bounds contains it,
from every initial set and over any time: a stronger demand than that tubes contain what was
measured, and met only by larger bounds. It cannot be met at all where the motion differs in a way
that no bound covers (the sideways speed of a slipping axle).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.models.vehicle_sections import Uncertainty
from workbench.simulation.conformance.fit import rounded_up
from workbench.simulation.conformance.windows import Array, Measured

_QUANTILE: Final = 0.99


@final
@dataclass(frozen=True, slots=True)
class Traces:
    """Largest differences on the windows fitted to; None where nothing is known.

    acceleration_mps2, steering_rate_radps: what W would have to be; ..._quantile: 99 % of the steps
    lie below; sideways_mps: the largest speed across the model's, which no bound covers.
    """

    acceleration_mps2: float | None
    steering_rate_radps: float | None
    acceleration_quantile_mps2: float | None
    steering_rate_quantile_radps: float | None
    sideways_mps: float | None

    def uncertainty(self) -> Uncertainty:
        """W alone, by the largest differences."""
        return Uncertainty(
            acceleration_mps2=rounded_up(self.acceleration_mps2 or 0.0),
            steering_rate_radps=rounded_up(self.steering_rate_radps or 0.0),
        )

    def kept(self, measured: Measured) -> float | None:
        """Share of these windows' steps with both differences within; None where none is known."""
        gaps = np.concatenate([window.gaps[:, :2] for window in measured.windows])
        bounds = [self.acceleration_mps2 or 0.0, self.steering_rate_radps or 0.0]
        known = ~np.isnan(gaps).any(axis=1)
        within = (np.abs(gaps[known]) <= bounds).all(axis=1)
        return float(within.mean()) if known.any() else None


def traces(measured: Measured) -> Traces:
    """Of all windows; there is at least one."""
    acceleration, steering_rate, sideways = np.concatenate(
        [np.abs(window.gaps) for window in measured.windows]
    ).T
    return Traces(
        _largest(acceleration), _largest(steering_rate), _quantile(acceleration),
        _quantile(steering_rate), _largest(sideways),
    )  # fmt: skip


def _largest(values: Array) -> float | None:
    return None if np.isnan(values).all() else float(np.nanmax(values))


def _quantile(values: Array) -> float | None:
    return None if np.isnan(values).all() else float(np.nanquantile(values, _QUANTILE))
