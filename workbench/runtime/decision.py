"""What the monitor answers."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.claims import Assumption, Rigor, Verdict


class Action(enum.Enum):
    """What the vehicle does until the next decision."""

    TRACK = "TRACK"
    BRAKE = "BRAKE"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """One answer of the monitor.

    clearance_m, clearance_time_s, clearance_person: smallest proved clearance over the horizon,
    when and to whom; None when there is none. occupancy (rows: centre x, y, heading, half length,
    half width), tube_lower, tube_upper (rows: path states): one row per proved time segment, empty
    when INVALID. assumptions: what a SAFE rests on; rigor: grade of its mathematics. elapsed_s:
    duration of the step.
    """

    verdict: Verdict
    action: Action
    reason: str
    clearance_m: float | None
    clearance_time_s: float | None
    clearance_person: str | None
    assumptions: tuple[Assumption, ...]
    occupancy: Sequence[tuple[float, ...]]
    tube_lower: Sequence[tuple[float, ...]]
    tube_upper: Sequence[tuple[float, ...]]
    elapsed_s: float
    rigor: Rigor
