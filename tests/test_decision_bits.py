"""The decision is a function of the query alone, bit for bit, however the C text is optimised."""

from __future__ import annotations

import numpy as np
import pytest
from decision_answers import Array
from decision_fixture import (
    INVALID,
    SAFE,
    STARTS,
    UNPROVED,
    Seen,
    Start,
    compiled,
    guarded,
    kernel,
    place,
    query,
    real_text,
)
from decision_paths import paths


def _random_query(chance: np.random.Generator) -> Array:
    table = list(paths().values())[chance.integers(len(paths()))].table
    center = chance.uniform([0, -0.8, -0.2, 0, -0.2, -0.5, -0.5], [3, 0.8, 0.2, 3, 0.2, 0.5, 0.5])
    widest = np.array([0.2, 0.2, 0.02, 0.2, 0.05, 0.2, 0.2])
    radius = chance.uniform(0.0, 1.0, 7) * widest * chance.integers(0, 2, 7)
    start = Start(tuple(center), tuple(radius), float(chance.uniform(0.0, 3.0)))
    people: list[Seen] = []
    for _ in range(chance.integers(0, 4)):
        disc = [
            *chance.uniform(-5.0, 15.0, 2), *chance.uniform(-2.0, 2.0, 2),
            *chance.uniform(0, 0.5, 3),
        ]  # fmt: skip
        people.append(guarded(disc) if chance.integers(0, 4) else disc)
    times = {
        "switch_s": np.cumsum(chance.uniform(0.0, 0.2, 2)),
        "brake_s": np.cumsum(chance.uniform(0.0, 0.1, 2)),
        "start_s": np.cumsum(chance.uniform(0.0, 0.1, 2)) * chance.integers(0, 2),
        "skew_s": np.array([-0.1, 0.0]) + chance.uniform(0.0, 0.1, 2),
    }
    numbers = query(table, start, people, **{name: list(both) for name, both in times.items()})
    if not chance.integers(0, 12):
        numbers[place("people_count")] = 33.0
    return numbers


def _check_agree(count: int, seed: int) -> None:
    plain, optimised = compiled(real_text()), kernel()
    chance = np.random.default_rng(seed)
    verdicts: list[float] = []
    for _ in range(count):
        numbers = _random_query(chance)
        answer = optimised(numbers)
        assert answer.numbers.tobytes() == plain(numbers).numbers.tobytes()
        verdicts += [tube.verdict for tube in answer.tubes]
    # Agreement on refusals alone would say little.
    assert min(verdicts.count(verdict) for verdict in (SAFE, UNPROVED, INVALID)) >= count / 20


def test_optimised_and_plain_builds_agree_on_every_bit() -> None:
    _check_agree(250, 41)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(10))
def test_optimised_and_plain_builds_agree_on_every_bit_of_many(seed: int) -> None:
    _check_agree(10_000, seed)


@pytest.mark.parametrize("fill", [0.0, np.inf, -1e300])
def test_nothing_is_kept_from_call_to_call(fill: float) -> None:
    chance = np.random.default_rng(47)
    queries = [_random_query(chance) for _ in range(40)]
    first = [kernel()(numbers).numbers.tobytes() for numbers in queries]
    again = [kernel()(numbers, fill=fill).numbers.tobytes() for numbers in reversed(queries)]
    assert first == again[::-1]


def test_the_query_is_left_as_it_was() -> None:
    for start in STARTS.values():
        numbers = query(paths()["S"].table, start)
        before = numbers.tobytes()
        kernel()(numbers)
        assert numbers.tobytes() == before
