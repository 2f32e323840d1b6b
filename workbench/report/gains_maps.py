"""The maps of a gain study's page: exact stability, spectral radius, jitter."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from workbench.models.gains import pictures
from workbench.models.gains.lateral import axis
from workbench.models.gains.routh import Reason
from workbench.models.gains.stability_map import StabilityMap
from workbench.models.gains.study import GainStudy
from workbench.report.drawing import Figure, Key, svg_panel
from workbench.report.gains_tables import (
    along_table,
    boundary_table,
    jitter_table,
    sampled_table,
)
from workbench.report.page import Block, Paragraph

_SAMPLED_WORDS: Final = (
    "at the rate on the vehicle",
    "at the rate and delay on the vehicle",
    "at the speed of the study",
)


def _map_figure(found: StabilityMap, caption: str) -> Figure:
    title = f"Stability over {axis(found.x_name).words} and {axis(found.y_name).words}"
    panel = svg_panel(partial(pictures.paint_map, found=found), label=title, height_in=3.2)
    return Figure((panel,), _reason_keys([found]), caption, boundary_table(found))


def _reason_keys(maps: Sequence[StabilityMap]) -> tuple[Key, ...]:
    found = {reason for each in maps for reason in each.reasons()}
    return tuple(
        Key(f"{pictures.REASON_LETTERS[r]}: {r.value}", pictures.REASON_COLOURS[r], filled=True)
        for r in Reason
        if r in found
    )


def map_blocks(study: GainStudy) -> list[Block]:
    """All maps and their numbers."""
    panels = tuple(
        svg_panel(
            partial(pictures.paint_map, found=each),
            label=f"Stability over {axis(each.x_name).words} and {axis(each.y_name).words}",
            height_in=3.2,
        )
        for each in study.maps
    )
    return [
        Figure(
            panels, _reason_keys(study.maps),
            "Other values as in the study; x: where it is. On each vertical line the boundaries "
            "are roots of exact polynomials, isolated by Sturm chains; between lines nothing is "
            "proved. Thin lines: equal real part of the slowest pole (1/s). A speed below 0 is "
            "driving in reverse: gains that are stable forwards are not stable backwards.",
        ),
        along_table(study),
        *(boundary_table(each) for each in study.maps),
    ]  # fmt: skip


def without_blocks(study: GainStudy) -> list[Block]:
    """The structural result, in words and as a map."""
    text = (
        "With l = 0 the characteristic polynomial is L s⁴ + 0 s³ + kd v² s² + kp v² s + ki v²: the "
        "coefficient behind the leading one, kd l v, is 0 whatever the gains. It is minus the sum "
        "of the poles, times L. Poles that sum to 0 cannot all lie in Re < 0, so no gains make the "
        "offset of the rear axle alone asymptotically stable with a steering rate as command."
    )
    return [
        Paragraph(text),
        _map_figure(study.without_ahead, "The same axes with look-ahead 0: nothing is stable."),
    ]


def sampled_blocks(study: GainStudy) -> list[Block]:
    """Maps of the spectral radius, and proof and search under jitter."""
    panels = tuple(
        svg_panel(
            partial(pictures.paint_sampled, found=each),
            label=f"Spectral radius {words}",
            height_in=3.2,
        )
        for each, words in zip(study.sampled, _SAMPLED_WORDS, strict=True)
    )
    keys = (
        Key("stable: spectral radius per sample below 1", pictures.SKY, filled=True),
        Key("not stable", pictures.ORANGE, filled=True, hatch="///"),
    )
    jitter = svg_panel(partial(pictures.paint_jitter, found=study.jitter), label="Rates by jitter")
    jitter_keys = (
        Key("proved: no schedule is slower (ENCLOSED)", pictures.BLUE),
        Key("found: one schedule is as slow (SAMPLED)", pictures.VERMILLION, "7 3"),
    )
    return [
        Paragraph(timing_text(study)),
        Figure(
            panels, keys,
            "Exact zero-order hold: the plant is a chain of integrators, so that its motion under "
            "a held command is a polynomial. No jitter here; bold: spectral radius 1.",
            sampled_table(study.sampled),
        ),
        Figure(
            (jitter,), jitter_keys,
            "With jitter the matrix differs from sample to sample, and eigenvalues decide nothing. "
            "Proved: one quadratic function falls at every sample, for all times within their "
            "bounds. Found: the fastest growth among random schedules that repeat; above 1 it "
            "would refute. Where the two lines leave room, the truth lies between them. A proof is "
            "not tried where it would take more than 64 matrices: that is open, too.",
            jitter_table(study.jitter),
        ),
    ]  # fmt: skip


def timing_text(study: GainStudy) -> str:
    """Rate, delays, jitter, and how much delay there is room for."""
    sampling, critical = study.sampling, study.critical
    low = sampling.measurement_delay_s[0] + sampling.actuation_delay_s[0]
    high = sampling.measurement_delay_s[1] + sampling.actuation_delay_s[1]
    delay = f"{low:g} s" if low == high else f"{low:g} to {high:g} s"
    if critical.stable_s is None:
        room = "Even without delay the sampled loop is not proved stable at this speed"
    elif critical.unstable_s is None:
        room = f"Without jitter the loop is still stable with a delay of {critical.stable_s:.4g} s"
    else:
        room = (
            f"Without jitter the loop is stable with a delay of {critical.stable_s:.4g} s and not "
            f"with {critical.unstable_s:.4g} s (both by exact Schur and Cohn conditions)"
        )
    return (
        f"{1.0 / sampling.period_s:.4g} samples per second, {sampling.jitter.value}, jitter "
        f"{sampling.jitter_s:g} s either way; from a measurement to when its command acts {delay}. "
        f"{room}."
    )
