"""The witness against a bound on a black box's runs, as a file that names the box."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Final

from workbench.cli.common import write_text
from workbench.cli.learn_sources import Source
from workbench.cli.output import plain
from workbench.errors import InputError
from workbench.sensitivity.witness import SimulatedWitness

_FORMAT: Final = "witness of a simulator 1"
_MADE_BY: Final = "a witness, written by `workbench examine --from ...` as witness.json"


def save_simulated(
    target: Path, witness: SimulatedWitness | None, source: Source, *, verdict: str
) -> None:
    """Write the witness (or that there is none) with whose runs it was found in."""
    document = {
        "format": _FORMAT,
        "verdict": verdict,
        "source": source.kind,
        "runs_of": dict(source.identity),
        "times_s": source.pairs.times,
        "witness": witness,
    }
    write_text(target, json.dumps(plain(document), indent=2, allow_nan=False) + "\n")


def load_simulated(path: Path, source: Source) -> SimulatedWitness:
    """Read it back. Raises InputError for another format or simulator, and where there is none."""
    document = _document(path)
    for key, own in (
        ("source", source.kind),
        ("runs_of", dict(source.identity)),
        ("times_s", source.pairs.times),
    ):
        if document.get(key) != json.loads(json.dumps(plain(own))):
            raise InputError(
                f"{path}: expected a witness of {source.title}, got one of another simulator "
                f"({key} differs); pass the same --from, --start, --vehicle, --horizon and --step "
                "as then"
            )
    fields = document.get("witness")
    if fields is None:
        raise InputError(
            f"{path}: expected a witness, and the examination found none "
            f"(verdict {document.get('verdict')}); there is nothing to replay"
        )
    try:
        witness = SimulatedWitness(
            tuple(map(float, fields["first"])),
            tuple(map(float, fields["second"])),
            int(fields["seed"]),
            float(fields["time_s"]),
            str(fields["coordinate"]),
            float(fields["distance"]),
            float(fields["bound"]),
        )
        size = len(source.names)
        if (len(witness.first), len(witness.second)) != (size, size):
            raise ValueError("expected one number per state")
        if not all(map(math.isfinite, (*witness.first, *witness.second, witness.bound))):
            raise ValueError("expected finite numbers")
        if witness.coordinate not in source.names:
            raise ValueError("expected a state's name as the coordinate")
        if not 0 <= witness.seed < 2**64:
            raise ValueError("expected a seed of 64 bits")
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: expected the file as it was written, but: {error}; make it again"
        ) from None
    return witness


def _document(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: expected {_MADE_BY}, got {error}") from None
    if not isinstance(document, dict) or document.get("format") != _FORMAT:
        raise InputError(
            f'{path}: expected {_MADE_BY}, got JSON without "format": "{_FORMAT}"; name another '
            "file or pass the --from it was made with"
        )
    return document
