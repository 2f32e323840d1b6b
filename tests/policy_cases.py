"""A car that starts from standstill and tracks, cycle by cycle, for tests of single hypotheses."""

from __future__ import annotations

import dataclasses
from typing import Any

from policy_runs import FAIL_SAFE, TIMING
from policy_world import (
    BODY_M,
    LIMITS,
    PLACE_ERROR_M,
    VELOCITY_ERROR_MPS,
    Car,
    Question,
    measured,
    nobody,
    stop_answer,
)

from workbench.runtime import Action
from workbench.runtime.person_guard import Disc, Guard
from workbench.runtime.policies import (
    Cycle,
    FailSafe,
    FailSafeState,
    Outcome,
    SeenPerson,
    Watched,
)

PERIOD_S = 0.08
CHECK_S = 0.03


def person(
    name: str, stamp_s: float, *, x: float = 5.0, y: float = 8.0, vx: float = 1.4
) -> SeenPerson:
    """Somebody who walks along the path, far to its side, since time 0."""
    position = Disc(x + vx * stamp_s, y, PLACE_ERROR_M + BODY_M)
    return SeenPerson(name, Guard(stamp_s, position, Disc(vx, 0.0, VELOCITY_ERROR_MPS), LIMITS))


def changed_person(stamp_s: float, **changes: Any) -> SeenPerson:
    """Ann, with changes to her guard."""
    seen = person("Ann", stamp_s)
    return dataclasses.replace(seen, guard=dataclasses.replace(seen.guard, **changes))


def cycle(state: FailSafeState, car: Car, stamp_s: float, /, **changes: Any) -> Cycle:
    """A cycle in order, about `car` among `people`; `changes` to its fields."""
    box = measured(car, 0.0, 0.0)
    people = changes.pop("people", (person("Ann", stamp_s),))
    question = Question(TIMING.switch_s, FAIL_SAFE.start_s(state, stamp_s))
    made = Cycle(
        stamp_s=stamp_s, started_s=stamp_s, finished_s=stamp_s + CHECK_S, measured=(box,),
        people=people, watched=Watched(car.station_m, 0.0, 30.0), track_intent=nobody(),
        brake_intent=nobody(), brake_guard=nobody(),
        stop_guard=stop_answer(box, people, question, car.station_m), fault=None,
    )  # fmt: skip
    return dataclasses.replace(made, **changes)


class Drive:
    """Sender and checks in step: `on` is one good cycle and what the sender does until the next."""

    def __init__(self, policy: FailSafe = FAIL_SAFE) -> None:
        self.policy, self.car, self.now_s = policy, Car(braking_s=0.0), 0.0
        # The sender turns from the start, so that BRAKE is sent before anything is measured.
        self.state, _ = policy.turn(policy.start(0.0), 0.0)

    def ask(self, **changes: Any) -> Outcome:
        """One check, stamped now."""
        made = cycle(self.state, self.car, self.now_s, **changes)
        self.now_s = max(self.now_s, made.finished_s)
        self.state, outcome = self.policy.step(self.state, made)
        return outcome

    def send(self, until_s: float) -> list[Action]:
        """The sender's turns until then."""
        sent = []
        while self.now_s < until_s - 1e-9:
            self.car.move(self.now_s, 0.01, accel=0.6, deceleration=2.5)
            self.now_s += 0.01
            self.state, turn = self.policy.turn(self.state, self.now_s)
            self.car.command(track=turn.action is Action.TRACK, now_s=self.now_s)
            sent.append(turn.action)
        return sent

    def on(self, cycles: int = 1) -> Outcome:
        """Good cycles, the sender working meanwhile."""
        for _ in range(cycles):
            stamp_s = self.now_s
            made = cycle(self.state, self.car, stamp_s)
            self.send(made.finished_s)
            made = dataclasses.replace(made, finished_s=self.now_s)
            self.state, outcome = self.policy.step(self.state, made)
            self.send(stamp_s + PERIOD_S)
        return outcome


def tracking() -> Drive:
    """A drive that has reached about 1 m/s, with a plan in force."""
    drive = Drive()
    drive.on(30)
    assert drive.car.speed_mps > 0.8
    return drive
