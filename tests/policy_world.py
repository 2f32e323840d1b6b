"""A car on a line among people in the plane, with closed-form tubes, for runs of the policies."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

from workbench.claims import Verdict
from workbench.runtime.person_guard import Disc, Guard, MotionLimits
from workbench.runtime.policies import Answer, BrakeBounds, ProvedTube, SeenPerson, StopAnswer
from workbench.sets import Box

FRONT_M, REAR_M, HALF_WIDTH_M, BODY_M = 2.26, 0.47, 0.88, 0.3
ACCEL, TOP_MPS = (-0.5, 1.0), 3.0
DECELERATION = (2.0, 3.0)
BRAKE = BrakeBounds(deceleration_min_mps2=2.0, delay_s=0.2, build_up_s=0.1)
LIMITS = MotionLimits(2.5, 1.5)
STEP_S, ROWS = 0.1, 29
STATION_ERROR_M, SPEED_ERROR_MPS = 0.1, 0.05
PLACE_ERROR_M, VELOCITY_ERROR_MPS = 0.1, 0.1
_PAD = 1e-9


@dataclass
class Car:
    """The true car. braking_s: since when BRAKE is commanded, None under TRACK. drag: how much of
    the brake still acts under TRACK; it fades only after the delay."""

    station_m: float = 0.0
    speed_mps: float = 0.0
    braking_s: float | None = 0.0
    released_s: float = -math.inf

    def command(self, *, track: bool, now_s: float) -> None:
        if track and self.braking_s is not None:
            self.braking_s, self.released_s = None, now_s
        elif not track and self.braking_s is None:
            self.braking_s = now_s

    def move(self, now_s: float, dt_s: float, *, accel: float, deceleration: float) -> None:
        """One short step; the acceleration is the one in the middle of it."""
        middle_s = now_s + 0.5 * dt_s
        if self.braking_s is not None:
            share = (middle_s - self.braking_s - BRAKE.delay_s) / BRAKE.build_up_s
            rate = -min(max(share, 0.0), 1.0) * deceleration
        elif self.speed_mps > 0.0 and middle_s < self.released_s + BRAKE.delay_s:
            # A brake that is let go while the car moves holds on for its delay.
            rate = -deceleration
        else:
            rate = accel if self.speed_mps < TOP_MPS or accel < 0.0 else 0.0
        speed = min(max(self.speed_mps + rate * dt_s, 0.0), TOP_MPS)
        self.station_m += 0.5 * (speed + self.speed_mps) * dt_s
        self.speed_mps = speed


@dataclass
class Walker:
    """A true person: acceleration and speed within LIMITS."""

    name: str
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float

    def move(self, ax: float, ay: float, dt_s: float) -> None:
        size = math.hypot(ax, ay)
        if size > LIMITS.acceleration_mps2:
            ax, ay = (LIMITS.acceleration_mps2 / size * a for a in (ax, ay))
        vx, vy = self.vx_mps + ax * dt_s, self.vy_mps + ay * dt_s
        speed = math.hypot(vx, vy)
        if speed > LIMITS.speed_mps:
            # Projection onto the disc of speeds shortens the change of velocity.
            vx, vy = (LIMITS.speed_mps / speed * v for v in (vx, vy))
        self.x_m += 0.5 * (vx + self.vx_mps) * dt_s
        self.y_m += 0.5 * (vy + self.vy_mps) * dt_s
        self.vx_mps, self.vy_mps = vx, vy

    def seen(self, now_s: float, errors: Sequence[float]) -> SeenPerson:
        """Measured with errors (place angle and size, velocity angle and size; sizes 0 to 1)."""
        place, far, turn, fast = errors
        x = self.x_m + far * PLACE_ERROR_M * math.cos(place)
        y = self.y_m + far * PLACE_ERROR_M * math.sin(place)
        vx = self.vx_mps + fast * VELOCITY_ERROR_MPS * math.cos(turn)
        vy = self.vy_mps + fast * VELOCITY_ERROR_MPS * math.sin(turn)
        position = Disc(x, y, PLACE_ERROR_M + BODY_M + _PAD)
        velocity = Disc(vx, vy, VELOCITY_ERROR_MPS + _PAD)
        return SeenPerson(self.name, Guard(now_s, position, velocity, LIMITS))


def gap_m(station_m: tuple[float, float], x_m: float, y_m: float) -> float:
    """Distance of a point from the body somewhere on an interval of stations."""
    low, high = station_m[0] - REAR_M, station_m[1] + FRONT_M
    along = max(low - x_m, 0.0, x_m - high)
    return math.hypot(along, max(abs(y_m) - HALF_WIDTH_M, 0.0))


def measured(car: Car, station_error: float, speed_error: float) -> Box:
    """Errors from -1 to 1."""
    station = car.station_m + STATION_ERROR_M * station_error
    speed = car.speed_mps + SPEED_ERROR_MPS * speed_error
    radius = {"station": STATION_ERROR_M + _PAD, "speed": SPEED_ERROR_MPS + _PAD}
    return Box.around({"station": station, "speed": speed}, radius=radius)


@dataclass(frozen=True)
class Question:
    """switch_s, start_s as in `StopAnswer`; delay_s: what the tube believes of the brake's."""

    switch_s: tuple[float, float]
    start_s: tuple[float, float] | None
    delay_s: float = BRAKE.delay_s


def _speed_above(v: float, t: float, question: Question) -> float:
    """Fastest speed at t: full acceleration to the last switch, then the weakest brake."""
    start = 0.0 if question.start_s is None else question.start_s[0]
    pushed = min(t, question.switch_s[1])
    speed = min(v + ACCEL[1] * max(pushed - start, 0.0), max(v, TOP_MPS))
    since = t - question.switch_s[1] - question.delay_s
    if since <= 0.0:
        return speed
    ramp = min(since, BRAKE.build_up_s)
    lost = 0.5 * ramp**2 / BRAKE.build_up_s + since - ramp
    return max(speed - DECELERATION[0] * lost, 0.0)


def _speed_below(v: float, t: float, question: Question) -> float:
    """Slowest speed at t: it falls like TRACK at its slowest, then like the full brake at once."""
    braked = max(t - question.switch_s[0] - question.delay_s, 0.0)
    return max(v + ACCEL[0] * (t - braked) - DECELERATION[1] * braked, 0.0)


def stop_tube(box: Box, question: Question) -> ProvedTube:
    """Rows of (station, speed) under TRACK, then BRAKE at any instant of the switch interval."""
    (least, most), (slow, fast) = box.interval("station"), box.interval("speed")
    slow, measured_mps = max(slow, 0.0), slow
    times = [k * STEP_S for k in range(ROWS + 1)]
    above = [_speed_above(fast, t, question) for t in times]
    below = [_speed_below(slow, t, question) for t in times]
    lower, upper = [], []
    for k in range(ROWS):
        # The fastest speed rises, then falls, and stays level for the delay in between.
        top, bottom = max(above[k], above[k + 1]), min(below[k], below[k + 1])
        farthest = most + top * STEP_S
        lower.append((least - _PAD, (bottom if k else min(bottom, measured_mps)) - _PAD))
        upper.append((farthest + _PAD, top if top == 0.0 else top + _PAD))
        least, most = least + bottom * STEP_S, farthest
    return ProvedTube(times, lower, upper)


def _guard_at(
    guard: Guard, since_s: float, until_s: float
) -> tuple[tuple[float, float, float], ...]:
    """Discs (x, y, radius) that hold the person all the time from since_s to until_s."""
    p, w = guard.position, guard.velocity
    middle, half = 0.5 * (since_s + until_s), 0.5 * (until_s - since_s)
    reach = (w.radius + 0.5 * guard.limits.acceleration_mps2 * until_s) * until_s
    swept = half * math.hypot(w.x, w.y)
    fast = p.radius + guard.limits.speed_mps * until_s
    moved = (p.x + w.x * middle, p.y + w.y * middle, p.radius + reach + swept)
    return moved, (p.x, p.y, fast)


def answer(tube: ProvedTube, people: Sequence[SeenPerson]) -> Answer:
    """SAFE if the rows keep clear of everybody's guard until the car stands."""
    best, when, who = math.inf, None, None
    moving = ROWS
    while moving and tube.upper[moving - 1][1] <= 0.0:
        moving -= 1
    holds_s = tube.times_s[moving]
    for person in people:
        for k in range(moving):
            discs = _guard_at(person.guard, tube.times_s[k], tube.times_s[k + 1])
            stations = tube.lower[k][0], tube.upper[k][0]
            clear = max(gap_m(stations, x, y) - radius for x, y, radius in discs)
            if clear < best:
                best, when, who = clear, tube.times_s[k], person.name
            if best <= 0.0:
                return Answer(Verdict.UNPROVED, f"near {who}", best, when, who, holds_s)
    return Answer(Verdict.SAFE, "safe", best, when, who, holds_s)


def stop_answer(
    box: Box, people: Sequence[SeenPerson], question: Question, center_m: float
) -> StopAnswer:
    tube = stop_tube(box, question)
    ends = (tube.lower[0][0] - REAR_M, max(row[0] for row in tube.upper) + FRONT_M)
    farthest = max(math.hypot(end - center_m, HALF_WIDTH_M) for end in ends)
    found = answer(tube, people)
    return StopAnswer(found, tube, question.switch_s, question.start_s, farthest)


def nobody() -> Answer:
    return Answer(Verdict.SAFE, "safe: nobody is near", None, None, None, 3.0)


def objection() -> Answer:
    return dataclasses.replace(nobody(), verdict=Verdict.UNPROVED, reason="unproved")
