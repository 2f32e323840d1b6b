"""What a cross-examination is given and what it answers."""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import final

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.sensitivity.vectorised import Array
from workbench.sensitivity.witness import AnyWitness


class ExaminationVerdict(enum.Enum):
    """REFUTED: a replayable pair breaks the bound. IMPLIED_BY_PROOF: an ENCLOSED bound lies below
    it at every examined instant, under that bound's condition. CONSISTENT: neither was found."""

    REFUTED = "REFUTED"
    CONSISTENT = "CONSISTENT"
    IMPLIED_BY_PROOF = "IMPLIED_BY_PROOF"


@final
@dataclass(frozen=True, slots=True)
class ProvedEnvelope:
    """Proved half widths about the run from the set's centre, such as a reach tube gives.

    half_widths: time in s -> one half width per state. condition: what the proof takes for granted.
    """

    name: str
    half_widths: Callable[[float], Sequence[float]]
    rigor: Rigor
    condition: str


@final
@dataclass(frozen=True, slots=True)
class Examiner:
    """How hard to try.

    samples: pairs per group; seed; step_s: spacing of the instants; goals_per_coordinate: instants
    at which each coordinate's distance is driven up, the tightest ones first; rounds: of gradient
    steps; starts: different pairs from which second-order steps set out at each goal;
    second_order_rounds: of these. any_centre: examine the claim for every pair in the set no
    further apart than its half widths; otherwise only for pairs with the centre (the tube about
    the nominal run). closer: hold pairs nearer than that to the bound of their own distances.
    stays_in_region: grade of what shows that runs from the set stay in the regions of the proved
    discrepancies, which are no stronger than it.
    """

    samples: int
    seed: int
    step_s: float
    goals_per_coordinate: int
    rounds: int
    starts: int
    second_order_rounds: int
    any_centre: bool
    closer: bool
    stays_in_region: Rigor

    def __post_init__(self) -> None:
        if min(self.samples, self.goals_per_coordinate, self.starts) < 1 or (
            min(self.rounds, self.second_order_rounds) < 0
        ):
            raise InputError(
                "expected samples, goals_per_coordinate and starts >= 1, rounds and "
                f"second_order_rounds >= 0, got {self.samples}, {self.goals_per_coordinate}, "
                f"{self.starts}, {self.rounds}, {self.second_order_rounds}"
            )


@final
@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """How many pairs of a group obey the bound: share per instant (K+1,), and over whole runs.

    worst_ratio: the largest distance / bound (inf where the bound is 0 and the distance is not).
    """

    group: str
    pairs: int
    per_instant: Array
    whole_run: float
    worst_ratio: float


@final
@dataclass(frozen=True, slots=True, eq=False)
class ProvedCurve:
    """A proved bound beside the learned one: half widths (K+1, n) at the examined instants.

    implies_learned: nowhere above the learned bound, and its claim covers the examined one.
    worst_ratio: largest distance reached / half width; above 1 the proof or its condition fails.
    tightness (n,): mean of half width / distance reached; 1 is perfect, NaN where nothing moved.
    """

    name: str
    half_widths: Array
    rigor: Rigor
    condition: str
    implies_learned: bool
    worst_ratio: float
    tightness: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Examination:
    """Outcome: verdict, witness (with REFUTED only), coverage, and growth curves for plotting.

    times (K+1,) in s; sampled, driven, learned (K+1, n) in the states' units: the largest distance
    in the sampled groups, the largest with the search as well (reached, in floats), the
    learned bound. tightness (n,): of the learned bound, as in `ProvedCurve`.
    """

    verdict: ExaminationVerdict
    witness: AnyWitness | None
    names: tuple[str, ...]
    times: Array
    sampled: Array
    driven: Array
    learned: Array
    proved: tuple[ProvedCurve, ...]
    coverage: tuple[Coverage, ...]
    tightness: Array
