"""`workbench build --learned`: a bundle with the paper's own tubes, to compare and not to drive."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import count, seed
from workbench.cli.output import Progress
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle
    from workbench.reach.learned.tube import LearnedTube

_PAIRS: Final = 39_396
_SEED: Final = 1
_DELTA: Final = 1e-6


def add_learned_options(parser: argparse.ArgumentParser) -> None:
    """Add `--learned`, `--pairs`, `--seed` and `--regions`; `chosen_learned` reads them."""
    parser.add_argument(
        "--learned",
        action="store_true",
        help="TRACK's tubes by the paper's method: simulations bloated by a beta that is learned "
        "now from sampled runs over the operating region. Such a bundle is SAMPLED: `shadow` and "
        "`replay` take it, `gate` and `drive` refuse it",
    )
    parser.add_argument(
        "--pairs", type=count, metavar="N",
        help=f"pairs of runs that the beta is learned from, with --learned (default: {_PAIRS}, "
        "for a violation in 1000 with confidence 1 - 1e-6)",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=seed, metavar="N",
        help=f"of the runs' random numbers, with --learned (default: {_SEED})",
    )  # fmt: skip
    parser.add_argument(
        "--regions", type=count, metavar="N",
        help="regions of an initial set along each state that has a width in the vehicle file, "
        "with --learned (default: 1)",
    )  # fmt: skip


def chosen_learned(
    args: argparse.Namespace, vehicle: Vehicle, *, horizon_s: float, step_s: float
) -> LearnedTube | None:
    """Learn what `--learned` asks for, None without it. InputError for options that need it."""
    if not args.learned:
        for option in ("pairs", "seed", "regions"):
            if getattr(args, option) is not None:
                raise InputError(
                    f"--{option}: expected --learned beside it; add it or leave it out"
                )
        return None
    from workbench.reach.learned.tube import LearnedTube
    from workbench.reach.learned.vehicle_beta import learn_vehicle_beta
    from workbench.sensitivity import LearnedExponential

    pairs = args.pairs or _PAIRS
    method = LearnedExponential(
        pairs=pairs, seed=_SEED if args.seed is None else args.seed, step_s=step_s, delta=_DELTA
    )
    regions = _regions(vehicle, args.regions or 1)
    with Progress(f"learning from {pairs} pairs", 1):
        learned = learn_vehicle_beta(vehicle, horizon_s=horizon_s, method=method)
    return LearnedTube(learned, regions, step_s)


def _regions(vehicle: Vehicle, each: int) -> dict[str, int]:
    from workbench.reach.learned.tube import MOST_REGIONS

    box = vehicle.initial_set
    wide: Sequence[str] = [
        name for name, radius in zip(box.names, box.radius, strict=True) if radius > 0.0
    ]
    if each ** len(wide) > MOST_REGIONS:
        raise InputError(
            f"--regions: expected at most {MOST_REGIONS} in all, got {each} along each of "
            f"{', '.join(wide)}: {each ** len(wide)}; give fewer"
        )
    return dict.fromkeys(wide, each)
