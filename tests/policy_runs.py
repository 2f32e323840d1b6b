"""Runs of the policies in the closed-form world, each decided by a list of numbers in [0, 1]."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from policy_world import (
    ACCEL,
    BODY_M,
    BRAKE,
    DECELERATION,
    LIMITS,
    Car,
    Question,
    Walker,
    gap_m,
    measured,
    nobody,
    objection,
    stop_answer,
)

from workbench.runtime import Action
from workbench.runtime.policies import (
    Cycle,
    Deciding,
    FailSafe,
    LookAhead,
    Policies,
    PoliciesOutcome,
    PoliciesState,
    Relation,
    SeenPerson,
    Timing,
    Violation,
    Watched,
)

TIMING = Timing(period_s=0.1, latency_s=0.06, send_gap_s=0.034)
FAIL_SAFE = FailSafe(
    level=0, timing=TIMING, brake=BRAKE, required=Relation.OVERLAPS,
    unseen_speed_mps=LIMITS.speed_mps,
)  # fmt: skip
POLICIES = Policies(
    look_ahead=LookAhead(horizon_s=2.0, release_steps=2, timing=TIMING),
    fail_safe=FAIL_SAFE,
    deciding=Deciding.BOTH,
)
GENES = 64
DURATION_S = 7.0


@dataclass(frozen=True)
class World:
    """What may go wrong in a run; everything here keeps the hypotheses or is refuted in time.

    late: shares of checks that end late, and never; lost: the tracker may lose people for a while;
    watched_m: people farther away are not reported; delay_s: what the tubes believe of the brake's
    delay; jump_m: how far back the localisation jumps for 0.3 s, once.
    """

    late: float = 0.15
    lost: bool = True
    watched_m: float = 30.0
    delay_s: float = BRAKE.delay_s
    jump_m: float = 0.0


@dataclass
class Record:
    """clearance_m: smallest distance between body and person while the car moves; resumed: how
    often TRACK was sent to a braking car that still moved; the rest: what the log would hold."""

    clearance_m: float = math.inf
    travelled_m: float = 0.0
    permitted: int = 0
    stops: int = 0
    resumed: int = 0
    violations: list[Violation] = field(default_factory=list)
    outcomes: list[PoliciesOutcome] = field(default_factory=list)


@dataclass
class Adversary:
    """Everybody's choices from a genome: it decides the style, a seeded generator the details."""

    genes: Sequence[float]
    random: random.Random = field(init=False)

    def __post_init__(self) -> None:
        self.random = random.Random(int(self.genes[0] * 1e6))

    def style(self, k: int, low: float, high: float) -> float:
        return low + (high - low) * self.genes[k % GENES]

    def extreme(self, k: int, low: float, high: float) -> float:
        """An end, or anything between them, as gene k says."""
        gene = self.genes[k % GENES]
        if gene < 0.35:
            return low
        return high if gene > 0.65 else low + (high - low) * self.random.random()

    def walkers(self) -> list[Walker]:
        """Up to three people around the first metres of the way."""
        people = []
        for k in range(1 + int(self.genes[1] * 2.999)):
            g = 8 + 10 * k
            speed, course = self.style(g + 2, 0.0, 2.5), self.style(g + 3, -math.pi, math.pi)
            people.append(
                Walker(
                    f"p{k}", self.style(g, -6.0, 24.0), self.style(g + 1, -6.0, 6.0),
                    speed * math.cos(course), speed * math.sin(course),
                )
            )  # fmt: skip
        return people

    def push(self, k: int, walker: Walker, car: Car, now_s: float) -> tuple[float, float]:
        """Acceleration of walker k: on as before until its moment, then at a point of the car."""
        g = 8 + 10 * k
        if now_s < self.style(g + 4, 0.0, DURATION_S):
            return 0.0, 0.0
        aim = car.station_m + self.style(g + 5, -1.0, 6.0)
        wanted = (aim - walker.x_m, self.style(g + 6, -0.8, 0.8) - walker.y_m)
        size = math.hypot(*wanted) or 1.0
        error = [
            LIMITS.speed_mps * w / size - v
            for w, v in zip(wanted, (walker.vx_mps, walker.vy_mps), strict=True)
        ]
        return 20.0 * error[0], 20.0 * error[1]


class Run:
    """One run: the truth, the sender's turns and the checks on one clock."""

    def __init__(self, genes: Sequence[float], world: World, policies: Policies) -> None:
        self.world, self.policies = world, policies
        self.adversary = Adversary(genes)
        self.car, self.people = Car(), self.adversary.walkers()
        self.record = Record()
        self.now_s = 100.0
        self.car.braking_s = self.now_s
        self.state: PoliciesState = policies.start(self.now_s)
        self.late = world.late * max(0.0, 2.0 * self.adversary.genes[47] - 1.0)
        self.jump_s = math.inf
        self.reported: set[str] = set()

    def go(self) -> Record:
        end_s = self.now_s + DURATION_S
        next_stamp_s = self.now_s
        while self.now_s < end_s:
            if self.now_s >= next_stamp_s:
                started_s = self.now_s
                ask = self._observe()
                self._wait(self._check_s())
                if ask is not None:
                    self._judge(ask)
                next_stamp_s = started_s + self.adversary.style(5, 0.07, 0.1)
            self._wait(min(max(next_stamp_s - self.now_s, 1e-3), 0.03))
        return self.record

    def _check_s(self) -> float:
        if self.adversary.random.random() < self.late:
            return self.adversary.random.choice((0.08, 0.12, 0.3, 1.0))
        return self.adversary.style(6, 0.01, 0.05)

    def _wait(self, duration_s: float) -> None:
        """The truth goes on, and the sender has its turns."""
        end_s = self.now_s + duration_s
        while self.now_s < end_s - 1e-12:
            dt_s = min(self.adversary.style(7, 0.008, 0.016), end_s - self.now_s)
            self._move(dt_s)
            self.state, turn = self.policies.turn(self.state, self.now_s)
            if turn.violation is not None:
                self.record.violations.append(turn.violation)
            tracked = self.car.braking_s is None
            tracks = turn.action is Action.TRACK
            self.record.resumed += tracks and not tracked and self.car.speed_mps > 0.0
            self.car.command(track=tracks, now_s=self.now_s)
            self.record.stops += tracked and self.car.braking_s is not None

    def _move(self, dt_s: float) -> None:
        a, car = self.adversary, self.car
        before_m = car.station_m
        hurries = self.now_s - 100.0 < a.style(48, 0.0, DURATION_S)
        accel = ACCEL[1] if hurries else a.extreme(2, *ACCEL)
        car.move(self.now_s, dt_s, accel=accel, deceleration=a.extreme(3, *DECELERATION))
        for k, walker in enumerate(self.people):
            walker.move(*a.push(k, walker, car, self.now_s - 100.0), dt_s)
        self.now_s += dt_s
        self.record.travelled_m += car.station_m - before_m
        if car.station_m > before_m:
            places = (car.station_m, car.station_m)
            near = min(gap_m(places, w.x_m, w.y_m) for w in self.people) - BODY_M
            self.record.clearance_m = min(self.record.clearance_m, near)

    def _observe(self) -> Callable[[float], Cycle] | None:
        """Measure now; the cycle is complete once its end is known."""
        a, stamp_s = self.adversary, self.now_s
        if a.random.random() < 0.3 * self.late:
            return None
        errors = [a.extreme(40 + k, -1.0, 1.0) for k in range(2)]
        box = measured(self.car, *errors)
        if self.jump_s == math.inf and self.car.speed_mps > a.style(4, 0.5, 2.9):
            self.jump_s = stamp_s
        if self.world.jump_m and 0.0 <= stamp_s - self.jump_s < 0.3:
            shifted = {"station": box.center[0] - self.world.jump_m, "speed": box.center[1]}
            box = box.around(shifted, radius=dict(zip(box.names, box.radius, strict=True)))
        center_m = box.center[0]
        people = self._seen(stamp_s, center_m)
        question = Question(
            TIMING.switch_s, self.policies.fail_safe.start_s(self.state.fail_safe, stamp_s),
            self.world.delay_s,
        )  # fmt: skip
        stop = stop_answer(box, people, question, center_m)
        ahead = objection() if a.random.random() < 0.03 * a.genes[44] else nobody()

        def ended(finished_s: float) -> Cycle:
            return Cycle(
                stamp_s=stamp_s, started_s=stamp_s, finished_s=finished_s, measured=(box,),
                people=people, watched=Watched(center_m, 0.0, self.world.watched_m),
                track_intent=ahead, brake_intent=nobody(), brake_guard=nobody(), stop_guard=stop,
                fault=None,
            )  # fmt: skip

        return ended

    def _seen(self, stamp_s: float, center_m: float) -> tuple[SeenPerson, ...]:
        a, seen = self.adversary, []
        for k, walker in enumerate(self.people):
            g = 8 + 10 * k
            # The tracker loses only whom it had: within the watched disc the list is complete.
            tracked = walker.name in self.reported
            away = math.hypot(walker.x_m - center_m, walker.y_m)
            lost_s = a.style(g + 7, 0.2, DURATION_S)
            lost = self.world.lost and lost_s <= stamp_s - 100.0 < lost_s + a.style(g + 8, 0.0, 3.0)
            if away - BODY_M > self.world.watched_m or (lost and tracked and a.genes[45] > 0.7):
                continue
            self.reported.add(walker.name)
            angles = [a.style(g + 9, -math.pi, math.pi), 1.0, a.style(46 + k, -math.pi, math.pi)]
            seen.append(walker.seen(stamp_s, (*angles, 1.0)))
        return tuple(seen)

    def _judge(self, ask: Callable[[float], Cycle]) -> None:
        self.state, outcome = self.policies.step(self.state, ask(self.now_s))
        self.record.permitted += outcome.action is Action.TRACK
        self.record.violations += outcome.violations
        self.record.outcomes.append(outcome)


def run(genes: Sequence[float], world: World = World(), policies: Policies = POLICIES) -> Record:
    return Run(genes, world, policies).go()


def _worst(genes: Sequence[float], world: World) -> float:
    record = run(genes, world)
    return -math.inf if record.resumed else record.clearance_m


def search(world: World, *, seed: int, starts: int, climbs: int) -> tuple[float, list[float]]:
    """Smallest clearance found: random runs, then random changes to the best of them.

    -inf for a run in which a moving car was let go on after BRAKE.
    """
    rng = random.Random(seed)
    runs = []
    for _ in range(starts):
        genes = [rng.random() for _ in range(GENES)]
        runs.append((_worst(genes, world), genes))
        if runs[-1][0] < 0.0:
            break
    runs.sort(key=lambda pair: pair[0])
    best, genes = runs[0]
    pool = runs[: max(1, starts // 20)]
    for k in range(climbs):
        if best < 0.0:
            break
        base_m, base = pool[k % len(pool)]
        count = rng.choice((1, 2, 5))
        changed = list(base)
        for _ in range(count):
            at = rng.randrange(GENES)
            nudged = changed[at] + rng.gauss(0.0, 0.1)
            changed[at] = rng.random() if rng.random() < 0.3 else min(max(nudged, 0.0), 1.0)
        found = _worst(changed, world)
        if found < base_m:
            pool[k % len(pool)] = (found, changed)
        if found < best:
            best, genes = found, changed
    return best, genes
