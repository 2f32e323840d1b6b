"""The page of a gain study."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final, final

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.claims import Rigor
from workbench.models.control_view import QuickStudy
from workbench.models.gains import pictures
from workbench.models.gains.jitter import Answer
from workbench.models.gains.study import GainStudy
from workbench.report.curves import TubeCurves
from workbench.report.drawing import INK, Figure, Key, svg_panel, thinned
from workbench.report.figures import tube_figure
from workbench.report.gains_maps import map_blocks, sampled_blocks, without_blocks
from workbench.report.gains_tables import (
    checked_table,
    margin_table,
    pole_table,
    quick_table,
    step_table,
)
from workbench.report.page import Block, Claim, Claims, Notice, Page, Paragraph, Section
from workbench.report.tables import Table

_DASHES: Final = {"-": "", "--": "7 3", ":": "2 3", "-.": "8 3 2 3"}


@final
@dataclass(frozen=True, slots=True, eq=False)
class GainReport:
    """What the page shows: the study, both loops at reference speed, the tube (None: left out)."""

    study: GainStudy
    quick: QuickStudy
    tube: TubeCurves | None = None


def gains_page(report: GainReport, *, version: str, command: str) -> Page:
    """The page, in reading order: answer, speed, gains, samples, tube."""
    study = report.study
    sections = [
        Section("What is stable, and how that is known", _answers(report)),
        Section("Poles and margins over speed", _speed_blocks(study)),
        Section("Nyquist, Bode and root locus", _loop_blocks(study)),
        Section("Back to the path: step responses", _step_blocks(study)),
        Section("Stability maps with exact boundaries", map_blocks(study)),
        Section("Without look-ahead: never stable", without_blocks(study)),
        Section("At samples, with delay and jitter", sampled_blocks(study)),
    ]
    if report.tube is not None:
        sections.append(Section("The tube of the full loop", [tube_figure(report.tube)]))
    return Page(
        f"Gains of {study.vehicle}", lead(study), sections, version=version, command=command
    )


def lead(study: GainStudy) -> list[str]:
    """The answer in a few sentences."""
    loop = study.loop
    low, high = study.speed_range_mps
    stable = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in study.stable_speeds_mps) or "none"
    verdict = study.reason.short
    said = [
        f"kp = {loop.proportional:g} rad/(s m), ki = {loop.integral:g} rad/(s² m), "
        f"kd = {loop.derivative:g} rad/m, look-ahead {loop.look_ahead_m:g} m; at "
        f"{loop.speed_mps:g} m/s the linearised loop: {verdict}.",
        f"Speeds from {low:g} to {high:g} m/s at which it is stable when the speed keeps: "
        f"{stable} m/s{' (all of them, proved)' if study.always_stable else ''}.",
    ]
    sampling, answer = study.sampling, study.judged.answer
    said.append(
        f"At {1.0 / sampling.period_s:.4g} samples per second with jitter of "
        f"{sampling.jitter_s:g} s: {answer.value}."
    )
    return said


def _answers(report: GainReport) -> list[Block]:
    study = report.study
    blocks: list[Block] = [Notice("Mind:", warning) for warning in report.quick.warnings]
    compared = sum(each.compared for each in (*study.maps, study.without_ahead))
    claims = [
        Claim(
            f"At {study.loop.speed_mps:g} m/s: {study.reason.value}. Hurwitz' conditions in exact "
            "arithmetic, for the lateral loop linearised on a straight path.",
            Rigor.ENCLOSED,
        ),
        Claim("Every line of the maps: where stability changes along it, and why.", Rigor.ENCLOSED),
        Claim(
            f"Eigenvalues on {compared} grid points differ from the exact conditions at "
            f"{study.disagreements}.",
            Rigor.NUMERICAL,
        ),
        Claim("Margins, step responses, maps of the spectral radius.", Rigor.NUMERICAL),
    ]
    if study.judged.answer is Answer.PROVED:
        claims.append(
            Claim(
                "At samples, whatever delays and jitter do within their bounds: stable, by one "
                "quadratic function that falls at every sample, checked exactly.",
                Rigor.ENCLOSED,
            )
        )
    claims.append(Claim("Worst schedules of samples found by random search.", Rigor.SAMPLED))
    limit = study.linear_offset_m
    blocks += [
        Claims(claims),
        Paragraph(
            "All of this is about small deviations at a speed that keeps. Beside the path and "
            f"parallel to it, the proportional part alone asks for the steering rate's limit from "
            f"{limit:.3g} m on; beyond, the linear picture does not hold and the tube counts."
        ),
        quick_table(report.quick),
        Paragraph("Below, points on both sides of boundaries are judged by three routes."),
        checked_table(study.checked),
    ]
    return blocks


def _panel(draw: Callable[[Axes], None], label: str) -> str:
    def paint(canvas: Canvas) -> None:
        draw(canvas.add_subplot())

    return svg_panel(paint, label=label)


def _speed_blocks(study: GainStudy) -> list[Block]:
    over = study.over_speed
    panels = [
        _panel(partial(pictures.draw_margin, found=over, label=label, value=value), label)
        for label, value in pictures.MARGINS
    ]
    legend = [
        Key(schedule.value, colour, _DASHES[dashes])
        for schedule, (colour, dashes) in pictures.SCHEDULE_LINES.items()
    ]
    locus = _panel(partial(pictures.draw_poles, found=over), "Poles as the speed rises")
    return [
        Figure(
            tuple(panels), tuple(legend),
            "Margins of the loop broken at the steering rate. Gains scheduled over distance: kp "
            "grows like v, ki like v²; over time: the look-ahead grows like v, all gains fall like "
            "1/v². Both keep damping and phase margin at every frozen speed; where a line is "
            "missing, the loop is not stable. Dotted: the speed of the study.",
            margin_table(over),
        ),
        Figure(
            (locus,), (Key("poles with fixed gains; larger dots: higher speed", pictures.BLUE),),
            "Root locus over speed. Left of the line at 0 is stable.", pole_table(over),
        ),
    ]  # fmt: skip


def _speed_keys(study: GainStudy) -> list[Key]:
    return [
        Key(f"{step.speed_mps:.3g} m/s", colour, _DASHES[dashes])
        for step, (colour, dashes) in zip(study.responses.steps, pictures.SPEED_LINES, strict=False)
    ]


def _loop_blocks(study: GainStudy) -> list[Block]:
    drawn = (
        (pictures.draw_nyquist, "Nyquist curve"),
        (pictures.draw_magnitude, "Bode plot, magnitude"),
        (pictures.draw_phase, "Bode plot, phase"),
        (pictures.draw_locus, "Root locus over the loop gain"),
    )
    panels = tuple(_panel(partial(draw, found=study.responses), label) for draw, label in drawn)
    rows = [
        [each.speed_mps, row["frequency_radps"], row["magnitude"], row["phase_deg"]]
        for each in study.responses.frequency
        for row in (each.rows()[k] for k in thinned(len(each.radps), 25))
    ]
    headings = ["speed (m/s)", "frequency (rad/s)", "|L| (1)", "phase of L (deg)"]
    return [
        Figure(
            panels, tuple(_speed_keys(study)),
            "L(s) = (kp + ki/s + kd s)(v² + l v s) / (L s³). Two poles at 0 and more: the curve "
            "comes from far away, and too little gain is what makes this loop unstable. +: the "
            "point -1; x: the present gain, lines: 0 to 5 times it.",
            Table("the open loop at some frequencies", headings, rows, folded=True),
        )
    ]  # fmt: skip


def _step_blocks(study: GainStudy) -> list[Block]:
    panel = _panel(partial(pictures.draw_steps, found=study.responses), "Offset over time")
    keys = (*_speed_keys(study), Key("linearised, by python-control", INK))
    start = study.responses.steps[0].start_m
    return [
        Figure(
            (panel,), keys,
            f"A start {start:.3g} m beside the path, at rest otherwise; bold: the full loop with "
            "its limits.",
            step_table(study.responses),
        )
    ]  # fmt: skip
