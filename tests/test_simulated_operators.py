"""Whoever operates a simulated monitor leads a yielded car on, also where a fault was latched, and
the summary says that it was yielded or held, since when and for what."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from workbench.runtime.decision import Action
from workbench.runtime.onboard.arming import state_refusal
from workbench.runtime.onboard.control import ControlSocket
from workbench.runtime.onboard.states import (
    Mode,
    Request,
    Situation,
    Standing,
    State,
    next_standing,
)
from workbench.runtime.onboard.times import TURN_US
from workbench.runtime.onboard.turns import TurnResult
from workbench.simulation.onboard_operator import Operator


class YieldedCore:
    """The states of the true one, without faults from now on."""

    def __init__(self, *, latched: bool) -> None:
        self.standing = Standing(State.YIELDED, 0, latched=latched)
        self.asked: list[Request] = []
        self._request: Request | None = None

    def receive(self, *_: object) -> None:
        raise AssertionError("nothing is on this bus")

    def request(self, request: Request, _: int) -> None:
        self.asked.append(request)
        self._request = request

    def turn(self, at_us: int, clock: Callable[[], int] | None = None) -> TurnResult:
        request, self._request = self._request, None
        refusal = ""
        if request in (Request.ARM, Request.REARM):
            refusal = state_refusal(request, self.standing, Mode.DRIVE)
        there = Situation(
            at_us, frozenset(), None if refusal else request, Action.TRACK, enabled=True,
            stands=True,
        )  # fmt: skip
        self.standing, _order = next_standing(self.standing, there, release_us=0)
        events = (f"not armed: {refusal}",) if refusal else ()
        return TurnResult(at_us, (), self.standing.state, None, None, None, (), events)


WANTED = [
    (False, [Request.REARM]),
    (True, [Request.REARM, Request.DISARM, Request.ARM]),
]


@pytest.mark.parametrize(("latched", "asked"), WANTED)
def test_in_virtual_time(latched: bool, asked: list[Request]) -> None:
    pytest.importorskip("casadi", reason="needs the extra analysis")
    from workbench.simulation.bus_drive import BusLoop

    core = YieldedCore(latched=latched)
    world: Any = SimpleNamespace(until=lambda _: (), begun_us=0)
    loop = BusLoop(core, world, seed=0)  # type: ignore[arg-type]
    for _ in range(300):
        loop.turn()
    assert core.asked == asked
    assert core.standing.state is State.TRACKING


@pytest.mark.parametrize(("latched", "asked"), WANTED)
def test_of_a_soak(latched: bool, asked: list[Request]) -> None:
    core, operator = YieldedCore(latched=latched), Operator()
    result: TurnResult | None = None
    for k in range(300):
        request = operator.asks(result)
        if request is not None:
            core.request(request, k * TURN_US)
        result = core.turn(k * TURN_US)
    assert core.asked == asked
    assert core.standing.state is State.TRACKING


def test_in_real_time_over_the_control_socket(tmp_path: Path) -> None:
    pytest.importorskip("casadi", reason="needs the extra analysis")
    from workbench.simulation import live_processes

    tmp_path.chmod(0o700)
    core, control, over = YieldedCore(latched=True), ControlSocket(tmp_path), threading.Event()

    def turns() -> None:
        state = core.standing.state
        while not over.wait(0.005):
            for word in control.heard({"state": state.name, "faults": []}):
                core.request(Request(word.value), 0)
            state = core.turn(0).state

    monitor = threading.Thread(target=turns)
    monitor.start()
    operator = live_processes.Operator(tmp_path)
    try:
        operator.may_arm()
        until_s = time.monotonic() + 20.0
        while core.standing.state is not State.TRACKING and time.monotonic() < until_s:
            time.sleep(0.02)
    finally:
        operator.close()
        over.set()
        monitor.join()
        control.close()
    assert core.asked == [Request.REARM, Request.DISARM, Request.ARM]
    assert core.standing.state is State.TRACKING


def instant(t_s: float, state: State, *faults: str, grounds: tuple[str, ...] = ()) -> Any:
    details = tuple("it is so" for _ in faults)
    tracks = state is State.TRACKING
    return SimpleNamespace(
        t_s=t_s, state=state, faults=faults, details=details, tracks=tracks, grounds=grounds
    )


def test_a_summary_says_that_a_car_was_yielded_or_held() -> None:
    pytest.importorskip("casadi", reason="needs the extra analysis")
    from workbench.simulation.holding import holding_notes

    def drive(*states: tuple[State, str]) -> tuple[str, ...]:
        return holding_notes(
            [instant(float(k), state, *filter(None, [name])) for k, (state, name) in
             enumerate(states)]
        )  # fmt: skip

    calm = (State.TRACKING, "")
    assert drive(calm, calm, (State.BRAKING, "LATE"), calm, calm, calm) == ()
    gone = (State.YIELDED, "")
    yielded = drive(calm, calm, calm, (State.YIELDED, "DRIVER_OVERRIDE"), gone, calm, calm, calm)
    assert yielded == (
        "the monitor gave the car to the driver (YIELDED) from 3.0 s until 4.0 s, for "
        "DRIVER_OVERRIDE: it is so",
    )
    # A fault holds the car after it is gone, until TRACK is sent again.
    held = drive(calm, (State.BRAKING, "LATE"), (State.BRAKING, ""), (State.BRAKING, ""), calm)
    assert len(held) == 1
    assert held[0].startswith("held by faults for 3.0 s of 4.0 s: LATE 3.0 s;")
    # What a decision stands against is no fault.
    people = [instant(float(k), State.BRAKING, grounds=("people",)) for k in range(4)]
    assert holding_notes([instant(-1.0, State.BRAKING, "LATE"), *people]) == ()
