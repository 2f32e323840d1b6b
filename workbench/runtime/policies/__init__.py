"""When to track and when to brake: `LookAhead`, `FailSafe`, and both together."""

from workbench.runtime.policies.cycle import (
    Alert,
    Answer,
    Cycle,
    Ground,
    Hypothesis,
    Outcome,
    ProvedTube,
    SeenPerson,
    StopAnswer,
    Violation,
    Watched,
)
from workbench.runtime.policies.deciding import (
    Deciding,
    Policies,
    PoliciesOutcome,
    PoliciesState,
)
from workbench.runtime.policies.fail_safe import FailSafe
from workbench.runtime.policies.guards import Relation
from workbench.runtime.policies.horizon import BrakeBounds, Timing, fail_safe_horizon_s
from workbench.runtime.policies.look_ahead import LookAhead, LookAheadState
from workbench.runtime.policies.phases import FailSafeState, Phase, Turn

__all__ = [
    "Alert",
    "Answer",
    "BrakeBounds",
    "Cycle",
    "Deciding",
    "FailSafe",
    "FailSafeState",
    "Ground",
    "Hypothesis",
    "LookAhead",
    "LookAheadState",
    "Outcome",
    "Phase",
    "Policies",
    "PoliciesOutcome",
    "PoliciesState",
    "ProvedTube",
    "Relation",
    "SeenPerson",
    "StopAnswer",
    "Timing",
    "Turn",
    "Violation",
    "Watched",
    "fail_safe_horizon_s",
]
