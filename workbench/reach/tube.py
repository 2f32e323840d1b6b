"""The result of a reachability computation."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import final

import numpy as np
import numpy.typing as npt

from workbench.claims import Rigor

Array = npt.NDArray[np.float64]


class TubeStatus(enum.Enum):
    """How a tube computation ended; everything but COMPLETE ends `times` where the proof ends.

    LEFT_REGION: the tube left the region for which its bounds hold; use a smaller initial set or a
    larger region. ENCLOSURE_FAILED: no a priori enclosure was found, or steps became too short; use
    a shorter step or split the initial set. SINGULAR: a pole (of tan, or a division by an interval
    with zero), or the border of a domain (of log, sqrt, asin, ...), lies in what a step sweeps; use
    a smaller initial set.
    """

    COMPLETE = 0
    LEFT_REGION = 1
    ENCLOSURE_FAILED = 2
    SINGULAR = 3


@final
@dataclass(frozen=True, slots=True, eq=False)
class KinkRecord:
    """What a tube has decided about the kinks (limits, clips, absolute values) of its field.

    decided_share (K, n_kinks): share of the steps and cells of a row in which the kink lay on one
    of its branches throughout; linear (K, n_kinks): whether it never went beyond its limits in the
    row. Both proved to the tube's rigor.
    """

    decided_share: Array
    linear: npt.NDArray[np.bool_]

    @property
    def share(self) -> float:
        """Decided share over all rows and kinks; 1 where there is none."""
        return float(self.decided_share.mean()) if self.decided_share.size else 1.0

    @property
    def unsaturated(self) -> bool:
        """Whether no limit is exceeded by any trajectory at any time of the tube.

        Limits are constants and parameters in fmin, fmax and if_else. False where the tube has no
        row, and where a kink has no such limit: of two moving values none is known to be it.
        """
        rows, count = self.linear.shape
        return bool(self.linear.all()) and (rows > 0 or count == 0)


@final
@dataclass(frozen=True, slots=True)
class ReachTube:
    """Boxes that contain every trajectory from an initial set.

    times (K+1): grid in s; lower, upper (K x n), in the states' units: row k encloses every state
    on all of [times[k], times[k+1]]; lower_at, upper_at (K+1 x n): the sets at the instants; names:
    columns; status, message: how it ended, and why; rigor: as its method says; kinks: which limits
    were decided, where the method says so. Raises ValueError where the shapes do not fit.
    """

    times: Array
    lower: Array
    upper: Array
    lower_at: Array
    upper_at: Array
    names: tuple[str, ...]
    status: TubeStatus
    rigor: Rigor
    message: str = ""
    kinks: KinkRecord | None = None

    def __post_init__(self) -> None:
        steps, n = len(self.times) - 1, len(self.names)
        shapes = (self.lower.shape, self.upper.shape, self.lower_at.shape, self.upper_at.shape)
        expected = ((steps, n), (steps, n), (steps + 1, n), (steps + 1, n))
        if shapes != expected:
            raise ValueError(f"expected arrays of shapes {expected}, got {shapes}")

    @property
    def complete(self) -> bool:
        """Whether the tube reaches the horizon."""
        return self.status is TubeStatus.COMPLETE

    def half_width_at(self) -> Array:
        """Half widths of the sets at the instants, (K+1 x n), in the states' units."""
        return 0.5 * (self.upper_at - self.lower_at)
