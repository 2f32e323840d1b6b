"""`workbench commission`: steering zero, speed scale and wheelbase from one drive."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import positive, text_table
from workbench.cli.common import add_vehicle_option, chosen_vehicle
from workbench.cli.localise import add_site_option, chosen_site
from workbench.cli.output import emit

if TYPE_CHECKING:
    from workbench.estimation.commissioning import Commissioned
    from workbench.estimation.localisation_site import Site

HELP: Final = (
    "Fit one recorded drive (a straight part of some 10 m, then curves to both sides): first "
    "heading, steering zero, speed scale and wheelbase with their standard errors, and what to put "
    "into the site file. Exit status 1 if the site's figures do not explain the ranges."
)
EXAMPLE: Final = """\
workbench commission out/drive --wheelbase-error 0.02
workbench localise --generate out/drive
"""

_RESIDUAL: Final = (0.8, 1.25)
# Of a binomial count: with six beacons a true site fails once in some thousands of drives.
_DEVIATIONS: Final = 4.0
_UNITS: Final = {
    "x": "m", "y": "m", "heading": "rad", "steering_zero": "rad", "speed_scale": "-",
    "wheelbase": "m",
}  # fmt: skip


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("folder", type=Path, metavar="DRIVE", help="folder of the drive")
    add_site_option(parser)
    add_vehicle_option(parser)
    parser.add_argument(
        "--wheelbase-error", type=positive, default=0.01, metavar="M",
        help="how far the vehicle file's wheelbase may be wrong, a deviation (default: 0.01 m)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Fit and tell."""
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.estimation.commissioning import ESTIMATED, commission
    from workbench.estimation.recorded_drives import load_drive

    site = chosen_site(args)
    drive = load_drive(args.folder, site)
    found = commission(
        site, drive.log, wheelbase_m=chosen_vehicle(args).geometry.wheelbase_m,
        wheelbase_error_m=args.wheelbase_error,
    )  # fmt: skip
    rows: list[list[str | int | float | None]] = [
        [name, found.value(name), found.deviation(name), _UNITS[name]] for name in ESTIMATED
    ]
    doubted = _doubted(site, found)
    explained = _RESIDUAL[0] <= found.residual <= _RESIDUAL[1] and not doubted
    lines = [text_table(["estimate", "value", "standard error", "unit"], rows), ""]
    lines += _verdict(found, doubted, explained=explained)
    data = {name: {"value": found.value(name), "error": found.deviation(name)}
            for name in ESTIMATED}  # fmt: skip
    emit(args, "\n".join(lines),
         {"estimates": data, "residual": found.residual, "strays": found.strays,
          "doubted beacons": doubted})  # fmt: skip
    return DONE if explained else CLAIM_FAILS


def _doubted(site: Site, found: Commissioned) -> list[str]:
    """Names of the beacons more of whose ranges were set aside than the site's share of strays
    gives by chance."""
    share = site.ranges.stray_share + 1.0 - site.ranges.accepted
    return [
        beacon.name
        for beacon, strays, ranges in zip(site.beacons, found.strays, found.ranges, strict=True)
        if strays > share * ranges + _DEVIATIONS * math.sqrt(share * (1.0 - share) * ranges)
    ]


def _verdict(found: Commissioned, doubted: list[str], *, explained: bool) -> list[str]:
    lines = [
        f"ranges: residuals are {found.residual:.2f} times what the site file says, "
        f"{sum(found.strays)} of {sum(found.ranges)} set aside as strays"
    ]
    if doubted:
        lines.append(f"more set aside than the site's share of strays: {', '.join(doubted)}")
    if not explained:
        low, high = _RESIDUAL
        return [
            *lines,
            f"expected residuals of {low:g} to {high:g} times and no such beacon: places of "
            "beacons, deviation or the antenna's place are wrong; measure them again before using "
            "these estimates",
        ]
    scale, zero = 1.0 + found.value("speed_scale"), found.value("steering_zero")
    return [
        *lines,
        f"correct the reports: speed / {scale:.5f}, steering {-zero:+.5f} rad; then, in [reports] "
        "of the site file:",
        f"speed_scale = {_up(found.deviation('speed_scale'))}",
        f"steering_zero_rad = {_up(found.deviation('steering_zero'))}",
    ]


def _up(value: float) -> str:
    """Rounded up in the fifth place."""
    return f"{math.ceil(value * 1e5) / 1e5:.5f}"
