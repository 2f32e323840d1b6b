"""From event to event: flows under held commands, and what samples and commands do to the set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np
from scipy.linalg import block_diag

from workbench.reach.sampled_data.drift import Anchor, PlantRates
from workbench.reach.sampled_data.held_loop import HeldLoop, Law
from workbench.reach.sampled_data.image import Noise, SetMap
from workbench.reach.sampled_data.reading import Shift
from workbench.reach.sampled_data.schedule import Event, Kind, Schedule
from workbench.reach.switching.exact_times import Ticks, seconds
from workbench.reach.switching.set_rows import with_copies, with_sums
from workbench.reach.tube import Array, TubeStatus
from workbench.reach.validated.algebra import upward
from workbench.reach.validated.bounds import Range
from workbench.reach.validated.composition import BORDERED, OutsideDomainError
from workbench.reach.validated.picard import NoEnclosureError, UndefinedFieldError
from workbench.reach.validated.run import run
from workbench.reach.validated.sets import PolynomialSet
from workbench.reach.validated.step import Stepper


@final
@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """A box (n,) for all of [start, end] in sample time.

    kinks (2, n_kinks): decided share and linearity of the plant's kinks. rates: ranges of the
    plant's rates, where samples drift and a range was found.
    """

    start: Ticks
    end: Ticks
    box: Range
    kinks: Array
    rates: Range | None


@final
@dataclass(slots=True)
class March:
    """What was proved: stretches of sample time without a gap, boxes at their ends (before and
    after what happens there), what each sample decided about the law's kinks (n_kinks,), and
    anchors where samples drift."""

    stretches: list[Stretch] = field(default_factory=list)
    instants: dict[Ticks, Range] = field(default_factory=dict)
    decided: dict[Ticks, Array] = field(default_factory=dict)
    anchors: dict[Ticks, Anchor] = field(default_factory=dict)
    status: TubeStatus = TubeStatus.COMPLETE
    message: str = ""


@final
@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """The set, and whether some command is about to act."""

    set: PolynomialSet
    opening: bool

    def box(self) -> Range:
        low, high = self.set.hull()
        return low[0], high[0]


@final
class Marcher:
    """The flows and maps of a sampled loop."""

    def __init__(self, held: HeldLoop, schedule: Schedule) -> None:
        self._held, self._schedule = held, schedule
        self._shut = Stepper(held.flow(opening=False))
        self._opening = self._shut if schedule.instant else Stepper(held.flow(opening=True))
        self._laws = [held.law(slot) for slot in range(schedule.slots)]
        self._maps = [SetMap(law.ode, len(law.ode.states) - held.x.numel()) for law in self._laws]
        self._shift = Shift(held) if schedule.read else None
        self._rates = PlantRates(held) if held.sampling.stretch else None

    def march(
        self,
        start: PolynomialSet,
        until: Ticks,
        *,
        stops: Sequence[Ticks],
        each_stop: Callable[[], object],
    ) -> March:
        """All of [0, until] in sample time, or up to where a proof fails; also halts at `stops`,
        and calls `each_stop` at each after 0."""
        done, state = March(), _State(start, False)
        events = self._schedule.events(until)
        halts = {*stops} - {0}
        times = sorted({0, *(event.time for event in events), *halts, until})
        for k, time in enumerate(times):
            before = state.box()
            if done.stretches and (rates := done.stretches[-1].rates) is not None:
                done.anchors[time] = Anchor.of(state.set, self._held.pose_rows, time, rates)
            try:
                for event in (each for each in events if each.time == time):
                    state = self._after(state, event, done)
            except (NoEnclosureError, OutsideDomainError) as failure:
                done.status, done.message = _ending(failure, seconds(time))
                # What this sample would do to the end of the last stretch is not known.
                done.instants[time] = before
                del done.stretches[-1:]
                break
            done.instants[time] = _hull(before, state.box())
            if time == until:
                break
            span = np.array([seconds(time), seconds(times[k + 1])])
            trace = run(self._opening if state.opening else self._shut, state.set, span)
            if trace.status is not TubeStatus.COMPLETE:
                done.status, done.message = trace.status, trace.message
                break
            box = trace.lower[0][0], trace.upper[0][0]
            rates = self._rates(box, opening=state.opening) if self._rates else None
            done.stretches.append(Stretch(time, times[k + 1], box, trace.kinks[0], rates))
            state = _State(_trimmed(trace.end), state.opening)
            if times[k + 1] in halts:
                each_stop()
        return done

    def _after(self, state: _State, event: Event, done: March) -> _State:
        held, jump = self._held.pair(0), self._held.pair(self._schedule.slots + 1)
        waiting = self._held.pair(1 + self._schedule.slot(event.sample))
        match event.kind:
            case Kind.SAMPLE:
                slot = self._schedule.slot(event.sample)
                image = self._maps[slot](state.set, self._noise(state, self._laws[slot]))
                done.decided[event.time] = image.decided[0]
                return _State(image.end, state.opening)
            case Kind.CLOSE:
                sums = {h: (h, j) for h, j in zip(held, jump, strict=True)}
                return _State(with_sums(state.set, sums, sign=1.0), False)
            case _ if event.known:
                copies = dict(zip(held, waiting, strict=True))
                return _State(with_copies(state.set, copies), False)
            case _:
                sums = {j: (w, h) for j, w, h in zip(jump, waiting, held, strict=True)}
                return _State(with_sums(state.set, sums, sign=-1.0), True)

    def _noise(self, state: _State, law: Law) -> Noise:
        """What is new at a sample: errors, the integral's step, and how far the state has moved."""
        lower = np.array([each.lower for each in law.noise])
        upper = np.array([each.upper for each in law.noise])
        center = np.clip(0.5 * lower + 0.5 * upper, lower, upper)
        radius = upward(np.maximum(upper - center, center - lower)) * (lower < upper)
        known = Noise(center, np.diag(radius))
        if self._shift is None:
            return known
        width_s = seconds(self._schedule.read)
        moved = self._shift.noise(state.set, width_s, opening=state.opening)
        return Noise(
            np.concatenate([known.center, moved.center]),
            block_diag(known.generators, moved.generators),
        )


def _ending(failure: Exception, time_s: float) -> tuple[TubeStatus, str]:
    where = f"at the sample at t = {time_s:.6g} s"
    if isinstance(failure, OutsideDomainError) and str(failure) in BORDERED:
        reason = f"the set reaches the border of the domain of {failure}"
        return TubeStatus.SINGULAR, f"{reason}, {where}"
    undefined = isinstance(failure, UndefinedFieldError)
    status = TubeStatus.SINGULAR if undefined else TubeStatus.ENCLOSURE_FAILED
    return status, f"{failure}, {where}"


def _hull(first: Range, second: Range) -> Range:
    return np.minimum(first[0], second[0]), np.maximum(first[1], second[1])


def _trimmed(source: PolynomialSet) -> PolynomialSet:
    """Without generators that are zero, which resting rows bring with every step."""
    used = source.generators.any(axis=(0, 1))
    return PolynomialSet(source.algebra, source.coef, source.generators[:, :, used])
