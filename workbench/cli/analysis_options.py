"""Options that the analysis commands share: what to analyse, how finely, and where to write."""

from __future__ import annotations

import argparse
import contextlib
import math
import shlex
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar, final

from workbench.cli.common import add_vehicle_option, chosen_vehicle
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.models.system import System
    from workbench.sets import Box

_T = TypeVar("_T")

# Written out because `--help` has to work without the analysis extra.
SYSTEMS: Final = ("b1", "b1-small", "b1-brake", "b2", "b2-slow", "b2-path", "b2-noise")
_LONGEST_S: Final = 60.0
_MOST_STEPS: Final = 20_000
_ROUNDING: Final = 1e-9
_SHOWN_S: Final = (1.0, 2.0, 3.0)


@final
@dataclass(frozen=True, slots=True)
class Subject:
    """What is analysed: a loop, where it starts, and the region it is meant for (or None)."""

    name: str
    system: System
    initial_set: Box
    region: Box | None


def add_subject_options(parser: argparse.ArgumentParser) -> None:
    """Add `--vehicle`, `--system` and `--curvature`; `chosen_subject` reads them."""
    add_vehicle_option(parser)
    parser.add_argument(
        "--system",
        type=str.lower,
        choices=SYSTEMS,
        metavar="NAME",
        help=f"a benchmark loop instead of a vehicle: {', '.join(SYSTEMS)}",
    )
    parser.add_argument(
        "--curvature",
        nargs=2,
        type=number,
        metavar=("LOW", "HIGH"),
        help="bounds on the path's curvature in 1/m, positive to the left; it may vary in between "
        "at will (default: 0 0, a straight path)",
    )


def chosen_subject(args: argparse.Namespace) -> Subject:
    """The benchmark that `--system` names, else the vehicle's TRACK loop along a path.

    Raises InputError for options that exclude each other and for a bad vehicle file.
    """
    if args.system is not None:
        for option in ("vehicle", "curvature"):
            if getattr(args, option) is not None:
                raise InputError(
                    f"expected --system or --{option}, got both; a benchmark loop brings its own "
                    "vehicle and path, so leave one of them out"
                )
        return _benchmark(args.system)
    low, high = args.curvature or (0.0, 0.0)
    if low > high:
        raise InputError(
            f"--curvature: expected LOW <= HIGH, got {low!r} {high!r}; swap the two numbers"
        )
    vehicle = chosen_vehicle(args)
    from workbench.models.bicycle import PathFrame

    loop = vehicle.closed_loop(vehicle.track(), PathFrame(low, high))
    return Subject(vehicle.name, loop, vehicle.initial_set, vehicle.operation.region)


def _benchmark(name: str) -> Subject:
    from workbench.models.benchmarks import all_benchmarks

    found = next(each for each in all_benchmarks() if each.name.lower() == name)
    return Subject(found.name, found.system, found.initial_set, None)


def add_time_options(parser: argparse.ArgumentParser, *, step_s: float) -> None:
    """Add `--horizon` and `--step`; `check_steps` holds them against each other."""
    parser.add_argument(
        "--horizon", type=positive, default=3.0, metavar="S", help="in s (default: 3)"
    )
    parser.add_argument(
        "--step", type=positive, default=step_s, metavar="S", help=f"in s (default: {step_s:g})"
    )


def check_steps(args: argparse.Namespace, *, most: int = _MOST_STEPS) -> None:
    """Raise InputError where `--horizon` and `--step` ask for a run that would not end."""
    if args.horizon > _LONGEST_S:
        raise InputError(
            f"--horizon: expected at most {_LONGEST_S:g} s, got {args.horizon:g}; bounds over "
            "longer times say nothing, give a few seconds"
        )
    if args.step > args.horizon:
        raise InputError(
            f"expected --step <= --horizon, got {args.step:g} s and {args.horizon:g} s; "
            "shorten the step or lengthen the horizon"
        )
    if args.horizon / args.step > most:
        raise InputError(
            f"expected at most {most} steps, got --horizon {args.horizon:g} / --step "
            f"{args.step:g} = {args.horizon / args.step:.3g}; give a longer step"
        )


def check_whole_steps(args: argparse.Namespace) -> None:
    """Raise InputError unless `--horizon` is a whole number of `--step`."""
    steps = round(args.horizon / args.step)
    if abs(steps * args.step - args.horizon) > _ROUNDING * args.horizon:
        raise InputError(
            f"expected a horizon of whole steps, got --horizon {args.horizon:g} and --step "
            f"{args.step:g}; give --step {args.horizon / steps!r}"
        )


def shown_instants(horizon_s: float) -> tuple[float, ...]:
    """The instants that tables show: 1, 2 and 3 s as far as the horizon goes, and its end."""
    return (*(t for t in _SHOWN_S if t < horizon_s), horizon_s)


def number(text: str) -> float:
    """A finite number, for argparse."""
    return _parsed(text, float, "a finite number", math.isfinite)


def positive(text: str) -> float:
    """A finite number > 0, for argparse."""
    return _parsed(text, float, "a finite number > 0", lambda x: math.isfinite(x) and x > 0.0)


def share(text: str) -> float:
    """A number strictly between 0 and 1, for argparse."""
    return _parsed(text, float, "a number between 0 and 1", lambda x: 0.0 < x < 1.0)


def count(text: str) -> int:
    """A whole number >= 1, for argparse."""
    return _parsed(text, int, "a whole number >= 1", lambda x: x >= 1)


def seed(text: str) -> int:
    """A whole number >= 0, for argparse."""
    return _parsed(text, int, "a whole number >= 0", lambda x: x >= 0)


def _parsed(text: str, kind: Callable[[str], _T], what: str, fits: Callable[[_T], bool]) -> _T:
    try:
        value = kind(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected {what}, got {text!r}") from None
    if not fits(value):
        raise argparse.ArgumentTypeError(f"expected {what}, got {text!r}")
    return value


def add_file_option(parser: argparse.ArgumentParser, option: str, *, text: str) -> None:
    """Add an option that names a file to write; pass its value to `writable_file` first."""
    parser.add_argument(option, type=Path, metavar="FILE", help=text)


def writable_file(target: Path | None, option: str) -> None:
    """Try a write in the folder of `target`, so that a long run cannot end in a refusal.

    A folder that is missing is made for the trial only; writing makes it again. Raises InputError
    when it cannot be written; None is no file and always right.
    """
    if target is None:
        return
    reason = "it is a folder" if target.is_dir() else ""
    missing = [each for each in target.parents if not each.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except FileExistsError:
        reason = "a part of its path is a file, not a folder"
    except OSError as error:
        reason = str(error.strerror)
    finally:
        for each in missing:
            with contextlib.suppress(OSError):
                each.rmdir()
    if reason:
        raise InputError(
            f"{option}: expected a file that can be written, got {target} ({reason}); "
            "name one in another folder, or change its permissions"
        )


def separate_files(args: argparse.Namespace, *options: str) -> None:
    """Raise InputError where two of the options name one file; the later would overwrite it."""
    taken: dict[Path, str] = {}
    for option in options:
        target = getattr(args, option)
        if target is None:
            continue
        first = taken.setdefault(target.resolve(), option)
        if first != option:
            raise InputError(
                f"expected different files for --{first} and --{option}, got {target} for both; "
                "rename one of them"
            )


def command_line(
    command: str,
    args: argparse.Namespace,
    *,
    positional: Sequence[str] = (),
    repeated: Sequence[str] = (),
) -> str:
    """The command that makes the same result again, every option written out.

    positional: the arguments that are given without an option, in their order; repeated: those
    whose option stands before every value.
    """
    given = (getattr(args, name) for name in positional)
    words = ["workbench", command]
    words += [str(word) for each in given for word in (each if isinstance(each, list) else [each])]
    for name, value in sorted(vars(args).items()):
        option = "--" + name.replace("_", "-")
        if value is None or value is False or name in ("json", *positional):
            continue
        values = value if isinstance(value, list) else [] if value is True else [value]
        if name in repeated:
            words += [word for each in values for word in (option, str(each))]
        else:
            words += [option, *map(str, values)]
    return shlex.join(words)


def text_table(headings: list[str], rows: list[list[str | int | float | None]]) -> str:
    """Aligned columns for a terminal: words to the left, numbers to the right."""
    from workbench.report.tables import shown

    cells = [headings, *([shown(cell) for cell in row] for row in rows)]
    widths = [max(len(row[column]) for row in cells) for column in range(len(headings))]
    worded = [all(isinstance(row[column], str) for row in rows) for column in range(len(headings))]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if left else cell.rjust(width)
            for cell, width, left in zip(row, widths, worded, strict=True)
        ).rstrip()
        for row in cells
    )


def percent(share: float) -> str:
    """Rounded down: what is not all must not look like it."""
    return f"{math.floor(1e5 * share) / 1e3:.3f} %"
