"""Nested levels: SAFE is what the level alone would be given, or follows from a larger one."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence

import numpy as np
import pytest
from decision_answers import Answer, Array, TubeAnswer
from decision_crowd import somebody
from decision_fixture import (
    BUDGET,
    COMPLETE,
    INVALID,
    SAFE,
    SHARES,
    STARTS,
    SWITCH_S,
    UNFINISHED,
    UNPROVED,
    DecisionKernel,
    Seen,
    Start,
    Text,
    compiled,
    guarded,
    kernel,
    nested,
    place,
    query,
    real_text,
    text_of,
)
from decision_paths import paths
from decision_stops import drive, excess, sampled_orders

from workbench.codegen import MonitorSpec
from workbench.codegen.decision_source import DecisionSizes
from workbench.models.vehicle import gem_e2

_PLENTY = 1_000_000
_TUBES = ("track", "stop", "brake")


def _case(chance: np.random.Generator) -> tuple[str, Start, list[Seen]]:
    where = list(paths())[chance.integers(len(paths()))]
    start = list(STARTS.values())[chance.integers(len(STARTS))]
    people: list[Seen] = [
        guarded(somebody(chance, where)) for _ in range(int(chance.integers(0, 3)))
    ]
    return where, start.scaled(float(chance.uniform(0.3, 1.0))), people


def _alone(
    where: str, start: Start, people: Sequence[Seen], share: float, *, cells: bool
) -> Answer:
    """What a kernel of this level alone says."""
    text = text_of(levels=1, budget=_PLENTY)
    if not cells:
        text = text.edited((r"#define WB_TUBES \d+", "#define WB_TUBES 1"))
    box = nested(start, (share,))
    return compiled(text)(query(paths()[where].table, start, people, text.query, **box))


@pytest.mark.parametrize("deciding", [0, 1, 2])
def test_levels_say_what_each_says_alone_or_what_a_larger_one_implies(deciding: int) -> None:
    """Only the deciding level is cut into cells; the first that is proved settles the rest."""
    text = text_of(deciding=deciding, budget=_PLENTY)
    chance = np.random.default_rng(31)
    seen = []
    for _ in range(7):
        where, start, people = _case(chance)
        answer = compiled(text)(
            query(paths()[where].table, start, people, text.query, **nested(start))
        )
        alone = [
            _alone(where, start, people, share, cells=level == deciding)
            for level, share in enumerate(SHARES)
        ]
        for name in _TUBES:
            tube: TubeAnswer = getattr(answer, name)
            each: list[TubeAnswer] = [getattr(one, name) for one in alone]
            safe = [one.verdict == SAFE for one in each]
            assert tube.verdicts == tuple(
                SAFE if any(safe[: level + 1]) else UNPROVED for level in range(3)
            )
            level = safe.index(True) if any(safe[:deciding]) else deciding
            assert tube.level == level
            for field in ("status", "rows", "cells", "intent", "guard", "lower", "upper"):
                np.testing.assert_array_equal(tube.field(field), each[level].field(field))
            seen.append(tube.verdicts)
    assert len(set(seen)) >= 3


def test_a_monitor_decides_by_the_level_it_was_built_for() -> None:
    sizes = [
        MonitorSpec(gem_e2(), 3.0, 0.05, deciding_level=name, budget=77).sizes
        for name in ("whole", "two thirds", "one third")
    ]
    assert sizes == [DecisionSizes(60, 0.05, 3, deciding, 77) for deciding in range(3)]
    assert text_of().source == real_text().source


@pytest.mark.parametrize("level", [1, 2])
@pytest.mark.parametrize("sticks_out", [2e-16, 1e-3])
def test_a_level_that_sticks_out_of_a_larger_one_is_covered(level: int, sticks_out: float) -> None:
    """Rounding, or a mistake: the larger level is widened before anything is proved of it."""
    start = STARTS["rate limit"].scaled(0.3)
    numbers = query(paths()["right"].table, start)
    whole = numbers[place("initial_radius") : place("initial_radius", 7)].copy()
    radius = numbers[place("initial_radius", 7 * level) : place("initial_radius", 7 * level + 7)]
    center = numbers[place("initial_center", 7 * level) : place("initial_center", 7 * level + 7)]
    center += [sticks_out, -sticks_out, 0.0, sticks_out, -sticks_out, 0.0, 0.0]
    radius[:] = whole
    answer = kernel()(numbers)
    assert answer.stop.verdicts[level] == SAFE
    assert answer.stop.level <= level
    chance = np.random.default_rng(2)
    out = Start(tuple(center), tuple(radius), start.reference_mps)
    states, orders = sampled_orders(out.states(30, chance), SWITCH_S, chance, corners=16)
    runs = drive(start, states, paths()["right"], orders, chance)
    assert excess(answer.stop, runs).max() < 1e-13
    lower, upper = answer.track.rows("lower", 7)[0], answer.track.rows("upper", 7)[0]
    assert (lower[:, None] <= states).all()
    assert (states <= upper[:, None]).all()


@functools.cache
def _thrifty(budget: int) -> DecisionKernel:
    """With a count of its own of the steps that are tried."""
    text = real_text().edited(
        (rf"#define WB_BUDGET {BUDGET}L", f"#define WB_BUDGET {budget}L"),
        (r"(static int wb_attempt\([^{]*\{)", r"\1 ++wb_tried;"),
    )
    return compiled(Text("long wb_tried;\n" + text.source, text.query, text.result))


def _tried(budget: int, numbers: Array) -> tuple[Answer, int]:
    tried = ctypes.c_long.in_dll(_thrifty(budget).handle, "wb_tried")
    tried.value = 0
    answer = _thrifty(budget)(numbers)
    return answer, tried.value


def _check_within_budget(answer: Answer, tried: int, budget: int) -> None:
    assert answer.spent == tried <= budget
    for tube in answer.tubes:
        if SAFE in tube.verdicts[:1]:
            assert tube.status == COMPLETE
        elif tube.status == UNFINISHED:
            assert tube.steps < 60 or tube is not answer.track


@pytest.mark.parametrize("budget", [1, 7, 50, 250, 3000])
def test_the_budget_is_never_exceeded_and_what_is_left_is_unproved(budget: int) -> None:
    chance = np.random.default_rng(37)
    finished = 0
    for _ in range(12):
        where, start, people = _case(chance)
        numbers = query(paths()[where].table, start, people)
        answer, tried = _tried(budget, numbers)
        _check_within_budget(answer, tried, budget)
        if budget <= 7:
            assert [tube.status for tube in answer.tubes] == [UNFINISHED] * 3
            assert {v for tube in answer.tubes for v in tube.verdicts} == {UNPROVED}
        finished += sum(tube.status == COMPLETE for tube in answer.tubes)
    if budget >= 250:
        assert finished >= 5


@pytest.mark.parametrize("budget", [7, 250, 3000])
def test_no_number_of_a_query_spends_more_than_the_budget(budget: int) -> None:
    chance = np.random.default_rng(41)
    for _ in range(16):
        where, start, people = _case(chance)
        numbers = query(paths()[where].table, start, people)
        count = chance.integers(1, 6)
        which = chance.choice(np.flatnonzero(numbers), count)
        numbers[which] *= 10.0 ** chance.uniform(-9, 9, count) * chance.choice([-1, 1], count)
        answer, tried = _tried(budget, numbers)
        if answer.track.verdict != INVALID:
            _check_within_budget(answer, tried, budget)
        assert tried <= budget


def test_the_budget_of_the_spec_is_the_one_in_the_text() -> None:
    edited = real_text().edited((rf"#define WB_BUDGET {BUDGET}L", "#define WB_BUDGET 50L"))
    assert text_of(budget=50).source == edited.source
