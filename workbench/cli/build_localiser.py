"""`workbench build-localiser`: compile the localiser of a site into a folder for the vehicle."""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.common import chosen_vehicle
from workbench.cli.output import emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.estimation.localisation_site import Site
    from workbench.runtime.localiser.numbers import Vehicle

HELP = (
    "Compiles the localiser of a site file into a folder: shared object, C text, all numbers, "
    "checksums. `workbench-localiser` runs it on a vehicle's bus. The folder is loaded and tried "
    "before success is reported; see docs/localisation.md."
)
EXAMPLE = """\
workbench build-localiser hall.toml --out out/localiser
workbench build-localiser hall.toml --vehicle my_shuttle.toml --level 0.99 --out out/localiser
workbench build-localiser hall.toml --key ~/keys/shuttle.key --out out/localiser --force
"""
SHAPES: Final = ("ellipsoid", "union")
_LEVELS: Final = (0.9, 0.99, 0.999)
# What a driver does, where the program does not hear the commands: m/s^2 and rad/s per sqrt(Hz).
_UNHEARD: Final = (1.0, 0.2)


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "site", type=Path, metavar="SITE.toml",
        help="site file: beacons, antenna, and what the estimate may assume",
    )  # fmt: skip
    parser.add_argument(
        "--vehicle", type=Path, metavar="FILE",
        help="vehicle file with [drive_by_wire] (default: the shipped one, which `workbench new "
        "drive NAME` writes)",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder of the localiser"
    )
    parser.add_argument("--force", action="store_true", help="replace a localiser that is there")
    parser.add_argument(
        "--key", type=Path, metavar="FILE", help="private key that signs the folder at once"
    )
    parser.add_argument(
        "--level", type=float, choices=_LEVELS, default=_LEVELS[-1],
        help="joint confidence of the sets sent (default: 0.999, the largest sets)",
    )  # fmt: skip
    parser.add_argument(
        "--shape", choices=SHAPES, default=SHAPES[0],
        help="of the sets: ellipsoid, its hull, or union, narrower and without room for strays "
        "(default: ellipsoid)",
    )  # fmt: skip
    _add_vehicle_numbers(parser)


def _add_vehicle_numbers(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--speed-scale", type=float, default=0.0, metavar="S",
        help="reported over true speed, less 1, as `commission` found it (default: 0)",
    )  # fmt: skip
    parser.add_argument(
        "--steering-zero", type=float, default=0.0, metavar="RAD",
        help="road-wheel angle reported when driving straight ahead, as `commission` found it "
        "(default: 0)",
    )  # fmt: skip
    parser.add_argument(
        "--unheard", type=float, nargs=2, default=_UNHEARD, metavar=("ACCELERATION", "RATE"),
        help="what the driver does at least, m/s^2 and rad/s per sqrt(Hz): the program does not "
        "hear the commands, so the site's [motion] acceleration and steering_rate are raised to "
        f"these (default: {_UNHEARD[0]:g} {_UNHEARD[1]:g})",
    )  # fmt: skip
    parser.add_argument(
        "--range-delay", type=float, nargs=2, default=(0.0, 0.015), metavar=("LEAST", "MOST"),
        help="from a range's instant to its frame's arrival, s; what comes later is refused "
        "(default: 0 0.015)",
    )  # fmt: skip
    parser.add_argument(
        "--report-delay", type=float, default=0.0, metavar="S",
        help="from what a report is about to its arrival, s (default: 0)",
    )  # fmt: skip
    parser.add_argument(
        "--drift", type=int, default=100, metavar="PPM",
        help="how much faster or slower the clock of the ranges runs at most (default: 100)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Build, load and report."""
    from workbench.cli.private_key import read_private_key, signature_file
    from workbench.codegen.localiser import (
        LocaliserSpec,
        localiser_files,
        require_place,
        write_localiser,
    )
    from workbench.estimation.localisation_sets import EllipsoidHull, UnionBound
    from workbench.estimation.localisation_site import load_site
    from workbench.runtime.contents import CHECKSUM_FILE
    from workbench.runtime.localiser.core import behind_us
    from workbench.runtime.localiser.folder import LIBRARY_FILE, load_localiser
    from workbench.runtime.localiser.numbers import Clocks
    from workbench.runtime.signature import SIGNATURE_FILE

    require_place(args.out, replaces=args.force)
    seed = None if args.key is None else read_private_key(args.key)
    least_us, most_us = (_micros("--range-delay", end) for end in args.range_delay)
    spec = LocaliserSpec(
        _unheard(load_site(args.site), args.unheard), _vehicle(args),
        Clocks(
            report_delay_us=_micros("--report-delay", args.report_delay),
            range_delay_us=(least_us, most_us), drift_ppm=args.drift,
        ),
        EllipsoidHull() if args.shape == SHAPES[0] else UnionBound(), args.level,
    )  # fmt: skip
    files = localiser_files(spec)
    if seed is not None:
        signature, _ = signature_file(files[CHECKSUM_FILE], seed, args.out / SIGNATURE_FILE)
        files |= {SIGNATURE_FILE: signature}
    folder = write_localiser(files, args.out, replaces=args.force)
    numbers = load_localiser(folder, public_key=None).numbers
    size = len(files[LIBRARY_FILE])
    signed = "unsigned" if seed is None else "signed"
    behind = behind_us(numbers.clocks)
    text = (
        f"localiser for {numbers.vehicle.name} among {len(numbers.site.beacons)} beacons: sets of "
        f"{100 * numbers.level:g} %, {numbers.shape}, {size / 1024:.0f} kB for {numbers.machine}, "
        f"{len(numbers.golden)} recorded calls repeated bit for bit, {signed}\n"
        f"its sets come {behind[0] / 1e3:g} to {behind[1] / 1e3:g} ms after their stamp: [clocks] "
        f"delay_us of the monitor's sensors file must hold {list(behind)}, and nothing on board "
        f"notices if it does not\n{folder}"
    )
    emit(args, text, {
        "folder": str(folder), "vehicle": numbers.vehicle.name,
        "protocol": numbers.vehicle.protocol, "beacons": [b.name for b in numbers.site.beacons],
        "level": numbers.level, "shape": numbers.shape, "machine": numbers.machine,
        "library_bytes": size, "signed": seed is not None, "behind_us": list(behind),
    })  # fmt: skip
    return 0


def _unheard(site: Site, least: tuple[float, float]) -> Site:
    """The site for a program that does not hear the commands."""
    if not all(math.isfinite(number) and number >= 0.0 for number in least):
        raise InputError(f"--unheard: expected two numbers >= 0, got {tuple(least)!r}")
    motion = site.motion
    raised = dataclasses.replace(
        motion, acceleration=max(motion.acceleration, least[0]),
        steering_rate=max(motion.steering_rate, least[1]),
    )  # fmt: skip
    return dataclasses.replace(site, motion=raised)


def _vehicle(args: argparse.Namespace) -> Vehicle:
    from workbench.models.vehicle import gem_e2_drive_path, load_vehicle
    from workbench.runtime.localiser.numbers import Vehicle

    shipped = args.vehicle is None
    file = load_vehicle(gem_e2_drive_path()) if shipped else chosen_vehicle(args)
    wire = file.drive_by_wire
    if wire is None:
        raise InputError(
            "--vehicle: expected a vehicle file with [drive_by_wire], which says what the steering "
            "wheel's reports mean, got one without; `workbench new drive NAME` writes one to edit"
        )
    return Vehicle(
        name=file.name, protocol=wire.value.protocol, wheelbase_m=file.geometry.wheelbase_m,
        road_wheel=wire.value.steering.road_wheel, speed_scale=args.speed_scale,
        steering_zero_rad=args.steering_zero,
    )  # fmt: skip


def _micros(option: str, seconds: float) -> int:
    if not 0.0 <= seconds <= 1.0:
        raise InputError(f"{option}: expected 0 to 1 s, got {seconds!r}")
    return round(1e6 * seconds)
