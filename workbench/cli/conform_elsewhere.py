"""Further folders that `workbench conform --test-on` tests a fit on."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle
    from workbench.simulation.conformance.windows import Measured, Window


def check_folders(args: argparse.Namespace, holds: Callable[[Path], bool], expected: str) -> None:
    """Raise InputError for a folder that does not hold what is expected, or comes twice."""
    seen = [args.source.resolve()]
    for folder in args.test_on:
        if not holds(folder):
            raise InputError(f"--test-on: expected a folder with {expected}, got {folder}")
        if folder.resolve() in seen:
            raise InputError(
                f"--test-on: expected folders other than SOURCE, each once, got {folder}; the "
                "recordings of SOURCE that are not fitted to are tested on anyway"
            )
        seen.append(folder.resolve())


def check_drivers(folders: Sequence[Path], vehicle: Vehicle) -> None:
    """Raise InputError for runs of another vehicle: with other gains they say nothing of this one's
    loop."""
    from workbench.models.vehicle import load_vehicle

    for folder in folders:
        file = folder / "vehicle.toml"
        if not file.is_file():
            continue
        other = dataclasses.replace(load_vehicle(file), uncertainty=vehicle.uncertainty)
        if other != vehicle:
            raise InputError(
                f"--test-on: expected runs of {vehicle.name} as its file has it (but for "
                f"[uncertainty]), got {file}, which differs; drive them with the same vehicle file"
            )


def _motion(window: Window) -> tuple[float, bytes]:
    return window.start_s, window.measured.tobytes()


def windows_elsewhere(
    args: argparse.Namespace, measured_here: Measured, cut: Callable[[Path], Measured]
) -> tuple[tuple[str, Measured], ...]:
    """The windows that `cut` finds in each folder, with the folder as it was given. Raises
    InputError for none, and for those that SOURCE has as well."""
    found = []
    here = {_motion(window): window.recording for window in measured_here.windows}
    for folder in args.test_on:
        measured = cut(folder)
        for window in measured.windows:
            again = here.get(_motion(window))
            if again is not None:
                raise InputError(
                    f"--test-on: expected motion that SOURCE does not have, got {window.recording} "
                    f"in {folder} from {window.start_s:g} s, as {again} in {args.source}; leave it "
                    "out, or nothing is tested by it"
                )
        if not measured.windows:
            raise InputError(
                f"--test-on: expected windows of {args.window:g} s in {folder}, got none; shorten "
                "--window, or take longer recordings"
            )
        found.append((str(folder), measured))
    return tuple(found)
