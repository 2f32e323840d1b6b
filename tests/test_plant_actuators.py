"""Every part of the actuators shows in the motion as its value says, and none leaves the bands."""

from __future__ import annotations

import dataclasses
import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.models.vehicle import gem_e2_drive_path, load_vehicle
from workbench.simulation.plants.actuators import Actuators, DriveByWireCar, bands
from workbench.simulation.plants.bicycle import BicycleChassis
from workbench.simulation.plants.chassis import Motion, Start

VEHICLE = load_vehicle(gem_e2_drive_path())
assert VEHICLE.drive_by_wire is not None
WIRE = VEHICLE.drive_by_wire.value
MIDDLE = Actuators.middle(WIRE)
AT_ONCE = dataclasses.replace(
    MIDDLE, pedal_delay_s=0.0, accelerator_up_s=0.0, brake_up_s=0.0, steering_delay_s=0.0,
    steering_up_s=0.0,
)  # fmt: skip


class Watched:
    """A chassis that remembers what was asked of it, at the end of each sub-step."""

    def __init__(self, speed_mps: float = 2.0) -> None:
        self.inner = BicycleChassis(1.75, 0.6, start=Start(0.0, 0.0, 0.0, speed_mps))
        self.at_s = 0.0
        self.asked: list[tuple[float, float, float]] = []

    @property
    def motion(self) -> Motion:
        return self.inner.motion

    def advance(self, a: float, u: float, duration_s: float) -> None:
        self.at_s += duration_s
        self.asked.append((self.at_s, a, u))
        self.inner.advance(a, u, duration_s)


def car(actuators: Actuators, speed_mps: float = 2.0) -> tuple[DriveByWireCar, Watched]:
    chassis = Watched(speed_mps)
    return DriveByWireCar(chassis, WIRE, actuators), chassis


def told(
    plant: DriveByWireCar, *, accelerator: float = 0.0, brake: float = 0.0, wheel: float = 0.0,
    rate: float = 0.0,
) -> None:  # fmt: skip
    plant.command(accelerator=accelerator, brake=brake, wheel_rad=wheel, wheel_rate_radps=rate)


@pytest.mark.parametrize("delay_s", [0.0, 0.013, 0.05])
@pytest.mark.parametrize("up_s", [0.0, 0.012, 0.1])
def test_the_brake_begins_after_its_delay_and_is_up_after_its_build_up(
    delay_s: float, up_s: float
) -> None:
    plant, chassis = car(dataclasses.replace(AT_ONCE, pedal_delay_s=delay_s, brake_up_s=up_s))
    told(plant, brake=0.35)
    plant.advance(300_000)
    late = round(delay_s, 6)
    assert late == 0.0 or min(abs(at_s - late) for at_s, _, _ in chassis.asked) < 1e-9
    for at_s, a, _ in chassis.asked:
        # Linear between begin and end; the value of a sub-step is that at its end.
        share = 1.0 if up_s == 0.0 else min(max((at_s - late) / up_s, 0.0), 1.0)
        if at_s <= late + 1e-9:
            assert a == MIDDLE.coast_mps2
        else:
            assert a == pytest.approx(-WIRE.pedals.brake.middle(0.35 * share), abs=1e-9)
    assert plant.brake == 0.35


def test_the_accelerator_builds_up_by_its_own_time_and_comes_back() -> None:
    plant, _ = car(dataclasses.replace(AT_ONCE, accelerator_up_s=0.1, brake_up_s=0.0))
    told(plant, accelerator=0.4, brake=0.0)
    plant.advance(50_000)
    assert plant.accelerator == pytest.approx(0.2)
    plant.advance(50_000)
    assert plant.accelerator == pytest.approx(0.4)
    assert plant.motion.acceleration_mps2 == pytest.approx(WIRE.pedals.accelerator.middle(0.4))
    plant.release()
    plant.advance(25_000)
    assert plant.accelerator == pytest.approx(0.3)
    plant.advance(100_000)
    assert plant.accelerator == 0.0


def test_the_accelerator_does_nothing_below_its_dead_band() -> None:
    least, most = bands(WIRE)["accelerator_dead"]
    assert 0.32 == least < most < 0.34
    for dead, ratio, expected in (
        (most, 0.333, 0.02), (least, 0.333, WIRE.pedals.accelerator.middle(0.333)),
    ):  # fmt: skip
        plant, chassis = car(dataclasses.replace(AT_ONCE, accelerator_dead=dead, coast_mps2=0.02))
        told(plant, accelerator=ratio)
        plant.advance(20_000)
        assert chassis.asked[-1][1] == pytest.approx(expected)


@pytest.mark.parametrize("share", [-1.0, -0.5, 0.0, 1.0])
def test_gains_lie_in_the_map_s_band_where_their_share_says(share: float) -> None:
    errors = dataclasses.replace(
        AT_ONCE, accelerator_share=share, brake_share=-0.7 * share, road_wheel_share=share,
        coast_mps2=0.04,
    )  # fmt: skip
    plant, chassis = car(errors)
    told(plant, brake=0.35)
    plant.advance(10_000)
    assert chassis.asked[-1][1] == pytest.approx(-(2.8 - 0.7 * 0.15 * share))
    # Whatever its map is, the wheel is where the road wheels are straight.
    assert plant.motion.road_wheel_rad == pytest.approx(0.0, abs=1e-12)
    told(plant, accelerator=0.4, wheel=2.0, rate=4.0)
    plant.advance(2_000_000)
    middle = WIRE.pedals.accelerator.middle(0.4)
    assert chassis.asked[-1][1] == pytest.approx(middle + 0.15 * share)
    resting = WIRE.steering.road_wheel.middle(plant.wheel_rad)
    assert plant.motion.road_wheel_rad == pytest.approx(resting + 0.001 * share, abs=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_wheel_turns_late_at_its_rate_and_rests_before_its_target(side: float) -> None:
    slow = dataclasses.replace(
        AT_ONCE, steering_delay_s=0.028, rate_share=0.04, wheel_dead_rad=0.01
    )
    plant, _ = car(slow)
    told(plant, wheel=side * 1.0, rate=2.0)
    plant.advance(28_000)
    assert plant.wheel_rad == 0.0
    plant, _ = car(slow)
    told(plant, wheel=side * 1.0, rate=2.0)
    plant.advance(128_000)
    assert plant.wheel_rad == pytest.approx(side * 0.1 * 2.0 * 1.04)
    plant.advance(2_000_000)
    assert 0.99 - 1e-9 <= side * plant.wheel_rad <= 1.0
    assert side * plant.motion.yaw_rate_radps > 0.0
    rested = plant.wheel_rad
    told(plant, wheel=rested + 0.009, rate=2.0)
    plant.advance(500_000)
    assert plant.wheel_rad == rested


def test_the_motor_s_rate_and_build_up_limit_the_wheel() -> None:
    plant, _ = car(dataclasses.replace(AT_ONCE, steering_up_s=0.02, wheel_rate_limit_radps=5.0))
    told(plant, wheel=8.0, rate=12.0)
    plant.advance(5_000)
    # The rate changes by at most 10 rad/s within 0.02 s.
    assert plant.wheel_rad == pytest.approx(0.005 * 2.5)
    plant.advance(5_000)
    begin = plant.wheel_rad
    plant.advance(100_000)
    assert plant.wheel_rad - begin == pytest.approx(0.5)


def test_the_wheel_never_turns_beyond_its_target() -> None:
    plant, _ = car(dataclasses.replace(AT_ONCE, steering_up_s=0.02, wheel_dead_rad=0.0))
    told(plant, wheel=0.503, rate=5.0)
    for _ in range(100):
        plant.advance(3_000)
        assert plant.wheel_rad <= 0.503
    assert plant.wheel_rad == 0.503


def test_release_frees_pedals_and_leaves_the_wheel() -> None:
    plant, _ = car(MIDDLE)
    told(plant, brake=0.3, wheel=1.0, rate=2.0)
    plant.advance(200_000)
    turned = plant.wheel_rad
    told(plant, brake=0.3, wheel=-1.0, rate=2.0)
    plant.release()
    plant.advance(300_000)
    assert (plant.accelerator, plant.brake, plant.wheel_rad) == (0.0, 0.0, turned)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 10**6),
    st.lists(
        st.tuples(st.integers(1_000, 90_000), st.sampled_from([0.0, 0.36, 0.4, 0.48]),
                  st.sampled_from([0.0, 0.1, 0.3125, 0.8]), st.floats(-11.0, 11.0),
                  st.floats(0.1, 5.0)),
        min_size=1, max_size=12,
    ),
)  # fmt: skip
def test_what_is_asked_lies_in_the_hull_of_what_the_file_allows_for_recent_commands(
    seed: int, commands: list[tuple[int, float, float, float, float]]
) -> None:
    drawn = Actuators.drawn(WIRE, random.Random(seed))
    plant, chassis = car(drawn)
    pedals, steering = WIRE.pedals, WIRE.steering
    sent: list[tuple[float, float, float, float]] = [(-1.0, 0.0, 0.0, 0.0)]
    for duration_us, accelerator, brake, wheel, rate in commands:
        accelerator = 0.0 if brake else accelerator
        sent.append((chassis.at_s, accelerator, brake, rate))
        told(plant, accelerator=accelerator, brake=brake, wheel=wheel, rate=rate)
        plant.advance(duration_us)
    for (at_s, a, u), begin in zip(
        chassis.asked, [0.0, *(each[0] for each in chassis.asked)], strict=False
    ):
        since = begin - pedals.longest_s - 1e-9
        inside = [k for k, each in enumerate(sent) if since < each[0] <= begin + 1e-9]
        first = max(k for k, each in enumerate(sent) if each[0] <= since or k == 0)
        ends = [_allowed(*sent[k][1:3]) for k in {first, *inside}]
        assert min(low for low, _ in ends) - 1e-9 <= a <= max(high for _, high in ends) + 1e-9
        fastest = max(sent[k][3] for k in {first, *inside})
        slope = max(steering.road_wheel.slopes) + 1e-9
        jump = 0.002 / (at_s - begin) if begin == 0.0 else 0.0
        assert abs(u) <= fastest * (1.0 + steering.rate_error) * slope + jump + 1e-6


def _allowed(accelerator: float, brake: float) -> tuple[float, float]:
    """Accelerations that the file allows for a pair of ratios, of which one is 0."""
    if brake:
        low, high = WIRE.pedals.brake.at(brake)
        return -high, -max(low, 0.0)
    return WIRE.pedals.accelerator.at(accelerator) if accelerator else WIRE.pedals.coast_mps2


@given(st.integers(0, 10**9))
def test_what_is_drawn_lies_in_its_bands_and_is_the_same_each_time(seed: int) -> None:
    one, two = (Actuators.drawn(WIRE, random.Random(seed)) for _ in range(2))
    assert one == two
    one.require_within(WIRE)


@pytest.mark.parametrize("name", [each.name for each in dataclasses.fields(Actuators)])
def test_what_lies_outside_of_its_band_is_refused(name: str) -> None:
    low, high = bands(WIRE)[name]
    assert low <= getattr(MIDDLE, name) <= high
    for value in (low - 1e-6, high + 1e-6, math.nan):
        with pytest.raises(InputError, match=name):
            DriveByWireCar(Watched(), WIRE, dataclasses.replace(MIDDLE, **{name: value}))


def test_commands_that_cannot_be_are_refused_and_those_beyond_are_ends() -> None:
    plant, _ = car(AT_ONCE)
    with pytest.raises(InputError, match="finite"):
        told(plant, brake=math.nan)
    with pytest.raises(InputError, match="wheel_rate_radps"):
        told(plant, rate=-1.0)
    told(plant, accelerator=-1.0, brake=3.0, wheel=99.0, rate=5.0)
    plant.advance(5_000_000)
    assert (plant.accelerator, plant.brake) == (0.0, 1.0)
    assert plant.wheel_rad == pytest.approx(WIRE.steering.wheel_limit_rad, abs=0.01)


def test_time_is_counted_in_microseconds() -> None:
    plant, chassis = car(AT_ONCE)
    for _ in range(30):
        plant.advance(33_333)
    assert plant.now_us == 999_990
    assert chassis.at_s == pytest.approx(0.99999)
