"""`workbench conform`: bounds of errors and disturbances fitted to measured motion."""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, final

from workbench.cli.analysis_options import command_line, number, percent, positive, text_table
from workbench.cli.common import add_output_option, add_vehicle_option, output_folder, write_text
from workbench.cli.output import Progress, emit, plain
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.conform_sources import Subject
    from workbench.models.vehicle_sections import Uncertainty
    from workbench.simulation.conformance.counting import Containment
    from workbench.simulation.conformance.verdict import DiscResult, Verdict

HELP: Final = (
    "Fits what a vehicle file is unsure of to measured motion: the least W (and N) whose tubes "
    "contain it, tested on recordings that were not fitted to. Exit status 1 when the tubes "
    "contain less of the others than asked, or when the vehicle cannot take the figures."
)
EXAMPLE: Final = """\
workbench conform RUNS --vehicle shuttle.toml --out out/conformance --plot
workbench conform DATA/kitti --outliers 1 --out out/conformance --plot
"""

_FILES: Final = ("vehicle.toml", "conformance.json", "report.html")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What came out: the verdict, discs beside it with which of them are lacking and why (empty:
    none), and the section; refused: why no vehicle file is written (empty: it is), with
    vehicle_text."""

    verdict: Verdict
    discs: tuple[DiscResult, ...]
    lacking: str
    section: Uncertainty
    refused: str
    vehicle_text: str


def configure(parser: argparse.ArgumentParser) -> None:
    """What was measured, how it is split, and what is asked."""
    parser.add_argument(
        "source", type=Path, metavar="SOURCE",
        help="folder of closed-loop runs (runs.csv, paths.csv) or of recordings "
        "(vehicles.csv, shapes.csv, peds.csv)",
    )  # fmt: skip
    add_vehicle_option(parser)
    add_output_option(parser, default="out/conformance")
    parser.add_argument(
        "--window", type=positive, default=3.0, metavar="S", help="length of a window (default: 3)"
    )
    parser.add_argument(
        "--step", type=positive, default=0.1, metavar="S",
        help="between the instants that are compared (default: 0.1)",
    )  # fmt: skip
    parser.add_argument(
        "--train", nargs="+", metavar="NAME",
        help="recordings to fit to (default: every other one by name)",
    )  # fmt: skip
    parser.add_argument(
        "--test-on", nargs="+", type=Path, default=[], metavar="FOLDER",
        help="further folders of the same kind and vehicle, whose recordings are all tested on",
    )  # fmt: skip
    parser.add_argument(
        "--outliers", type=int, default=0, metavar="N",
        help="training windows that may stay outside their tubes (default: 0)",
    )  # fmt: skip
    parser.add_argument(
        "--fit", choices=("w", "nw"), default="w",
        help="w: disturbances and wheelbase, errors of the readings stay as the vehicle file has "
        "them; nw: these as well (closed-loop runs only; default: w)",
    )  # fmt: skip
    parser.add_argument(
        "--require", type=number, default=0.99, metavar="SHARE",
        help="share of the other recordings' steps to be contained, and of each --test-on "
        "(default: 0.99)",
    )  # fmt: skip
    parser.add_argument(
        "--speed-max", type=positive, default=8.0, metavar="MPS",
        help="recordings: windows with no higher speed (default: 8)",
    )  # fmt: skip
    parser.add_argument(
        "--ahead", type=number, default=0.3, metavar="M",
        help="recordings: reference point ahead of the rear axle (default: 0.3)",
    )  # fmt: skip
    parser.add_argument("--plot", action="store_true", help="write report.html as well")


def run(args: argparse.Namespace) -> int:
    """Fit, judge, write; 0 where the tubes contain what was asked."""
    from workbench.cli.conform_sources import chosen_subject
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.simulation.conformance.fit import NoFitError

    if not 0.0 <= args.require <= 1.0:
        raise InputError(f"--require: expected a share from 0 to 1, got {args.require:g}")
    try:
        with output_folder(args.out) as folder:
            subject = chosen_subject(args)
            _keep_inputs(args, subject)
            outcome = _outcome(args, subject)
            _write(args, subject, outcome, folder)
    except NoFitError as error:
        _remove_results(args.out)
        emit(args, str(error), {"refused": str(error)})
        return CLAIM_FAILS
    emit(args, "\n".join(_lines(args, subject, outcome)), _data(subject, outcome))
    return DONE if outcome.verdict.reached(args.require) and not outcome.refused else CLAIM_FAILS


def _keep_inputs(args: argparse.Namespace, subject: Subject) -> None:
    """Raise InputError where a vehicle.toml that was given, or lies beside runs, would go."""
    folders = (subject.source, *args.test_on)
    given = {subject.vehicle_file.resolve()}
    given |= {(folder / "vehicle.toml").resolve() for folder in folders}
    if (args.out / "vehicle.toml").resolve() in given:
        raise InputError(
            "--out: expected another folder than SOURCE, those of --test-on and the vehicle "
            f"file's, got {args.out}; its vehicle.toml would be replaced"
        )


def _remove_results(folder: Path) -> None:
    """Of an earlier call: they must not look like those of one that was refused."""
    for name in _FILES:
        (folder / name).unlink(missing_ok=True)


def _outcome(args: argparse.Namespace, subject: Subject) -> Outcome:
    from workbench.simulation.conformance.verdict import STAGES, discs

    with Progress("fit", STAGES * len(subject.candidates) + len(args.test_on)) as bar:
        model, measured, verdict = subject.judged(args.outliers, advance=bar.advance)
    command = command_line("conform", args, positional=("source",))
    section = subject.section(model, verdict, command=command)
    refused = subject.refusal(section)
    beside, lacking = (
        discs(measured, verdict, error_m=subject.disc_error_m) if subject.discs else ((), "")
    )
    return Outcome(
        verdict,
        beside,
        lacking,
        section,
        refused if verdict.fit.contained else "the tubes do not contain the windows fitted to",
        "" if refused else subject.vehicle_text(section),
    )


def _write(args: argparse.Namespace, subject: Subject, outcome: Outcome, folder: Path) -> None:
    _remove_results(folder)
    if not outcome.refused:
        write_text(folder / "vehicle.toml", outcome.vehicle_text)
    data = json.dumps(plain(_data(subject, outcome)), indent=2, allow_nan=False)
    write_text(folder / "conformance.json", data + "\n")
    if args.plot:
        from workbench.cli.conform_page import write_conform_page

        write_conform_page(args, subject, outcome)


def figures(section: Uncertainty) -> list[list[str | int | float | None]]:
    """Key and value of each figure of the section."""
    keys = ("lateral_m", "heading_rad", "speed_mps", "acceleration_mps2", "steering_rate_radps",
            "wheelbase_m")  # fmt: skip
    return [[key, float(getattr(section, key))] for key in keys]


def counted(name: str, found: Containment) -> list[str | int | float | None]:
    """One row: what, steps, windows, recordings with intervals, area."""
    shares = (found.steps, found.windows, found.recordings)
    words = [f"{s.inside}/{s.of} [{s.low:.3f}, {s.high:.3f}]" for s in shares]
    return [name, *words, found.mean_area_m2]


def count_rows(outcome: Outcome) -> list[list[str | int | float | None]]:
    """Tubes, the pointwise alternative and discs, side by side."""
    verdict = outcome.verdict
    rows = [
        counted("tubes, fitted to", verdict.training),
        *(counted(f"tubes, {name}", found) for name, found in verdict.tested),
        counted("tubes of pointwise W, other recordings", verdict.pointwise_tubes),
    ]
    for each in outcome.discs:
        name = f"disc, {each.disc.prediction.value}, {each.kind}; other recordings"
        rows.append(counted(name, each.held_out))
    return rows


COUNT_HEADINGS: Final = ["what", "steps", "windows", "recordings", "mean area (m2)"]


def interval_note(verdict: Verdict) -> str:
    """What the intervals count."""
    of = {"fitted to": verdict.training, "others": verdict.held_out}
    of |= {f"of {name}": found for name, found in verdict.elsewhere}
    worth = ", ".join(
        f"{found.windows.trials:.3g} for the {found.recordings.of} {name}"
        for name, found in of.items()
    )
    return (
        "95 % intervals (Clopper and Pearson); steps and windows count as so many trials as "
        f"recordings of these lengths are worth (Kish): {worth}"
    )


def _lines(args: argparse.Namespace, subject: Subject, outcome: Outcome) -> list[str]:
    verdict, points = outcome.verdict, outcome.verdict.pointwise
    lines = [
        subject.about(verdict),
        "",
        text_table(["key", "bound"], figures(outcome.section)),
        "",
        text_table(COUNT_HEADINGS, count_rows(outcome)),
        f"[ , ]: {interval_note(verdict)}",
        *([outcome.lacking] if outcome.lacking else []),
        "",
        verdict.said,
        "pointwise, at every instant of the windows fitted to: acceleration "
        f"{_shown(points.acceleration_mps2)} m/s^2, steering rate "
        f"{_shown(points.steering_rate_radps)} rad/s, sideways {_shown(points.sideways_mps)} m/s; "
        f"share of the other recordings' steps within: {_shown(verdict.pointwise_share)}",
    ]
    if outcome.refused:
        lines.append(f"no vehicle.toml: {outcome.refused}")
    return [*lines, ending(verdict, args.require)]


def ending(verdict: Verdict, require: float) -> str:
    """Whether the tubes contain what was asked."""
    fitted = verdict.training.windows
    shares = ", ".join(
        f"{percent(found.steps.value)} of the steps of {name}" for name, found in verdict.tested
    )
    if not verdict.fit.contained:
        return (
            f"the tubes do not contain what they were fitted to: {fitted.of - fitted.inside} of "
            f"{fitted.of} windows leave theirs (inside are {shares})"
        )
    return (
        f"the tubes contain {shares}: "
        f"{'as' if verdict.reached(require) else 'less than'} asked ({require:.2%})"
    )


def _shown(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.3g}"


def _data(subject: Subject, outcome: Outcome) -> dict[str, object]:
    verdict = outcome.verdict
    return {
        "about": subject.about(verdict),
        "uncertainty": outcome.section,
        "refused": outcome.refused or None,
        "split": verdict.split,
        "first_order_bounds": verdict.fit.linear.bounds,
        "inflation": verdict.fit.inflation,
        "windows_left_out": subject.left_out(verdict),
        "contained": verdict.fit.contained,
        "training": verdict.training,
        "held_out": verdict.held_out,
        "elsewhere": dict(verdict.elsewhere),
        "statement": verdict.stated,
        "pointwise": verdict.pointwise,
        "pointwise_share_held_out": verdict.pointwise_share,
        "pointwise_tubes_held_out": verdict.pointwise_tubes,
        "discs": outcome.discs,
        "discs_lacking": outcome.lacking or None,
    }
