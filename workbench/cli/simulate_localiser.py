"""The vehicle's own localiser among beacons: `workbench simulate --localiser`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.estimation.localisation_site import Site
    from workbench.runtime.localiser.folder import Built
    from workbench.simulation.bus_drive import BusDrive
    from workbench.simulation.ranged_place import Ranging

DROPPED: Final = 0.1
"""Share of the ranges that do not come; what becomes of the others is stated by the site file."""

INSTEAD: Final = (
    "where the car is was told by its localiser; what the scenario says of errors of its place was "
    "not used"
)


def add_localiser_options(parser: argparse.ArgumentParser) -> None:
    """Add `--localiser` and `--site`."""
    parser.add_argument(
        "--localiser", action="store_true",
        help="the vehicle's localiser says where the car is, from ranges to beacons; a driver "
        "takes the car to the path's beginning first",
    )  # fmt: skip
    parser.add_argument(
        "--site", type=Path, metavar="FILE",
        help="site file of the localiser (default: sixteen beacons around the library's paths)",
    )  # fmt: skip


def require_localiser_options(args: argparse.Namespace) -> None:
    """Raise InputError where they contradict each other or the others, and for a broken site."""
    if args.site is not None and not args.localiser:
        raise InputError("--site: expected with --localiser, got it alone; add --localiser")
    if args.localiser and args.desk:
        raise InputError(
            "--localiser: expected without --desk: the localiser hears frames; leave --desk out"
        )
    _site(args)


def built_localiser(args: argparse.Namespace, folder: Path | None = None) -> Built:
    """Compiled for the vehicle and the site that are asked for (into `folder`, if given)."""
    from workbench.cli.simulate_subject import chosen_vehicle
    from workbench.simulation.simulated import build_localiser

    return build_localiser(folder, vehicle=chosen_vehicle(args), site=_site(args))


def ranging_of(built: Built, *, elsewhere: bool = False) -> Ranging:
    """Ranges that err as the site states; elsewhere: as of `Ranging`."""
    from workbench.simulation.range_beacons import RangeErrors
    from workbench.simulation.ranged_place import Ranging

    errors = RangeErrors.stated(built.numbers.site, dropped=DROPPED)
    return Ranging(built, errors, elsewhere=elsewhere)


def localiser_notes(driven: BusDrive) -> tuple[str, ...]:
    """What it told of where the car was, and how true that was."""
    from workbench.simulation.told_scores import ToldScores

    scores = ToldScores.of(driven.told)
    none = "localiser among beacons: no set once the scenario had begun"
    return (INSTEAD, none if scores is None else scores.words)


def _site(args: argparse.Namespace) -> Site | None:
    if args.site is None:
        return None
    from workbench.estimation.localisation_site import load_site

    return load_site(args.site)
