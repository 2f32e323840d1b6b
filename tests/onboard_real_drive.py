"""The shipped driving vehicle, built into real bundles, under a real core in the virtual world."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from actuation_cases import granted_text
from onboard_world import Injector, World
from onboard_world_plant import Car, Plant, Truth
from onboard_world_sensors import Walker

from workbench.codegen import MonitorSpec, build_bundle
from workbench.models.vehicle import Vehicle, gem_e2_drive_path, load_vehicle
from workbench.runtime import Deciding, PathTable, Timing, load_bundle
from workbench.runtime.bundle import Bundle
from workbench.runtime.monitor_settings import MonitorSettings
from workbench.runtime.onboard.core import Core, TurnResult
from workbench.runtime.onboard.curve import Curve
from workbench.runtime.onboard.sensors_file import settings_from
from workbench.runtime.onboard.states import Mode, Request, State

ARM_US = 2_500_000
# What `workbench build` takes without --timing and --release-steps.
MONITOR = MonitorSettings(5, 0.2, Timing(period_s=0.12, latency_s=0.1, send_gap_s=0.055))
_NODES = 400
PATH = PathTable(
    -20.0, 0.5, tuple(0.5 * j - 20.0 for j in range(_NODES)), (0.0,) * _NODES, (0.0,) * _NODES,
    (0.0,) * (_NODES - 1), (0.0,) * (_NODES - 1),
)  # fmt: skip
# In the middle of what [drive_by_wire] allows, the pedals a little late.
_TRUTH = Truth(
    accel_per_ratio=7.3454, accel_dead=0.32, brake_per_ratio=8.0, brake_dead=0.0,
    pedal_delay_us=30_000, pedal_build_up_us=80_000, steering_dead_rad=0.008,
    steering_delay_us=20_000, wheel_rate_radps=6.0, sag_mps2=0.03,
)  # fmt: skip


def _vehicle(reference_mps: float) -> Vehicle:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "vehicle.toml"
        file.write_text(granted_text(reference_mps), encoding="utf-8")
        return load_vehicle(file)


SENSORS = gem_e2_drive_path().with_name("gem_e2_sensors.toml").read_text(encoding="utf-8")
"""The shipped ones, word for word."""


@functools.cache
def bundle(reference_mps: float, horizon_s: float, deciding: Deciding) -> Bundle:
    """Built once."""
    spec = MonitorSpec(
        _vehicle(reference_mps), horizon_s, 0.05, deciding=deciding, path=PATH,
        monitor=MONITOR, sensors=SENSORS,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        return load_bundle(build_bundle(spec, Path(folder) / "bundle"))


class FittingPlant(Plant):
    """A plant whose steering is the vehicle's map."""

    road_wheel: Curve

    @property
    def road_wheel_rad(self) -> float:
        return self.road_wheel.middle(self.car.wheel_rad)


class Witness:
    """A core whose every turn is kept beside the car's true state: car, road-wheel angle, turn."""

    def __init__(self, core: Core, plant: Plant) -> None:
        self._core, self._plant = core, plant
        self.seen: list[tuple[Car, float, TurnResult]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._core, name)

    def turn(self, at_us: int, clock: Callable[[], int]) -> TurnResult:
        car, road_rad = replace(self._plant.car), self._plant.road_wheel_rad
        result = self._core.turn(at_us, clock)
        self.seen.append((car, road_rad, result))
        return result


def drive(
    built: Bundle, until_us: int, *, mode: Mode = Mode.DRIVE, car: Car | None = None,
    walkers: Sequence[Walker] = (), injectors: Sequence[Injector] = (),
) -> tuple[World, Witness]:  # fmt: skip
    """From start-up, armed at ARM_US in DRIVE; car: where it stands."""
    assert built.manifest.path is not None
    settings = settings_from(built.manifest, signed=True, tag=0)
    plant = FittingPlant(truth=_TRUTH, car=Car() if car is None else car)
    plant.road_wheel = settings.drive_by_wire.steering.road_wheel
    witness = Witness(Core(built, built.manifest.path, settings, mode=mode), plant)
    sends = mode is not Mode.SHADOW
    core = cast(Core, witness)
    world = World(core, sends=sends, seed=3, plant=plant, walkers=walkers, injectors=injectors)
    if mode is Mode.DRIVE:
        world.notes.asked = [(ARM_US, Request.ARM)]
    return world.run(until_us), witness


def outside(witness: Witness) -> list[str]:
    """Observations that do not hold the truth, named."""
    wrong = []
    for car, road_rad, turn in witness.seen:
        seen = turn.observation
        truth = {
            "x": car.x_m, "y": car.y_m, "heading": car.heading, "steering": road_rad,
            "speed": car.speed_mps,
        }  # fmt: skip
        for name, value in truth.items():
            if seen is not None and not getattr(seen, name)[0] <= value <= getattr(seen, name)[1]:
                wrong.append(f"{turn.at_us} us: {name} {value!r} of {seen}")
    return wrong


def decided(witness: Witness, state: State) -> list[Any]:
    """The decisions of turns that ended in a state."""
    turns = [turn for _, _, turn in witness.seen if turn.state is state]
    return [turn.decision for turn in turns if turn.decision is not None]


def faults(witness: Witness, *, since_us: int) -> set[str]:
    """Names of all that was found from an instant on."""
    turns = (turn for _, _, turn in witness.seen if turn.at_us >= since_us)
    return {found.fault.name for turn in turns for found in turn.faults}
