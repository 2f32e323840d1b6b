"""In GATE a command from upstream passes only within the proof, and never instead of BRAKE."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from onboard_core_bench import (
    Bench,
    bench,
    brakes,
    commander,
    commands,
    faults,
    framed,
    person,
    said,
)
from onboard_core_cases import DRIVE_BY_WIRE, SETTINGS

from workbench.runtime.onboard.actuation import Wanted
from workbench.runtime.onboard.core import Mode, Request, State, TurnResult
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.gate import Upstream, passed

FLAGS = {"PACMOD_ENABLE": 1, "CLEAR_OVERRIDE": 1, "IGNORE_OVERRIDE": 1}


def upstream(b: Bench, at_us: int, *, accel: float, wheel: float = 0.0, brake: float = 0.0,
             enable: int = 1) -> None:  # fmt: skip
    """What an upstream driver sends in a cycle, its bad habits included."""
    for frame in (
        framed("GLOBAL_CMD", FLAGS | {"PACMOD_ENABLE": enable}),
        framed("ACCEL_CMD", {"ACCEL_CMD": accel}),
        framed("BRAKE_CMD", {"BRAKE_CMD": brake}),
        framed("STEERING_CMD", {"POSITION_VALUE": wheel, "SPEED_LIMIT": 4.0}),
    ):
        b.core.receive_upstream(*frame, at_us)


def gated(accel: float = 0.4, wheel: float = 0.0) -> Bench:
    b = bench(Mode.GATE)
    for _ in range(12):
        b.step(lambda b, at_us: upstream(b, at_us, accel=accel, wheel=wheel))
    b.request(Request.ARM)
    for _ in range(60):
        result = b.step(lambda b, at_us: upstream(b, at_us, accel=accel, wheel=wheel))
        if result.state is State.TRACKING:
            return b
    raise AssertionError(result)


def wanted(result: TurnResult) -> tuple[float, float]:
    """Acceleration (m/s^2) by the map's middle, and the wheel's angle (rad), that were sent."""
    heard = said(result)
    accel, brake = heard["ACCEL_CMD"]["ACCEL_CMD"], heard["BRAKE_CMD"]["BRAKE_CMD"]
    pedals = DRIVE_BY_WIRE.pedals
    if brake > 0.0:
        acceleration = -pedals.brake.middle(brake)
    else:
        acceleration = pedals.accelerator.middle(accel) if accel > 0.0 else 0.0
    return acceleration, heard["STEERING_CMD"]["POSITION_VALUE"]


@pytest.mark.parametrize(("accel", "brake", "wheel"), [(1.0, 0.0, 10.0), (0.0, 1.0, -10.0)])
def test_what_upstream_asks_is_cut_to_our_own_command_and_the_margin(
    accel: float, brake: float, wheel: float
) -> None:
    b = gated()
    other = gated()
    for _ in range(6):
        b.step(lambda b, at_us: upstream(b, at_us, accel=accel, brake=brake, wheel=wheel))
        other.step(lambda b, at_us: upstream(b, at_us, accel=accel, brake=brake, wheel=wheel))
        last = commander(b).last
        law = b.core._helm._command
        margin = SETTINGS.gate
        assert last is not None
        sent = last.sent.command
        assert abs(sent.acceleration_mps2 - law.acceleration_mps2) <= margin.acceleration_mps2
        assert (
            abs(sent.steering_rate_radps - law.steering_rate_radps)
            <= margin.steering_rate_radps + 1e-12
        )
        towards = math.copysign(1.0, wheel)
        assert (sent.steering_rate_radps - law.steering_rate_radps) * towards >= 0.0


def test_flags_of_upstream_never_pass() -> None:
    b = gated()
    result = b.step(lambda b, at_us: upstream(b, at_us, accel=0.4))
    assert said(result)["GLOBAL_CMD"] == {
        "PACMOD_ENABLE": 1, "CLEAR_OVERRIDE": 0, "IGNORE_OVERRIDE": 0,
    }  # fmt: skip


def test_brake_replaces_whatever_upstream_asks() -> None:
    b = gated()
    for _ in range(40):
        b.step(lambda b, at_us: upstream(b, at_us, accel=0.4))
    b.people = [person(7, b.x_m + 5.0, 0.0)]
    for _ in range(20):
        result = b.step(lambda b, at_us: upstream(b, at_us, accel=1.0))
        if result.state is State.BRAKING:
            break
    assert brakes(result)
    assert brakes(b.step(lambda b, at_us: upstream(b, at_us, accel=1.0)))


def test_an_upstream_controller_that_is_silent_brakes() -> None:
    b = gated()
    results = [b.step() for _ in range(6)]
    first = next(r for r in results if Fault.UPSTREAM_LOST in faults(r))
    assert (first.state, brakes(first)) == (State.BRAKING, True)
    found = next(each for each in first.faults if each.fault is Fault.UPSTREAM_LOST)
    assert 0 <= first.at_us - found.since_us <= 33_333


def test_an_upstream_controller_that_lets_go_yields() -> None:
    b = gated()
    result = b.step(lambda b, at_us: upstream(b, at_us, accel=0.0, enable=0))
    assert result.state is State.YIELDED
    assert commands(result) == {"GLOBAL_CMD"}


def test_without_upstream_there_is_no_arming() -> None:
    b = bench(Mode.GATE)
    b.run(12)
    b.request(Request.ARM)
    result = b.step()
    assert result.state is State.DISARMED
    assert "UPSTREAM_LOST: GLOBAL_CMD" in result.events[0]
    # Without a gate nobody listens there.
    free = bench(Mode.DRIVE)
    upstream(free, 0, accel=1.0)
    assert not faults(free.run(12))


numbers = st.floats(width=64, allow_nan=True, allow_infinity=True)
own = st.builds(Wanted, st.floats(-2.0, 1.0), st.floats(-0.2, 0.2))
margins = st.builds(Wanted, st.floats(0.0, 1.0), st.floats(0.0, 0.2))


@given(st.builds(Wanted, numbers, numbers), own, margins)
def test_nothing_beyond_margin_or_limits_passes(asked: Wanted, law: Wanted, margin: Wanted) -> None:
    found = passed(asked, law, margin, DRIVE_BY_WIRE)
    for value, centre, most, low, high, wish in (
        (
            found.acceleration_mps2, law.acceleration_mps2, margin.acceleration_mps2, -2.0, 1.0,
            asked.acceleration_mps2,
        ),
        (
            found.steering_rate_radps, law.steering_rate_radps, margin.steering_rate_radps, -0.2,
            0.2, asked.steering_rate_radps,
        ),
    ):  # fmt: skip
        assert max(centre - most, low) <= value <= min(centre + most, high)
        if max(centre - most, low) <= wish <= min(centre + most, high):
            assert value == wish


def test_what_upstream_asks_is_read_by_the_middles_of_the_maps() -> None:
    b = bench(Mode.GATE)
    listener = Upstream(DRIVE_BY_WIRE)
    b.core.receive_upstream = listener.receive  # type: ignore[method-assign]
    upstream(b, 0, accel=0.5, wheel=1.0)
    found = listener.wanted(0.0)
    assert found.acceleration_mps2 == pytest.approx(6.0 * 0.2)
    assert found.steering_rate_radps == pytest.approx(0.05 / DRIVE_BY_WIRE.steering.lead_s)
    upstream(b, 0, accel=0.1)
    assert listener.wanted(0.0).acceleration_mps2 == 0.0
    upstream(b, 0, accel=0.5, brake=0.55)
    assert listener.wanted(0.0).acceleration_mps2 == pytest.approx(-4.0)
    assert math.isnan(listener.wanted(math.nan).steering_rate_radps)
    listener.receive(0x67, bytes(7), 0)
    listener.receive(0x68, bytes(8), 0)
    assert listener.wanted(0.0).acceleration_mps2 == pytest.approx(-4.0)
