"""The crossing driven: a decision ten times a second, a sender that turns thirty times, a car that
does what was sent."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import dataclass
from typing import final

from workbench.estimation.people_estimator import PeopleNow
from workbench.models.vehicle import Vehicle
from workbench.runtime import Action, Observation, Timing, Watched
from workbench.simulation.clock import SetClock
from workbench.simulation.crossing import PERIOD_S, Crossing
from workbench.simulation.driving import CarState, Driver
from workbench.simulation.measures import Drawing, Judge, Measures, Moment, Progress
from workbench.simulation.people import Body
from workbench.simulation.people_sources import PeopleSource, StraightPeople
from workbench.simulation.recorded_path import corners
from workbench.simulation.runlog import Entry

TURNS = 3
"""Of the sender, per decision."""
TURN_S = PERIOD_S / TURNS
TIMING = Timing(period_s=PERIOD_S, latency_s=0.05, send_gap_s=TURN_S)
"""What the monitor of `simulate` must be told; a check takes less than a turn."""
_CHECK_S = (0.005, 0.03)


@final
@dataclass(frozen=True, slots=True)
class CrossingResult:
    """What happened, closed-loop: the car did what was sent.

    entries: one per decision; started_s: first TRACK; brakes: how often BRAKE came after TRACK;
    braked_s: when it first did; slowest_mps: lowest speed from then on; resumed_s: TRACK after the
    last BRAKE. None where it did not happen.
    """

    entries: tuple[Entry, ...]
    measures: Measures
    started_s: float | None
    brakes: int
    braked_s: float | None
    slowest_mps: float | None
    resumed_s: float | None

    def summary_line(self) -> str:
        """The run in one line."""
        return f"crossing: {self.measures.summary()}, closed-loop: the car {self._story()}"

    def _story(self) -> str:
        if self.started_s is None:
            return "did not set off"
        # A car that rolls from the start does not set off.
        rolls = self.entries[0].frame.speed_mps > 0.0
        begun = f"{'tracked from' if rolls else 'set off at'} {self.started_s:.1f} s"
        if self.braked_s is None:
            return f"{begun} and did not brake"
        end = "braking at the end"
        if self.resumed_s is not None:
            end = f"tracking for good from {self.resumed_s:.1f} s"
        often = "once" if self.brakes == 1 else f"{self.brakes} times"
        return (
            f"{begun}, braked {often}, first at {self.braked_s:.1f} s, slowest "
            f"{self.slowest_mps:.2f} m/s, {end}"
        )


def simulate(
    crossing: Crossing,
    monitor: Judge,
    *,
    clock: SetClock,
    people: PeopleSource | None = None,
    progress: Progress | None = None,
) -> CrossingResult:
    """Drive the scene: 30 turns of the sender a second, at every third one an observation.

    The plant is the vehicle's own closed loop, RK4 at up to 0.01 s: TRACK, or the vehicle's BRAKE.
    A check ends 5 to 30 ms after its stamp, before the next turn, and the car drives on meanwhile.
    The monitor must have been built for `crossing.path_table()`, `crossing.vehicle` and `TIMING`,
    and read `clock`. people: what it is told of them, None for straight on from where they are, as
    the crossing's models and limits say. `progress(done, total)` is called after each decision.
    """
    chance = None if crossing.seed is None else random.Random(crossing.seed)
    driver = Driver(crossing.vehicle, crossing.path, deceleration_mps2=_deceleration(crossing))
    walks = tuple(walker.track(crossing.duration_s) for walker in crossing.walkers)
    source = people or StraightPeople(walks, crossing.models, crossing.limits)
    drawing = Drawing(3.0, 0.5, corners(crossing.path_table()))
    state = driver.start(crossing.start_speed_mps)
    count = round(crossing.duration_s / PERIOD_S)
    entries, turns = [], []
    for k in range(count):
        t_s = clock.now_s = k * PERIOD_S
        turns.append(monitor.turn(t_s))
        sent = turns[-1].action
        told = source.observe(t_s)
        observation = _observation(crossing, state, (t_s, told), chance)
        moment = Moment(
            t_s, turns, _body(crossing.vehicle, state), state.speed_mps, walks, crossing.models,
            told,
        )  # fmt: skip
        check_s = sum(_CHECK_S) / 2.0 if chance is None else chance.uniform(*_CHECK_S)
        state = driver.drive(state, sent, check_s)
        clock.now_s = t_s + check_s
        entries.append(moment.entry(observation, monitor.step(observation), drawing))
        state = driver.drive(state, sent, TURN_S - check_s)
        turns = []
        for turn in range(1, TURNS):
            clock.now_s = t_s + turn * TURN_S
            turns.append(monitor.turn(clock.now_s))
            state = driver.drive(state, turns[-1].action, TURN_S)
        if progress is not None:
            progress(k + 1, count)
    return _result(tuple(entries))


def _deceleration(crossing: Crossing) -> float | None:
    """Some deceleration that the vehicle's brake may have; None without a seed."""
    if crossing.seed is None:
        return None
    brake = crossing.vehicle.brake
    return random.Random(~crossing.seed).uniform(
        brake.deceleration_min_mps2, brake.deceleration_max_mps2
    )


def _observation(
    crossing: Crossing,
    state: CarState,
    told: tuple[float, PeopleNow],
    chance: random.Random | None,
) -> Observation:
    error, (stamp_s, now) = crossing.localisation, told

    def around(value: float, radius: float) -> tuple[float, float]:
        centre = value if chance is None else value + chance.uniform(-radius, radius)
        return centre - radius, centre + radius

    low, high = around(state.speed_mps, error.speed_mps)
    return Observation(
        x=around(state.x_m, error.position_m),
        y=around(state.y_m, error.position_m),
        heading=around(state.heading, error.heading_rad),
        steering=around(state.steering, error.steering_rad),
        speed=(max(low, 0.0), max(high, 0.0)),
        speed_integral=(state.speed_integral_m, state.speed_integral_m),
        offset_integral=(state.offset_integral_ms, state.offset_integral_ms),
        reference_speed_mps=crossing.vehicle.operation.reference_speed_mps,
        people=now.people,
        stamp_s=stamp_s,
        watched=Watched(state.x_m, state.y_m, crossing.watched_m),
    )


def _body(vehicle: Vehicle, state: CarState) -> Body:
    shape = vehicle.geometry
    return Body(
        state.x_m, state.y_m, state.heading, shape.front_m, shape.rear_m, shape.half_width_m
    )


def _result(entries: tuple[Entry, ...]) -> CrossingResult:
    frames = [entry.frame for entry in entries]

    def first(sent: Action, since_s: float | None) -> float | None:
        if since_s is None:
            return None
        return next((f.t_s for f in frames if f.sent == sent.name and f.t_s >= since_s), None)

    started_s = first(Action.TRACK, 0.0)
    braked_s = first(Action.BRAKE, started_s)
    after = [frame for frame in frames if braked_s is not None and frame.t_s >= braked_s]
    last_s = max((f.t_s for f in after if f.sent == Action.BRAKE.name), default=math.inf)
    return CrossingResult(
        entries,
        Measures.of(entries),
        started_s,
        sum(
            (before.sent, frame.sent) == (Action.TRACK.name, Action.BRAKE.name)
            for before, frame in itertools.pairwise(frames)
        ),
        braked_s,
        min((frame.speed_mps for frame in after), default=None),
        first(Action.TRACK, last_s) if after else None,
    )
