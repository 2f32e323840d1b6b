"""The page of the whole decision: time against what stays proved, and how the time grows."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from workbench import __version__
from workbench.bench.decision_latency import LIMIT_US
from workbench.bench.decision_text import growth_claim
from workbench.report.drawing import BLUE, INK, VERMILLION, Figure, Key, svg_panel
from workbench.report.page import Page, Paragraph, Section
from workbench.report.tables import Cell, Table

if TYPE_CHECKING:
    from workbench.bench.decision_board import DecisionBoard
    from workbench.bench.decision_bound import PeopleBound
    from workbench.bench.decision_growth import Growth
    from workbench.bench.decision_latency import Latency
    from workbench.bench.decision_methods import MethodCost

_MILLION: Final = 1e6
_MARKS: Final = ("o", "s")


def decision_page(board: DecisionBoard, command: str) -> Page:
    """Budget against latency and proof, growth with horizon, cells and people, and the bound."""
    usual = board.latencies[0]
    sections = [Section("Time against what stays proved", [frontier(board.sweep)])]
    sections.append(Section("Kernels and forms", [methods_table(board.methods)]))
    claims = [Paragraph(f"{each.over}: {growth_claim(each)}.") for each in board.growth]
    sections.append(Section("Growth", [*claims, growth_figure(board.growth)]))
    if board.bound is not None:
        sections.append(Section("Bound of the instructions", [_bound(board.bound.people)]))
    lead = [
        "One decision computes three tubes for three nested sets and compares them with everybody "
        "near: both policies, in C, on one core.",
        f"{usual.calls} random scenes with the default budget of {usual.budget} steps, tubes: "
        f"{usual.method}: median "
        f"{usual.median_us:.0f} us, 99.9 % below {usual.p999_us:.0f} us, largest "
        f"{usual.max_us:.0f} us; {usual.proved:.1%} let both policies go on.",
    ]
    return Page("Whole decision", lead, sections, __version__, command)


def frontier(sweep: Sequence[Latency]) -> Figure:
    """Latency of each budget over the share of decisions that both policies are proved for."""
    panel = svg_panel(
        lambda canvas: _paint_frontier(canvas, sweep),
        label="Latency against the share that is proved", height_in=3.8,
    )  # fmt: skip
    rows: list[list[Cell]] = [
        [row.budget, row.median_us, row.p999_us, row.max_us, 100.0 * row.proved]
        for row in sweep
    ]  # fmt: skip
    headings = ["budget (steps)", "median (us)", "p99.9 (us)", "largest (us)", "proved (%)"]
    return Figure(
        (panel,),
        (
            Key("99.9 %, quicker of two calls", VERMILLION),
            Key("median", BLUE, "7 3"),
            Key("1 ms", INK, "2 3"),
        ),
        "Time of a decision against the share of the same random scenes in which both policies are "
        "proved safe to go on; the number at a point is the budget of attempted steps. A smaller "
        "budget bounds the time and proves less.",
        Table("latency and proof of every budget", headings, rows, folded=True),
    )


def _paint_frontier(canvas: Canvas, sweep: Sequence[Latency]) -> None:
    axes = canvas.add_subplot()
    share = [100.0 * row.proved for row in sweep]
    for values, colour, dashes in (
        ([row.quickest_us[1] for row in sweep], VERMILLION, "-"),
        ([row.median_us for row in sweep], BLUE, "--"),
    ):
        axes.plot(share, values, color=colour, linestyle=dashes, marker="o", markersize=4.0)
    for row, x in zip(sweep, share, strict=True):
        axes.annotate(
            str(row.budget), (x, row.quickest_us[1]), xytext=(0, 6), textcoords="offset points",
            fontsize=8.0, ha="center",
        )  # fmt: skip
    axes.axhline(LIMIT_US, color=INK, linestyle=":", linewidth=1.0)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(-3.0, 103.0)
    axes.set_xlabel("scenes with both policies proved (%)")
    axes.set_ylabel("time of a decision (us), log scale")


def methods_table(methods: Sequence[MethodCost]) -> Table:
    """Latency, proof and instructions of every kernel in every form, on the same scenes."""
    least = methods[0]
    rows: list[list[Cell]] = [
        [
            each.latency.method, each.latency.median_us, each.latency.p999_us, each.latency.max_us,
            100.0 * each.latency.proved, each.instructions, each.code, each.times(least),
            each.times_instructions(least),
        ]
        for each in methods
    ]  # fmt: skip
    name = least.latency.method
    headings = [
        "kernel, form", "median (us)", "p99.9 (us)", "largest (us)", "proved (%)",
        "instructions (mean)", "code (bytes)", f"time over {name}", f"instructions over {name}",
    ]  # fmt: skip
    return Table(f"every kernel in every form, {least.latency.calls} scenes", headings, rows)


def growth_figure(growths: Sequence[Growth]) -> Figure:
    """Instructions, or time where they are not counted, over each thing that grows."""
    panels = tuple(
        svg_panel(partial(_paint_growth, growth=growth), label=f"Cost over {growth.over}")
        for growth in growths
    )
    rows: list[list[Cell]] = [
        [growth.over, point.value, point.spent, point.us, point.instructions]
        for growth in growths
        for point in growth.points
    ]
    headings = ["over", "value", "steps", "time (us)", "instructions"]
    return Figure(
        panels,
        (Key("whole decision", BLUE), Key("best straight line", INK, "7 3")),
        "Cost of a decision over what grows, everything else the same; dashed: the straight line "
        "that fits best, with the part that is the same for all.",
        Table("growth", headings, rows, folded=True),
    )


def _paint_growth(canvas: Canvas, *, growth: Growth) -> None:
    axes = canvas.add_subplot()
    values = [point.value for point in growth.points]
    counted = [point.instructions / _MILLION for point in growth.points if point.instructions]
    costs = counted if len(counted) == len(values) else [point.us for point in growth.points]
    slope, start = np.polyfit(values, costs, 1)
    axes.plot(values, costs, color=BLUE, marker="o", markersize=4.0)
    ends = [0.0, max(values)]
    axes.plot(ends, [start + slope * end for end in ends], color=INK, linestyle="--", alpha=0.5)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(growth.over if growth.over.endswith(")") else f"{growth.over} (1)")
    axes.set_ylabel("instructions (10⁶)" if costs is counted else "time (us)")


def _bound(bounds: Sequence[PeopleBound]) -> Figure:
    """The bound of the instructions over the people, and what was seen."""
    kinds = list(dict.fromkeys((each.tubes, each.pieces) for each in bounds))
    colours = dict(zip(kinds, (BLUE, VERMILLION), strict=False))
    panel = svg_panel(
        lambda canvas: _paint_bound(canvas, bounds, colours), label="Bound over people",
        height_in=3.4,
    )  # fmt: skip
    rows: list[list[Cell]] = [
        [each.people, each.tubes, each.pieces, each.bound / _MILLION, each.largest / _MILLION]
        for each in bounds
    ]
    headings = ["people", "tubes each", "pieces at once", "bound (10^6)", "largest seen (10^6)"]
    names = {kind: f"{kind[0]} tubes each, {kind[1]} pieces at once" for kind in kinds}
    return Figure(
        (panel,),
        (
            *(
                Key(names[kind], colours[kind], mark=mark)
                for kind, mark in zip(kinds, _MARKS, strict=False)
            ),
            Key("bound", INK),
            Key("largest seen", INK, "2 3"),
        ),
        "Millions of instructions of one decision as a bound: the most steps, rows and "
        "boxes, each at the largest cost measured; dotted: the largest of the scenes that were "
        "tried, with the same marks.",
        Table("bound of the instructions", headings, rows, folded=True),
    )


def _paint_bound(
    canvas: Canvas, bounds: Sequence[PeopleBound], colours: dict[tuple[int, int], str]
) -> None:
    axes = canvas.add_subplot()
    for (kind, colour), mark in zip(colours.items(), _MARKS, strict=False):
        own = [each for each in bounds if (each.tubes, each.pieces) == kind]
        people = [each.people for each in own]
        axes.plot(
            people, [each.bound / _MILLION for each in own], color=colour, marker=mark,
            markersize=4.0,
        )  # fmt: skip
        seen = [each.largest / _MILLION for each in own]
        axes.plot(
            people, seen, color=colour, linestyle=":", linewidth=1.2, marker=mark, markersize=3.0
        )
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("people (1)")
    axes.set_ylabel("instructions (10⁶)")
