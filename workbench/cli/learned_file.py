"""Files that name the loop they belong to: a learned bound, and the witness against one."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Final

from workbench.claims import Rigor
from workbench.cli.analysis_options import Subject
from workbench.cli.common import write_text
from workbench.cli.learn_sources import COMPILED, MODEL, Source
from workbench.cli.learned_growth import form_of, growth_fields, read_growth
from workbench.cli.output import plain
from workbench.errors import InputError
from workbench.sensitivity import Discrepancy
from workbench.sensitivity.learning.statement import Argument, Statement
from workbench.sensitivity.sampling import step_count
from workbench.sensitivity.witness import Witness
from workbench.sets import Box

_LEARNED: Final = "learned discrepancy 2"
_FORMER: Final = "learned discrepancy 1"
_WITNESS: Final = "witness 1"
_MADE_BY: Final = {
    _LEARNED: "a learned bound, written by `workbench learn --save FILE`",
    _WITNESS: "a witness, written by `workbench examine` as witness.json",
}


def save_learned(
    target: Path,
    bound: Discrepancy,
    subject: Subject | None = None,
    *,
    source: Source | None = None,
) -> None:
    """Write a learned bound with whose runs it was learned from; `load_learned` reads it back
    without loss. subject: the model, where it was learned from the model's runs; else source."""
    document = {
        "format": _LEARNED,
        "source": MODEL if source is None else source.kind,
        "loop": _identity(subject, source),
        "states": bound.names,
        "region": None if bound.region is None else _intervals(bound.region),
        "horizon_s": bound.horizon_s,
        "norm": bound.norm,
        "condition": bound.condition,
        "form": form_of(bound.growth),
        **growth_fields(bound.growth),
        "statements": bound.statements,
    }
    write_text(target, json.dumps(plain(document), indent=2, allow_nan=False) + "\n")


def load_learned(
    path: Path, subject: Subject | None = None, *, source: Source | None = None
) -> Discrepancy:
    """Read a learned bound of this model, or of this source.

    Raises InputError on another format, source, loop or initial set.
    """
    document = _document(path, _LEARNED)
    _require_same_runs(path, document, subject, source)
    try:
        names = tuple(map(str, document["states"]))
        horizon_s = float(document["horizon_s"])
        if not (math.isfinite(horizon_s) and horizon_s > 0.0):
            raise ValueError("expected a finite horizon_s > 0")
        stored = document["region"]
        region = None if stored is None else {name: _interval(stored[name]) for name in names}
        return Discrepancy(
            names=names,
            region=None if region is None else Box.from_intervals(region),
            horizon_s=horizon_s,
            norm=str(document["norm"]),
            rigor=Rigor.SAMPLED,
            condition=str(document["condition"]),
            growth=read_growth(document, len(names)),
            statements=tuple(map(_statement, document["statements"])),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise _spoilt(path, error) from None


def _interval(ends: list[Any]) -> tuple[float, float]:
    low, high = map(float, ends)
    return low, high


def _statement(fields: dict[str, Any]) -> Statement:
    numbers = {key: float(fields[key]) for key in ("epsilon", "epsilon_at_an_instant", "delta")}
    if not all(0.0 <= value <= 1.0 for value in numbers.values()):
        raise ValueError("expected probabilities between 0 and 1 in every statement")
    return Statement(**{**fields, **numbers, "argument": Argument[fields["argument"]]})


def save_witness(target: Path, witness: Witness | None, subject: Subject, *, verdict: str) -> None:
    """Write the witness (or that there is none) with the loop it was found on."""
    document = {
        "format": _WITNESS,
        "verdict": verdict,
        "loop": loop_of(subject),
        "witness": witness,
    }
    write_text(target, json.dumps(plain(document), indent=2, allow_nan=False) + "\n")


def load_witness(path: Path, subject: Subject) -> Witness:
    """Read a witness. Raises InputError on another format or loop, and where there is none."""
    document = _document(path, _WITNESS)
    _require_same_loop(path, document, loop_of(subject), subject.name)
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


def loop_of(subject: Subject) -> dict[str, Any]:
    """What makes the loop: its form, and the range of every number in it."""
    ode, box = subject.system.ode, subject.initial_set
    ranged = (*ode.parameters, *ode.disturbances)
    return {
        "form": ode.name,
        "states": list(ode.names),
        "ranges": {each.name: [each.lower, each.upper] for each in ranged},
        "initial_set": _intervals(box),
    }


def _identity(subject: Subject | None, source: Source | None) -> dict[str, Any]:
    if source is not None:
        return dict(source.identity)
    assert subject is not None
    return loop_of(subject)


def _require_same_runs(
    path: Path, document: dict[str, Any], subject: Subject | None, source: Source | None
) -> None:
    """A bound of one simulator says nothing about another."""
    wanted = MODEL if source is None else source.kind
    found = document.get("source")
    # Both march the same equation.
    of_model = (MODEL, COMPILED)
    if found != wanted and not (found in of_model and wanted in of_model):
        raise InputError(
            f"{path}: expected a bound learned from {wanted}, got one learned from {found}; pass "
            f"--from {found} as then, or learn again"
        )
    title = source.title if source is not None else subject.name if subject is not None else ""
    _require_same_loop(path, document, _identity(subject, source), title)


def _require_same_loop(
    path: Path, document: dict[str, Any], own: dict[str, Any], title: str
) -> None:
    stored = document.get("loop")
    for part, expected in json.loads(json.dumps(own)).items():
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
            f"{path}: expected a file made with the loop of {title}, got another "
            f"({where}: {expected} here, {found} in the file); pass the same --vehicle, --system "
            "and --curvature as then, or make the file again"
        )


def _intervals(box: Box) -> dict[str, list[float]]:
    return {name: list(box.interval(name)) for name in box.names}


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
    if kind == _LEARNED and isinstance(document, dict) and document.get("format") == _FORMER:
        raise InputError(
            f"{path}: expected {_MADE_BY[kind]}, got one of an earlier version of workbench; "
            "learn it again"
        )
    if not isinstance(document, dict) or document.get("format") != kind:
        raise InputError(
            f'{path}: expected {_MADE_BY[kind]}, got JSON without "format": "{kind}"; '
            "name another file or make it again"
        )
    return document


def _spoilt(path: Path, error: Exception) -> InputError:
    what = f"the entry {error} is missing" if isinstance(error, KeyError) else str(error)
    return InputError(f"{path}: expected the file as it was written, but: {what}; make it again")
