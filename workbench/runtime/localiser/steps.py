"""The compiled steps as the localiser calls them: buffers that are filled, run and read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias, final

from workbench.runtime.localiser.states import HYPOTHESES, STATES, WINDOW

_N: Final = len(STATES)
_SQUARE: Final = _N * _N

NAMES: Final = ("predict", "report_speed", "report_steering", "range_update", "locate", "collapse")
"""The functions, in the order in which every part of the project lists them."""
GIVEN: Final = (
    (_N, _SQUARE, 2, 1, 1), (_N, _SQUARE, 1, _N), (_N, _SQUARE, 1, _N), (_N, _SQUARE, 1, 3, _N),
    (3 * WINDOW, WINDOW, WINDOW), (_N * HYPOTHESES, _SQUARE * HYPOTHESES, HYPOTHESES),
)  # fmt: skip
"""How many numbers each argument of each function has; matrices column by column."""
FOUND: Final = (
    (_N, _SQUARE), (_N, _SQUARE), (_N, _SQUARE), (_N, _SQUARE, 1, 1, 1), (2, 4), (_N, _SQUARE)
)  # fmt: skip
"""How many numbers each result has."""

Numbers: TypeAlias = "memoryview[float]"
"""Doubles, format "d"."""


@final
@dataclass(frozen=True, slots=True)
class Step:
    """One function with its own buffers: fill `given`, call `run`, read `found`.

    What `found` holds is overwritten by the next run.
    """

    given: tuple[Numbers, ...]
    found: tuple[Numbers, ...]
    run: Callable[[], object]


@final
@dataclass(frozen=True, slots=True)
class Steps:
    """Every step, for one belief, and the first four for each of HYPOTHESES beliefs at once.

    What they compute, and the order of their arguments: `estimation.localisation_filter`. Of the
    `each` ones every argument and result holds its HYPOTHESES values one after the other.
    """

    predict: Step
    report_speed: Step
    report_steering: Step
    range_update: Step
    locate: Step
    collapse: Step
    each_predict: Step
    each_report_speed: Step
    each_report_steering: Step
    each_range_update: Step


def doubles(count: int) -> Numbers:
    """So many zeros in a buffer of their own."""
    return memoryview(bytearray(8 * count)).cast("d")
