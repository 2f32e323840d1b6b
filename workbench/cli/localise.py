"""`workbench localise`: where a car was in a recorded drive, with nested sets."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    add_file_option,
    command_line,
    seed,
    text_table,
    writable_file,
)
from workbench.cli.common import add_vehicle_option, chosen_vehicle, output_folder, write_text
from workbench.cli.output import Progress, emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.estimation.localisation_site import Site
    from workbench.estimation.recorded_drives import Located, RecordedDrive

HELP: Final = (
    "Estimate where the car was in a recorded drive (reports.csv: t, speed, steering; ranges.csv: "
    "t, beacon, range), message by message, as the vehicle does: nested sets of x, y, heading, "
    "steering and speed, or why there is none. Exit status 1 if there is never a set."
)
EXAMPLE: Final = """\
workbench localise --generate out/drive
workbench localise out/drive --out out/poses.csv --plot out/localise.html
workbench localise out/drive --site yard.toml --shape union
"""

_SHAPES: Final = ("hull", "union")
_DROPPED: Final = 0.3
_STRAY: Final = 0.1
_STRAY_MEAN_M: Final = 1.0
_NOTES: Final = (
    "At each report only messages until then are used. The largest set is drawn; the smaller ones "
    "lie in it.",
    "That the errors are as large as said is a matter of test, not of proof: see the tables of "
    "NEES in the document on localisation.",
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("folder", nargs="?", type=Path, metavar="DRIVE", help="folder of the drive")
    add_site_option(parser)
    add_vehicle_option(parser)
    parser.add_argument(
        "--shape", choices=_SHAPES, default=_SHAPES[0],
        help="hull: for jointly Gaussian errors, with room to spare; union: each side by its own "
        "share of what may fail (default: hull)",
    )  # fmt: skip
    add_file_option(parser, "--out", text="table of poses with half-widths of the 99.9 %% set")
    add_file_option(parser, "--plot", text="page to draw")
    parser.add_argument(
        "--generate", type=Path, metavar="DIR",
        help=f"write a generated drive there instead, {_DROPPED:.0%} of its ranges dropped and "
        f"{_STRAY:.0%} too long, with the truth beside it".replace("%", "%%"),
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=seed, default=1, metavar="N", help="of the generated drive (default: 1)"
    )


def add_site_option(parser: argparse.ArgumentParser) -> None:
    """Add `--site FILE`; `chosen_site` reads it."""
    add_file_option(parser, "--site", text="site file, TOML (default: the hall that is shipped)")


def chosen_site(args: argparse.Namespace) -> Site:
    """The site that `--site` names, or the shipped one. Raises InputError on a bad file."""
    from workbench.estimation.localisation_site import hall_path, load_site

    return load_site(hall_path() if args.site is None else args.site)


def run(args: argparse.Namespace) -> int:
    """Check, then generate a drive or follow one."""
    if (args.folder is None) == (args.generate is None):
        raise InputError("expected either a folder DRIVE or --generate DIR, got both or none")
    return _generate(args) if args.generate is not None else _follow(args)


def _generate(args: argparse.Namespace) -> int:
    from workbench.estimation.localisation_world import Faults, figure_eight, generated_drive
    from workbench.estimation.recorded_drives import drive_tables

    for name in ("out", "plot"):
        if getattr(args, name) is not None:
            raise InputError(f"--{name}: expected a recorded drive to go with it, got --generate")
    site, wheelbase_m = chosen_site(args), chosen_vehicle(args).geometry.wheelbase_m
    faults = Faults(_DROPPED, _STRAY, _STRAY_MEAN_M)
    drive = generated_drive(
        site, figure_eight(), faults, cars=1, wheelbase_m=wheelbase_m, seed=args.seed
    )
    texts = drive_tables(drive, site)
    with output_folder(args.generate) as folder:
        for name, text in texts.items():
            write_text(folder / name, text)
    counts = {name: text.count("\n") - 1 for name, text in texts.items()}
    told = ", ".join(f"{name} ({count} rows)" for name, count in counts.items())
    emit(args, f"wrote {told} to {args.generate}", {"folder": args.generate, "rows": counts})
    return 0


def _follow(args: argparse.Namespace) -> int:
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.estimation.localisation import Localiser
    from workbench.estimation.localisation_filter import filter_functions
    from workbench.estimation.localisation_sets import LEVELS, EllipsoidHull, UnionBound
    from workbench.estimation.recorded_drives import POSE_COLUMNS, load_drive, located, pose_rows

    for path, option in ((args.out, "--out"), (args.plot, "--plot")):
        writable_file(path, option)
    site = chosen_site(args)
    drive = load_drive(args.folder, site)
    wheelbase_m = chosen_vehicle(args).geometry.wheelbase_m
    localiser = Localiser.of(site, filter_functions(site, wheelbase_m=wheelbase_m))
    shape = EllipsoidHull() if args.shape == _SHAPES[0] else UnionBound()
    moments: list[Located] = []
    with Progress("localising", len(drive.log.times_s)) as bar:
        for moment in located(localiser, drive, levels=LEVELS, shape=shape):
            moments.append(moment)
            bar.advance()
    if args.out is not None:
        lines = [",".join(row) for row in (POSE_COLUMNS, *pose_rows(moments))]
        write_text(args.out, "\n".join(lines) + "\n")
    text, data = _summary(moments, drive)
    if args.plot is not None:
        _plot(args, site, moments, text)
    written = [f"wrote {path}" for path in (args.out, args.plot) if path is not None]
    emit(args, "\n".join([text, *written]), data)
    return DONE if data["with a set"] else CLAIM_FAILS


def _summary(moments: Sequence[Located], drive: RecordedDrive) -> tuple[str, dict[str, float]]:
    """What was known when, and how wide the largest sets are."""
    import numpy as np

    sets = [moment.sets[-1] for moment in moments if moment.sets]
    first = next((moment.t_s for moment in moments if moment.sets), None)
    counts: dict[str, int] = {}
    for moment in moments:
        counts[moment.status.value] = counts.get(moment.status.value, 0) + 1
    lines = [f"{len(moments)} reports, {len(drive.log.ranges_m)} ranges"]
    lines.append("first set: " + ("never" if first is None else f"at {first:g} s"))
    rows: list[list[str | int | float | None]] = [
        [status, count, 100.0 * count / len(moments)] for status, count in counts.items()
    ]
    lines += ["", text_table(["status", "reports", "%"], rows)]
    data: dict[str, float] = {"reports": len(moments), "with a set": len(sets)}
    if sets:
        widths: list[list[str | int | float | None]] = []
        for name, unit in (("x", "m"), ("y", "m"), ("heading", "rad"), ("steering", "rad"),
                           ("speed", "m/s")):  # fmt: skip
            radii = [0.5 * (side[1] - side[0]) for side in (getattr(each, name) for each in sets)]
            middle, late = float(np.median(radii)), float(np.quantile(radii, 0.99))
            widths.append([f"{name} ({unit})", middle, late])
            data |= {f"{name} median": middle, f"{name} 99 %": late}
        headings = ["half-width of the 99.9 % set", "median", "99 % below"]
        lines += ["", text_table(headings, widths)]
    return "\n".join(lines), data


def _plot(args: argparse.Namespace, site: Site, moments: Sequence[Located], text: str) -> None:
    import numpy as np

    from workbench import __version__
    from workbench.estimation.localisation_sets import LEVELS
    from workbench.estimation.tables import Table as Rows
    from workbench.report.localisation import LocalisationReport, localisation_page
    from workbench.report.page import write_page
    from workbench.report.tables import Table

    sets = [moment.sets[-1] for moment in moments if moment.sets]
    sides = np.array([[each.x, each.y, each.heading] for each in sets]).reshape(len(sets), 3, 2)
    truth = np.zeros((0, 2))
    if Rows.exists(args.folder, "truth"):
        rows = Rows.read(args.folder, "truth", ("x", "y")).rows
        truth = np.array([[row.number("x"), row.number("y")] for row in rows])
    counts = sorted({moment.status.value for moment in moments})
    table = Table(
        "Reports by what was known", ["status", "reports"],
        [[status, sum(moment.status.value == status for moment in moments)] for status in counts],
    )  # fmt: skip
    report = LocalisationReport(
        f"Where the car was: {args.folder.resolve().name}", tuple(text.split("\n")[:2]),
        np.array([moment.t_s for moment in moments if moment.sets]),
        sides.mean(axis=2), 0.5 * np.diff(sides, axis=2)[:, :, 0], LEVELS[-1],
        np.array([moment.t_s for moment in moments]),
        np.array([bool(moment.sets) for moment in moments]),
        tuple(beacon.name for beacon in site.beacons),
        np.array([[beacon.x_m, beacon.y_m] for beacon in site.beacons]), truth, (table,), _NOTES,
    )  # fmt: skip
    command = command_line("localise", args, positional=("folder",))
    write_page(args.plot, localisation_page(report, version=__version__, command=command).html())
