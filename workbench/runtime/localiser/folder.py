"""Load what `workbench build-localiser` wrote: signature and hashes first, then the code."""

from __future__ import annotations

import os
import platform
from array import array
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime.bundle import first_difference
from workbench.runtime.contents import CHECKSUM_FILE
from workbench.runtime.floats import float_mode_fault
from workbench.runtime.keys import read_public_key
from workbench.runtime.localiser.native_steps import REBUILD, native_steps
from workbench.runtime.localiser.numbers import NUMBERS_FILE, Numbers, numbers_from_json
from workbench.runtime.localiser.steps import NAMES, Step, Steps
from workbench.runtime.manifest import checksums_text
from workbench.runtime.native import check_machine
from workbench.runtime.reading import read_once
from workbench.runtime.signature import SIGNATURE_FILE, check_signature, signature_from
from workbench.runtime.signed_bundle import MOST_BYTES, require_apart

LIBRARY_FILE: Final = "localiser.so"
SOURCE_FILE: Final = "localiser.c"
FILES: Final = (NUMBERS_FILE, LIBRARY_FILE, SOURCE_FILE)
"""What SHA256SUMS lists."""


@final
@dataclass(frozen=True, slots=True)
class Built:
    """A verified, loaded localiser: its numbers and its steps."""

    numbers: Numbers
    steps: Steps


def load_localiser(folder: Path, *, public_key: Path | None) -> Built:
    """Verify a folder that `workbench build-localiser` wrote, then load its code.

    public_key: of `workbench keygen`, installed apart from the folder; None leaves the signature
    unasked for. In order: every file is read once; the signature over the bytes of SHA256SUMS; its
    lines against the files; the numbers; the machine; the library, from the very bytes that were
    hashed; its functions' sizes; one recorded call of each, bit for bit; the floating-point mode.
    Raises InputError that names the file at fault, what was expected and what came.
    """
    if not os.path.isdir(folder):
        raise InputError(
            f"{folder}: expected a folder of a localiser, found none; see `workbench "
            "build-localiser`"
        )
    names = (CHECKSUM_FILE, *FILES)
    missing = [name for name in names if not os.path.lexists(folder / name)]
    if missing:
        raise InputError(f"{folder}: expected a whole localiser, it lacks {missing}; {_COPY}")
    files = {name: read_once(folder / name, most_bytes=MOST_BYTES).content for name in names}
    if public_key is not None:
        _check_signed(folder, files[CHECKSUM_FILE], public_key)
    check_hashes(files, folder)
    numbers = numbers_from_json(files[NUMBERS_FILE])
    library = files[LIBRARY_FILE]
    check_machine(
        library, built_for=numbers.machine, here=platform.machine(), name=LIBRARY_FILE, mend=REBUILD
    )
    steps = native_steps(library)
    for name, golden in zip(NAMES, numbers.golden, strict=True):
        _check_golden(name, getattr(steps, name), golden.query, golden.result)
    fault = float_mode_fault()
    if fault is not None:
        raise InputError(f"after {LIBRARY_FILE} was loaded {fault}; {REBUILD}")
    return Built(numbers, steps)


def check_hashes(files: Mapping[str, bytes], folder: Path) -> None:
    """Raise InputError unless SHA256SUMS is exactly that of `FILES`."""
    listed = files[CHECKSUM_FILE]
    for name in FILES:
        line = checksums_text({name: files[name]}).encode()
        if line not in listed:
            raise InputError(
                f"{folder / name}: expected the file whose hash {CHECKSUM_FILE} lists, got "
                f"another; one of the two was changed or damaged: {_COPY}"
            )
    if listed != checksums_text({name: files[name] for name in FILES}).encode():
        raise InputError(f"{folder / CHECKSUM_FILE}: expected a line for each of {FILES}; {_COPY}")


def called(step: Step, given: array[float]) -> tuple[float, ...]:
    """One call with all arguments one after the other; the results likewise."""
    begin = 0
    for place in step.given:
        place[:] = given[begin : begin + len(place)]
        begin += len(place)
    step.run()
    return tuple(number for part in step.found for number in part)


def _check_golden(
    name: str, step: Step, given: tuple[float, ...], expected: tuple[float, ...]
) -> None:
    place = first_difference(expected, called(step, array("d", given)))
    if place is not None:
        raise InputError(
            f"{LIBRARY_FILE}: the recorded call of {name} gives another number {place} than it did "
            f"where it was built, so this machine computes differently; {REBUILD}"
        )


def _check_signed(folder: Path, sums: bytes, public_key: Path) -> None:
    require_apart(public_key, folder)
    key, path = read_public_key(public_key), folder / SIGNATURE_FILE
    if not os.path.lexists(path):
        raise InputError(
            f"{folder}: expected a signed localiser, got one without {SIGNATURE_FILE}; see that it "
            "is the right one and build it with `workbench build-localiser --key`"
        )
    signature = signature_from(read_once(path, most_bytes=MOST_BYTES).content, path)
    check_signature(sums, signature, key=key, path=path)


_COPY: Final = "copy the folder again, or build it with `workbench build-localiser`"
