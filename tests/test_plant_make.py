"""Every plant starts where it is told to and keeps to the vehicle's wheelbase and limits."""

from __future__ import annotations

import math
import random
from importlib.util import find_spec

import pytest

from workbench.errors import InputError
from workbench.models.vehicle import gem_e2, gem_e2_drive_path, load_vehicle
from workbench.simulation.plants.actuators import Actuators, DriveByWireCar
from workbench.simulation.plants.chassis import Start
from workbench.simulation.plants.make import PLANTS, chassis, chassis_at

_SECTION = load_vehicle(gem_e2_drive_path()).drive_by_wire
assert _SECTION is not None
WIRE = _SECTION.value
KINDS = [
    pytest.param(kind, marks=pytest.mark.skipif(kind == "multi-body" and not found, reason="extra"))
    for found in [find_spec("vehiclemodels")]
    for kind in PLANTS
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("speed_mps", [0.0, 2.0])
def test_it_starts_where_it_is_told_to_and_rolls_straight_on(kind: str, speed_mps: float) -> None:
    plant = chassis(kind, gem_e2(), x_m=3.0, y_m=-1.0, heading=2.0, speed_mps=speed_mps)
    begin = plant.motion
    assert (begin.x_m, begin.y_m, begin.heading) == pytest.approx((3.0, -1.0, 2.0))
    assert (begin.speed_mps, begin.road_wheel_rad, begin.yaw_rate_radps) == (speed_mps, 0.0, 0.0)
    plant.advance(0.0, 0.0, 0.5)
    end = plant.motion
    way = 0.5 * speed_mps
    expected = (3.0 + way * math.cos(2.0), -1.0 + way * math.sin(2.0))
    assert (end.x_m, end.y_m) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("kind", KINDS)
def test_a_gentle_curve_has_the_radius_of_the_wheelbase(kind: str) -> None:
    plant = chassis(kind, gem_e2(), x_m=0.0, y_m=0.0, heading=0.0, speed_mps=2.0)
    plant.advance(0.0, 0.1, 1.0)
    for _ in range(60):
        plant.advance(2.0 - plant.motion.speed_mps, 0.0, 0.05)
    m = plant.motion
    assert m.yaw_rate_radps == pytest.approx(m.speed_mps * math.tan(0.1) / 1.75, rel=0.06)
    assert m.road_wheel_rad == pytest.approx(0.1)


@pytest.mark.parametrize("kind", KINDS)
def test_its_wheels_turn_no_further_than_the_vehicle_s(kind: str) -> None:
    plant = chassis(kind, gem_e2(), x_m=0.0, y_m=0.0, heading=0.0)
    plant.advance(0.0, -0.5, 3.0)
    assert plant.motion.road_wheel_rad == -gem_e2().limits.steering_rad


@pytest.mark.parametrize("kind", KINDS)
def test_a_start_in_a_curve_goes_on_in_it(kind: str) -> None:
    start = Start(0.0, 0.0, 1.0, 2.0, 0.2)
    plant = chassis_at(kind, gem_e2(), start)
    turning = 2.0 * math.tan(0.2) / 1.75
    begin = plant.motion
    assert (begin.x_m, begin.y_m, begin.heading) == pytest.approx((0.0, 0.0, 1.0))
    assert (begin.speed_mps, begin.road_wheel_rad) == pytest.approx((2.0, 0.2))
    assert (begin.yaw_rate_radps, begin.lateral_mps) == pytest.approx((turning, 0.0))
    plant.advance(0.0, 0.0, 0.5)
    assert plant.motion.heading - 1.0 == pytest.approx(0.5 * turning, rel=0.1)
    with pytest.raises(InputError, match="road wheels within"):
        chassis_at(kind, gem_e2(), Start(0.0, 0.0, 0.0, 2.0, -0.7))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [1, 2, 3, 40])
def test_wild_commands_give_motion_that_a_car_can_have(kind: str, seed: int) -> None:
    source = random.Random(seed)
    start = Start(0.0, 0.0, source.uniform(-3.0, 3.0), source.choice([0.0, 1.0, 2.8]))
    car = DriveByWireCar(chassis_at(kind, gem_e2(), start), WIRE, Actuators.drawn(WIRE, source))
    before, told = car.motion, (0.0, 0.0, 0.0, 0.0)
    for turn in range(300):
        if turn % 20 == 0:
            told = (
                source.choice([0.0, 0.36, 0.48]), source.choice([0.0, 0.0, 0.1, 0.8]),
                source.choice([0.0, 2.0, -10.98, 10.98]), source.uniform(0.1, 5.0),
            )  # fmt: skip
        push = 0.0 if told[1] or before.speed_mps > 4.0 else told[0]
        car.command(accelerator=push, brake=told[1], wheel_rad=told[2], wheel_rate_radps=told[3])
        car.advance(33_333)
        now = car.motion
        gained = (now.speed_mps - before.speed_mps) / 0.033333
        assert now.speed_mps >= 0.0
        assert -7.5 < gained < 1.5
        way_m = math.hypot(now.x_m - before.x_m, now.y_m - before.y_m)
        fastest = max(math.hypot(m.speed_mps, m.lateral_mps) for m in (before, now))
        assert way_m <= 0.033333 * fastest + 0.003
        assert abs(now.road_wheel_rad) <= 0.6
        before = now


def test_another_kind_is_refused() -> None:
    with pytest.raises(InputError, match="bicycle, single-track, multi-body, got 'tank'"):
        chassis("tank", gem_e2(), x_m=0.0, y_m=0.0, heading=0.0)
