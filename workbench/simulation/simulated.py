"""The shipped vehicle that simulations drive, and its bundle on a rig."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Final

from workbench.codegen import MonitorSpec, build_bundle
from workbench.codegen.bundle import LEVELS as NESTED
from workbench.codegen.localiser import LocaliserSpec, localiser_files, write_localiser
from workbench.errors import InputError
from workbench.estimation.localisation_sets import LEVELS, EllipsoidHull
from workbench.estimation.localisation_site import Site, load_site
from workbench.models.vehicle import Vehicle, load_vehicle
from workbench.runtime import Timing, load_bundle
from workbench.runtime.contents import NestedLevel
from workbench.runtime.localiser.folder import Built, load_localiser
from workbench.runtime.localiser.numbers import Clocks
from workbench.runtime.localiser.numbers import Vehicle as ReportedVehicle
from workbench.runtime.monitor_settings import MonitorSettings
from workbench.simulation.onboard_car import straight_road
from workbench.simulation.rig import Rig

STEP_S: Final = 0.05
HORIZON_S: Final = 3.0
MONITOR: Final = MonitorSettings(5, 0.2, Timing(period_s=0.12, latency_s=0.1, send_gap_s=0.055))
"""Five SAFE in a row release LookAhead's brake; 0.2 m of clearance."""
_CLOCKS: Final = Clocks(report_delay_us=0, range_delay_us=(0, 15_000), drift_ppm=100)
"""What `workbench build-localiser` takes by default."""


def simulated_path() -> Path:
    """The vehicle file: a GEM e2 with softer gains and what its simulated sensors reach."""
    return Path(__file__).parent / "data" / "gem_e2_simulated.toml"


def simulated_sensors() -> str:
    """The text of its sensors' file."""
    return simulated_path().with_name("gem_e2_simulated_sensors.toml").read_text(encoding="utf-8")


def street_path() -> Path:
    """The site file: beacons around the paths of the library's scenarios."""
    return simulated_path().with_name("street_beacons.toml")


def ranged_sensors() -> str:
    """The text of the sensors' file of a car with its own localiser."""
    return simulated_path().with_name("gem_e2_ranged_sensors.toml").read_text(encoding="utf-8")


def build_localiser(
    folder: Path | None = None, *, vehicle: Vehicle | None = None, site: Site | None = None
) -> Built:
    """Compile the vehicle's localiser for a site, as `workbench build-localiser` does, and load it.

    folder: as of `build_rig`; vehicle, site: the shipped ones where None. Its sets are those of
    99.9 %. Raises InputError for a vehicle without [drive_by_wire].
    """
    if folder is None:
        with tempfile.TemporaryDirectory() as place:
            return build_localiser(Path(place) / "localiser", vehicle=vehicle, site=site)
    chosen = load_vehicle(simulated_path()) if vehicle is None else vehicle
    wire = chosen.drive_by_wire
    if wire is None:
        raise InputError(
            "vehicle: expected one with [drive_by_wire], which says what its reports mean, got one "
            "without; take the shipped one, or add the section"
        )
    spec = LocaliserSpec(
        load_site(street_path()) if site is None else site,
        ReportedVehicle(
            name=chosen.name, protocol=wire.value.protocol,
            wheelbase_m=chosen.geometry.wheelbase_m, road_wheel=wire.value.steering.road_wheel,
            speed_scale=0.0, steering_zero_rad=0.0,
        ),
        _CLOCKS, EllipsoidHull(), LEVELS[-1],
    )  # fmt: skip
    write_localiser(localiser_files(spec), folder, replaces=False)
    return load_localiser(folder, public_key=None)


def build_rig(
    folder: Path | None = None,
    *,
    vehicle: Vehicle | None = None,
    horizon_s: float = HORIZON_S,
    sensors: str | None = None,
    levels: tuple[NestedLevel, ...] = NESTED,
    deciding_alone: bool = False,
) -> Rig:
    """Compile a bundle and put it on a rig; some seconds.

    folder: where the bundle stays, which must not exist; None for nowhere (it is loaded then, and
    its files are gone). vehicle, sensors: the shipped ones where None. `LookAhead` looks horizon_s
    ahead. levels: nested sets, the first of which decides. deciding_alone: without those that only
    inform; decisions are the same, and quicker.
    """
    if folder is None:
        with tempfile.TemporaryDirectory() as place:
            return build_rig(
                Path(place) / "bundle", vehicle=vehicle, horizon_s=horizon_s, sensors=sensors,
                levels=levels, deciding_alone=deciding_alone,
            )  # fmt: skip
    chosen = load_vehicle(simulated_path()) if vehicle is None else vehicle
    levels = levels[:1] if deciding_alone else levels
    spec = MonitorSpec(
        chosen, horizon_s, STEP_S, levels=levels, deciding_level=levels[0].name,
        path=straight_road(-20.0, 180.0), monitor=MONITOR,
        sensors=simulated_sensors() if sensors is None else sensors,
    )  # fmt: skip
    return Rig(load_bundle(build_bundle(spec, folder)), chosen)
