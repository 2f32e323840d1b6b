"""`workbench survey`: sampled scenarios driven by every policy and by others, side by side."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import count, seed

if TYPE_CHECKING:
    from workbench.simulation.campaign.store import Manifest, Store
    from workbench.simulation.campaign.workers import Workers

HELP: Final = (
    "Drives sampled scenarios on simulated plants: the monitor's policies, three baselines tuned "
    "on half of the scenarios, and a car that never brakes. Counts contacts, avoidable ones by "
    "brute force, needless stops and what could not be judged. Goes on where it was left. Exit "
    "status 1 where FailSafe or both policies together had an avoidable contact."
)
EXAMPLE: Final = """\
workbench survey --scenarios 64 --plants bicycle --jobs 2 --out out/survey --plot
workbench survey --scenarios 20000 --plants bicycle single-track --out out/survey
workbench survey --hunt collisions --contenders FailSafe --trials 100 --out out/survey
workbench survey --point out/survey/hunts/collisions-FailSafe-bicycle-1/best.json
"""

_PLANTS: Final = ("bicycle", "single-track", "multi-body")
_LONG_LOOKS: Final = 2000
_LARGEST_SEED: Final = 2**31 - 1
_HUNTS: Final = ("collisions", "needless-stops")
GUARANTEED: Final = ("FailSafe", "both")
"""Whose avoidable contacts refute what is claimed."""


def configure(parser: argparse.ArgumentParser) -> None:
    """How much, on what, where, and what is asked beside."""
    parser.add_argument(
        "--scenarios", type=count, default=64, metavar="N", help="in all, by index (default: 64)"
    )
    parser.add_argument(
        "--plants", nargs="+", choices=_PLANTS, default=["bicycle"], metavar="PLANT",
        help=f"of {', '.join(_PLANTS)} (default: bicycle)",
    )  # fmt: skip
    parser.add_argument(
        "--contenders", nargs="+", metavar="NAME",
        help="who drives (default: all); what a folder was begun with stays",
    )  # fmt: skip
    parser.add_argument(
        "--vehicle", type=Path, metavar="FILE", help="vehicle file (default: the simulated GEM e2)"
    )
    parser.add_argument(
        "--training", type=count, default=256, metavar="N",
        help="most scenarios of the training half to tune baselines on (default: 256)",
    )  # fmt: skip
    parser.add_argument(
        "--long-looks", type=seed, metavar="N",
        help="most scenarios that `LookAhead 5 s` drives, whose tubes take long "
        f"(default: {_LONG_LOOKS})",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=seed, default=1, metavar="N", help="of all chance (default: 1)"
    )
    parser.add_argument(
        "--jobs", type=count, default=1, metavar="N", help="local processes (default: 1)"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="of a Dask cluster instead, whose workers see the same folder",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=Path, default=Path("out/survey"), metavar="DIR",
        help="folder of the survey (default: out/survey)",
    )  # fmt: skip
    parser.add_argument(
        "--hunt", choices=_HUNTS, help="let an optimiser look for the worst instead of sampling"
    )
    parser.add_argument(
        "--trials", type=count, default=100, metavar="N", help="of a hunt, in all (default: 100)"
    )
    parser.add_argument(
        "--point", type=Path, metavar="FILE",
        help="drive the first scenario of a hunt's best.json again, with all contenders",
    )  # fmt: skip
    parser.add_argument(
        "--index", type=int, metavar="N", help="drive this scenario again, with all contenders"
    )
    parser.add_argument("--plot", action="store_true", help="write report.html as well")
    parser.add_argument(
        "--table", action="store_true", help="print the table of what is there in Markdown, and end"
    )


def run(args: argparse.Namespace) -> int:
    """Survey what is missing, then sum up."""
    from workbench.cli.survey_hunt import drive_again, hunted
    from workbench.cli.survey_results import summed_up
    from workbench.simulation.campaign.store import Store

    _require_one(args)
    store = Store(args.out)
    if args.point is not None or args.index is not None:
        return drive_again(args, store)
    if args.hunt is not None:
        return hunted(args, store)
    if not args.table:
        _survey(args, store)
    return summed_up(args, store, guaranteed=GUARANTEED)


def _require_one(args: argparse.Namespace) -> None:
    """Raise InputError for options that exclude each other."""
    from workbench.errors import InputError

    ways = {
        "--point": args.point is not None, "--index": args.index is not None,
        "--hunt": args.hunt is not None, "--table": args.table,
    }  # fmt: skip
    asked = [name for name, is_asked in ways.items() if is_asked]
    if len(asked) > 1:
        raise InputError(f"expected one of {', '.join(ways)}, got {' and '.join(asked)}")
    if args.seed > _LARGEST_SEED:
        raise InputError(f"--seed: expected at most {_LARGEST_SEED}, got {args.seed}")
    if args.plot and asked and asked != ["--table"]:
        raise InputError(f"--plot: expected without {asked[0]}, which writes no page; leave it out")


def _survey(args: argparse.Namespace, store: Store) -> None:
    from workbench.simulation.campaign.workers import workers

    import_parquet()
    # A cluster that does not answer should say so before anything is built or written.
    with workers(args.jobs, args.scheduler) as crew:
        manifest = begun(args, store)
        for plant in args.plants:
            _plant(args, (store, manifest, crew), plant)


def begun(args: argparse.Namespace, store: Store) -> Manifest:
    """The folder made, or the one that is there, with its bundles built. Raises InputError where
    it was begun otherwise."""
    contenders, long_looks = chosen_contenders(args), args.long_looks
    if (store.folder / "manifest.json").exists():
        stored = store.manifest()
        if args.contenders is None or args.hunt is not None:
            contenders = stored.contenders
        long_looks = stored.long_looks if long_looks is None else long_looks
    manifest = store.begin(
        seed=args.seed, contenders=contenders, vehicle=args.vehicle,
        long_looks=_LONG_LOOKS if long_looks is None else long_looks,
    )  # fmt: skip
    store.build()
    return manifest


def _plant(args: argparse.Namespace, survey: tuple[Store, Manifest, Workers], plant: str) -> None:
    from workbench.cli.output import Progress
    from workbench.simulation.campaign.surveying import Survey, training_half

    store, manifest, crew = survey
    under_way = Survey(store, manifest, crew)
    training = training_half(args.scenarios, args.training)
    wanted = under_way.untuned(plant, len(training))
    if wanted:
        with Progress(f"{plant}, baselines", len(wanted)) as progress:
            under_way.tune(plant, training, progress.advance)
    left = sum(map(len, store.missing(plant, args.scenarios)))
    if left:
        with Progress(plant, left) as progress:
            under_way.drive(plant, args.scenarios, progress.advance)


def chosen_contenders(args: argparse.Namespace) -> tuple[str, ...]:
    """In the usual order; raises InputError for an unknown name."""
    from workbench.errors import InputError
    from workbench.simulation.campaign.contenders import CONTENDERS

    if args.contenders is None:
        return CONTENDERS
    for name in args.contenders:
        if name not in CONTENDERS:
            raise InputError(
                f"--contenders: expected some of {', '.join(CONTENDERS)}, got {name!r}; quote "
                "names of several words"
            )
    return tuple(name for name in CONTENDERS if name in args.contenders)


def import_parquet() -> None:
    """Raise InputError where the extra for results is missing, before any work."""
    from workbench.errors import InputError

    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError as error:
        raise InputError(
            "results are stored as Parquet files, which need the study extra: pip install "
            "'reach-workbench[study]'"
        ) from error
