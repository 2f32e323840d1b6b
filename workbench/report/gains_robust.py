"""The page of a robustness study: worst margins and tube over ranges of cars."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Final, final

import numpy as np
from matplotlib.figure import Figure as Canvas

from workbench.claims import Rigor
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.ranged_loop import Car, Ranges
from workbench.models.gains.ranged_search import MOST_GAIN
from workbench.reach.robustness.pictures import FOUND_COLOUR, PROVED_COLOUR, draw_over_size
from workbench.reach.robustness.tubes import RangedTube
from workbench.reach.robustness.verdict import (
    MARGIN_NAMES,
    MarginName,
    OverSize,
    Robust,
    Robustness,
)
from workbench.report.curves import SampledRuns, TubeCurves
from workbench.report.drawing import INK, Figure, Key, svg_panel
from workbench.report.figures import tube_figure
from workbench.report.page import Block, Claim, Claims, Page, Paragraph, Section
from workbench.report.tables import Cell, Table

SHOWN_STATES: Final = ("station", "offset", "steering", "speed", "heading_error")
NO_ROUNDING: Final = (
    f"Gain factors are looked at from {1 / MOST_GAIN:g} to {MOST_GAIN:g}, disk margins to 1.8: "
    "beyond, nothing is proved. No margins where a car is not stable."
)


@final
@dataclass(frozen=True, slots=True, eq=False)
class RobustReport:
    """What the page shows; runs: of cars of the ranges, for the picture (None: no tube)."""

    vehicle: str
    loop: LateralLoop
    answer: Robustness
    sizes: OverSize
    tube: RangedTube | None
    runs: SampledRuns | None


def robust_page(report: RobustReport, *, version: str, command: str) -> Page:
    """Answer, margins, sizes, tube."""
    sections = [
        Section("What is claimed", [_claims(report), Paragraph(NO_ROUNDING)]),
        Section("Worst margins of all cars of the ranges", [margin_table(report.answer)]),
        Section("Worst margins over the size of the ranges", [_size_figure(report.sizes)]),
    ]
    if report.tube is not None:
        sections.append(Section("The tube of all cars of the ranges", _tube_blocks(report)))
    return Page(
        f"Robustness of {report.vehicle}", lead(report.loop, report.answer), sections,
        version=version, command=command,
    )  # fmt: skip


def lead(loop: LateralLoop, answer: Robustness) -> list[str]:
    """The answer in a few sentences."""
    said = [
        f"Controller for wheelbase {loop.wheelbase_m:g} m at {loop.speed_mps:g} m/s on a straight "
        f"path; kp = {loop.proportional:g} rad/(s m), ki = {loop.integral:g} rad/(s² m), kd = "
        f"{loop.derivative:g} rad/m, look-ahead {loop.look_ahead_m:g} m.",
        f"Cars: {ranges_text(answer.ranges)}.",
        f"{answer.answer.value[0].upper()}{answer.answer.value[1:]}.",
    ]
    if answer.witness is not None:
        said.append(f"Not stable: {car_text(answer.witness)}.")
    return said


def ranges_text(ranges: Ranges) -> str:
    """The three ranges in words."""
    base, scale, delay = (
        f"{low:g}" if low == high else f"{low:g} to {high:g}" for low, high in ranges.ends
    )
    return (
        f"wheelbase {base} m, true speed {scale} times the measured one, steering commands "
        f"{delay} s late"
    )


def car_text(car: Car) -> str:
    """One car in words."""
    return (
        f"wheelbase {car.wheelbase_m:.4g} m, speed scale {car.speed_scale:.4g}, "
        f"delay {car.delay_s:.4g} s"
    )


def margin_table(answer: Robustness) -> Table:
    """Every margin: what all cars keep, and the worst that was found."""
    headings = [
        "worst margin", "proved for every car", "found by search", "at wheelbase (m)",
        "speed scale (1)", "delay (s)",
    ]  # fmt: skip
    rows: list[list[Cell]] = [
        [each.name.label, each.proved, each.found,
         *((each.at.wheelbase_m, each.at.speed_scale, each.at.delay_s) if each.at
           else (None, None, None))]
        for each in answer.margins
    ]  # fmt: skip
    return Table("worst margins; the truth lies between proved and found", headings, rows)


def width_table(tube: RangedTube) -> Table:
    """Half widths at the instants: proved, and shown by runs."""
    headings = ["state", "unit"]
    for t in tube.instants_s:
        headings += [f"{t:g} s, proved", f"{t:g} s, found by search"]
    rows: list[list[Cell]] = []
    for i, (name, unit) in enumerate(zip(tube.tube.names, tube.units, strict=True)):
        if name in SHOWN_STATES:
            pairs = np.stack([tube.proved[:, i], tube.found[:, i]], axis=1).ravel().tolist()
            rows.append([name, unit, *(None if np.isnan(value) else value for value in pairs)])
    return Table(
        f"half widths of what all cars of the ranges reach; search: {tube.runs} runs",
        headings, rows,
    )  # fmt: skip


def _claims(report: RobustReport) -> Claims:
    answer = report.answer
    said = answer.answer.value
    rigor = Rigor.NUMERICAL if answer.answer is Robust.OPEN else Rigor.ENCLOSED
    claims = [
        Claim(f"{said[0].upper()}{said[1:]}. Of the lateral loop, linearised, with constant "
              "wheelbase, speed scale and delay.", rigor),
    ]  # fmt: skip
    if answer.answer is Robust.PROVED:
        claims.append(
            Claim("Every car keeps the margins in the column “proved for every car”.",
                  Rigor.ENCLOSED)
        )  # fmt: skip
    claims.append(Claim("The column “found by search”: a worse car may exist.", Rigor.NUMERICAL))
    if report.tube is not None:
        tube = report.tube.tube
        claims.append(
            Claim(f"Every car, from every state of the initial set, stays in the tube up to "
                  f"{tube.times[-1]:g} s.", tube.rigor)
        )  # fmt: skip
    return Claims(claims)


def _size_figure(sizes: OverSize) -> Figure:
    panels = tuple(
        svg_panel(partial(_paint, sizes=sizes, name=name), label=f"{name.label} over size")
        for name in MARGIN_NAMES
    )
    legend = (
        Key("proved for every car", PROVED_COLOUR),
        Key("worst found by search", FOUND_COLOUR, "7 3"),
        Key("not proved stable", INK, filled=True),
    )
    return Figure(
        panels, legend,
        "All ranges grow about their middles; at 1 they are as given, at 0 one car. Where the two "
        "lines lie on each other the proof is as good as it can be.", size_table(sizes),
    )  # fmt: skip


def _paint(canvas: Canvas, *, sizes: OverSize, name: MarginName) -> None:
    draw_over_size(canvas.add_subplot(), sizes, name)


def size_table(sizes: OverSize) -> Table:
    """Answer and margins for each size."""
    headings = ["size", "answer"]
    for name in MARGIN_NAMES:
        headings += [f"{name.label}, proved", "found"]
    rows: list[list[Cell]] = [
        [size, each.answer.name, *(v for m in each.margins for v in (m.proved, m.found))]
        for size, each in zip(sizes.sizes, sizes.answers, strict=True)
    ]
    return Table("worst margins over the size of the ranges", headings, rows, folded=True)


def _tube_blocks(report: RobustReport) -> list[Block]:
    found = report.tube
    if found is None:
        return []
    tube = found.tube
    blocks: list[Block] = [
        width_table(found),
        Paragraph(
            "Wheelbase and speed scale are unknown constants. What a delay holds back enters the "
            "proof as an arbitrary function of time within the delay times the steering rate's "
            "limit, which makes the proved tube wider than the car can be."
        ),
    ]
    if len(tube.lower):
        curves = TubeCurves(
            tube.names, found.units, tube.times, tube.lower, tube.upper, tube.lower_at,
            tube.upper_at, tube.rigor,
        )  # fmt: skip
        blocks.append(tube_figure(curves, report.runs))
    return blocks
