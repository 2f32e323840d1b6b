"""Every change of a certificate is refused, or what it then claims is still true."""

from __future__ import annotations

import copy
import itertools
import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from certificate_cases import METHODS, rates_hold, spread, spread_holds, tube, tube_holds
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.checker.arithmetic import UnprovedError
from workbench.checker.claims import check

NUMBERS: list[Any] = [0.0, -1.0, 1e9, -1e9, 1e300, 1e-300, 7, None, "1", True, [], {}]
FACTORS = [1.0 + 1e-12, 1.0 - 1e-12, 1.001, 0.999, 2.0, 0.5, -1.0]


def accepted(document: Any) -> bool:
    """Whether the checker accepts; it ends with one of its two errors or a statement."""
    try:
        check(json.dumps(document).encode())
    except (ValueError, UnprovedError) as error:
        assert str(error)
        return False
    return True


def paths(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where every value of a document stands, inner ones after outer ones."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value)
    if isinstance(value, dict | list):
        for key, item in items:
            if isinstance(item, dict | list):
                yield from paths(item, (*path, key))
            else:
                yield (*path, key)


def at(document: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        document = document[key]
    return document


def replaced(document: Any, path: tuple[Any, ...], value: Any) -> Any:
    changed = copy.deepcopy(document)
    if not path:
        return value
    at(changed, path[:-1])[path[-1]] = value
    return changed


def variants(value: Any) -> Iterator[Any]:
    """What a value is changed to."""
    if isinstance(value, bool) or value is None:
        yield from (0.0, {"axis": 0, "at": 0.0}, [0.0, 0.0])
    elif isinstance(value, int | float):
        yield from (value * factor for factor in FACTORS)
        yield from (value + 1, value - 1, value + 1e-9, *NUMBERS)
    elif isinstance(value, str):
        yield from (value + " ", value[:-1], value.upper(), "", "mul", "add", "cos", 1.0)
    elif isinstance(value, list):
        yield from (value[:-1], value[1:], value[::-1], [*value, *value[-1:]], [])
    else:
        for key in value:
            yield {name: item for name, item in value.items() if name != key}
        yield value | {"another": 0.0}


def judged(document: Any, oracles: list[Any], every: int) -> tuple[int, int]:
    """Tries one in `every` of the variants of all values; accepted ones must pass the oracles."""
    mutants = (
        (path, variant) for path in paths(document) for variant in variants(at(document, path))
    )
    tried = passed = 0
    for path, variant in itertools.islice(mutants, 0, None, every):
        mutant = replaced(document, path, variant)
        tried += 1
        if accepted(mutant):
            passed += 1
            with np.errstate(all="ignore"):
                holds = all(oracle(mutant) for oracle in oracles)
            assert holds, (path, at(document, path), variant)
    assert 0 < passed < tried / 2
    return tried, passed


@pytest.mark.parametrize("name", METHODS)
def test_the_certificate_is_accepted_and_true(name: str) -> None:
    assert accepted(spread(name))
    assert spread_holds(spread(name))
    assert rates_hold(spread(name))


@pytest.mark.parametrize("name", METHODS)
def test_no_changed_spread_is_accepted_and_false(name: str) -> None:
    assert judged(spread(name), [spread_holds, rates_hold], every=7)[0] > 250


def test_no_changed_tube_is_accepted_and_false() -> None:
    assert accepted(tube())
    assert tube_holds(tube())
    assert judged(tube(), [tube_holds], every=7)[0] > 250


@pytest.mark.campaign
@pytest.mark.parametrize("name", [*METHODS, "tube"])
def test_none_of_all_changes_is_accepted_and_false(name: str) -> None:
    if name == "tube":
        assert judged(tube(), [tube_holds], every=1)[0] > 1500
    else:
        assert judged(spread(name), [spread_holds, rates_hold], every=1)[0] > 1500


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_no_sequence_of_changes_is_accepted_and_false(data: st.DataObject) -> None:
    document = data.draw(st.sampled_from([*(spread(name) for name in METHODS), tube()]))
    leaves = [p for p in paths(document) if isinstance(at(document, p), int | float)]
    for _ in range(data.draw(st.integers(1, 4))):
        path = data.draw(st.sampled_from(leaves))
        near = at(document, path) * data.draw(st.floats(0.9, 1.1))
        value = data.draw(st.one_of(st.just(near), st.floats(), st.integers(-3, 40)))
        document = replaced(document, path, value)
    if accepted(document):
        oracles = [tube_holds] if document["kind"] == "tube" else [spread_holds, rates_hold]
        with np.errstate(all="ignore"):
            assert all(oracle(document) for oracle in oracles)
