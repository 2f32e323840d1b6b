"""Commands open, close and give their slot back one after the other, whatever the timing."""

from __future__ import annotations

import random

from workbench.controllers.sampling import IntegralStep, Jitter, Sampling
from workbench.errors import InputError
from workbench.reach.sampled_data.schedule import Kind, Schedule
from workbench.reach.switching.exact_times import ticks_up


def drawn(rng: random.Random) -> Sampling | None:
    """Delays of up to six periods, often whole ones; None where they are refused."""
    period = rng.choice([0.05, 1 / 30, 0.0731, 0.0625, rng.uniform(0.01, 0.2)])
    late = [rng.choice([0.0, 0.3, 1.0, 2.0, 3.7, rng.uniform(0.0, 6.0)]) for _ in range(2)]
    open_s = [rng.choice([0.0, 0.0, 0.1, 0.5]) for _ in range(2)]
    windows = [
        (begin * period, begin * period + width * period)
        for begin, width in zip(late, open_s, strict=True)
    ]
    jitter = rng.choice([0.0, 0.001, 0.01, 0.05, 0.1, 0.3, 0.49]) * period
    kind = rng.choice([Jitter.CLOCK, Jitter.DRIFT])
    try:
        return Sampling(period, jitter, kind, windows[0], windows[1], IntegralStep.NOMINAL)
    except InputError:
        return None


def test_each_command_waits_in_its_own_slot_and_acts_in_turn() -> None:
    rng, accepted = random.Random(1), 0
    while accepted < 600:
        sampling = drawn(rng)
        if sampling is None:
            continue
        accepted += 1
        check(Schedule.of(sampling), ticks_up(16.0 * sampling.period_s))


def check(schedule: Schedule, until: int) -> None:
    waiting = {schedule.slot(k): k for k in range(-schedule.under_way, 0)}
    assert len(waiting) == schedule.under_way
    acted: list[int] = []
    opening: int | None = None
    for event in schedule.events(until):
        match event.kind:
            case Kind.SAMPLE:
                waiting[schedule.slot(event.sample)] = event.sample
            case Kind.CLOSE:
                assert opening == event.sample
                opening = None
            case _:
                assert opening is None
                assert waiting[schedule.slot(event.sample)] == event.sample
                acted.append(event.sample)
                opening = None if event.known else event.sample
    assert acted == list(range(-schedule.under_way, -schedule.under_way + len(acted)))
    assert len(acted) > schedule.under_way
