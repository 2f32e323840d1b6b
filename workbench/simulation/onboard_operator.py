"""An operator who arms the monitor, and arms it again after every fault."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, final

from workbench.runtime.onboard.states import Request, State

if TYPE_CHECKING:
    from workbench.runtime.onboard.turns import TurnResult

_PATIENCE_TURNS: Final = 60
_ASKS: Final = {
    State.DISARMED: Request.ARM,
    State.FAULT: Request.DISARM,
    State.YIELDED: Request.REARM,
}


@final
class Operator:
    """Asks two seconds after the last time, where the state asks for somebody.

    A latched fault is released by DISARM, once the car stands, and ARM; a yielded car by REARM.
    """

    def __init__(self) -> None:
        self._waits = _PATIENCE_TURNS

    def asks(self, result: TurnResult | None) -> Request | None:
        """What is asked before the next turn; result: of the last one."""
        self._waits -= 1
        if result is None or self._waits > 0 or result.state not in _ASKS:
            return None
        self._waits = _PATIENCE_TURNS
        return _ASKS[result.state]
