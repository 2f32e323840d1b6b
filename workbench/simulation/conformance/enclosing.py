"""Real tubes about measured windows: which instants they contain, and what area that takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from workbench.models.system import Ode
from workbench.models.vehicle_sections import Uncertainty
from workbench.reach import ReachTube, ValidatedTube
from workbench.sets import Box
from workbench.simulation.conformance.windows import Array, Measured, MotionModel

# Beyond these the vectorised run takes more memory than it saves time.
_TOGETHER = 64


@final
@dataclass(frozen=True, slots=True, eq=False)
class Enclosed:
    """What the tubes of W windows say at K+1 instants about m outputs.

    recordings (W): whose windows; deviation, half_width (W, K+1, m): measured against the tube's
    middle; inside (W, K+1): all outputs contained (False where the proof ended before); area_m2
    (W, K+1): of the tube's rectangle over the first two outputs, NaN where the proof had ended.
    """

    recordings: tuple[str, ...]
    deviation: Array
    half_width: Array
    inside: NDArray[np.bool_]
    area_m2: Array

    @property
    def whole(self) -> NDArray[np.bool_]:
        """(W,): is the window inside at every instant?"""
        return np.asarray(self.inside.all(axis=1))

    @property
    def mean_area_m2(self) -> float:
        """Over windows and instants to which the proofs reach; NaN where none does."""
        reached = np.isfinite(self.area_m2)
        return float(self.area_m2[reached].mean()) if reached.any() else float("nan")

    @property
    def proof_ended(self) -> int:
        """Windows whose tube ends before the window does."""
        return int((~np.isfinite(self.area_m2)).any(axis=1).sum())


def enclose(model: MotionModel, uncertainty: Uncertainty, measured: Measured) -> Enclosed:
    """One proved tube (`ValidatedTube`) per window, compared with the measured motion."""
    ode = model.ode(uncertainty)
    tubes = _tubes(ode, [window.initial for window in measured.windows], measured.times_s)
    columns = [ode.names.index(name) for name in model.outputs]
    shape = (len(tubes), len(measured.times_s), len(columns))
    lower, upper = np.full(shape, np.nan), np.full(shape, np.nan)
    for place, tube in enumerate(tubes):
        lower[place, : len(tube.times)] = tube.lower_at[:, columns]
        upper[place, : len(tube.times)] = tube.upper_at[:, columns]
    seen = np.array([window.measured for window in measured.windows])
    half = 0.5 * (upper - lower)
    return Enclosed(
        tuple(window.recording for window in measured.windows),
        np.abs(seen - 0.5 * (upper + lower)),
        half,
        np.asarray(((seen >= lower) & (seen <= upper)).all(axis=2)),
        4.0 * half[:, :, 0] * half[:, :, 1],
    )


def _tubes(ode: Ode, initial_sets: Sequence[Box], times_s: Array) -> list[ReachTube]:
    """In batches; a batch ends where its first proof ends, and is then halved."""
    if len(initial_sets) > _TOGETHER:
        return [
            tube
            for begin in range(0, len(initial_sets), _TOGETHER)
            for tube in _tubes(ode, initial_sets[begin : begin + _TOGETHER], times_s)
        ]
    method = ValidatedTube(step_s=float(times_s[1] - times_s[0]), degree=1)
    tubes = method.tubes(ode, initial_sets=initial_sets, horizon_s=float(times_s[-1]))
    if tubes[0].complete or len(tubes) == 1:
        return list(tubes)
    half = len(initial_sets) // 2
    return [
        *_tubes(ode, initial_sets[:half], times_s),
        *_tubes(ode, initial_sets[half:], times_s),
    ]
