"""A tube over a switch between two systems at an unknown time."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import System
from workbench.reach.switching.exact_times import seconds
from workbench.reach.switching.rows import Row, SwitchingRuns
from workbench.reach.switching.set_rows import joined, with_values
from workbench.reach.switching.shared_states import SharedStates
from workbench.reach.switching.times import SwitchingTimes, in_seconds
from workbench.reach.tube import Array, KinkRecord, ReachTube, TubeStatus
from workbench.reach.validated.run import Trace, run
from workbench.reach.validated.sets import PolynomialSet
from workbench.reach.validated.step import Stepper
from workbench.reach.validated.tube import ValidatedTube
from workbench.sets import Box

_ONE_UNIT = np.array([0.0, 1.0])
_SCALED = "where 1 s stands for a piece of the time of the switch"
_SINCE = "counted from the switch or from the end of its piece"


@final
@dataclass(frozen=True, slots=True)
class Switched:
    """One tube for `system` until a switch at any time in `between_s`, and `then` from there on.

    Every trajectory switches once, at its own time sigma in [t1, t2]; a state in `reset` takes the
    given value (or any value of the interval) then, all others carry over.

    then: the second system; states that only it has need a reset. between_s: (t1, t2) in s, t1 =
    t2 for a known time. reset: state -> value or (low, high). method: step, degree and region; a
    region names states that both systems have; its each_row is called `rows_run` times.

    [t1, t2] is cut into pieces of at most step_s, d long. A switch within the piece that begins at
    s is s + theta, and theta in [0, d] is one more variable of the polynomial: over one unit of
    scaled time, y' = theta f_first(y), then the reset, then z' = (d - theta) f_then(z) bring all
    switched states to s + d; from there on they follow `then`, all pieces side by side. Scaling
    time leaves a disturbance what it is, an arbitrary function of time within its bounds. A row
    within [t1, t2] is the hull of what has not switched, what just switches and what has switched.

    The tube's states are those that both systems have. Its kinks are those of `system` followed by
    those of `then`; where no trajectory is in a mode, its kinks count as decided and linear.
    Instants are multiples of 2^-44 s: t1 rounds down, t2 and the horizon up. Rigor ENCLOSED. A
    proof that ends early is a value. Raises InputError on times out of order, missing or unknown
    resets. Source: time scaling as for event times in Lin, Loxton, Teo, J. Ind. Manag. Optim. 10,
    2014, applied to sets.
    """

    then: System
    between_s: tuple[float, float]
    reset: Mapping[str, float | tuple[float, float]]
    method: ValidatedTube

    def __post_init__(self) -> None:
        low, high = self.between_s
        if not (math.isfinite(high) and 0.0 <= low <= high):
            raise InputError(f"expected 0 <= t1 <= t2 in between_s, got {self.between_s!r}")

    def rows_run(self, horizon_s: float) -> int:
        """How many rows a tube over [0, horizon_s] computes: its own, and those of the switch."""
        step_s = self.method.step_s
        return SwitchingTimes.of(self.between_s, horizon_s=horizon_s, step_s=step_s).rows_run

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """Run over [0, horizon_s] from `initial_set` (axes = state names of `system`)."""
        times = SwitchingTimes.of(self.between_s, horizon_s=horizon_s, step_s=self.method.step_s)
        states = SharedStates.of(system.ode, self.then.ode, longest_s=seconds(times.piece))
        resets = states.resets(self.reset)
        _check_region(self.method.region, states)
        ends = np.array(states.initial_intervals(initial_set)).T
        start = PolynomialSet.of_boxes(ends[:1], ends[1:], degree=self.method.degree)
        first = Stepper(states.embedded(states.first))
        before = [self._run(first, start, in_seconds(times.before))]
        before[0].lower_at[0], before[0].upper_at[0] = ends[:1], ends[1:]
        for k in range(times.pieces):
            if _ended(before[-1]):
                break
            piece = times.begin(k), times.begin(k + 1)
            before.append(self._run(first, before[-1].end, in_seconds(piece)))
        switching = () if _ended(before[0]) else self._switched(states, resets, before, times)
        caught = switching[1] if times.pieces and len(switching) > 1 else None
        after = switching[-1] if len(switching) == (3 if times.pieces else 1) else None
        runs = SwitchingRuns.of(times, resets, before=before, caught=caught, after=after)
        failed = next((t for t in (*before, *switching) if _ended(t)), None)
        return self._tube(states, runs, failed)

    def _run(self, stepper: Stepper, start: PolynomialSet, times_s: Array) -> Trace:
        def row_done(_low: Array, _high: Array) -> bool:
            self.method.each_row()
            return True

        return run(stepper, start, times_s, inside=row_done)

    def _switched(
        self,
        states: SharedStates,
        resets: Mapping[int, tuple[float, float]],
        before: Sequence[Trace],
        times: SwitchingTimes,
    ) -> tuple[Trace, ...]:
        """Up to the switch, from it to the end of the piece, and what follows, all groups at once.

        Ends with the first trace that fails. For a known time there is only what follows.
        """
        then = Stepper(states.embedded(states.then))
        complete = [trace for trace in before if not _ended(trace)]
        if not times.pieces:
            start = with_values(complete[0].end, resets)
            return (_told(self._run(then, start, in_seconds(times.after(1))), _SINCE),)
        groups = len(complete) - 1
        if not groups:
            return ()
        scaled = Stepper(states.embedded(states.first, states.elapsed))
        up = self._run(scaled, joined([trace.end for trace in complete[:groups]]), _ONE_UNIT)
        if _ended(up):
            return (_told(up, _SCALED),)
        rest = Stepper(states.embedded(states.then, seconds(times.piece) - states.elapsed))
        caught = self._run(rest, with_values(up.end, resets), _ONE_UNIT)
        if _ended(caught):
            return up, _told(caught, _SCALED)
        after = self._run(then, caught.end, in_seconds(times.after(groups)))
        return up, caught, _told(after, _SINCE)

    def _tube(self, states: SharedStates, runs: SwitchingRuns, failed: Trace | None) -> ReachTube:
        rows = runs.rows()
        status = TubeStatus.COMPLETE if failed is None else failed.status
        message = "" if failed is None else failed.message
        columns = [states.index(s.name) for s in states.first.states if s.name in states.then.names]
        names = tuple(states.signals[column].name for column in columns)
        boxes = [(row.box[0][columns], row.box[1][columns]) for row in rows]
        for k, (low, high) in enumerate(boxes):
            if not _inside(self.method.region, names, low, high):
                rows, boxes = rows[:k], boxes[:k]
                status, message = TubeStatus.LEFT_REGION, f"row {k} of the tube left the region"
                break
        times = runs.times.all[: len(rows) + 1]
        at = [runs.instant(time) for time in times]
        return ReachTube(
            times=in_seconds(times),
            lower=np.array([low for low, _ in boxes]).reshape(-1, len(names)),
            upper=np.array([high for _, high in boxes]).reshape(-1, len(names)),
            lower_at=np.array([low[columns] for low, _ in at]),
            upper_at=np.array([high[columns] for _, high in at]),
            names=names,
            status=status,
            rigor=Rigor.ENCLOSED,
            message=message,
            kinks=_record(rows),
        )


def _record(rows: Sequence[Row]) -> KinkRecord:
    """Columns for the kinks of both systems; decided and linear where nobody is in a mode."""
    sizes = [
        max((kinks.shape[1] for kinks in each), default=0)
        for each in ([row.kinks_first for row in rows], [row.kinks_then for row in rows])
    ]
    table = np.ones((len(rows), 2, sum(sizes)))
    for k, row in enumerate(rows):
        table[k, :, : row.kinks_first.shape[1]] = row.kinks_first
        table[k, :, sizes[0] : sizes[0] + row.kinks_then.shape[1]] = row.kinks_then
    return KinkRecord(table[:, 0], table[:, 1] == 1.0)


def _check_region(region: Box | None, states: SharedStates) -> None:
    known = [name for name in states.first.names if name in states.then.names]
    unknown = [] if region is None else sorted(set(region.names) - set(known))
    if unknown:
        raise InputError(
            f"expected a region over states that both systems have ({', '.join(known)}), got "
            f"{', '.join(unknown)}"
        )


def _inside(region: Box | None, names: tuple[str, ...], low: Array, high: Array) -> bool:
    if region is None:
        return True
    columns = [names.index(name) for name in region.names]
    return bool(np.all(low[columns] >= region.lower) and np.all(high[columns] <= region.upper))


def _ended(trace: Trace) -> bool:
    return trace.status is not TubeStatus.COMPLETE


def _told(trace: Trace, clock: str) -> Trace:
    """The trace, with a message that says what its times count."""
    message = f"{trace.message}, {clock}" if trace.message else ""
    return dataclasses.replace(trace, message=message)
