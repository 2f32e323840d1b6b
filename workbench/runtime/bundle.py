"""Load a bundle: hashes first, then the machine, then the code, then its golden vectors."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import platform
import struct
from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import final, overload

from workbench.errors import InputError
from workbench.runtime.contents import (
    CHECKED_FILES,
    CHECKSUM_FILE,
    LIBRARY_FILE,
    MANIFEST_FILE,
    Field,
    Golden,
    Manifest,
)
from workbench.runtime.floats import float_mode_fault
from workbench.runtime.manifest import manifest_from_json
from workbench.runtime.native import NativeKernel, check_machine
from workbench.runtime.policies.deciding import Deciding

OPEN_FIELDS = frozenset({"people_tubes", "people_pieces"})
"""Query fields that counts elsewhere in the query say how much of is read."""

_MEND = "copy the bundle again, or rebuild it with `workbench build`"


@final
class Result:
    """One call's outcome: a copy of the result buffer, read field by field only where asked.

    code: what the entry point returned, 0 when the kernel ran to its end.
    """

    __slots__ = ("_fields", "_values", "code")

    def __init__(self, code: int, buffer: bytes, fields: Mapping[str, Field]) -> None:
        self.code = code
        self._values = memoryview(buffer).cast("d")
        self._fields = fields

    def values(self, name: str) -> memoryview[float]:
        """The numbers of a field, without a copy."""
        return self._values[self._fields[name].span]

    def scalar(self, name: str) -> float:
        """The first number of a field."""
        return self._values[self._fields[name].offset]

    def rows(self, name: str, *, width: int, count: int) -> Rows:
        """The first `count` rows of a field that holds a row-major matrix with `width` columns."""
        return Rows(self.values(name)[: width * count], width)


@final
class Rows(Sequence[tuple[float, ...]]):
    """Rows of a row-major matrix, made into tuples only when they are read; numbers: all of it."""

    __slots__ = ("_width", "numbers")

    def __init__(self, numbers: memoryview[float], width: int) -> None:
        self.numbers = numbers
        self._width = width

    def __len__(self) -> int:
        return len(self.numbers) // self._width

    @overload
    def __getitem__(self, index: int) -> tuple[float, ...]: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[tuple[float, ...], ...]: ...

    def __getitem__(self, index: int | slice) -> tuple[float, ...] | tuple[tuple[float, ...], ...]:
        if isinstance(index, slice):
            return tuple(self[k] for k in range(*index.indices(len(self))))
        start = range(len(self))[index] * self._width
        return tuple(self.numbers[start : start + self._width])


@final
class Bundle:
    """A verified, loaded bundle: what it claims (`manifest`, and the SHA-256 of the bytes that say
    so) and its one entry point (`call`)."""

    def __init__(self, manifest: Manifest, kernel: NativeKernel, manifest_sha256: str) -> None:
        self.manifest = manifest
        self.manifest_sha256 = manifest_sha256
        self._kernel = kernel
        self._query_fields = {field.name: field for field in manifest.query}
        self._result_fields = {field.name: field for field in manifest.result}
        self._required = {field.name for field in manifest.query if field.default is None}
        self._template = array("d")
        for field in manifest.query:
            missing = 0.0 if field.name in OPEN_FIELDS else math.nan
            self._template.extend(field.default or (missing,) * field.count)

    def with_deciding(self, deciding: Deciding) -> Bundle:
        """The same proof with another policy deciding: for studies, as no file says so."""
        manifest = dataclasses.replace(self.manifest, deciding=deciding.value)
        return Bundle(manifest, self._kernel, self.manifest_sha256)

    def call(self, values: Mapping[str, Sequence[float]]) -> Result:
        """Run the kernel once.

        values: query field name -> its numbers, exactly as many as the field holds; fields with a
        default may be left out; of `OPEN_FIELDS` the last numbers may be missing and are 0. Raises
        InputError on unknown, missing or wrongly sized fields.
        Nothing is checked about the numbers themselves: `Monitor` does that, before and after.
        """
        missing = self._required - values.keys()
        if missing:
            raise InputError(f"the query lacks {sorted(missing)}; these fields have no default")
        query = self._kernel.query
        query[:] = self._template
        for name, numbers in values.items():
            field = self._query_fields.get(name)
            if field is None:
                raise InputError(
                    f"the query has no field {name!r}; it has {sorted(self._query_fields)}"
                )
            block = array("d", numbers)
            short = name in OPEN_FIELDS and len(block) <= field.count
            if len(block) != field.count and not short:
                raise InputError(
                    f"query field {name!r}: expected {field.count} numbers, got {len(block)}"
                )
            query[field.offset : field.offset + len(block)] = block
        code = self._kernel.run()
        return Result(code, bytes(self._kernel.result), self._result_fields)


def load_bundle(folder: Path | str) -> Bundle:
    """Verify a bundle folder and load its kernel.

    In order: SHA-256 of manifest.json, kernel.so, kernel.c and kernel.h against SHA256SUMS; the
    manifest; the machine type; only then the library, from the very bytes that were hashed;
    exported sizes; golden vectors bit for bit (every NaN counts as the same); the floating-point
    mode before and after. Hashes show damage, not intent: whoever can rewrite SHA256SUMS can
    rewrite the rest; `load_signed_bundle` asks who wrote it.
    Raises InputError that names the file at fault, what was expected and what came.
    """
    place = Path(folder)
    _require_files(place)
    names = (CHECKSUM_FILE, *CHECKED_FILES)
    return bundle_of({name: (place / name).read_bytes() for name in names}, place)


def bundle_of(files: Mapping[str, bytes], folder: Path) -> Bundle:
    """Verify and load what was read of a bundle, without reading anything again.

    files: name -> content, of SHA256SUMS and all it lists; folder: where they came from, for
    messages. What is checked, and how it fails: as `load_bundle` says.
    """
    manifest = checked_manifest(files, folder)
    library = files[LIBRARY_FILE]
    check_machine(library, built_for=manifest.machine, here=platform.machine())
    kernel = NativeKernel(library, manifest.kernel)
    for index, golden in enumerate(manifest.golden):
        _check_golden(kernel, golden, manifest.result, index)
    fault = float_mode_fault()
    if fault is not None:
        raise InputError(f"after the golden vectors {fault}: the kernel changed it; {_MEND}")
    return Bundle(manifest, kernel, hashlib.sha256(files[MANIFEST_FILE]).hexdigest())


def checked_manifest(files: Mapping[str, bytes], folder: Path) -> Manifest:
    """The manifest, after every file's hash was compared with SHA256SUMS.

    Nothing is executed. Raises InputError as `load_bundle` does.
    """
    digests = _listed_digests(files[CHECKSUM_FILE], folder / CHECKSUM_FILE)
    for name in CHECKED_FILES:
        found = hashlib.sha256(files[name]).hexdigest()
        if found != digests[name]:
            raise InputError(
                f"{folder / name} and its line in {CHECKSUM_FILE} disagree: expected SHA-256 "
                f"{digests[name]}, got {found}; one of them was changed or damaged, {_MEND}"
            )
    try:
        text = files[MANIFEST_FILE].decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{MANIFEST_FILE}: expected UTF-8 text ({error}); {_MEND}") from None
    return manifest_from_json(text)


def _require_files(folder: Path) -> None:
    if not folder.is_dir():
        raise InputError(f"{folder}: expected a bundle folder, found none; see `workbench build`")
    missing = [name for name in (CHECKSUM_FILE, *CHECKED_FILES) if not (folder / name).is_file()]
    if missing:
        raise InputError(f"{folder} is not a complete bundle, it lacks {missing}; {_MEND}")


def _listed_digests(text: bytes, path: Path) -> dict[str, str]:
    lines = text.split(b"\n")
    digests = {}
    # The text must end in one newline, hence the empty piece after the last.
    for line in lines[:-1] if lines[-1] == b"" else lines:
        digest, gap, name = line[:64], line[64:66], line[66:].decode("ascii", "replace")
        if len(digest) < 64 or digest.strip(b"0123456789abcdef") or gap != b"  ":
            raise InputError(
                f"{path}: expected lines of 64 hex digits, two spaces and a name, "
                f"got {line!r}; {_MEND}"
            )
        if name in digests or name not in CHECKED_FILES:
            raise InputError(
                f"{path}: expected {list(CHECKED_FILES)} once each, found {name!r}; {_MEND}"
            )
        digests[name] = digest.decode("ascii")
    absent = [name for name in CHECKED_FILES if name not in digests]
    if absent or lines[-1] != b"":
        raise InputError(f"{path}: incomplete, it lacks {absent or 'its last newline'}; {_MEND}")
    return digests


def _check_golden(
    kernel: NativeKernel, golden: Golden, fields: Sequence[Field], index: int
) -> None:
    kernel.query[:] = array("d", golden.query)
    code = kernel.run()
    if code != golden.returns:
        raise InputError(
            f"golden vector {index}: expected the kernel to return {golden.returns}, "
            f"got {code}; {_MEND}"
        )
    place = first_difference(golden.result, kernel.result)
    if place is not None:
        field = next(f for f in fields if f.offset <= place < f.offset + f.count)
        raise InputError(
            f"golden vector {index}: {field.name}[{place - field.offset}] is "
            f"{kernel.result[place].hex()}, the bundle promised {golden.result[place].hex()}; this "
            "machine computes differently: rebuild the bundle with `workbench build` here"
        )


def first_difference(expected: Sequence[float], found: Sequence[float]) -> int | None:
    """Index of the first number that differs in its bits, or None; any NaN equals any NaN."""
    for index, (want, have) in enumerate(zip(expected, found, strict=True)):
        if want != have or want == 0.0:
            both_nan = math.isnan(want) and math.isnan(have)
            if not both_nan and struct.pack("d", want) != struct.pack("d", have):
                return index
    return None
