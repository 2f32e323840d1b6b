"""Learned formulas as JSON: plain numbers under the word of their form."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from workbench.sensitivity.discrepancy import Growth

PUBLISHED: Final = "published"


def _classes() -> dict[str, tuple[type[Any], tuple[str, ...]]]:
    """Class and the fields that are never negative, by form."""
    from workbench.sensitivity.learning.exponential import (
        ExponentialEnvelope,
        PerStateExponential,
    )
    from workbench.sensitivity.learning.matrix_form import MatrixEnvelope
    from workbench.sensitivity.learning.piecewise import PiecewiseEnvelope
    from workbench.sensitivity.learning.published import PublishedEnvelope

    return {
        "exponential": (PerStateExponential, ("factor",)),
        "set": (ExponentialEnvelope, ("scale", "amplitude")),
        "piecewise": (PiecewiseEnvelope, ("scale", "nodes_s", "amplitudes")),
        "matrix": (MatrixEnvelope, ("scale", "nodes_s", "matrices")),
        PUBLISHED: (PublishedEnvelope, ("factor", "step_s")),
    }


def form_of(growth: Growth) -> str:
    """The word under which a learned formula is written."""
    return next(name for name, (kind, _) in _classes().items() if isinstance(growth, kind))


def growth_fields(growth: Growth) -> dict[str, Any]:
    """Its numbers, by name."""
    formula: Any = growth
    return {field.name: getattr(formula, field.name) for field in dataclasses.fields(formula)}


def read_growth(document: Mapping[str, Any], size: int) -> Growth:
    """The formula for `size` states. Raises ValueError, TypeError or KeyError where it is none."""
    known = _classes()
    form = document["form"]
    if form not in known:
        raise ValueError(f"expected a form, one of {', '.join(known)}, got {form!r}")
    kind, positive = known[form]
    values = {f.name: _numbers(document[f.name]) for f in dataclasses.fields(kind)}
    for name, value in values.items():
        flat = list(_flat(value))
        if not all(map(math.isfinite, flat)):
            raise ValueError(f"expected finite numbers in {name!r}")
        if name in positive and min(flat, default=0.0) < 0.0:
            raise ValueError(f"expected no negative number in {name!r}")
    nodes = values.get("nodes_s")
    if nodes is not None and not _rising(nodes):
        raise ValueError("expected nodes_s that rise from 0")
    shapes = {"amplitudes": (_length(nodes), size), "matrices": (_length(nodes), size, size)}
    for name, value in values.items():
        if name in ("nodes_s", "step_s"):
            continue
        if _shape(value) != shapes.get(name, (size,)):
            raise ValueError(
                f"expected {size} numbers per list, one per state, and a list per node, in {name!r}"
            )
    found: Growth = kind(**values)
    return found


def _numbers(value: Any) -> Any:
    """Nested lists as nested tuples of floats."""
    return tuple(map(_numbers, value)) if isinstance(value, list) else float(value)


def _flat(value: Any) -> Sequence[float]:
    return [x for each in value for x in _flat(each)] if isinstance(value, tuple) else [value]


def _shape(value: Any) -> tuple[int, ...] | None:
    """Of nested tuples; None where they are ragged."""
    if not isinstance(value, tuple):
        return ()
    inner = {_shape(each) for each in value}
    shape = inner.pop() if len(inner) == 1 else None
    return None if shape is None else (len(value), *shape)


def _length(nodes: Any) -> int:
    return len(nodes) if isinstance(nodes, tuple) else 0


def _rising(nodes: Any) -> bool:
    return (
        isinstance(nodes, tuple)
        and len(nodes) > 1
        and nodes[0] == 0.0
        and all(a < b for a, b in itertools.pairwise(nodes))
    )
