"""What the plants cost, and how far each is from the bicycle.

`python -m workbench.bench.plant_cost` prints two tables and takes about 10 s.
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, final

from workbench.bench.text import table
from workbench.errors import InputError
from workbench.models.vehicle import Vehicle, gem_e2_drive_path, load_vehicle
from workbench.simulation.plants.actuators import Actuators, DriveByWireCar
from workbench.simulation.plants.chassis import Chassis, Motion, Start
from workbench.simulation.plants.make import PLANTS, chassis, chassis_at

STEP_S: Final = 0.005
# Acceleration (m/s^2), rate of the road wheels (rad/s), duration (s): from rest to 2.8 m/s, a bend
# to the left at 0.3 rad, one to the right, straight on, braking, standing.
MANOEUVRE: Final = (
    (0.7, 0.0, 4.0), (0.0, 0.0, 2.0), (0.0, 0.15, 2.0), (0.0, 0.0, 3.0), (0.0, -0.15, 4.0),
    (0.0, 0.0, 3.0), (0.0, 0.15, 2.0), (0.0, 0.0, 2.0), (-2.0, 0.0, 3.0),
)  # fmt: skip
_ROUNDS: Final = 7
_WINDOW: Final = 600
_EVERY: Final = 100
_COMMAND_US: Final = 33_333


@final
@dataclass(frozen=True, slots=True)
class PlantCost:
    """Of one plant: first_s until it can be used in a process, step_us of 5 ms alone and
    driven_us with actuators around it, median of rounds over the manoeuvre."""

    plant: str
    first_s: float
    step_us: float
    driven_us: float


@final
@dataclass(frozen=True, slots=True)
class Mismatch:
    """The most by which a plant differs from the bicycle.

    acceleration_mps2: of speed from what was asked, while it moves; yaw_rate_radps: from v
    tan(steering) / L; lateral_mps: of the middle of the rear axle. Then after 3 s from the same
    start with the same inputs: ahead and aside of the bicycle, m, in heading, rad, and speed, m/s.
    """

    plant: str
    acceleration_mps2: float
    yaw_rate_radps: float
    lateral_mps: float
    ahead_m: float
    aside_m: float
    heading_rad: float
    speed_mps: float


def plant_cost(plant: str, vehicle: Vehicle) -> PlantCost:
    """Time of the manoeuvre on this core. Raises InputError as `chassis` does."""
    begun = time.perf_counter()
    _started(plant, vehicle)
    first_s = time.perf_counter() - begun
    steps = len(inputs())
    alone = _median_s(lambda: driven(_started(plant, vehicle), inputs()))
    with_wire = _median_s(lambda: _with_actuators(_started(plant, vehicle), vehicle, steps))
    return PlantCost(plant, first_s, 1e6 * alone / steps, 1e6 * with_wire / steps)


def mismatch(plant: str, vehicle: Vehicle) -> Mismatch:
    """Over the manoeuvre. Raises InputError as `chassis` does."""
    asked = inputs()
    motions = driven(_started(plant, vehicle), asked)
    moving = [(a, m) for (a, _), m in zip(asked, motions[1:], strict=True) if m.speed_mps > 0.0]
    wheelbase_m = vehicle.geometry.wheelbase_m
    ends = [
        _apart(motions[k + _WINDOW], _by_bicycle(motions[k], asked[k : k + _WINDOW], vehicle))
        for k in range(0, len(asked) - _WINDOW + 1, _EVERY)
    ]
    return Mismatch(
        plant,
        max(abs(m.acceleration_mps2 - a) for a, m in moving),
        max(
            abs(m.yaw_rate_radps - m.speed_mps * math.tan(m.road_wheel_rad) / wheelbase_m)
            for _, m in moving
        ),
        max(abs(m.lateral_mps) for _, m in moving),
        *(max(end[j] for end in ends) for j in range(4)),
    )


def inputs() -> list[tuple[float, float]]:
    """Acceleration and steering rate of every step of the manoeuvre."""
    return [(a, u) for a, u, duration_s in MANOEUVRE for _ in range(round(duration_s / STEP_S))]


def driven(plant: Chassis, asked: Iterable[tuple[float, float]]) -> list[Motion]:
    """The motion before the first and after every step."""
    motions = [plant.motion]
    for acceleration, rate in asked:
        plant.advance(acceleration, rate, STEP_S)
        motions.append(plant.motion)
    return motions


def _started(plant: str, vehicle: Vehicle) -> Chassis:
    return chassis(plant, vehicle, x_m=0.0, y_m=0.0, heading=0.0)


def _by_bicycle(begin: Motion, asked: Iterable[tuple[float, float]], vehicle: Vehicle) -> Motion:
    start = Start(begin.x_m, begin.y_m, begin.heading, begin.speed_mps, begin.road_wheel_rad)
    return driven(chassis_at("bicycle", vehicle, start), asked)[-1]


def _apart(plant: Motion, bicycle: Motion) -> tuple[float, float, float, float]:
    x_m, y_m = plant.x_m - bicycle.x_m, plant.y_m - bicycle.y_m
    cos, sin = math.cos(bicycle.heading), math.sin(bicycle.heading)
    return (
        abs(cos * x_m + sin * y_m), abs(cos * y_m - sin * x_m),
        abs(plant.heading - bicycle.heading), abs(plant.speed_mps - bicycle.speed_mps),
    )  # fmt: skip


def _with_actuators(plant: Chassis, vehicle: Vehicle, steps: int) -> None:
    wire = vehicle.drive_by_wire
    if wire is None:
        raise InputError("expected a vehicle with [drive_by_wire], got one without; choose another")
    car = DriveByWireCar(plant, wire.value, Actuators.middle(wire.value))
    for turn in range(round(steps * STEP_S * 1e6) // _COMMAND_US):
        fast = car.motion.speed_mps > 2.8
        car.command(
            accelerator=0.0 if fast else 0.4, brake=0.0, wheel_rad=4.0 * math.sin(turn / 60.0),
            wheel_rate_radps=3.0,
        )  # fmt: skip
        car.advance(_COMMAND_US)


def _median_s(work: Callable[[], object]) -> float:
    times = []
    for _ in range(_ROUNDS):
        begun = time.process_time()
        work()
        times.append(time.process_time() - begun)
    return statistics.median(times)


def plant_text(costs: Iterable[PlantCost], found: Iterable[Mismatch]) -> str:
    """Both as tables."""
    cost_rows = [
        [cost.plant, f"{cost.first_s:.2f}", f"{cost.step_us:.1f}",
         f"{1e6 * STEP_S / cost.step_us:.0f}", f"{cost.driven_us:.1f}",
         f"{1e6 * STEP_S / cost.driven_us:.0f}"]
        for cost in costs
    ]  # fmt: skip
    rows = [
        [each.plant, f"{each.acceleration_mps2:.3f}", f"{each.yaw_rate_radps:.4f}",
         f"{each.lateral_mps:.4f}", f"{each.ahead_m:.3f}", f"{each.aside_m:.3f}",
         f"{each.heading_rad:.4f}", f"{each.speed_mps:.3f}"]
        for each in found
    ]  # fmt: skip
    headings = ["plant", "first use s", "us per 5 ms", "times real time", "with actuators us",
                "times real time"]  # fmt: skip
    others = ["most from the bicycle", "m/s^2", "rad/s", "m/s aside", "after 3 s: ahead m",
              "aside m", "heading rad", "speed m/s"]  # fmt: skip
    return f"{table(headings, cost_rows)}\n\n{table(others, rows)}\n"


def main() -> None:
    """Print the tables for the shipped vehicle."""
    vehicle = load_vehicle(gem_e2_drive_path())
    costs = [plant_cost(plant, vehicle) for plant in PLANTS]
    sys.stdout.write(plant_text(costs, [mismatch(plant, vehicle) for plant in PLANTS]))


if __name__ == "__main__":
    main()
