"""Claim: bounds of random graphs contain 200-bit values and are about as wide as balls."""

from __future__ import annotations

import sys
import time

import numpy as np
import pytest
from inclusion_cases import random_boxes, random_function

from workbench.models.graph import graph_of
from workbench.models.operations import BRANCHES, KINKS, SMOOTH
from workbench.sensitivity.inclusion import inclusion

BOXES = 100


@pytest.fixture
def balls():
    flint = pytest.importorskip("flint", reason="python-flint (ball arithmetic) is not installed")
    before, flint.ctx.prec = flint.ctx.prec, 200
    import inclusion_balls

    yield inclusion_balls
    flint.ctx.prec = before


def tallied(balls, seeds: range):
    tally = balls.Tally()
    for seed in seeds:
        function, boxes = random_function(seed), random_boxes(seed, BOXES)
        lifted = inclusion(function)
        tally.add(function, lifted, boxes)
        tally.compare_widths(function, lifted, boxes)
    return tally


def require_sound_and_tight(tally) -> np.ndarray:
    assert tally.wrong == 0
    assert tally.valid > 0.85 * tally.boxes
    assert tally.undecided < 0.01 * tally.examined
    quantiles = np.quantile(tally.ratios, (0.5, 0.9))
    assert len(tally.ratios) > 0.5 * tally.boxes
    assert np.all(quantiles < (1.001, 1.01))
    return quantiles


def test_two_hundred_random_graphs(balls) -> None:
    require_sound_and_tight(tallied(balls, range(200)))


@pytest.mark.campaign
def test_ten_thousand_random_graphs_on_a_million_boxes(balls, capsys) -> None:
    start = time.perf_counter()
    tally = tallied(balls, range(10_000))
    quantiles = require_sound_and_tight(tally)
    with capsys.disabled():
        sys.stdout.write(
            f"\n{tally.boxes} boxes, {tally.valid} valid, {tally.examined} values examined, "
            f"{tally.wrong} violations, {tally.undecided} undecided by 4000 bits; bounded by balls "
            f"alone: {tally.missed}; width / ball width over {len(tally.ratios)} ranges: median "
            f"{quantiles[0]:.4f}, 90 % {quantiles[1]:.4f}; {time.perf_counter() - start:.0f} s\n"
        )


def test_the_random_graphs_use_every_supported_operation() -> None:
    used = {node.name for seed in range(200) for node in graph_of(random_function(seed)).nodes}
    assert used >= SMOOTH | KINKS | BRANCHES
