"""An operator who arms the monitor, and arms it again after every fault."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, final

from workbench.runtime.onboard.states import Request, State

if TYPE_CHECKING:
    from workbench.runtime.onboard.turns import TurnResult

_PATIENCE_TURNS: Final = 60
ASKS: Final = {
    State.DISARMED: Request.ARM,
    State.FAULT: Request.DISARM,
    State.YIELDED: Request.REARM,
}
"""By the state that waits for somebody."""


def refused_as_latched(result: TurnResult) -> bool:
    """Whether this turn refused a REARM because a fault is latched: only DISARM, then ARM, leads on
    from there."""
    return any("a fault is latched" in event for event in result.events)


@final
class Operator:
    """Asks two seconds after the last time, where the state asks for somebody.

    A latched fault is released by DISARM, once the car stands, and ARM; a yielded car by REARM, and
    by DISARM and ARM where that was refused because a fault is latched.
    """

    def __init__(self) -> None:
        self._waits, self._latched = _PATIENCE_TURNS, False

    def asks(self, result: TurnResult | None) -> Request | None:
        """What is asked before the next turn; result: of the last one."""
        self._waits -= 1
        self._latched = result is not None and (self._latched or refused_as_latched(result))
        if result is None or self._waits > 0 or result.state not in ASKS:
            return None
        self._waits = _PATIENCE_TURNS
        if self._latched and result.state is State.YIELDED:
            self._latched = False
            return Request.DISARM
        return ASKS[result.state]
