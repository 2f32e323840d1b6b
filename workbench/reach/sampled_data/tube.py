"""The tube of a loop as its controller runs on the car."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import final

import numpy as np

from workbench.claims import Rigor
from workbench.controllers.sampling import Sampling, SentCommand
from workbench.errors import InputError
from workbench.models.system import System
from workbench.reach.ranged_parameters import initial_box
from workbench.reach.sampled_data.held_loop import HeldLoop
from workbench.reach.sampled_data.march import March, Marcher
from workbench.reach.sampled_data.rows import Rows, sample_time
from workbench.reach.sampled_data.schedule import Schedule
from workbench.reach.switching.exact_times import seconds, ticks_up
from workbench.reach.tube import KinkRecord, ReachTube
from workbench.reach.validated.sets import PolynomialSet
from workbench.sets import Box


@final
@dataclass(frozen=True, slots=True)
class SampledTube:
    """The tube of a closed loop under `sampling`, for a `ClosedLoop` in TRACK or in
    BRAKE by reference speed 0.

    sampling: when the controller reads and when its commands act. sent: the commands sent before
    t = 0, in the order in which they act: the one that holds at t = 0, then those under way
    (`sampling.commands_sent` in all). degree, each_row: as in `ValidatedTube`.

    Between events the plant runs under held commands, by validated steps. At a sample the law's
    image of the set is taken with new estimation errors: each limit by its best affine relaxation,
    whose gap moves command and back-calculated integral together. The rates in the law are the
    exact expressions of the reading, as in the continuous loop. A measurement at an unknown instant
    adds what the state can move in that window; while it is unknown when a command begins to act,
    each command is any function of time between the old and the new value. Drifting samples run at
    a pace that is any function of time in 1 +- jitter / period; rows then hold over absolute time
    (see `drift`).

    The tube's states are the loop's; the integrals count as stepped when their sample is measured
    at the earliest. Rows end at multiples of the period and at the horizon, which is rounded up to
    2^-44 s. Kinks: the plant's, then the law's. Rigor ENCLOSED. A proof that ends early is a value.
    Raises InputError for another system or number of sent commands. Source: images and remainders
    as in `ValidatedTube`; the hybrid view of sampled loops in Goebel, Sanfelice, Teel, 2012.
    """

    sampling: Sampling
    sent: tuple[SentCommand, ...]
    degree: int
    each_row: Callable[[], object] = field(default=lambda: None, repr=False, compare=False)

    def __post_init__(self) -> None:
        if len(self.sent) != self.sampling.commands_sent:
            raise InputError(
                f"SampledTube.sent: expected {self.sampling.commands_sent} commands, the one that "
                "holds at t = 0 and those that delay and period leave under way, got "
                f"{len(self.sent)}; give them in the order in which they act"
            )
        if self.degree not in (1, 2, 3, 4):
            raise InputError(f"expected a degree from 1 to 4, got {self.degree!r}")

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """Run over [0, horizon_s] from `initial_set` (axes = state names)."""
        if not horizon_s > 0.0:
            raise InputError(f"expected a positive horizon_s in s, got {horizon_s!r}")
        schedule = Schedule.of(self.sampling)
        held = HeldLoop.of(system, self.sampling, schedule.slots)
        horizon, stretch = ticks_up(horizon_s), self.sampling.stretch
        start = self._start(system, held, schedule, initial_set)
        times = (*schedule.dues(horizon), horizon)
        until = sample_time(horizon, stretch)
        marcher = Marcher(held, schedule)
        march = marcher.march(start, until, stops=times, each_stop=self.each_row)
        return _tube(Rows.of(march, times, stretch), march, system.ode.names)

    def _start(
        self, system: System, held: HeldLoop, schedule: Schedule, initial_set: Box
    ) -> PolynomialSet:
        box = initial_box(system.ode, held.loop, initial_set)
        ends = np.zeros((2, held.x.numel()))
        ends[0, : len(held.loop.states)], ends[1, : len(held.loop.states)] = box.lower, box.upper
        waiting = {1 + schedule.slot(k): k for k in range(-schedule.under_way, 0)}
        for pair in range(schedule.slots + 1):
            sent = 0 if pair == 0 else waiting.get(pair)
            # Where nothing waits yet stands a number that widens no hull of commands.
            command = _middle(self.sent[-1]) if sent is None else self.sent[sent]
            values = command.steering_rate_radps, command.acceleration_mps2
            ends[:, list(held.pair(pair))] = np.array(values).T
        return PolynomialSet.of_boxes(ends[:1], ends[1:], degree=self.degree)


def _middle(command: SentCommand) -> SentCommand:
    ends = command.steering_rate_radps, command.acceleration_mps2
    return SentCommand.exactly(*(min(max(0.5 * low + 0.5 * high, low), high) for low, high in ends))


def _tube(rows: Rows, march: March, names: tuple[str, ...]) -> ReachTube:
    count, n = len(rows.boxes), len(names)
    kinks = np.array(rows.kinks) if count else np.zeros((0, 2, 0))
    return ReachTube(
        times=np.array([seconds(time) for time in rows.times]),
        lower=np.array([low[:n] for low, _ in rows.boxes]).reshape(count, n),
        upper=np.array([high[:n] for _, high in rows.boxes]).reshape(count, n),
        lower_at=np.array([low[:n] for low, _ in rows.instants]),
        upper_at=np.array([high[:n] for _, high in rows.instants]),
        names=names,
        status=march.status,
        rigor=Rigor.ENCLOSED,
        message=march.message,
        kinks=KinkRecord(kinks[:, 0], kinks[:, 1] == 1.0),
    )
