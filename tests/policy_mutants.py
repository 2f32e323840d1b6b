"""Faults planted into the policies and their questions, each with the world that shows it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import pytest
from policy_runs import World

from workbench.runtime import Action
from workbench.runtime.policies import Cycle, FailSafe, FailSafeState, Phase, Turn, fail_safe
from workbench.runtime.policies.plan import Plan

Plant = Callable[[pytest.MonkeyPatch], None]


def nothing(*_args: object, **_kwargs: object) -> None:
    return None


def checks_may_be_late(patch: pytest.MonkeyPatch) -> None:
    """The sender waits for a check that is under way, and takes it however late it ends."""
    turn = FailSafe.turn

    def waits(self: FailSafe, state: FailSafeState, now_s: float) -> tuple[FailSafeState, Turn]:
        if state.phase is Phase.TRACKING:
            return dataclasses.replace(state, clock_s=now_s), Turn(Action.TRACK, None)
        return turn(self, state, now_s)

    patch.setattr(FailSafe, "turn", waits)
    patch.setattr(FailSafe, "_late", nothing)
    patch.setattr(fail_safe, "age_violation", nothing)


def people_are_not_compared(patch: pytest.MonkeyPatch) -> None:
    """Nobody notices who was lost."""
    patch.setattr(fail_safe, "people_violations", lambda *_a, **_k: ())


def state_is_not_compared(patch: pytest.MonkeyPatch) -> None:
    """Nobody notices that the measured state has left the tube."""
    patch.setattr(fail_safe, "state_violation", nothing)


def not_latched(patch: pytest.MonkeyPatch) -> None:
    """A new plan may follow before the car stands."""
    patch.setattr(FailSafe, "_phase_fault", staticmethod(lambda *_a: ""))


def switch_is_later(patch: pytest.MonkeyPatch) -> None:
    """BRAKE is commanded 0.5 s after what was proved."""

    def later(*values: Any) -> Plan:
        plan = Plan(*values)
        first, last = plan.switch_s
        return dataclasses.replace(plan, switch_s=(first + 0.5, last + 0.5))

    patch.setattr(fail_safe, "Plan", later)


def unproved_is_enough(patch: pytest.MonkeyPatch) -> None:
    """The verdict is not read."""
    patch.setattr(fail_safe, "fault_in_answer", lambda *_a, **_k: "")


def edge_is_not_watched(patch: pytest.MonkeyPatch) -> None:
    """People beyond the watched disc are thought not to exist."""
    step = FailSafe.step

    def trusting(
        self: FailSafe, state: FailSafeState, cycle: Cycle, *, consent: bool = True
    ) -> Any:
        near = dataclasses.replace(cycle.stop_guard, farthest_m=-math.inf)
        return step(self, state, dataclasses.replace(cycle, stop_guard=near), consent=consent)

    patch.setattr(FailSafe, "step", trusting)


def delay_is_ignored(patch: pytest.MonkeyPatch) -> None:
    """The tubes brake without the brake's delay: planted in the question, see the world."""


MUTANTS: dict[str, tuple[Plant, World]] = {
    "checks may be late": (checks_may_be_late, World(late=0.5, lost=False)),
    "people are not compared": (people_are_not_compared, World(late=0.0)),
    "state is not compared": (state_is_not_compared, World(late=0.0, lost=False, jump_m=6.0)),
    "not latched": (not_latched, World(late=0.3, lost=False)),
    "switch is later": (switch_is_later, World(late=0.3, lost=False)),
    "unproved is enough": (unproved_is_enough, World(late=0.0, lost=False)),
    "edge is not watched": (edge_is_not_watched, World(late=0.0, lost=False, watched_m=5.0)),
    "delay is ignored": (delay_is_ignored, World(late=0.0, lost=False, delay_s=0.0)),
}
