"""Files that name the loop they belong to: a learned bound, and the witness against one."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Final

from workbench.claims import Rigor
from workbench.cli.analysis_options import Subject
from workbench.cli.common import write_text
from workbench.cli.output import plain
from workbench.errors import InputError
from workbench.sensitivity import Discrepancy
from workbench.sensitivity.learned import ExponentialEnvelope
from workbench.sensitivity.sampling import step_count
from workbench.sensitivity.scenario import ScenarioStatement
from workbench.sensitivity.witness import Witness

_LEARNED: Final = "learned discrepancy 1"
_WITNESS: Final = "witness 1"
_MADE_BY: Final = {
    _LEARNED: "a learned bound, written by `workbench learn --save FILE`",
    _WITNESS: "a witness, written by `workbench examine` as witness.json",
}


def save_learned(target: Path, bound: Discrepancy, subject: Subject) -> None:
    """Write a learned bound; `load_learned` reads it back without loss."""
    growth = bound.growth
    assert isinstance(growth, ExponentialEnvelope)
    document = {
        "format": _LEARNED,
        "loop": _loop(subject),
        "horizon_s": bound.horizon_s,
        "norm": bound.norm,
        "condition": bound.condition,
        "scale": growth.scale,
        "amplitude": growth.amplitude,
        "rate_per_s": growth.rate_per_s,
        "statement": growth.evidence,
    }
    write_text(target, json.dumps(plain(document), indent=2, allow_nan=False) + "\n")


def load_learned(path: Path, subject: Subject) -> Discrepancy:
    """Read a learned bound. Raises InputError on another format, loop or initial set."""
    document = _document(path, _LEARNED)
    _require_same_loop(path, document, subject)
    names = subject.system.ode.names
    try:
        columns = [tuple(map(float, document[key])) for key in ("scale", "amplitude", "rate_per_s")]
        numbers = [float(document["horizon_s"]), *(x for column in columns for x in column)]
        if any(len(column) != len(names) for column in columns):
            raise ValueError(f"expected {len(names)} numbers per list, one per state")
        if not all(map(math.isfinite, numbers)):
            raise ValueError("expected finite numbers")
        if min(numbers[0], *columns[0], *columns[1]) < 0.0:
            raise ValueError("expected no negative horizon, scale or amplitude")
        scale, amplitude, rate = columns
        return Discrepancy(
            names=names,
            region=subject.initial_set.reordered(names),
            horizon_s=numbers[0],
            norm=str(document["norm"]),
            rigor=Rigor.SAMPLED,
            condition=str(document["condition"]),
            growth=ExponentialEnvelope(
                scale, amplitude, rate, ScenarioStatement(**document["statement"])
            ),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise _spoilt(path, error) from None


def save_witness(target: Path, witness: Witness | None, subject: Subject, *, verdict: str) -> None:
    """Write the witness (or that there is none) with the loop it was found on."""
    document = {
        "format": _WITNESS,
        "verdict": verdict,
        "loop": _loop(subject),
        "witness": witness,
    }
    write_text(target, json.dumps(plain(document), indent=2, allow_nan=False) + "\n")


def load_witness(path: Path, subject: Subject) -> Witness:
    """Read a witness. Raises InputError on another format or loop, and where there is none."""
    document = _document(path, _WITNESS)
    _require_same_loop(path, document, subject)
    if document.get("witness") is None:
        raise InputError(
            f"{path}: expected a witness, and the examination found none "
            f"(verdict {document.get('verdict')}); there is nothing to replay"
        )
    try:
        fields = dict(document["witness"])
        for key in ("first", "second", "parameters"):
            fields[key] = tuple(map(float, fields[key]))
        for key in ("time_s", "distance", "integration_error", "bound", "step_s"):
            fields[key] = float(fields[key])
        witness = Witness(**fields)
        ode = subject.system.ode
        sizes = (len(witness.first), len(witness.second), len(witness.parameters))
        if sizes != (len(ode.states), len(ode.states), len(ode.parameters)):
            raise ValueError("expected one number per state and parameter")
        numbers = (*witness.first, *witness.second, *witness.parameters, witness.bound)
        if not all(map(math.isfinite, numbers)) or witness.coordinate not in ode.names:
            raise ValueError("expected finite numbers and a state's name as the coordinate")
        step_count(witness.time_s, witness.step_s)
        return witness
    except (KeyError, TypeError, ValueError) as error:
        raise _spoilt(path, error) from None


def _loop(subject: Subject) -> dict[str, Any]:
    """What makes the loop: its form, and the range of every number in it."""
    ode, box = subject.system.ode, subject.initial_set
    ranged = (*ode.parameters, *ode.disturbances)
    return {
        "form": ode.name,
        "states": list(ode.names),
        "ranges": {each.name: [each.lower, each.upper] for each in ranged},
        "initial_set": {name: list(box.interval(name)) for name in box.names},
    }


def _require_same_loop(path: Path, document: dict[str, Any], subject: Subject) -> None:
    stored, own = document.get("loop"), _loop(subject)
    for part, expected in own.items():
        found = stored.get(part) if isinstance(stored, dict) else None
        if found == expected:
            continue
        where = part
        if isinstance(found, dict) and isinstance(expected, dict):
            where = next(
                key for key in {**expected, **found} if expected.get(key) != found.get(key)
            )
            found, expected = found.get(where), expected.get(where)
        raise InputError(
            f"{path}: expected a file made with the loop of {subject.name}, got another "
            f"({where}: {expected} here, {found} in the file); pass the same --vehicle, --system "
            "and --curvature as then, or make the file again"
        )


def _document(path: Path, kind: str) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; expected {_MADE_BY[kind]}") from None
    except OSError as error:
        raise InputError(f"{path}: expected {_MADE_BY[kind]}, got {error.strerror}") from None
    except ValueError as error:
        raise InputError(
            f"{path}: expected {_MADE_BY[kind]}, but it is not JSON ({error}); make it again"
        ) from None
    if not isinstance(document, dict) or document.get("format") != kind:
        raise InputError(
            f'{path}: expected {_MADE_BY[kind]}, got JSON without "format": "{kind}"; '
            "name another file or make it again"
        )
    return document


def _spoilt(path: Path, error: Exception) -> InputError:
    what = f"the entry {error} is missing" if isinstance(error, KeyError) else str(error)
    return InputError(f"{path}: expected the file as it was written, but: {what}; make it again")
