"""Options and file handling that several commands share."""

from __future__ import annotations

import argparse
import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.errors import InputError
from workbench.runtime.policies.deciding import Deciding

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle

# What the commands give a monitor: the tube's grid, the SAFE verdicts in a row that end braking
# (below five the decision chatters while somebody crosses), and the distance SAFE must prove.
MONITOR_STEP_S = 0.025
RELEASE_STEPS = 5
CLEARANCE_REQUIRED_M = 0.2


def add_vehicle_option(parser: argparse.ArgumentParser) -> None:
    """Add `--vehicle FILE`; `chosen_vehicle` reads it."""
    parser.add_argument(
        "--vehicle",
        type=Path,
        metavar="FILE",
        help="vehicle file, TOML (default: the GEM e2 that is shipped)",
    )


def chosen_vehicle(args: argparse.Namespace) -> Vehicle:
    """The vehicle that `--vehicle` names, or the shipped one. Raises InputError on a bad file."""
    from workbench.models.vehicle import gem_e2, load_vehicle

    if args.vehicle is None:
        return gem_e2()
    return load_vehicle(args.vehicle)


def add_deciding_option(parser: argparse.ArgumentParser) -> None:
    """Add `--deciding POLICY`; `chosen_deciding` reads it."""
    parser.add_argument(
        "--deciding",
        choices=[deciding.value for deciding in Deciding],
        default=Deciding.BOTH.value,
        help="whose TRACK counts; both: only that of both (default: both)",
    )


def chosen_deciding(args: argparse.Namespace) -> Deciding:
    """The policy that `--deciding` names."""
    return Deciding(args.deciding)


def add_output_option(parser: argparse.ArgumentParser, *, default: str) -> None:
    """Add `--out DIR`; pass its value to `writable_folder` before any work."""
    parser.add_argument(
        "--out",
        type=_folder,
        metavar="DIR",
        default=Path(default),
        help=f"folder for the results (default: {default})",
    )


def _folder(text: str) -> Path:
    """A folder's name, for argparse; "" would be the current folder."""
    if not text.strip():
        raise argparse.ArgumentTypeError(
            f"expected the name of a folder, got {text!r}; the current one is ."
        )
    return Path(text)


def writable_folder(folder: Path) -> Path:
    """Create `folder` if needed and try a write, so that a long run cannot end in a refusal.

    Raises InputError when it cannot be created or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        reason = error.strerror
        if any(each.is_file() for each in (folder, *folder.parents)):
            reason = "it is a file, or lies in one"
        raise InputError(
            f"expected an output folder that can be written, got {folder} ({reason}); "
            "choose another with --out DIR, or change its permissions"
        ) from error
    return folder


@contextlib.contextmanager
def output_folder(folder: Path) -> Iterator[Path]:
    """As `writable_folder`; where the block fails, folders made for it and still empty go again."""
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        yield writable_folder(folder)
    except BaseException:
        for each in made:
            try:
                each.rmdir()
            except OSError:
                break
        raise


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Path of a temporary file beside `target`, which takes its place when the block succeeds.

    Missing folders are made.
    A reader finds the old file or the new one, never a part; an error leaves only the old one.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        yield temporary
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(target: Path, text: str) -> None:
    """Write a UTF-8 file whole or not at all."""
    with replacing(target) as temporary:
        temporary.write_text(text, encoding="utf-8")


def marked(path: Path, begin: str, end: str) -> tuple[str, str]:
    """What stands before and after the marks. InputError unless each stands there once."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"--into: expected a document that can be read, got {path} ({error}); write one with "
            f"the lines {begin} and {end}"
        ) from error
    before, found, rest = text.partition(begin)
    _, ended, after = rest.partition(end)
    if not found or not ended or begin in rest or end in before + after:
        raise InputError(
            f"--into: expected the lines {begin} and {end} once each in {path}, in this order"
        )
    return before, after
