"""`workbench reach`: a tube that contains every trajectory from the initial set."""

from __future__ import annotations

import argparse
import dataclasses
import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    Subject,
    add_file_option,
    add_subject_options,
    add_time_options,
    check_steps,
    chosen_subject,
    command_line,
    separate_files,
    shown_instants,
    text_table,
    writable_file,
)
from workbench.cli.common import chosen_vehicle, write_text
from workbench.cli.output import emit, warn
from workbench.cli.reach_learned import add_learned_option, run_learned
from workbench.cli.reach_sampled import run_sampled
from workbench.cli.reach_switch import add_switch_options, chosen_switch
from workbench.cli.sampling_options import add_sampling_options, check_sampling
from workbench.cli.tube_table import limits_data, limits_text, tube_csv
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.reach_switch import Switch
    from workbench.reach import ReachTube

HELP = (
    "Computes a tube that contains every trajectory from the initial set, for a vehicle's TRACK "
    "loop in path coordinates or a benchmark loop. Exit status 1 when the proof ends before the "
    "horizon."
)
EXAMPLE = """\
workbench reach
workbench reach --curvature -0.01 0.01 --parts offset=2,speed=2 --csv out/tube.csv
workbench reach --system b1 --step 0.025 --plot out/tube.html
workbench reach --system b1 --learned out/learned.json --plot out/paper-tube.html
workbench reach --switch-at 0.1 0.3 --step 0.05 --plot out/switch.html
workbench reach --sampled --rate 30 --actuation-delay 0.05 0.05 --plot out/sampled.html
"""

_MOST_CELLS: Final = 4096
_PLOTTED_RUNS: Final = 200


def configure(parser: argparse.ArgumentParser) -> None:
    """Loop, time grid, partition, and the files to write."""
    add_subject_options(parser)
    parser.add_argument(
        "--unsure",
        action="store_true",
        help="with all that the vehicle file is unsure of: [uncertainty] and [drive_by_wire]",
    )
    add_time_options(parser, step_s=0.05)
    parser.add_argument(
        "--parts",
        metavar="STATE=N,...",
        help="split the initial set into N parts along each state named, and take the hull",
    )
    add_learned_option(parser)
    add_switch_options(parser)
    add_sampling_options(parser)
    add_file_option(parser, "--csv", text="write the whole tube as a table")
    add_file_option(parser, "--plot", text="write a page with the tube and sampled trajectories")


def run(args: argparse.Namespace) -> int:
    """Compute and show; 0 when the tube reaches the horizon, 1 when not."""
    check_steps(args)
    check_sampling(args)
    separate_files(args, "csv", "plot")
    writable_file(args.csv, "--csv")
    writable_file(args.plot, "--plot")
    subject = _subject(args)
    parts = _parts(args.parts, subject)
    if args.learned:
        return run_learned(args, subject, parts)
    if args.sampled:
        return run_sampled(args, subject, parts)
    switch = chosen_switch(args, subject)
    from workbench.cli.analysis_results import first_exit, tube_of

    if switch is None:
        tube = tube_of(subject, horizon_s=args.horizon, step_s=args.step, parts=parts)
    else:
        tube = switch.tube(horizon_s=args.horizon, step_s=args.step, parts=parts)
    region = switch.region(tube) if switch else subject.region
    left = first_exit(tube, region) if region else ""
    if args.csv:
        write_text(args.csv, tube_csv(tube))
    if args.plot:
        _write_page(args, subject, tube, switch, left)
    data = {
        "name": subject.name,
        "parts": parts,
        "switch_between_s": args.switch_at,
        **tube_data(tube, horizon_s=args.horizon),
        **limits_data(tube),
        "leaves_operating_region": left or None,
        "files": _written(args),
    }
    emit(args, _text(args, subject, tube, switch), data)
    if left:
        warn(f"the tube is not inside the vehicle's operating region: {left}")
    return 0 if tube.complete else 1


def _subject(args: argparse.Namespace) -> Subject:
    """What `--vehicle` or `--system` names, with its disturbances where `--unsure` asks."""
    subject = chosen_subject(args)
    if args.system is not None or args.sampled:
        if args.unsure:
            raise InputError(
                "--unsure: expected the vehicle's continuous loop, got "
                f"{'--sampled' if args.system is None else '--system'}; leave one of them out"
            )
        return subject
    from workbench.models.bicycle import PathFrame

    vehicle = chosen_vehicle(args)
    frame = PathFrame(*(args.curvature or (0.0, 0.0)))
    sure = vehicle.closed_loop(vehicle.track(), frame)
    unsure = vehicle.uncertain_loop(vehicle.track(), frame)
    if args.unsure:
        return dataclasses.replace(subject, system=unsure)
    if (unsure.disturbance, unsure.estimation_error) != (sure.disturbance, sure.estimation_error):
        warn(
            "the tube leaves out what the vehicle file is unsure of; a bundle's tubes hold it, and "
            "--unsure puts it in"
        )
    return subject


def _written(args: argparse.Namespace) -> list[Path]:
    return [file for file in (args.csv, args.plot) if file]


def _text(
    args: argparse.Namespace, subject: Subject, tube: ReachTube, switch: Switch | None
) -> str:
    return "\n".join(
        [
            f"{subject.name}: half widths of the set of reachable states"
            + (f", {switch.words}" if switch else ""),
            half_width_text(subject, tube, horizon_s=args.horizon),
            *_facts(tube, switch),
            *(f"wrote {file}" for file in _written(args)),
        ]
    )


def _facts(tube: ReachTube, switch: Switch | None) -> list[str]:
    """How the tube ends, what it proves about limits, and how to read a speed below 0."""
    from workbench.cli.analysis_results import ending

    return [ending(tube), *limits_text(tube), *(switch.reading(tube) if switch else [])]


def half_width_text(subject: Subject, tube: ReachTube, *, horizon_s: float) -> str:
    """Half widths at the shown instants, one line per state."""
    import numpy as np

    from workbench.cli.analysis_results import half_widths

    times = (0.0, *shown_instants(horizon_s))
    values = half_widths(tube, np.array(times))
    return text_table(
        ["state", "unit", *(f"{t:g} s" for t in times)],
        [
            [state.name, state.unit, *(float(value) for value in values[:, i])]
            for i, state in enumerate(subject.system.ode.states)
        ],
    )


def tube_data(tube: ReachTube, *, horizon_s: float) -> dict[str, object]:
    """Status, rigor and half widths of the tube, for JSON."""
    import numpy as np

    from workbench.cli.analysis_results import half_widths

    times = (0.0, *shown_instants(horizon_s))
    return {
        "status": tube.status,
        "rigor": tube.rigor,
        "message": tube.message,
        "horizon_s": horizon_s,
        "proved_until_s": tube.times[-1],
        "states": tube.names,
        "instants_s": times,
        "half_widths": half_widths(tube, np.array(times)),
    }


def _parts(text: str | None, subject: Subject) -> dict[str, int]:
    if text is None:
        return {}
    parts: dict[str, int] = {}
    names = subject.initial_set.names
    for item in text.split(","):
        name, _, number = (word.strip() for word in item.partition("="))
        if not re.fullmatch(r"[1-9][0-9]{0,3}", number) or name in parts:
            raise InputError(
                f"--parts: expected STATE=N,... with each state once and N from 1 to 9999, "
                f"got {text!r}; for example --parts offset=2,speed=2"
            )
        if name not in names:
            raise InputError(f"--parts: unknown state {name!r}; the states are {', '.join(names)}")
        low, high = subject.initial_set.interval(name)
        if low == high and number != "1":
            raise InputError(
                f"--parts: expected states that the initial set gives a width, and {name} is "
                f"exactly {low:g} there; leave it out"
            )
        parts[name] = int(number)
    cells = 1
    for each in parts.values():
        cells *= each
    if cells > _MOST_CELLS:
        raise InputError(
            f"--parts: expected at most {_MOST_CELLS} cells in all, got {cells}; split fewer states"
        )
    return parts


def _write_page(
    args: argparse.Namespace, subject: Subject, tube: ReachTube, switch: Switch | None, left: str
) -> None:
    from workbench import __version__
    from workbench.cli.analysis_results import ending, sampled_runs, tube_curves
    from workbench.report.figures import tube_figure
    from workbench.report.page import Block, Claim, Claims, Notice, Page, Section, write_page

    blocks: list[Block] = []
    if not tube.complete:
        blocks.append(Notice("The proof ends early.", ending(tube)))
    if left:
        blocks.append(Notice("The tube is not inside the vehicle's operating region.", left))
    if len(tube.lower):
        if switch is None:
            runs = sampled_runs(subject, horizon_s=args.horizon, count=_PLOTTED_RUNS, seed=1)
        else:
            runs = switch.runs(horizon_s=args.horizon, count=_PLOTTED_RUNS, seed=1)
        blocks.append(tube_figure(tube_curves(tube, subject.system.ode), runs))
    statement = (
        f"Every trajectory from the initial set{f', {switch.words},' if switch else ''} stays in "
        f"the tube up to {tube.times[-1]:g} s."
    )
    page = Page(
        f"Reach tube of {subject.name}",
        _facts(tube, switch),
        [
            Section("What is claimed", [Claims([Claim(statement, tube.rigor)])]),
            Section("The tube", blocks),
        ],
        __version__,
        command_line("reach", args),
    )
    write_page(Path(args.plot), page.html())
