"""`workbench campaign`: trajectories of random loops against the tubes of a method."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import count, positive, seed, text_table

if TYPE_CHECKING:
    from workbench.bench.campaign import CampaignResult
    from workbench.reach import TubeMethod

HELP: Final = (
    "Attack the tubes of a method: trajectories from corners, faces, interior and gradient ascent "
    "of random closed loops, with and without limits, unstable ones included, under estimation "
    "errors and disturbances that vary in time. Runs that come near the boundary are settled by "
    "validated arithmetic. Exit status 1 if any trajectory escapes or stays undecided."
)
EXAMPLE: Final = """\
workbench campaign
workbench campaign --loops 20 --trajectories 20000 --seed 7
workbench campaign --method online-quadratic --loops 50
"""

_METHODS: Final = ("validated", "online-linear", "online-quadratic")
_STEP_S: Final = 0.05
_PER_LOOP: Final = 100
# About what a loop's tube and a trajectory take on two shared cores.
_TUBE_S, _TRAJECTORY_S, _LONG_S = 3.0, 3.5e-4, 3600.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Size, seed and method."""
    parser.add_argument(
        "--loops", type=count, default=200, metavar="N", help="random loops (default: 200)"
    )
    parser.add_argument(
        "--trajectories",
        type=count,
        default=1_000_000,
        metavar="N",
        help=f"in all, at least {_PER_LOOP} per loop (default: 1000000)",
    )
    parser.add_argument(
        "--seed", type=seed, default=1, metavar="N", help="of all random choices (default: 1)"
    )
    parser.add_argument(
        "--method",
        choices=_METHODS,
        default="validated",
        help="whose tubes are attacked (default: validated)",
    )
    parser.add_argument(
        "--step",
        type=positive,
        default=_STEP_S,
        metavar="S",
        help=f"of the tubes, in s (default: {_STEP_S:g})",
    )


def run(args: argparse.Namespace) -> int:
    """Run, print, and return 1 unless every trajectory is inside."""
    from workbench.bench.campaign import run_campaign
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.cli.output import Progress, emit, warn

    expected_s = _TUBE_S * args.loops + _TRAJECTORY_S * args.trajectories
    if expected_s > _LONG_S:
        warn(f"about {expected_s / 3600.0:.0f} h; fewer --loops or --trajectories take less")
    with Progress("campaign", args.loops) as progress:
        result = run_campaign(
            _method(args.method, args.step),
            loops=args.loops,
            trajectories=args.trajectories,
            seed=args.seed,
            progress=progress.advance,
        )
    data = {
        "method": args.method,
        "step_s": args.step,
        "seed": result.seed,
        "trajectories": result.trajectories,
        "escapes": result.escapes,
        "undecided": result.undecided,
        "completed": result.completed,
        "loops": result.loops,
    }
    emit(args, _text(result), data)
    return CLAIM_FAILS if result.escapes or result.undecided else DONE


def _method(name: str, step_s: float) -> TubeMethod:
    from workbench.bench.online_method import OnlineMethod
    from workbench.reach import ValidatedTube
    from workbench.reach.online.kernels import Form

    if name == "validated":
        return ValidatedTube(step_s)
    return OnlineMethod(step_s, Form(name.removeprefix("online-")))


def _text(result: CampaignResult) -> str:
    loops = result.loops
    settled = sum(loop.reintegrated for loop in loops)
    proved_s, asked_s = sum(loop.proved_until_s for loop in loops), sum(x.horizon_s for x in loops)
    failures = [
        f"{loop.name}: {loop.escapes} escapes, {loop.undecided} undecided"
        for loop in loops
        if loop.escapes or loop.undecided
    ]
    return "\n".join(
        [
            "closest approach to the boundary after the start, inside positive",
            _closest(result),
            f"{result.completed} of {len(loops)} tubes reach their horizon "
            f"({proved_s:.0f} of {asked_s:.0f} s proved)",
            f"tubes {sum(loop.tube_s for loop in loops):.0f} s, "
            f"trajectories {sum(loop.runs_s for loop in loops):.0f} s",
            *failures,
            f"{result.trajectories} trajectories, {settled} settled by validated arithmetic, "
            f"{result.undecided} undecided, {result.escapes} escapes (seed {result.seed})",
        ]
    )


def _closest(result: CampaignResult) -> str:
    """One line per state: least and median over the loops that have it."""
    import statistics

    names = list(dict.fromkeys(name for loop in result.loops for name in loop.closest))
    rows: list[list[str | int | float | None]] = []
    for name in names:
        found = [loop.closest[name] for loop in result.loops if name in loop.closest]
        shares = [each.relative for each in found if each.relative is not None]
        rows.append(
            [
                name,
                len(found),
                f"{min(each.absolute for each in found):.1e}",
                f"{min(shares):.1e}" if shares else "-",
                f"{statistics.median(shares):.1e}" if shares else "-",
            ]
        )
    headings = ["state", "loops", "least distance", "least share of half width", "median share"]
    return text_table(headings, rows)
