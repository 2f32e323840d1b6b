"""What `workbench simulate` drives: the scenario, the rig, and who estimates intents."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import positive
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.estimation.people_estimator import PeopleEstimator
    from workbench.models.vehicle import Vehicle
    from workbench.runtime import Bundle
    from workbench.simulation.rig import Rig
    from workbench.simulation.scenarios.scenario import Expected, Scenario

THRESHOLD: Final = 0.26
LEVEL: Final = 0.9
_HEADROOM: Final = 1.2
_BEYOND_S: Final = 0.5
_MOST_AGE_S, _GONE_AGE_S = 0.5, 1.0
_GEOMETRY_TOLERANCE_M: Final = 0.02
_ROUNDING: Final = 1e-9
_LOOK_M: Final = 0.05
_NEEDED: Final = ("drive_by_wire", "monitor", "sensors")


def chosen_scenario(text: str) -> tuple[Scenario, tuple[str, ...]]:
    """The scenario of that name or file, and what its import left out.

    Raises InputError for an unknown name and a broken file.
    """
    from workbench.simulation.scenarios.scenario_file import load_scenario
    from workbench.simulation.scenarios.shipped import library, named, suggestion

    if text in library():
        return named(text), ()
    file = Path(text)
    if text.endswith((".xml", ".xml.gz")):
        # CommonRoad is read only where it is asked for.
        from workbench.simulation.scenarios.commonroad import from_commonroad

        imported = from_commonroad(file)
        return imported.scenario, imported.notes
    if file.suffix == ".toml":
        return load_scenario(file), ()
    raise InputError(
        f"expected the name of a scenario (`workbench simulate --list` has all), a .toml or a "
        f"CommonRoad .xml, got {text!r}{suggestion(text)}"
    )


def expected_of(scenario: Scenario, policy: str) -> Expected:
    """What the scenario expects of a policy; ANY, so no contact, where it says nothing."""
    from workbench.simulation.scenarios.scenario import Expected

    return scenario.expected.get(policy, Expected.ANY)


def add_rig_options(parser: argparse.ArgumentParser, *, bundle: str) -> None:
    """Add `--horizon`, `--vehicle`, `--sensors` and `--bundle`, which `chosen_rig` reads; bundle:
    the help of the last."""
    parser.add_argument("--horizon", type=positive, metavar="S", help="of LookAhead (default: 3)")
    parser.add_argument(
        "--vehicle", type=Path, metavar="FILE", help="vehicle file (default: the simulated GEM e2)"
    )
    parser.add_argument(
        "--sensors", type=Path, metavar="FILE", help="sensors file (default: of the same)"
    )
    parser.add_argument("--bundle", type=Path, metavar="DIR", help=bundle)


def require_rig_options(args: argparse.Namespace) -> None:
    """Raise InputError where a bundle is named beside what it already says, and for a horizon that
    no bundle can be built for."""
    if args.bundle is not None and (args.horizon is not None or args.sensors is not None):
        raise InputError(
            "--bundle: expected without --horizon and --sensors, which are the bundle's own; leave "
            "them out, or leave it out to build one"
        )

    if args.horizon is not None:
        _require_horizon(args.horizon)


def _require_horizon(horizon_s: float) -> None:
    from workbench.codegen.bundle import MOST_STEPS
    from workbench.simulation.simulated import STEP_S

    steps = horizon_s / STEP_S
    if not (1.0 - _ROUNDING <= steps <= MOST_STEPS and abs(steps - round(steps)) <= _ROUNDING):
        raise InputError(
            f"--horizon: expected {STEP_S:g} to {MOST_STEPS * STEP_S:g} s in whole steps of "
            f"{STEP_S:g} s, got {horizon_s:g}; 3 is usual"
        )


def require_steerable(scenario: Scenario, vehicle: Vehicle) -> None:
    """Raise InputError for a path that bends more than the car can steer:
    |curvature| <= tan(steering_rad) / wheelbase_m."""
    import numpy as np

    path, angle_rad = scenario.path, vehicle.limits.steering_rad
    most = math.tan(angle_rad) / vehicle.geometry.wheelbase_m
    stations = np.linspace(0.0, path.length_m, max(2, math.ceil(path.length_m / _LOOK_M)))
    bends = np.abs(path.curvature(stations))
    worst = int(np.argmax(bends))
    if bends[worst] > most:
        raise InputError(
            f"{scenario.name}: expected a path with a curvature of at most {most:.3g} 1/m, what "
            f"{vehicle.name} can steer (tan of {angle_rad:g} rad over its wheelbase), got "
            f"{bends[worst]:.3g} 1/m at station {stations[worst]:.1f} m; move the waypoints there "
            "apart, or leave some out"
        )


def chosen_vehicle(args: argparse.Namespace) -> Vehicle:
    """That of `--vehicle`, or the shipped simulated one."""
    from workbench.models.vehicle import load_vehicle
    from workbench.simulation.simulated import simulated_path

    return load_vehicle(args.vehicle or simulated_path())


def chosen_sensors(args: argparse.Namespace) -> str | None:
    """The text of `--sensors`, None for the shipped ones."""
    if args.sensors is None:
        return None
    try:
        text: str = args.sensors.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"--sensors: expected a file that can be read, got {error}") from error
    return text


def chosen_rig(
    args: argparse.Namespace, folder: Path | None = None, *, ranged: bool = False
) -> Rig:
    """The bundle of `--bundle`, or one that is built (into `folder`, where one is given).

    ranged: for a car that its own localiser tells where it is; its sensors file is another.
    Raises InputError for a bundle that cannot drive, or is for a car of another shape.
    """
    from workbench.runtime import load_bundle
    from workbench.simulation.rig import Rig
    from workbench.simulation.simulated import HORIZON_S, build_rig, ranged_sensors

    vehicle = chosen_vehicle(args)
    if args.bundle is None:
        sensors = chosen_sensors(args)
        if sensors is None and ranged:
            sensors = ranged_sensors()
        return build_rig(
            folder, vehicle=vehicle, horizon_s=args.horizon or HORIZON_S, sensors=sensors
        )
    bundle = load_bundle(args.bundle)
    require_fit(bundle, vehicle, args.bundle)
    return Rig(bundle, vehicle)


def require_fit(bundle: Bundle, vehicle: Vehicle, folder: Path) -> None:
    """Raise InputError unless the bundle can drive this car."""
    missing = [name for name in _NEEDED if getattr(bundle.manifest, name) is None]
    if missing:
        raise InputError(
            f"--bundle: expected one that is built for driving, got {folder}, which lacks "
            f"{', '.join(missing)}; build it with --sensors and --path, or leave --bundle out"
        )
    for key in ("wheelbase_m", "front_m", "rear_m", "half_width_m"):
        have, want = getattr(bundle.manifest.vehicle, key), getattr(vehicle.geometry, key)
        if abs(have - want) > _GEOMETRY_TOLERANCE_M:
            raise InputError(
                f"--bundle: expected one for a car with {key} = {want:g}, got {folder} with "
                f"{have:g}; name its vehicle file with --vehicle"
            )


def require_goals(scenario: Scenario) -> None:
    """Raise InputError for a scenario without goals."""
    if not scenario.goals:
        raise InputError(
            f"--intents: expected a scenario with [[goals]], got {scenario.name} without; add "
            "where people may want to go, or leave --intents out"
        )


def chosen_estimator(rig: Rig, scenario: Scenario) -> PeopleEstimator:
    """Who finds out what people want: one of the scenario's goals, or none of them."""
    from workbench.estimation.intent_cloud import FilterSettings, NumpyUpdate
    from workbench.estimation.motion_filter import MotionNumbers
    from workbench.estimation.motion_parameters import shipped_motion
    from workbench.estimation.people_estimator import Bodies, EstimatorSettings, PeopleEstimator
    from workbench.estimation.person_intents import EveryIntent
    from workbench.runtime import MotionLimits
    from workbench.simulation.people import PeopleModel

    motion, models, guard = shipped_motion(), PeopleModel.assumed(), rig.vehicle.guard
    error_m = scenario.sensing.person_m
    # Errors uniform in a disc have half its radius as their deviation in x and in y.
    numbers = MotionNumbers(max(0.5 * error_m, 0.01), *motion.numbers.row[1:])
    until_s = rig.bundle.manifest.horizon_s + _BEYOND_S
    return PeopleEstimator(
        EstimatorSettings(
            goals=scenario.goals, intents=FilterSettings.chosen(), update=NumpyUpdate(),
            motion=numbers, forwarding=EveryIntent(motion, THRESHOLD, LEVEL, until_s),
            guards=models.guards(MotionLimits(guard.speed_max_mps, guard.accel_max_mps2)),
            bodies=Bodies(models.on_foot.body_radius_m, models.on_wheels.body_radius_m, error_m),
            max_age_s=_MOST_AGE_S, gone_age_s=_GONE_AGE_S, headroom=_HEADROOM, seed=1,
        )
    )  # fmt: skip
