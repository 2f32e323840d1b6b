"""What came of a drive past somebody who changed their mind: distance, stops, and who led when."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import final

from workbench.estimation.people_estimator import UNKNOWN
from workbench.models.vehicle import Vehicle
from workbench.simulation.changing_minds import Mind, Way, leads_after_s
from workbench.simulation.crossing import PERIOD_S
from workbench.simulation.frames import Frame
from workbench.simulation.measures import LIMITS
from workbench.simulation.obeying import CrossingResult
from workbench.simulation.people import Body

_AHEAD_S = 3.0
_GAINS_MPS2 = 1.0


@final
@dataclass(frozen=True, slots=True)
class Outcome:
    """One drive.

    story: what the person did; wait_s: from the change until a right goal or the unknown one leads
    for good, None where nobody estimates goals, inf where none ever does; nearest_m: smallest
    distance from the body of the car while it moves to the person's, below 0 for a collision;
    braked_s: time under BRAKE after the car first set off; stops: how often BRAKE came after TRACK;
    needless: how many of these would not have been needed; way_m: how far the car got; broken:
    limits found broken.
    """

    story: str
    wait_s: float | None
    nearest_m: float
    braked_s: float
    stops: int
    needless: int
    way_m: float
    broken: int

    @classmethod
    def of(cls, result: CrossingResult, mind: Mind, *, body_m: float, clear_m: float) -> Outcome:
        """body_m: the person's radius; clear_m: a stop is needless if the car, going on, would have
        kept this distance from where the person really went for 3 s."""
        frames = [entry.frame for entry in result.entries]
        leaders = [(f.t_s, f.people[0].wanted[0][0]) for f in frames if f.people[0].wanted]
        apart = [
            entry.separation_m
            for entry in result.entries
            if entry.frame.speed_mps > 0.0 and entry.separation_m is not None
        ]
        stops = [
            after
            for before, after in itertools.pairwise(frames)
            if (before.sent, after.sent) == ("TRACK", "BRAKE")
        ]
        since_s = math.inf if result.started_s is None else result.started_s
        return cls(
            mind.story,
            leads_after_s(leaders, mind, unknown=UNKNOWN) if leaders else None,
            min(apart, default=math.inf),
            PERIOD_S * sum(f.sent == "BRAKE" for f in frames if f.t_s >= since_s),
            len(stops),
            sum(_clear_m(frame, mind, body_m) >= clear_m for frame in stops),
            frames[-1].x_m - frames[0].x_m,
            sum(text.startswith(LIMITS) for frame in frames for text in frame.violations),
        )


def _clear_m(frame: Frame, mind: Mind, body_m: float) -> float:
    """Smallest distance within 3 s, if the car goes straight on and gains 1 m/s^2 up to 2.8 m/s."""
    x_m, speed_mps, nearest_m = frame.x_m, frame.speed_mps, math.inf
    shape = (frame.front_m, frame.rear_m, frame.half_width_m)
    for k in range(round(_AHEAD_S / PERIOD_S) + 1):
        place = mind.walker.at(frame.t_s + k * PERIOD_S)
        away_m = Body(x_m, frame.y_m, frame.heading, *shape).distance(*place) - body_m
        nearest_m = min(nearest_m, away_m)
        x_m, speed_mps = x_m + PERIOD_S * speed_mps, min(speed_mps + PERIOD_S * _GAINS_MPS2, 2.8)
    return nearest_m


def unwatched_m(vehicle: Vehicle, way: Way, mind: Mind, *, body_m: float) -> float:
    """Smallest distance (m) between the person and a car that nobody stops."""
    g = vehicle.geometry
    return min(
        Body(way.station_m(t_s), 0.0, 0.0, g.front_m, g.rear_m, g.half_width_m).distance(
            *mind.walker.at(t_s)
        )
        - body_m
        for t_s in (k * PERIOD_S for k in range(round(mind.duration_s / PERIOD_S)))
    )
