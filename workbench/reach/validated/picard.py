"""A priori enclosures: boxes that every solution of a step stays in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench.reach.validated.algebra import Array
from workbench.reach.validated.bounds import Range

_TRIALS = 10
_INFLATION = 0.1
# A field without a range over a larger box has overflown rather than met a pole.
_LARGEST_STATE = 1e60

# From boxes (B, n) to the range of the field over them and which of the B are valid.
FieldRange = Callable[[Range], tuple[Range, Array]]


class NoEnclosureError(Exception):
    """No box was found that the field cannot leave within the step."""


class UndefinedFieldError(NoEnclosureError):
    """The field has no bounds over `box`, what the set sweeps."""

    def __init__(self, box: Range) -> None:
        super().__init__("the field could not be bounded over the enclosure of the step")
        self.box = box


def enclosure(start: Range, field: FieldRange, h: float) -> tuple[Range, Range]:
    """A box C with start + [0, h] field(C) inside C, and field(C).

    start (B, n) contains the states at the beginning; every solution, also of the inclusion with
    arbitrary inputs in the field's range, stays in C up to h (Picard-Lindeloef, Nedialkov, Jackson,
    Corliss, Applied Mathematics and Computation 105, 1999). Raises NoEnclosureError, and
    UndefinedFieldError where the field has no bounds over a moderate box.
    """
    box = start
    for trial in range(_TRIALS):
        rates, valid = field(box)
        if not np.all(valid):
            if max(np.max(np.abs(box[0])), np.max(np.abs(box[1]))) < _LARGEST_STATE:
                raise UndefinedFieldError(box)
            raise NoEnclosureError("the set left the range of numbers")
        reached = _swept(start, rates, h)
        if trial and np.all((reached[0] >= box[0]) & (reached[1] <= box[1])):
            return reached, rates
        slack = _INFLATION * (2.0**trial) * h * np.maximum(np.abs(rates[0]), np.abs(rates[1]))
        least = 1e-12 * (np.abs(reached[0]) + np.abs(reached[1])) + 1e-200
        box = reached[0] - slack - least, reached[1] + slack + least
        if not (np.all(np.isfinite(box[0])) and np.all(np.isfinite(box[1]))):
            break
    raise NoEnclosureError("no a priori enclosure of the step was found")


def _swept(start: Range, rates: Range, h: float) -> Range:
    low = start[0] + np.minimum(h * rates[0], 0.0) * (1.0 + 2.0**-51) - 1e-300
    high = start[1] + np.maximum(h * rates[1], 0.0) * (1.0 + 2.0**-51) + 1e-300
    return np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
