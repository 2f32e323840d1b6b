"""How an actuator answers: along a line within its map's band, and gradually."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from typing import final

from workbench.runtime.onboard.curve import Curve


@final
class Line:
    """Where in a map's band an effect lies: linear between the map's nodes, its ends beyond them.

    share: -1 for the band's lower edge, 0 for its middle, 1 for its upper edge.
    """

    __slots__ = ("_commands", "_effects")

    def __init__(self, curve: Curve, share: float) -> None:
        self._commands = curve.command
        self._effects = tuple(
            0.5 * (1.0 - share) * low + 0.5 * (1.0 + share) * high
            for low, high in zip(curve.lowest, curve.highest, strict=True)
        )

    def effect(self, command: float) -> float:
        """Of a command."""
        return _between(self._commands, self._effects, command)

    def command_for(self, effect: float) -> float:
        """A command with this effect."""
        return _between(self._effects, self._commands, effect)


def _between(nodes: Sequence[float], values: Sequence[float], at: float) -> float:
    j = bisect.bisect_right(nodes, at)
    if j == 0 or j == len(nodes):
        return values[0] if j == 0 else values[-1]
    share = (at - nodes[j - 1]) / (nodes[j] - nodes[j - 1])
    return values[j - 1] + share * (values[j] - values[j - 1])


@final
class Ramp:
    """The mean of what was set over the last `up_us`: every change comes up linearly within it.

    So its value always lies between the least and the most that was in force within `up_us`.
    """

    __slots__ = ("_set", "_up_us")

    def __init__(self, up_us: int) -> None:
        self._up_us, self._set = up_us, [(-(1 << 62), 0.0)]

    def set(self, at_us: int, value: float) -> None:
        """From an instant on, no earlier than what was set before."""
        if value != self._set[-1][1]:
            self._set.append((at_us, value))

    def at(self, now_us: int) -> float:
        """Its value until then; earlier instants cannot be asked about afterwards."""
        changes = self._set
        # What is set at this very instant has not acted yet, also where nothing comes up slowly.
        since = now_us - max(self._up_us, 1)
        while len(changes) > 1 and changes[1][0] <= since:
            del changes[0]
        value = changes[0][1]
        if len(changes) == 1 or self._up_us == 0:
            return value
        area, begin = 0.0, since
        for at_us, following in changes[1:]:
            if at_us >= now_us:
                break
            area += value * (at_us - begin)
            value, begin = following, at_us
        return (area + value * (now_us - begin)) / self._up_us
