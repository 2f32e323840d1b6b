"""Why a simulated car braked: what stood against TRACK first since it was permitted last."""

from __future__ import annotations

from typing import final

from workbench.runtime import Action, Decision
from workbench.runtime.policies import Ground


@final
class Objections:
    """Follows the decisions of a drive. A policy that carries out its plan brakes some turns after
    the decision that made no new one, so that the first objection counts, and not the last."""

    def __init__(self) -> None:
        self._first: tuple[Ground, ...] = ()

    def after(self, decision: Decision | None, *, blind: bool = False) -> tuple[Ground, ...]:
        """What stands against TRACK once a turn has decided; None: it has not. blind: BRAKE is sent
        for what is not measured, or a fault on board, whatever was decided."""
        if decision is not None:
            permitted = decision.action is Action.TRACK
            self._first = () if permitted else self._first or decision.grounds
        return (Ground.READING,) if blind else self._first
