"""Grade of a result (`Rigor`), conclusion of the monitor (`Verdict`), premise (`Assumption`)."""

from __future__ import annotations

import enum
from dataclasses import dataclass


class Rigor(enum.IntEnum):
    """Grade of a mathematical claim, weakest first.

    SAMPLED: learned or falsified from runs. NUMERICAL: the argument is sound, but floating-point
    operations or sampled ranges in it are unproved. ENCLOSED: containment is proved, by outward
    rounding or by a proved error budget for rounding, truncation and motion between grid points.
    """

    SAMPLED = 0
    NUMERICAL = 1
    ENCLOSED = 2


def weakest(*rigors: Rigor) -> Rigor:
    """Rigor of a claim that rests on all of `rigors`.

    >>> weakest(Rigor.ENCLOSED, Rigor.NUMERICAL).name
    'NUMERICAL'
    """
    if not rigors:
        raise ValueError("expected at least one Rigor, got none")
    return min(rigors)


class Verdict(enum.Enum):
    """Outcome of one check. Only SAFE permits tracking; UNPROVED never means unsafe."""

    SAFE = "SAFE"
    UNPROVED = "UNPROVED"
    INVALID = "INVALID"


@dataclass(frozen=True, slots=True)
class Assumption:
    """A named premise of a SAFE verdict and the evidence offered for it."""

    name: str
    statement: str
    evidence: str
