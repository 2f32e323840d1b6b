"""The decision is a function of the query alone, bit for bit, however the C text is optimised."""

from __future__ import annotations

import numpy as np
import pytest
from decision_fixture import INVALID, SAFE, STARTS, UNPROVED, Array, Start, kernel, query
from decision_paths import paths


def _random_queries(count: int) -> list[Array]:
    chance = np.random.default_rng(41)
    tables = [path.table for path in paths().values()]
    queries = []
    for _ in range(count):
        center = chance.uniform(
            [0, -0.8, -0.2, 0, -0.2, -0.5, -0.5], [3, 0.8, 0.2, 3, 0.2, 0.5, 0.5]
        )
        widest = np.array([0.2, 0.2, 0.02, 0.2, 0.05, 0.2, 0.2])
        radius = chance.uniform(0.0, 1.0, 7) * widest * chance.integers(0, 2, 7)
        start = Start(tuple(center), tuple(radius), float(chance.uniform(0.0, 3.0)))
        people = [
            [
                *chance.uniform(-5.0, 15.0, 2),
                *chance.uniform(-2.0, 2.0, 2),
                *chance.uniform(0, 0.5, 3),
            ]
            for _ in range(chance.integers(0, 4))
        ]
        queries.append(query(tables[chance.integers(len(tables))], start, people))
    return queries


def test_optimised_and_plain_builds_agree_on_every_bit() -> None:
    plain, optimised = kernel("-O0"), kernel()
    verdicts = []
    for numbers in _random_queries(2000):
        answer = optimised(numbers)
        assert answer.numbers.tobytes() == plain(numbers).numbers.tobytes()
        verdicts.append(answer.verdict)
    # Agreement on refusals alone would say little.
    assert min(verdicts.count(verdict) for verdict in (SAFE, UNPROVED, INVALID)) >= 100


@pytest.mark.parametrize("fill", [0.0, np.inf, -1e300])
def test_nothing_is_kept_from_call_to_call(fill: float) -> None:
    queries = _random_queries(60)
    first = [kernel()(numbers).numbers.tobytes() for numbers in queries]
    again = [kernel()(numbers, fill=fill).numbers.tobytes() for numbers in reversed(queries)]
    assert first == again[::-1]


def test_the_query_is_left_as_it_was() -> None:
    for start in STARTS.values():
        numbers = query(paths()["S"].table, start)
        before = numbers.tobytes()
        kernel()(numbers)
        assert numbers.tobytes() == before
