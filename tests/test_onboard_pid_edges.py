"""One number that is not finite is enough for no command; a reference moves by slew over gain."""

from __future__ import annotations

import dataclasses
import math

import pytest

from workbench.runtime.onboard.pid import (
    NOTHING,
    Integrals,
    LawCommand,
    Reading,
    TrackLaw,
    advanced,
    ramped_reference_mps,
)

LAW = TrackLaw(
    wheelbase_m=2.5, steering_min_rad=-0.6, steering_max_rad=0.6, look_ahead_m=2.0,
    steering_proportional=0.5, steering_integral=0.2, steering_derivative=0.4,
    rate_min_radps=-0.2, rate_max_radps=0.2, speed_proportional=0.8, speed_integral=0.1,
    accel_min_mps2=-2.0, accel_max_mps2=1.0,
)  # fmt: skip
READING = Reading(0.1, 0.02, 0.05, 1.0, 0.01)
WRONG = (math.nan, math.inf, -math.inf)


@pytest.mark.parametrize("wrong", WRONG)
def test_one_number_that_is_not_finite_is_enough_for_no_command(wrong: float) -> None:
    # An infinite error saturates, so that no rate would tell of it.
    speed, offset = Integrals(speed_m=wrong), Integrals(offset_ms=wrong)
    assert LAW.track(READING, speed, reference_speed_mps=1.0) is NOTHING
    assert LAW.track(READING, offset, reference_speed_mps=1.0) is NOTHING
    assert LAW.track(READING, Integrals(), reference_speed_mps=wrong) is NOTHING


@pytest.mark.parametrize(
    "command", [LawCommand(0.0, 0.0, 1.0, math.nan), LawCommand(0.0, 0.0, math.inf, 1.0)]
)
def test_integrals_advance_together_or_not_at_all(command: LawCommand) -> None:
    before = Integrals(1.0, 2.0)
    assert advanced(before, command, 0.5) == before


@pytest.mark.parametrize("proportional", [0.5, 0.8, 4.0])
def test_a_reference_moves_by_the_slew_over_the_gain(proportional: float) -> None:
    law = dataclasses.replace(LAW, speed_proportional=proportional)
    for side in (1.0, -1.0):
        moved = ramped_reference_mps(
            law, 2.0, target_mps=2.0 + 9.0 * side, slew_mps3=1.5, step_s=0.1
        )
        assert moved == pytest.approx(2.0 + side * 1.5 / proportional * 0.1, abs=1e-15)


@pytest.mark.parametrize("speed_mps", [-0.3, 0.0, 0.19, 0.3, 5.0])
def test_brake_asks_nothing_of_the_pedals_and_of_the_speed_s_integral(speed_mps: float) -> None:
    reading = Reading(0.1, 0.02, 0.05, speed_mps, 0.01)
    command = LAW.brake(reading, Integrals(1.0, 1.0), stop_speed_mps=0.2)
    assert (command.acceleration_mps2, command.speed_integral_rate_mps) == (0.0, 0.0)
