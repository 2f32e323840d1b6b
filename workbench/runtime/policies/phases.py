"""What `FailSafe` remembers between two instants, and what it sends."""

from __future__ import annotations

import dataclasses
import enum
import math
from dataclasses import dataclass
from typing import final

from workbench.runtime.decision import Action
from workbench.runtime.policies.cycle import Violation
from workbench.runtime.policies.guards import Scene
from workbench.runtime.policies.plan import Plan


class Phase(enum.Enum):
    """HOLDING: BRAKE is commanded. TRACKING: TRACK is, and a new plan may replace the one in force.
    CLOSING: TRACK is, until the plan's switch, and nothing may replace it."""

    HOLDING = "holding"
    TRACKING = "tracking"
    CLOSING = "closing"


@final
@dataclass(frozen=True, slots=True)
class FailSafeState:
    """What `FailSafe` remembers. plan: in force, or carried out last; offer: permitted from
    standstill, not yet begun. braking_s: since when BRAKE is sent, inf where the next turn is the
    first to do so; begun_s: when TRACK was commanded; stands_s: from when the car is proved to
    stand; clock_s: the latest instant; stamp_s: the latest stamp; scene: everybody known then,
    those who were lost included."""

    phase: Phase
    plan: Plan | None
    offer: Plan | None
    braking_s: float
    begun_s: float
    stands_s: float
    clock_s: float
    stamp_s: float
    scene: Scene | None


@final
@dataclass(frozen=True, slots=True)
class Turn:
    """What the sender sends now; violation: what this instant itself refutes."""

    action: Action
    violation: Violation | None


def braked(state: FailSafeState, *, sent_s: float = math.inf) -> FailSafeState:
    """BRAKE with nothing proved about it; sent_s: when it is sent, inf: by the next turn."""
    since_s = state.braking_s if state.phase is Phase.HOLDING else math.inf
    return dataclasses.replace(
        state, phase=Phase.HOLDING, plan=None, offer=None, begun_s=math.inf, stands_s=math.inf,
        braking_s=min(since_s, sent_s),
    )  # fmt: skip


def brakes_s(state: FailSafeState) -> float:
    """Since when BRAKE is sent, or now if the next turn sends it."""
    return min(state.braking_s, state.clock_s)


def closed(state: FailSafeState) -> FailSafeState:
    """Nothing replaces the plan in force any more, and none is offered."""
    closing = Phase.CLOSING if state.phase is Phase.TRACKING else state.phase
    return dataclasses.replace(state, phase=closing, offer=None)
