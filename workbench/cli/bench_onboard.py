"""The board of the monitor on the vehicle in `workbench bench`: its options, plan and keys."""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import count, positive

if TYPE_CHECKING:
    from workbench.bench.onboard_board import Keys, OnboardBoard, OnboardPlan

_DECISIONS: Final = 100_000
_DECISIONS_QUICK: Final = 2_000
_KERNEL_CALLS: Final = 1_000_000
_KERNEL_CALLS_QUICK: Final = 10_000
_SECONDS: Final = 60.0
_SECONDS_QUICK: Final = 10.0
_PROCESSES: Final = 11
_PROCESSES_QUICK: Final = 3
_RESIDENT_S: Final = 10.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of this board."""
    parser.add_argument(
        "--decisions",
        type=count,
        metavar="N",
        help="decisions of the whole core on board, and of its kernel alone (default: "
        f"{_DECISIONS} and {_KERNEL_CALLS}, with --quick {_DECISIONS_QUICK} and "
        f"{_KERNEL_CALLS_QUICK})",
    )
    parser.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help="of the loop on board in real time, per setting (default: "
        f"{_SECONDS:g}, with --quick {_SECONDS_QUICK:g})",
    )


def plan(args: argparse.Namespace) -> OnboardPlan:
    """What is measured: much, or with --quick little."""
    from workbench.bench.onboard_board import OnboardPlan

    quick = args.quick
    return OnboardPlan(
        decisions=args.decisions or (_DECISIONS_QUICK if quick else _DECISIONS),
        kernel_calls=args.decisions or (_KERNEL_CALLS_QUICK if quick else _KERNEL_CALLS),
        seconds=args.seconds or (_SECONDS_QUICK if quick else _SECONDS),
        processes=_PROCESSES_QUICK if quick else _PROCESSES,
        resident_s=_RESIDENT_S,
    )


def check(bundle: Path | None) -> None:
    """Refuse a bundle that this board cannot drive, before any work."""
    if bundle is not None:
        from workbench.bench.onboard_bundle import require_driving

        require_driving(bundle)


def measure(args: argparse.Namespace) -> OnboardBoard:
    """The board, with progress; the bundle is built here where none is given."""
    from workbench.bench.onboard_board import onboard_board, units_of_work
    from workbench.bench.onboard_bundle import build_driving
    from workbench.cli.output import Progress

    wanted = plan(args)
    with tempfile.TemporaryDirectory(prefix="workbench-") as name:
        folder = Path(name)
        bundle = args.bundle or build_driving(folder / "bundle")
        with Progress("monitor on the vehicle", units_of_work(wanted)) as progress:
            return onboard_board(signed_copy(bundle, folder), wanted, advance=progress.advance)


def signed_copy(bundle: Path, folder: Path) -> Keys:
    """A copy of it below `folder`, signed with a new key that nobody keeps."""
    from workbench.bench.onboard_board import Keys
    from workbench.cli.private_key import write_pair
    from workbench.cli.sign import sign_bundle

    signed = folder / "signed"
    shutil.copytree(bundle, signed)
    public, _ = write_pair(folder / "keys" / "bench.key")
    sign_bundle(signed, folder / "keys" / "bench.key")
    return Keys(bundle, signed, public)
