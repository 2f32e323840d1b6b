"""Cross-examination of a bound on a black box's runs: samples, and differences if asked for."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.ascent import Pairs
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.examination import Examination, Examiner
from workbench.sensitivity.examine import examined
from workbench.sensitivity.examine_pairs import Trial
from workbench.sensitivity.learning.by_workers import ByWorkers
from workbench.sensitivity.learning.drawing import Workforce
from workbench.sensitivity.learning.pairs import Simulator
from workbench.sensitivity.vectorised import Array, Index
from workbench.sensitivity.witness import SimulatedWitness, own_bound
from workbench.sets.box import Box

# Half the distance over which slopes are taken, as a share of the set's half widths.
_APART = 0.02
# Seeds travel as floats, which hold whole numbers up to here exactly.
_SEEDS = 2**53


@final
@dataclass(frozen=True, slots=True, eq=False)
class _BlackBox:
    """Runs and, by central differences inside `box`, slopes."""

    simulator: ByWorkers
    box: Box

    def runs(self, initial_states: Array, parameters: Array) -> Array:
        """As `ascent.Runs` says, for an even number of rows; parameters: the seeds."""
        return self.simulator.runs(initial_states, parameters[:, 0].astype(np.uint64))

    def slopes(
        self, initial_states: Array, parameters: Array, coordinate: Index, instant: Index
    ) -> Array:
        """Differences over a little of the box along each axis with width."""
        lower, upper = np.array(self.box.lower), np.array(self.box.upper)
        half = np.array(self.box.radius)
        free = np.flatnonzero(half)
        count = len(initial_states)
        ends = []
        for sign in (-1.0, 1.0):
            for i in free:
                states = initial_states.copy()
                states[:, i] = np.clip(states[:, i] + sign * _APART * half[i], lower[i], upper[i])
                ends.append(states)
        states = np.concatenate(ends)
        runs = self.runs(states, np.tile(parameters, (2 * len(free), 1)))
        rows = np.arange(len(states))
        reached = runs[rows, np.tile(instant, 2 * len(free)), np.tile(coordinate, 2 * len(free))]
        values = reached.reshape(2, len(free), count)
        places = states.reshape(2, len(free), count, -1)
        found = np.zeros_like(initial_states)
        for at, axis in enumerate(free.tolist()):
            apart = places[1, at, :, axis] - places[0, at, :, axis]
            found[:, axis] = (values[1, at] - values[0, at]) / apart
        return found


def cross_examine_simulator(
    simulator: Simulator,
    *,
    initial_set: Box,
    learned: Discrepancy,
    method: Examiner,
    workforce: Workforce,
    ran: Callable[[int], None] | None = None,
) -> Examination:
    """Try to refute `learned` by runs of `simulator` at its own instants; nothing is proved.

    method: `rounds` of gradient steps by finite differences, 0 for samples alone; second-order
    steps are never taken, as differences of differences show the simulator's own error. workforce:
    who runs it; ran(n): called after n more pairs. A pair is taken as a witness when the simulator
    repeats its distance; how exact the simulator is remains its own affair. Raises InputError where
    names or instants do not fit.
    """
    names = tuple(simulator.names)
    if set(initial_set.names) != set(names):
        raise InputError(
            f"expected the initial set to name the states {names}, got {initial_set.names}"
        )
    if learned.names != names:
        raise InputError(f"expected a bound over {names}, got one over {learned.names}")
    if learned.horizon_s < simulator.times[-1]:
        raise InputError(
            f"expected a bound up to {simulator.times[-1]:g} s, got one up to "
            f"{learned.horizon_s:g} s; simulate no further"
        )
    box = initial_set.reordered(names)
    elsewhere = ByWorkers(simulator, workforce, ran)
    again = ByWorkers(simulator, workforce)
    trial = Trial(
        _BlackBox(elsewhere, box),
        box,
        simulator.times,
        lambda count, rng: rng.integers(_SEEDS, size=(count, 1)).astype(float),
        (),
    )

    def confirm(pair: Pairs, coordinate: int, time_s: float) -> SimulatedWitness | None:
        bound = own_bound(pair, learned, time_s)[coordinate]
        first, second = tuple(pair.first[0].tolist()), tuple(pair.second[0].tolist())
        seed = int(pair.parameters[0, 0])
        found = SimulatedWitness(first, second, seed, time_s, names[coordinate], 0.0, bound)
        distance = found.replay(again)
        if not (distance > bound and found.replay(again) == distance):
            return None
        return dataclasses.replace(found, distance=distance)

    return examined(
        trial, learned, (), dataclasses.replace(method, second_order_rounds=0), confirm=confirm
    )
