"""`workbench gains sweep` and `recommend`: many gains scored by a study file, and a decision."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli.analysis_options import count, text_table
from workbench.cli.gains_options import AXES
from workbench.cli.output import emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.simulation.gain_sweep.deciding import Verdict
    from workbench.simulation.gain_sweep.store import SweepStore

_OUT = Path("out/gain-sweep")


def add_sweep(
    parser: argparse.ArgumentParser,
) -> argparse._SubParsersAction[argparse.ArgumentParser]:
    """Sub-commands beside the plain `workbench gains`; others may join them."""
    works = parser.add_subparsers(
        dest="work", metavar="{sweep,recommend,robust}", title="many gains or cars at once"
    )
    swept = works.add_parser(
        "sweep", help="score gains over cases, as a study file says",
        description="Scores gains over speeds, curvatures and initial sets, as a study file says: "
        "exact stability, margins, proved tube, runs; finalists drive scenarios where it has "
        "[drives]. Goes on where it was left.",
        allow_abbrev=False,
    )  # fmt: skip
    swept.add_argument("study", type=Path, metavar="STUDY", help="study file, TOML")
    swept.add_argument(
        "--jobs", type=count, default=1, metavar="N", help="local processes (default: 1)"
    )
    swept.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="of a Dask cluster instead, whose workers see the same folder",
    )  # fmt: skip
    decided = works.add_parser(
        "recommend", help="say which gains of a finished sweep to take, and why",
        description="Decides as the study file says, and writes the vehicle file with these "
        "gains, a page with the front, and the points as CSV. Exit status 1 where no gains keep "
        "the bounds.",
        allow_abbrev=False,
    )  # fmt: skip
    for each in (swept, decided):
        each.add_argument(
            "--out", type=Path, default=_OUT, metavar="DIR",
            help=f"folder of the sweep (default: {_OUT})",
        )  # fmt: skip
        each.add_argument(
            "--json", action="store_true", default=argparse.SUPPRESS,
            help="write the result as JSON to standard output",
        )  # fmt: skip
    return works


def run_sweep(args: argparse.Namespace) -> int:
    """Do what the sub-command says."""
    from workbench.cli.survey import import_parquet
    from workbench.simulation.gain_sweep.store import SweepStore

    _refuse_others(args)
    import_parquet()
    store = SweepStore(args.out)
    return _swept(args, store) if args.work == "sweep" else _recommended(args, store)


def _refuse_others(args: argparse.Namespace) -> None:
    """Raise InputError on options of the plain command, which would do nothing."""
    for name in ("vehicle", "speeds", "range", "points", "plot", "csv", *AXES):
        if getattr(args, name.replace("-", "_")) is not None:
            raise InputError(
                f"--{name}: expected no option before {args.work}, whose study file says what is "
                "swept; leave it out"
            )


def _swept(args: argparse.Namespace, store: SweepStore) -> int:
    from workbench.cli.output import Progress
    from workbench.simulation.campaign.workers import workers
    from workbench.simulation.gain_sweep.driving import drive_missing, missing_drives
    from workbench.simulation.gain_sweep.sweeping import sweep

    with workers(args.jobs, args.scheduler) as crew:
        plan = store.begin(args.study)
        store.build()
        left = sum(map(len, store.missing()))
        if left:
            with Progress("points", left) as progress:
                sweep(store, crew, progress.advance)
        drives = sum(len(task.numbers) for task in missing_drives(store))
        if drives:
            with Progress("drives", drives) as progress:
                drive_missing(store, crew, progress.advance)
    total, cases = plan.count + 1, len(plan.cases)
    driven = f", {drives} drives" if drives else ""
    text = (
        f"{plan.name}: {total} points in {cases} case{'s' * (cases > 1)}, {left} of them new"
        f"{driven}; `workbench gains recommend --out {args.out}` decides"
    )
    data = {"points": total, "cases": cases, "new": left, "drives": drives, "folder": args.out}
    emit(args, text, data)
    return 0


def _recommended(args: argparse.Namespace, store: SweepStore) -> int:
    from workbench.cli.gains_front import provenance, write_files
    from workbench.simulation.gain_sweep.deciding import verdict
    from workbench.simulation.gain_sweep.driving import driven_figures

    plan = store.plan()
    missing = sum(map(len, store.missing()))
    if missing:
        raise InputError(
            f"{args.out}: expected a finished sweep, got one that lacks {missing} of "
            f"{plan.count + 1} points; `workbench gains sweep STUDY --out {args.out}` goes on"
        )
    found = verdict(store.rows(), plan.decision, driven_figures(store))
    why = provenance(plan, found)
    files = write_files(args.out, store, found, why)
    emit(args, _text(found, why, files), _data(found, why, files))
    return 0 if found.best is not None else 1


def _text(found: Verdict, why: str, files: list[Path]) -> str:
    from workbench.cli.gains_front import costs_table, front_table

    lines = [why]
    for table in (costs_table(found), front_table(found)):
        if table.rows:
            rows = [list(row) for row in table.rows]
            lines += ["", table.caption, text_table(list(table.headings), rows)]
    return "\n".join([*lines, *(f"wrote {file}" for file in files)])


def _data(found: Verdict, why: str, files: list[Path]) -> dict[str, Any]:
    from workbench.simulation.gain_sweep.deciding import shown_figures

    def point(index: int) -> dict[str, Any]:
        each = found.points[index]
        figures = {name: each.figures[name] for name in shown_figures(found)}
        return {"point": each.index, **each.gains, **figures, "fails": each.fails}

    return {
        "recommended": None if found.best is None else point(found.best.index),
        "present": point(found.present.index),
        "why": why,
        "points": len(found.points),
        "keep_bounds": found.kept,
        "front": [point(each.index) for each in found.front],
        "files": files,
    }
