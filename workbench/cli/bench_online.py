"""The board of the online kernels in `workbench bench`: its options, page and document."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from statistics import median
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import count

if TYPE_CHECKING:
    from workbench.bench import Loop
    from workbench.bench.online_board import OnlineBoard
    from workbench.bench.online_kernels import Setting
    from workbench.report.frontier import Frontier, GrowthCurve
    from workbench.report.page import Page

_INPUTS: Final = 100_000
_INPUTS_QUICK: Final = 2_000
_ROUNDS: Final = 200
_ROUNDS_QUICK: Final = 50
_SIGNAL: Final = 1


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of this board."""
    parser.add_argument(
        "--inputs",
        type=count,
        metavar="N",
        help="random inputs on which the online kernels' C is held against CasADi, per function "
        f"(default: {_INPUTS}, with --quick {_INPUTS_QUICK})",
    )


def measure(
    args: argparse.Namespace, loops: Sequence[Loop], *, trajectories: int, seed: int
) -> list[OnlineBoard]:
    """The board of every loop, with progress."""
    from workbench.bench.online_board import GROWTH_S, OnlinePlan, online_board
    from workbench.bench.online_kernels import all_settings
    from workbench.bench.scoreboard import SAMPLE_STEP_S
    from workbench.cli.output import Progress

    plan = OnlinePlan(
        settings=all_settings(),
        count=trajectories,
        seed=seed,
        step_s=SAMPLE_STEP_S,
        inputs=args.inputs or (_INPUTS_QUICK if args.quick else _INPUTS),
        rounds=_ROUNDS_QUICK if args.quick else _ROUNDS,
        growth_s=GROWTH_S,
    )
    found = []
    for loop in loops:
        name = loop.benchmark.name
        with Progress(f"online kernels on {name}", plan.units_of_work) as progress:
            found.append(online_board(loop.benchmark, plan, advance=progress.advance))
    return found


def online_page(boards: Sequence[OnlineBoard], command: str) -> Page:
    """Width against time, growth with the horizon and with the cells."""
    from workbench import __version__
    from workbench.report.frontier import frontier_figure, growth_panels
    from workbench.report.page import Page, Section

    sections = []
    drawn = [frontier for board in boards if (frontier := _frontier(board)) is not None]
    if drawn:
        sections.append(Section("Width against time", [frontier_figure(drawn, signal="y")]))
    grown = [
        ("Growth with the horizon", "horizon (s)", False, _over_horizon),
        ("Growth with the cells", "cells of the initial set (1)", True, _over_cells),
    ]
    for title, over, logarithmic, curves_of in grown:
        curves = {board.loop: found for board in boards if (found := curves_of(board))}
        if curves:
            figure = growth_panels(curves, over=over, logarithmic=logarithmic)
            sections.append(Section(title, [figure]))
    escapes = sum(board.escapes for board in boards)
    lead = [
        "Tubes of 3 s that contain every trajectory, computed by compiled kernels on one core: how "
        "wide they are, and how long they take.",
        f"{escapes} of {boards[0].trajectories} sampled trajectories per loop leave any tube.",
    ]
    return Page("Online kernels", lead, sections, __version__, command)


def _frontier(board: OnlineBoard) -> Frontier | None:
    """Every complete tube of one loop as a point; None where there is none."""
    from workbench.report.frontier import Frontier, FrontierPoint

    name = list(board.validated[0].score.width_ratio)[_SIGNAL]
    points = [
        FrontierPoint(_series(row.setting), row.setting.step_s, row.setting.cells,
                      row.cost.tube_us, ratio)
        for row in board.rows
        if row.cost is not None and (ratio := row.score.width_ratio[name]) is not None
    ]  # fmt: skip
    references = {
        row.cells: ratio
        for row in board.validated
        if row.score.covered and (ratio := row.score.width_ratio[name]) is not None
    }
    costs = [row.cost.trajectory_us for row in board.rows if row.cost is not None]
    return Frontier(board.loop, points, references, median(costs)) if points else None


def _series(setting: Setting) -> str:
    return f"{setting.kernel}, {setting.form.value}"


def _over_horizon(board: OnlineBoard) -> list[GrowthCurve]:
    from workbench.report.frontier import GrowthCurve

    return [
        GrowthCurve(
            f"{facts.kernel}, {facts.form.value}",
            [cost.horizon_s for cost in facts.growth],
            [cost.tube_us for cost in facts.growth],
        )
        for facts in board.kernels
        if facts.growth
    ]


def _over_cells(board: OnlineBoard) -> list[GrowthCurve]:
    """At the step of the scores, 0.05 s."""
    from workbench.bench.tightness import SCORE_STEP_S
    from workbench.report.frontier import GrowthCurve

    curves = []
    for facts in board.kernels:
        costs = [
            row.cost for row in board.rows
            if row.cost is not None and row.setting.step_s == SCORE_STEP_S
            and (row.setting.kernel, row.setting.form) == (facts.kernel, facts.form)
        ]  # fmt: skip
        if costs:
            curves.append(GrowthCurve(
                f"{facts.kernel}, {facts.form.value}", [c.setting.cells for c in costs],
                [c.tube_us for c in costs],
            ))  # fmt: skip
    return curves
