"""A core around the fake bundle, set up for the car of the virtual world, and turns by hand."""

from __future__ import annotations

import functools
from array import array
from dataclasses import replace
from typing import Any

import runtime_fixture
from runtime_fixture import FLAGS, LEVELS, NODES, PARAMETERS, compiled, fake_manifest
from runtime_world import arc_table

from workbench.runtime import Bundle, PathTable
from workbench.runtime.contents import Kernel, Manifest, Parameter
from workbench.runtime.layout import query_counts, tile
from workbench.runtime.manifest import Golden
from workbench.runtime.native import NativeKernel
from workbench.runtime.onboard.actuation import Curve, DriveByWire, Pedals, Steering, Wanted
from workbench.runtime.onboard.core import Core, Mode
from workbench.runtime.onboard.limits import pacmod2_limits
from workbench.runtime.onboard.onboard_settings import OnboardSettings, ReadingErrors
from workbench.runtime.onboard.sensor_bounds import PersonBounds, SensorBounds
from workbench.runtime.onboard.stamps import StampBounds
from workbench.runtime.person_guard import MotionLimits
from workbench.runtime.policies import BrakeBounds, Timing

MAKER = 0x353243
_LAW = {
    "wheelbase": 1.75, "steering_min": -0.5, "steering_max": 0.5, "look_ahead": 2.0,
    "steering_gain_proportional": 0.6, "steering_gain_integral": 0.05,
    "steering_gain_derivative": 1.0, "steering_rate_min": -0.2, "steering_rate_max": 0.2,
    "speed_gain_proportional": 1.0, "speed_gain_integral": 0.1, "acceleration_min": -2.0,
    "acceleration_max": 1.0,
}  # fmt: skip
DRIVE_BY_WIRE = DriveByWire(
    protocol="pacmod2",
    turn_s=0.058,
    speed_error_mps=0.03,
    stop_speed_mps=0.2,
    steering=Steering(
        road_wheel=Curve((-11.0, 0.0, 11.0), (-0.56, -0.005, 0.54), (-0.54, 0.005, 0.56)),
        angle_limit_rad=0.5,
        rate_limit_radps=0.2,
        slew_radps2=10.0,
        wheel_limit_rad=10.5,
        wheel_rate_limit_radps=4.5,
        wheel_rate_floor_radps=0.5,
        lead_s=0.1,
        dead_band_rad=0.02,
        rate_error=0.1,
        delay_s=(0.0, 0.06),
        build_up_s=(0.0, 0.1),
        report_error_rad=0.02,
        report_age_s=0.05,
        withheld_radps=0.4,
    ),
    pedals=Pedals(
        accelerator=Curve((0.3, 1.0), (-0.2, 4.0), (0.2, 4.4)),
        brake=Curve((0.05, 1.0), (-0.2, 7.4), (0.2, 7.8)),
        accel_min_mps2=-2.0,
        accel_max_mps2=1.0,
        slew_mps3=30.0,
        coast_below_mps2=0.15,
        coast_mps2=(-0.2, 0.0),
        accelerator_limit=0.6,
        brake_limit=0.8,
        brake_profile=0.45,
        delay_s=(0.0, 0.1),
        build_up_s=(0.0, 0.2),
        withheld_mps2=3.5,
    ),
)
SENSORS = SensorBounds(
    stamps=StampBounds(delay_us=(1_000, 60_000), drift_ppm=200, window_us=5_000_000),
    report_delay_us=(0, 20_000),
    speed_gain=(1.0, 1.0),
    speed_error_mps=0.03,
    speed_range_mps=(-1.0, 8.0),
    acceleration_mps2=(-6.0, 3.0),
    steering_wheel_error_rad=0.02,
    steering_wheel_limit_rad=10.9,
    road_wheel=lambda angle: DRIVE_BY_WIRE.steering.road_wheel.effect((angle, angle)),
    steering_limit_rad=0.6,
    steering_rate_radps=0.4,
    wheelbase_m=(1.74, 1.76),
    on_foot=PersonBounds(MotionLimits(2.5, 2.0), 0.1),
    on_wheels=PersonBounds(MotionLimits(7.0, 3.0), 0.2),
    unseen_speed_mps=2.5,
    localisation_age_us=900_000,
    people_age_us=600_000,
    report_age_us=100_000,
)
SETTINGS = OnboardSettings(
    timing=Timing(period_s=0.12, latency_s=0.05, send_gap_s=0.058),
    release_steps=1,
    clearance_required_m=0.5,
    start_station_m=None,
    reference_speed_mps=2.8,
    drive_by_wire=DRIVE_BY_WIRE,
    sensors=SENSORS,
    limits=pacmod2_limits(localisation_age_us=900_000, people_age_us=600_000),
    reading=ReadingErrors(offset_m=1.0, heading_rad=0.5, speed_mps=1.0),
    gate=Wanted(0.1, 0.01),
    maker=MAKER,
    signed=True,
    bundle_tag=0xA5,
)


@functools.cache
def bundle(kind: int = 0) -> Bundle:
    """The fake kernel in a loop that has all parameters of the control law; kind: of mischief."""
    parameters = (
        PARAMETERS[0],
        replace(PARAMETERS[1], nominal=float(kind)),
        *(Parameter(name, "1", value, value, value) for name, value in _LAW.items()),
    )
    counts = query_counts(
        states=7, parameters=len(parameters), path_nodes=NODES, levels=len(LEVELS)
    )
    query = tile({**counts, "acceleration_bound": 1}, defaults={"acceleration_bound": (1.0,)})
    size = query[-1].offset + query[-1].count
    usual = fake_manifest()
    kernel = Kernel("wb_decide", size, usual.kernel.result_size, 4)
    native = NativeKernel(compiled(_source(query, size), FLAGS), kernel)
    native.query[:] = memoryview(array("d", [0.0] * size))
    returns = native.run()
    golden = Golden((0.0,) * size, tuple(native.result.tolist()), returns)
    manifest: Manifest = replace(
        usual, kernel=kernel, query=query, parameters=parameters, golden=(golden,),
        brake=BrakeBounds(deceleration_min_mps2=2.0, delay_s=0.15, build_up_s=0.2),
    )  # fmt: skip
    return Bundle(manifest, native, "0" * 64)


def _source(query: Any, size: int) -> str:
    """The fake kernel's text with this query's layout in place of its own."""
    lines = runtime_fixture.fake_source().splitlines()
    kept = [line for line in lines if not line.startswith(("#define Q_", "#define QUERY_SIZE"))]
    macros = [f"#define Q_{field.name} {field.offset}" for field in query]
    return "\n".join([*macros, f"#define QUERY_SIZE {size}", *kept])


PATH = arc_table(0.0, nodes=500)


def core(mode: Mode = Mode.DRIVE, *, kind: int = 0, path: PathTable = PATH, **changed: Any) -> Core:
    """A core, on a straight path along x if nothing else is said."""
    return Core(bundle(kind), path, replace(SETTINGS, **changed), mode=mode)
