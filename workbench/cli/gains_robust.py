"""`workbench gains robust`: stability, margins and tube of all cars within ranges."""

from __future__ import annotations

import argparse
import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from workbench.cli.analysis_options import (
    check_steps,
    command_line,
    count,
    number,
    shown_instants,
    text_table,
    writable_file,
)
from workbench.cli.common import chosen_vehicle, writable_folder, write_text
from workbench.cli.gains_options import AXES, changed_vehicle, check_gain_options
from workbench.cli.output import emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.models.gains.lateral import LateralLoop
    from workbench.models.gains.ranged_loop import Ranges
    from workbench.models.vehicle import Vehicle
    from workbench.reach.robustness.tubes import RangedTube
    from workbench.reach.robustness.verdict import Effort, OverSize, Robustness
    from workbench.report.tables import Table

_BOXES, _SEED = 40_000, 1
_RANGES: Final = {
    "wheelbase": ("m", "true wheelbase; the controller keeps the vehicle file's"),
    "delay": ("s", "by which the steering command is late"),
    "speed-scale": ("none", "true speed over the speed that the car measures"),
}
_NOT_HERE: Final = (
    "full", "speeds", "range", "points", "rate", "jitter", "drift", "measured_dt",
    "measurement_delay", "actuation_delay",
)  # fmt: skip


def add_robust(works: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """The sub-command; what the plain command has too may stand before it or behind it."""
    parser = works.add_parser(
        "robust", help="stability, margins and tube of all cars within ranges",
        description="Says for all cars within ranges, under the one controller of the vehicle "
        "file: whether each is stable, the worst margins, and a tube that holds all. What is "
        "proved and what a search found are told apart. A range that is left out is the vehicle "
        "file's value, no delay, or scale 1. Exit status 1 where it is not proved that all are "
        "stable.",
        allow_abbrev=False,
    )  # fmt: skip
    for name, (unit, text) in _RANGES.items():
        parser.add_argument(
            f"--{name}", nargs=2, type=number, metavar=("LOW", "HIGH"), help=f"{text} ({unit})"
        )
    parser.add_argument(
        "--boxes", type=count, default=_BOXES, metavar="N",
        help=f"most boxes that a proof may judge (default: {_BOXES})",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=count, default=_SEED, metavar="N", help=f"of the search (default: {_SEED})"
    )
    _add_shared(parser)


def _add_shared(parser: argparse.ArgumentParser) -> None:
    """Options of the plain command, without a default that would undo them."""
    left = argparse.SUPPRESS
    for name in AXES:
        parser.add_argument(
            f"--{name}", type=number, metavar="X", default=left,
            help="this value instead of the vehicle file's",
        )  # fmt: skip
    parser.add_argument("--vehicle", type=Path, metavar="FILE", default=left, help="vehicle file")
    for name in ("horizon", "step"):
        parser.add_argument(
            f"--{name}", type=number, metavar="S", default=left, help="of the tube, in s"
        )
    parser.add_argument("--no-tube", action="store_true", default=left, help="leave the tube out")
    parser.add_argument(
        "--plot", type=Path, metavar="FILE", default=left,
        help="write a page, with worst margins over the size of the ranges",
    )  # fmt: skip
    parser.add_argument(
        "--csv", type=Path, metavar="DIR", default=left, help="write one file per table"
    )
    parser.add_argument(
        "--json", action="store_true", default=left,
        help="write the result as JSON to standard output",
    )  # fmt: skip


def run_robust(args: argparse.Namespace) -> int:
    """Judge, search, and write; 0 where every car is proved to be stable."""
    _check(args)
    vehicle = changed_vehicle(args, chosen_vehicle(args))
    ranges = _ranges(args, vehicle)
    if args.csv:
        writable_folder(args.csv)
    from workbench.models.gains.lateral import LateralLoop
    from workbench.reach.robustness.verdict import Effort, Robust, robustness

    loop, effort = LateralLoop.of(vehicle), Effort(args.boxes, args.seed)
    answer = robustness(loop, ranges, effort=effort)
    sizes = _sizes(args, loop, ranges, effort)
    tube = None if args.no_tube else _tube(args, vehicle, ranges)
    if args.csv:
        _write_tables(args.csv, answer, sizes, tube)
    if args.plot and sizes is not None:
        _write_page(args, vehicle, answer, sizes, tube)
    files = [each for each in (args.plot, args.csv) if each]
    emit(
        args, _text(vehicle, loop, answer, tube, files), _data(vehicle, answer, sizes, tube, files)
    )
    return 0 if answer.answer is Robust.PROVED else 1


def _check(args: argparse.Namespace) -> None:
    given = [name for name in _NOT_HERE if getattr(args, name) not in (None, False)]
    if given:
        raise InputError(
            f"--{given[0].replace('_', '-')}: expected no option of the full study with robust, "
            "which does not make it; leave it out"
        )
    if all(getattr(args, name.replace("-", "_")) is None for name in _RANGES):
        raise InputError(
            "expected at least one range: --wheelbase, --delay or --speed-scale, each with LOW "
            "HIGH; for example --speed-scale 0.97 1.03 --delay 0 0.05"
        )
    for name in ("horizon", "step"):
        if not getattr(args, name) > 0.0:
            raise InputError(f"--{name}: expected a time > 0 in s, got {getattr(args, name):g}")
    args.full = False
    check_steps(args)
    check_gain_options(args)
    writable_file(args.plot, "--plot")


def _ranges(args: argparse.Namespace, vehicle: Vehicle) -> Ranges:
    from workbench.models.gains.ranged_loop import Ranges

    known = {"wheelbase": vehicle.geometry.wheelbase_m, "delay": 0.0, "speed-scale": 1.0}
    found = {}
    for name, value in known.items():
        low, high = getattr(args, name.replace("-", "_")) or (value, value)
        if not (low <= high and (low > 0.0 or (name == "delay" and low == 0.0))):
            least = "0 or more" if name == "delay" else "above 0"
            raise InputError(f"--{name}: expected LOW <= HIGH, both {least}, got {low:g} {high:g}")
        found[name] = (low, high)
    return Ranges(found["wheelbase"], found["speed-scale"], found["delay"])


def _sizes(
    args: argparse.Namespace, loop: LateralLoop, ranges: Ranges, effort: Effort
) -> OverSize | None:
    if not (args.plot or args.csv):
        return None
    from workbench.reach.robustness.verdict import over_size

    return over_size(loop, ranges, effort=effort)


def _tube(args: argparse.Namespace, vehicle: Vehicle, ranges: Ranges) -> RangedTube:
    import math

    from workbench.cli.output import Progress
    from workbench.reach.robustness.tubes import ranged_tube

    with Progress("tube", math.ceil(args.horizon / args.step)) as progress:
        return ranged_tube(
            vehicle, ranges, shown_instants(args.horizon), step_s=args.step, seed=args.seed,
            each_row=progress.advance,
        )  # fmt: skip


def _text(
    vehicle: Vehicle,
    loop: LateralLoop,
    answer: Robustness,
    tube: RangedTube | None,
    files: list[Path],
) -> str:
    from workbench.cli.analysis_results import ending
    from workbench.report.gains_robust import NO_ROUNDING, lead, margin_table, width_table

    lines = [vehicle.name, *lead(loop, answer), "", *_shown(margin_table(answer)), NO_ROUNDING]
    if tube is not None:
        lines += ["", *_shown(width_table(tube)), ending(tube.tube)]
    return "\n".join([*lines, *(f"wrote {each}" for each in files)])


def _shown(table: Table) -> tuple[str, str]:
    return table.caption, text_table(list(table.headings), [list(row) for row in table.rows])


def _data(
    vehicle: Vehicle,
    answer: Robustness,
    sizes: OverSize | None,
    tube: RangedTube | None,
    files: list[Path],
) -> dict[str, Any]:
    return {
        "name": vehicle.name,
        "ranges": answer.ranges,
        "answer": answer.answer.name,
        "witness": answer.witness,
        "margins": answer.rows(),
        "sizes": None if sizes is None else sizes.rows(),
        "tube": None if tube is None else {
            "status": tube.tube.status, "rigor": tube.tube.rigor, "message": tube.tube.message,
            "proved_until_s": tube.tube.times[-1], "runs": tube.runs, "widths": tube.rows(),
        },
        "files": files,
    }  # fmt: skip


def _write_tables(
    folder: Path, answer: Robustness, sizes: OverSize | None, tube: RangedTube | None
) -> None:
    """margins.csv, sizes.csv, widths.csv; numbers in full."""
    tables: dict[str, Sequence[Mapping[str, object]]] = {"margins.csv": answer.rows()}
    if sizes is not None:
        tables["sizes.csv"] = sizes.rows()
    if tube is not None:
        tables["widths.csv"] = tube.rows()
    for name, rows in tables.items():
        stream = io.StringIO()
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
        write_text(folder / name, stream.getvalue())


def _write_page(
    args: argparse.Namespace,
    vehicle: Vehicle,
    answer: Robustness,
    sizes: OverSize,
    tube: RangedTube | None,
) -> None:
    import numpy as np

    from workbench import __version__
    from workbench.models.gains.lateral import LateralLoop
    from workbench.reach.robustness.tubes import sampled_runs
    from workbench.report.curves import SampledRuns
    from workbench.report.gains_robust import RobustReport, robust_page
    from workbench.report.page import write_page

    runs = None
    if tube is not None:
        times = np.linspace(0.0, args.horizon, 61)
        states = sampled_runs(vehicle, answer.ranges, times, seed=args.seed)
        runs = SampledRuns(times, states.reshape(-1, *states.shape[2:]))
    report = RobustReport(vehicle.name, LateralLoop.of(vehicle), answer, sizes, tube, runs)
    plain = argparse.Namespace(
        **{k: v for k, v in vars(args).items() if k not in ("quick", "full")}
    )
    command = command_line("gains", plain, positional=("work",))
    write_page(args.plot, robust_page(report, version=__version__, command=command).html())
