"""How often tubes contain measured motion, and what so few recordings say about the next one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.special import gammaln
from scipy.stats import beta

from workbench.errors import InputError
from workbench.sensitivity.scenario import violation_bound
from workbench.simulation.conformance.enclosing import Enclosed

CONFIDENCE: Final = 0.95


@final
@dataclass(frozen=True, slots=True)
class Share:
    """A share with its interval: Clopper and Pearson's for so many effective trials.

    trials: (sum n)^2 / sum n^2 for recordings of n steps or windows each: where all of one
    recording are inside together or outside together, the share varies as that of so many
    independent trials. That is the number of recordings where all are of one length, and less
    where a long one outweighs the others. Source: L. Kish, Survey Sampling, Wiley 1965 (the
    effective size of a sample with weights n). With few recordings the interval is wide.
    """

    inside: int
    of: int
    trials: float
    low: float
    high: float

    @property
    def value(self) -> float:
        """inside / of."""
        return self.inside / self.of


def clustered(inside: int, *, sizes: Sequence[int]) -> Share:
    """`Share` of the steps or windows of recordings that have so many each. Raises InputError on
    numbers that cannot be.

    >>> share = clustered(30, sizes=[6, 6, 6, 6, 6])
    >>> round(share.low, 3), share.high
    (0.478, 1.0)
    >>> round(clustered(30, sizes=[26, 1, 1, 1, 1]).trials, 2)
    1.32
    """
    of = sum(sizes)
    if not (0 <= inside <= of and min(sizes, default=0) >= 1):
        raise InputError(
            "expected recordings of at least one step or window each, and 0 <= inside <= their "
            f"sum, got {inside} inside of sizes {list(sizes)}"
        )
    trials = of**2 / sum(size**2 for size in sizes)
    half, successes = 0.5 * (1.0 - CONFIDENCE), trials * inside / of
    failures = trials - successes
    low = float(beta.ppf(half, successes, failures + 1.0)) if inside else 0.0
    high = float(beta.ppf(1.0 - half, successes + 1.0, failures)) if inside < of else 1.0
    return Share(inside, of, trials, low, high)


@final
@dataclass(frozen=True, slots=True)
class RecordingCount:
    """One recording's steps and disjoint windows, and the mean area of its tubes."""

    recording: str
    steps_inside: int
    steps: int
    windows_inside: int
    windows: int
    mean_area_m2: float


@final
@dataclass(frozen=True, slots=True)
class Containment:
    """Per step, per disjoint window and per recording; a window's first instant is a step too."""

    steps: Share
    windows: Share
    recordings: Share
    mean_area_m2: float
    proof_ended: int
    by_recording: tuple[RecordingCount, ...]


def containment(enclosed: Enclosed) -> Containment:
    """Counts of tubes and measured motion; `enclosed` has at least one window."""
    names = sorted(set(enclosed.recordings))
    owner = np.array(enclosed.recordings)
    counts = []
    for name in names:
        mine = owner == name
        area = enclosed.area_m2[mine]
        counts.append(
            RecordingCount(
                name,
                int(enclosed.inside[mine].sum()),
                int(enclosed.inside[mine].size),
                int(enclosed.whole[mine].sum()),
                int(mine.sum()),
                float(np.nanmean(area)) if np.isfinite(area).any() else math.nan,
            )
        )
    complete = sum(each.windows_inside == each.windows for each in counts)
    return Containment(
        clustered(int(enclosed.inside.sum()), sizes=[each.steps for each in counts]),
        clustered(int(enclosed.whole.sum()), sizes=[each.windows for each in counts]),
        clustered(complete, sizes=[1] * len(counts)),
        enclosed.mean_area_m2,
        enclosed.proof_ended,
        tuple(counts),
    )


@final
@dataclass(frozen=True, slots=True)
class Statement:
    """With confidence 1 - delta, a further recording has a window outside with at most `epsilon`.

    recordings: fitted to, the independent units, without the one that the cost is made of;
    parameters: fitted bounds. a_priori: known before the fit, of the linear program alone, for
    tubes to first order; None where windows may be left out. supporting: recordings that decide
    bounds and factor or had windows left out. epsilon: wait and judge for whatever was made of the
    data, which covers the real tubes; 1 says nothing.
    """

    recordings: int
    parameters: int
    delta: float
    a_priori: float | None
    supporting: int
    epsilon: float

    def __str__(self) -> str:
        weak = ", which says nothing" if self.epsilon >= 1.0 else ""
        before = (
            "; nothing was known before the fit, because windows may be left out"
            if self.a_priori is None
            else f"; known before the fit, for tubes to first order: {self.a_priori:.3g} "
            f"({self.parameters} fitted bounds)"
        )
        return (
            f"with confidence 1 - {self.delta:g}, a further recording drawn as the "
            f"{self.recordings} independent ones were has a window that leaves its tube with "
            f"probability at most {self.epsilon:.3g}{weak} (wait and judge: {self.supporting} of "
            f"them decide the figures or had windows left out){before}"
        )


def statement(
    *, recordings: int, parameters: int, discards: bool, supporting: int, delta: float = 0.05
) -> Statement:
    """What that many recordings support, if every one that is not `supporting` is contained.

    discards: may windows be left out? Then nothing is said before the fit: the theory of discarded
    scenarios (M. C. Campi, S. Garatti, "A sampling-and-discarding approach to chance-constrained
    optimization", J. Optim. Theory Appl. 148, 2011) is about as many whole recordings as were
    named beforehand, all outside in the end; here a recording's other windows still count, and
    what was left out may turn out to be inside.
    Source: M. C. Campi, S. Garatti, "The exact feasibility of randomized solutions of uncertain
    convex programs", SIAM J. Optim. 19(3), 2008, before the fit; M. C. Campi, S. Garatti, F. A.
    Ramponi, "A general scenario theory for nonconvex optimization and decision making", IEEE TAC
    63(12), 2018: epsilon(k) = 1 - (delta / (N C(N, k)))^(1 / (N - k)), epsilon(N) = 1.

    >>> round(statement(recordings=500, parameters=2, discards=False, supporting=2).epsilon, 3)
    0.041
    """
    known = None if discards else violation_bound(recordings, delta=delta, parameters=parameters)
    epsilon = _judged(recordings, supporting, delta=delta)
    return Statement(recordings, parameters, delta, known, supporting, epsilon)


def _judged(count: int, supporting: int, *, delta: float) -> float:
    if supporting >= count:
        return 1.0
    choices = gammaln(count + 1) - gammaln(supporting + 1) - gammaln(count - supporting + 1)
    log_share = (math.log(delta) - math.log(count) - float(choices)) / (count - supporting)
    return 1.0 - math.exp(log_share)
