"""The law in plain floats is the closed loop's law: commands and integrals, saturated or not."""

from __future__ import annotations

import dataclasses
import functools
import math

import pytest
from actuation_cases import drive_vehicle
from hypothesis import example, given, settings
from hypothesis import strategies as st

pytest.importorskip("casadi", reason="needs the optional package casadi")

import casadi as ca

from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.drive_by_wire import reading_gain_per_s
from workbench.models.system import Ode
from workbench.runtime.contents import Parameter
from workbench.runtime.onboard.pid import (
    NOTHING,
    Integrals,
    LawCommand,
    Reading,
    TrackLaw,
    advanced,
    law_of,
    ramped_reference_mps,
)

# One unit in the last place of the largest term; the operations are the same, in the same order.
_ULPS = 4e-16


@functools.cache
def _ode(*, braking: bool) -> Ode:
    vehicle = drive_vehicle()
    mode = vehicle.brake.mode() if braking else vehicle.track()
    return vehicle.closed_loop(mode, PathFrame(-0.5, 0.5)).ode


@functools.cache
def _function(*, braking: bool) -> ca.Function:
    ode = _ode(braking=braking)
    return ca.Function("f", [ode.x, ode.p, ode.w], [ode.field])


@functools.cache
def _law() -> TrackLaw:
    parameters = _ode(braking=False).parameters
    return law_of([Parameter(p.name, p.unit, p.nominal, p.lower, p.upper) for p in parameters])


def _of_the_loop(
    reading: Reading, integrals: Integrals, *, braking: bool, reference: float
) -> LawCommand:
    """The same four numbers out of the closed loop's field."""
    ode, r = _ode(braking=braking), reading
    state = {
        "station": 0.0, "offset": r.offset_m, "steering": r.steering_rad, "speed": r.speed_mps,
        "heading_error": r.heading_error_rad, "speed_integral": integrals.speed_m,
        "offset_integral": integrals.offset_ms, "brake_clock": 0.0,
    }  # fmt: skip
    parameters = [reference if p.name == "reference_speed" else p.nominal for p in ode.parameters]
    forces = [r.curvature_per_m if w.name == "curvature" else w.nominal for w in ode.disturbances]
    rates = _function(braking=braking)([state[n] for n in ode.names], parameters, forces)
    rate = dict(zip(ode.names, (float(each) for each in ca.vertsplit(rates)), strict=True))
    return LawCommand(
        rate["speed"], rate["steering"], rate["speed_integral"], rate["offset_integral"]
    )


def _close(one: float, other: float, scale: float) -> bool:
    return abs(one - other) <= 8 * _ULPS * scale


_READINGS = st.builds(
    Reading,
    st.floats(-1.9, 1.9), st.floats(-0.6, 0.6), st.floats(-0.8, 0.8), st.floats(-0.5, 4.0),
    st.floats(-0.5, 0.5),
)  # fmt: skip
_INTEGRALS = st.builds(Integrals, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))


@settings(max_examples=400, deadline=None)
@given(_READINGS, _INTEGRALS, st.floats(0.0, 4.0))
@example(Reading(0.01, 0.0, 0.0, 2.0, 0.0), Integrals(), 2.1)
@example(Reading(1.5, 0.5, -0.7, 4.0, 0.4), Integrals(-3.0, 3.0), 0.0)
def test_track_is_the_loop_s(reading: Reading, integrals: Integrals, reference: float) -> None:
    expected = _of_the_loop(reading, integrals, braking=False, reference=reference)
    found = _law().track(reading, integrals, reference_speed_mps=reference)
    for name in LawCommand.__slots__:
        assert _close(getattr(found, name), getattr(expected, name), 40.0), name
    assert abs(found.steering_rate_radps) <= 0.2
    assert -2.0 <= found.acceleration_mps2 <= 1.0


@settings(max_examples=300, deadline=None)
@given(_READINGS, _INTEGRALS)
@example(Reading(0.5, 0.1, 0.0, 0.3, 0.0), Integrals())
@example(Reading(0.5, 0.1, 0.0, 0.1, 0.0), Integrals())
@example(Reading(0.5, 0.1, 0.0, -0.3, 0.0), Integrals())
def test_brake_steers_as_the_loop_s(reading: Reading, integrals: Integrals) -> None:
    expected = _of_the_loop(reading, integrals, braking=True, reference=0.0)
    stop = drive_vehicle().brake.stop_speed_mps
    found = _law().brake(reading, integrals, stop_speed_mps=stop)
    for name in ("steering_rate_radps", "speed_integral_rate_mps", "offset_integral_rate_m"):
        assert _close(getattr(found, name), getattr(expected, name), 400.0), name


def test_saturations_and_anti_windup_are_met_in_these_examples() -> None:
    wide, law = Reading(1.5, 0.5, 0.0, 1.0, 0.0), _law()
    command = law.track(wide, Integrals(), reference_speed_mps=3.0)
    assert (command.steering_rate_radps, command.acceleration_mps2) == (-0.2, 1.0)
    error = 1.5 + 2.0 * math.sin(0.5)
    assert command.offset_integral_rate_m < error
    assert command.speed_integral_rate_mps == 2.0 - (2.0 - 1.0)
    small = law.track(Reading(0.1, 0.0, 0.0, 2.0, 0.0), Integrals(), reference_speed_mps=2.1)
    assert small.offset_integral_rate_m == pytest.approx(0.1)
    assert small.speed_integral_rate_mps == pytest.approx(0.1)


@pytest.mark.parametrize(
    "wrong",
    [
        {"wheelbase_m": 2.45}, {"steering_min_rad": -0.61}, {"look_ahead_m": 1.9},
        {"steering_proportional": -0.6}, {"steering_integral": 0.0}, {"steering_derivative": 0.9},
        {"rate_max_radps": 0.25}, {"rate_min_radps": -0.25}, {"speed_proportional": 0.9},
        {"speed_integral": 0.0}, {"accel_max_mps2": 1.5}, {"accel_min_mps2": -3.0},
        {"steering_max_rad": 0.5},
    ],
)  # fmt: skip
def test_a_law_with_one_wrong_number_is_told_apart(wrong: dict[str, float]) -> None:
    law = dataclasses.replace(_law(), **wrong)
    readings = [
        Reading(e, psi, steering, v, 0.1)
        for e in (-1.0, -0.1, 0.1, 1.0)
        for psi in (-0.2, 0.02)
        for steering in (-0.62, 0.02, 0.55)
        for v in (0.1, 2.5, 4.0)
    ]
    differs = False
    for reading in readings:
        for reference in (0.0, 2.4, 4.0):
            integrals = Integrals(1.0, 0.5)
            expected = _of_the_loop(reading, integrals, braking=False, reference=reference)
            found = law.track(reading, integrals, reference_speed_mps=reference)
            differs |= any(
                not _close(getattr(found, name), getattr(expected, name), 40.0)
                for name in LawCommand.__slots__
            )
    assert differs


@given(st.lists(st.floats() | st.floats(-3.0, 3.0), min_size=8, max_size=8))
def test_whatever_is_read_there_is_a_finite_command_or_none(numbers: list[float]) -> None:
    reading, integrals = Reading(*numbers[:5]), Integrals(*numbers[5:7])
    for found in (
        _law().track(reading, integrals, reference_speed_mps=numbers[7]),
        _law().brake(reading, integrals, stop_speed_mps=0.2),
    ):
        rates = [getattr(found, name) for name in LawCommand.__slots__]
        assert found is NOTHING or all(map(math.isfinite, rates))
        after = advanced(integrals, found, 0.033)
        assert found is not NOTHING or after == integrals
    if not all(map(math.isfinite, numbers)):
        assert _law().track(reading, integrals, reference_speed_mps=numbers[7]) is NOTHING


@pytest.mark.parametrize(
    ("reading", "reference"),
    [
        (Reading(2.0, 0.0, 0.0, 1.0, 0.5), 1.0),
        (Reading(-4.0, 0.1, 0.0, 1.0, -0.5), 1.0),
        (Reading(0.0, 0.0, 0.0, -1.7e308, 0.0), 1.7e308),
    ],
)
def test_beyond_the_centre_of_the_path_or_of_all_numbers_there_is_no_command(
    reading: Reading, reference: float
) -> None:
    assert _law().track(reading, Integrals(), reference_speed_mps=reference) is NOTHING


def test_integrals_advance_by_their_rates() -> None:
    assert advanced(Integrals(1.0, 2.0), LawCommand(0.0, 0.0, 3.0, -4.0), 0.5) == Integrals(
        2.5, 0.0
    )


@settings(max_examples=200, deadline=None)
@given(
    _READINGS, _INTEGRALS, st.floats(-0.6, 0.6), st.floats(0.0, 0.05), st.sampled_from([-1.0, 1.0])
)
def test_misreading_the_road_wheels_costs_no_more_than_the_gain(
    reading: Reading, integrals: Integrals, steering: float, error: float, side: float
) -> None:
    vehicle = drive_vehicle()
    gain = reading_gain_per_s(
        vehicle.steering_pid, wheelbase_m=1.75, speed_mps=4.0,
        tangent_rise=1.0 + math.tan(0.6) ** 2,
    )  # fmt: skip
    commands = [
        _law()
        .track(dataclasses.replace(reading, steering_rad=at), integrals, reference_speed_mps=2.0)
        .steering_rate_radps
        for at in (steering, steering + side * error)
    ]
    assert abs(commands[1] - commands[0]) <= gain * error + 1e-12


def test_a_ramped_reference_never_asks_for_more_than_the_slew() -> None:
    law, reference, speed, before = _law(), 0.0, 0.0, 0.0
    for _ in range(300):
        reference = ramped_reference_mps(
            law, reference, target_mps=2.0, slew_mps3=1.0, step_s=1 / 30
        )
        reading = Reading(0.0, 0.0, 0.0, speed, 0.0)
        wanted = law.track(reading, Integrals(), reference_speed_mps=reference).acceleration_mps2
        assert abs(wanted - before) <= 1.0 / 30 + 1e-9
        speed, before = speed + wanted / 30, wanted
    assert reference == 2.0
    assert speed == pytest.approx(2.0, abs=0.05)


def test_a_bundle_without_the_law_s_numbers_is_refused() -> None:
    with pytest.raises(InputError, match=r"parameters \['wheelbase'.*workbench build"):
        law_of([])
