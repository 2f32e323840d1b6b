"""What the monitor on a vehicle is set up with, as its bundle says."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.policies.horizon import Timing


@final
@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """release_steps, clearance_required_m and timing: see `Monitor`. Raises InputError."""

    release_steps: int
    clearance_required_m: float
    timing: Timing

    def __post_init__(self) -> None:
        if self.release_steps < 1 or not 0.0 <= self.clearance_required_m < math.inf:
            raise InputError(
                "expected release_steps >= 1 and a finite clearance_required_m >= 0, got "
                f"{self.release_steps!r} and {self.clearance_required_m!r}"
            )
