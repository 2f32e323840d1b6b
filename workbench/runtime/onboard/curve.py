"""What a command brings about, known up to a band: monotone, linear between nodes, both ways."""

from __future__ import annotations

import bisect
import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.arc import Interval

# An interpolation takes four roundings of numbers no larger than its nodes.
_ROUNDING = 2.0**-48


@final
@dataclass(frozen=True, slots=True)
class Curve:
    """A monotone map from a command to its effect: at node j between lowest[j] and highest[j].

    Between nodes both bounds are linear; the middle, 1/2 (lowest + highest), is what is aimed at.
    Beyond the nodes nothing is known, and the answer is NaN. Raises InputError unless there are n
    >= 2 finite nodes with rising commands, rising middle, bounds that never fall, and lowest <=
    highest.
    """

    command: tuple[float, ...]
    lowest: tuple[float, ...]
    highest: tuple[float, ...]

    def __post_init__(self) -> None:
        columns = (self.command, self.lowest, self.highest)
        if len(self.command) < 2 or len({len(column) for column in columns}) != 1:
            raise InputError(
                "curve: expected n >= 2 nodes of command, lowest and highest each, got "
                f"{[len(column) for column in columns]}"
            )
        if not all(map(math.isfinite, itertools.chain(*columns))):
            raise InputError(f"curve: expected finite nodes, got {columns!r}")
        for name, column, strict in (
            ("command", self.command, True),
            ("middle of lowest and highest", self.middles, True),
            ("lowest", self.lowest, False),
            ("highest", self.highest, False),
        ):
            for j, (one, two) in enumerate(itertools.pairwise(column)):
                if two < one or (strict and two == one):
                    raise InputError(
                        f"curve: expected nodes that rise, the {name} goes from {one!r} to {two!r} "
                        f"at node {j + 1}; sort the nodes, or merge those that say the same"
                    )
        for j, (low, high) in enumerate(zip(self.lowest, self.highest, strict=True)):
            if low > high:
                raise InputError(
                    f"curve: expected lowest <= highest, got {low!r} > {high!r} at node {j}"
                )

    @property
    def middles(self) -> tuple[float, ...]:
        """The middle at every node."""
        return _middles(self.lowest, self.highest)

    @property
    def commands(self) -> Interval:
        """The commands of which something is known."""
        return self.command[0], self.command[-1]

    def middle(self, command: float) -> float:
        """The effect aimed at with a command; NaN outside of `commands`, and for NaN."""
        return _linear(self.command, self.middles, command)

    def command_for(self, effect: float) -> float:
        """The command whose middle is `effect`; NaN for what no command aims at, and for NaN."""
        return _linear(self.middles, self.command, effect)

    def effect(self, commands: Interval) -> Interval:
        """Every effect of every command in an interval, rounded outward; (NaN, NaN) beyond."""
        ends = (self.lowest[0], self.lowest[-1], self.highest[0], self.highest[-1])
        margin = _ROUNDING * max(map(abs, ends))
        return (
            _linear(self.command, self.lowest, commands[0]) - margin,
            _linear(self.command, self.highest, commands[1]) + margin,
        )

    def at(self, command: float) -> Interval:
        """Every effect of one command."""
        return self.effect((command, command))

    def slope(self, command: float) -> float:
        """How fast the middle rises at a command, from the piece it is in; NaN beyond."""
        if not self.command[0] <= command <= self.command[-1]:
            return math.nan
        return self.slopes[_piece(self.command, command)]

    @property
    def slopes(self) -> tuple[float, ...]:
        """The slope of the middle of every piece."""
        rises = itertools.pairwise(self.middles)
        runs = itertools.pairwise(self.command)
        return tuple((b - a) / (d - c) for (a, b), (c, d) in zip(rises, runs, strict=True))


@functools.lru_cache(maxsize=64)
def _middles(lowest: tuple[float, ...], highest: tuple[float, ...]) -> tuple[float, ...]:
    # Asked for at every turn, of a handful of curves.
    return tuple(0.5 * a + 0.5 * b for a, b in zip(lowest, highest, strict=True))


def _piece(nodes: Sequence[float], at: float) -> int:
    return min(max(bisect.bisect_right(nodes, at) - 1, 0), len(nodes) - 2)


def _linear(nodes: Sequence[float], values: Sequence[float], at: float) -> float:
    if not nodes[0] <= at <= nodes[-1]:
        return math.nan
    j = _piece(nodes, at)
    share = (at - nodes[j]) / (nodes[j + 1] - nodes[j])
    value = values[j] + share * (values[j + 1] - values[j])
    # Rounding must not leave the piece, or the inverse of a node would lie outside of the table.
    return min(max(value, values[j]), values[j + 1])
