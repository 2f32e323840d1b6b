"""What lies behind an UNPROVED separation: proved after splitting, refuted, or still undecided."""

from __future__ import annotations

import enum
import heapq
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.claims import Rigor, Verdict, weakest
from workbench.errors import InputError
from workbench.models.system import Ode, System
from workbench.reach.findings.encounter import Encounter
from workbench.reach.findings.refutation import SeparationWitness, refutation
from workbench.reach.inner.choice_flow import ChoiceFlow
from workbench.reach.inner.choices import Choices
from workbench.reach.inner.extremes import Admissible, SearchEffort
from workbench.reach.separation import Separation, check_separation
from workbench.reach.tube import Array, ReachTube
from workbench.reach.validated.tube import ValidatedTube, time_grid
from workbench.sensitivity.sampling import ordered_box
from workbench.sets import Box

_CELLS_AT_ONCE = 16


class Outcome(enum.Enum):
    """Answer of an analysis; never a run-time `Verdict`, and none follows from it.

    PROVED: every cell of a partition keeps clear. REFUTED: a validated trajectory does not, see the
    witness. UNDECIDED: neither was found within the effort; raise `cells`, or shrink the set.
    """

    PROVED = "PROVED"
    REFUTED = "REFUTED"
    UNDECIDED = "UNDECIDED"


@final
@dataclass(frozen=True, slots=True)
class FindingEffort:
    """cells: most tubes to compute; search: for witnesses. Neither can make a finding wrong.

    Raises InputError on cells < 1.
    """

    cells: int
    search: SearchEffort

    def __post_init__(self) -> None:
        if self.cells < 1:
            raise InputError(f"expected cells >= 1, got {self.cells!r}")


@final
@dataclass(frozen=True, slots=True)
class Finding:
    """outcome, and what it rests on.

    witness: the trajectory that comes too close, if REFUTED; clearance_m: smallest clearance proved
    over the whole set, -inf where a cell has none; cells: tubes computed; open_cells: what is not
    proved of the initial set; rigor: of the tubes and the ground if PROVED, of the witness if
    REFUTED, SAMPLED (nothing is claimed) if UNDECIDED.
    """

    outcome: Outcome
    witness: SeparationWitness | None
    clearance_m: float
    cells: int
    open_cells: tuple[Box, ...]
    rigor: Rigor


def explain_separation(
    system: System,
    *,
    initial_set: Box,
    horizon_s: float,
    encounter: Encounter,
    method: ValidatedTube,
    effort: FindingEffort,
) -> Finding:
    """Say whether the car keeps `encounter.clearance_required_m` from everybody up to horizon_s.

    First a witness is sought by gradients and validated: one initial state, parameter value and
    disturbance whose trajectory certainly has, at one instant, a point of a person's disc nearer to
    the body than required. Else the initial set is halved, the worst cells first, until the tube of
    every cell is SAFE (see `check_separation`) or `effort` is used up; then a witness is sought
    once more from what is left. Rigor: see `Finding`; a path's curvature that the system takes as a
    disturbance is free to vary, so a refutation then speaks of the system, not of one path. Raises
    InputError where the system lacks a state that the ground reads, or the set does not fit it.
    """
    ode = system.ode
    box = ordered_box(ode, initial_set, "initial set")
    _require_ground(ode, encounter)
    flow = ChoiceFlow.of(ode, time_grid(horizon_s, method.step_s))
    admissible = Admissible.of(ode, box, len(flow.times_s) - 1)
    witness = refutation(flow, admissible, encounter, effort.search, ())
    if witness is not None:
        return _refuted(witness, 0, (box,), encounter)
    cells = _Cells(box, flow, encounter)
    while cells.waiting and cells.spent < effort.cells:
        batch = cells.worst(min(_CELLS_AT_ONCE, effort.cells - cells.spent))
        cells.judge(batch, method.tubes(system, initial_sets=batch, horizon_s=horizon_s))
    left = cells.left()
    if not left:
        rigor = weakest(Rigor.ENCLOSED, encounter.ground.rigor)
        return Finding(Outcome.PROVED, None, cells.clearance_m, cells.spent, (), rigor)
    witness = refutation(flow, admissible, encounter, effort.search, left)
    if witness is not None:
        return _refuted(witness, cells.spent, left, encounter)
    return Finding(Outcome.UNDECIDED, None, -math.inf, cells.spent, left, Rigor.SAMPLED)


def _require_ground(ode: Ode, encounter: Encounter) -> None:
    missing = [name for name in encounter.ground.names if name not in ode.names]
    if missing:
        raise InputError(
            f"expected a system with the states {encounter.ground.names}, {missing} are missing; "
            "give the ground that fits the system"
        )


def _refuted(
    witness: SeparationWitness, spent: int, left: tuple[Box, ...], encounter: Encounter
) -> Finding:
    rigor = weakest(Rigor.ENCLOSED, encounter.ground.rigor)
    return Finding(Outcome.REFUTED, witness, -math.inf, spent, left, rigor)


@final
class _Cells:
    """The cells that wait for a proof, worst first, and what has been proved of the others."""

    def __init__(self, box: Box, flow: ChoiceFlow, encounter: Encounter) -> None:
        self.flow, self.encounter = flow, encounter
        self.spent, self.clearance_m = 0, math.inf
        self._order = itertools.count()
        self.waiting: list[tuple[float, int, Box]] = [(-math.inf, next(self._order), box)]
        self._points: list[Box] = []

    def worst(self, count: int) -> tuple[Box, ...]:
        """Take out up to `count` cells."""
        taken = [heapq.heappop(self.waiting) for _ in range(min(count, len(self.waiting)))]
        return tuple(box for _, _, box in taken)

    def judge(self, cells: Sequence[Box], tubes: Sequence[ReachTube]) -> None:
        """Keep the clearance of the SAFE ones and halve the others."""
        self.spent += len(cells)
        for cell, tube in zip(cells, tubes, strict=True):
            found = _checked(tube, self.encounter)
            if found.verdict is Verdict.SAFE:
                self.clearance_m = min(self.clearance_m, found.clearance_m)
                continue
            axis = self._axis(cell, found)
            if axis is None:
                self._points.append(cell)
                continue
            for half in cell.split({axis: 2}):
                worst = found.clearance_m if math.isfinite(found.clearance_m) else -math.inf
                heapq.heappush(self.waiting, (worst, next(self._order), half))

    def left(self) -> tuple[Box, ...]:
        """The cells without a proof, worst first."""
        return (*self._points, *(box for _, _, box in sorted(self.waiting)))

    def _axis(self, cell: Box, found: Separation) -> str | None:
        """The axis whose width moves the pose most at the time of the smallest clearance."""
        width = np.array(cell.upper) - np.array(cell.lower)
        # A box of two neighbouring floats has no middle.
        splittable = [
            low < low + 0.5 * (high - low) < high
            for low, high in zip(cell.lower, cell.upper, strict=True)
        ]
        if not any(splittable):
            return None
        effect = np.where(splittable, self._effect(cell, found.time_s) * width, -1.0)
        if not np.any(effect > 0.0):
            effect = np.where(splittable, width, -1.0)
        return cell.names[int(np.argmax(effect))]

    def _effect(self, cell: Box, time_s: float | None) -> Array:
        """Sum over the pose of |d pose / d initial state| (n,), at the cell's centre."""
        flow, names = self.flow, self.encounter.ground.names
        instants = len(flow.times_s) - 1
        at = instants if time_s is None else int(np.searchsorted(flow.times_s, time_s))
        low, high = Admissible.of(flow.ode, cell, instants).ends()
        centre = low.take(np.zeros(3, dtype=np.intp))
        middle = Choices(
            np.tile(np.array(cell.center), (3, 1)),
            0.5 * (centre.constants + high.constants),
            0.5 * (centre.signals + high.signals),
        )
        weights = np.eye(len(flow.ode.states))[[flow.ode.names.index(name) for name in names]]
        ends = np.full(3, min(max(at, 1), instants))
        return np.asarray(np.abs(flow.gradients(middle, ends, weights).states).sum(axis=0))


def _checked(tube: ReachTube, encounter: Encounter) -> Separation:
    return check_separation(
        tube, ground=encounter.ground, body=encounter.body, people=encounter.people,
        clearance_required_m=encounter.clearance_required_m,
    )  # fmt: skip
