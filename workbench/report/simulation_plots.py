"""A drive over time: distances, speed and stopping distance, acceleration and jerk."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Final, final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.errors import InputError
from workbench.report.curves import Values, require_shape
from workbench.report.drawing import (
    BLUE,
    GREEN,
    HATCHES,
    INK,
    PURPLE,
    SKY,
    VERMILLION,
    Figure,
    Key,
    svg_panel,
    thinned,
)
from workbench.report.tables import Table

_FAR_M: Final = 15.0
_TABLE_ROWS: Final = 400


@final
@dataclass(frozen=True, slots=True)
class Braking:
    """From BRAKE after TRACK until TRACK comes again or the drive ends; needless: None where that
    is not known."""

    since_s: float
    until_s: float
    needless: bool | None


@final
@dataclass(frozen=True, slots=True)
class DriveCurves:
    """One drive, turn by turn (n,), and decision by decision (m,). NaN: there is nothing.

    t_s; nearest_m: true distance from body to body; speed_mps; stopping_m: least and greatest way
    to standstill (n, 2); acceleration_mps2; jerk_mps3. decided_s; clearance_m: proved;
    reference_mps: speed that the controller follows. braking: intervals.
    """

    t_s: Values
    nearest_m: Values
    speed_mps: Values
    stopping_m: Values
    acceleration_mps2: Values
    jerk_mps3: Values
    decided_s: Values
    clearance_m: Values
    reference_mps: Values
    braking: tuple[Braking, ...]

    def __post_init__(self) -> None:
        turns, decisions = len(self.t_s), len(self.decided_s)
        if not turns:
            raise InputError("expected at least one turn of a drive, got none")
        for name in ("nearest_m", "speed_mps", "acceleration_mps2", "jerk_mps3"):
            require_shape(name, getattr(self, name), (turns,))
        require_shape("stopping_m", self.stopping_m, (turns, 2))
        require_shape("clearance_m", self.clearance_m, (decisions,))
        require_shape("reference_mps", self.reference_mps, (decisions,))


def drive_figure(curves: DriveCurves) -> Figure:
    """Distances, speed, stopping distance, acceleration and jerk over one axis of time."""
    panel = svg_panel(
        partial(_paint, curves=curves), label="Distances, speed and acceleration over time",
        width_in=4.6, height_in=6.6,
    )  # fmt: skip
    legend = (
        Key("true: distance, speed, acceleration", INK),
        Key("proved clearance", GREEN, mark="."),
        Key("reference speed", BLUE, "7 3"),
        Key("way to standstill, least to greatest", SKY, filled=True),
        Key("jerk", PURPLE),
        Key("BRAKE is sent, needed", INK, filled=True),
        Key("BRAKE is sent, needless", VERMILLION, filled=True, hatch=HATCHES[1]),
        Key("BRAKE is sent, not judged", INK, filled=True, hatch=HATCHES[3]),
    )
    caption = (
        f"Distances beyond {_FAR_M:g} m are not drawn. The clearance is that of TRACK to where "
        "people are expected to go, so that it is less than the distance. Way to standstill: speed "
        "times delay plus speed squared over twice the deceleration, for the bounds of both in the "
        "vehicle file. Jerk: change of acceleration over 0.2 s. Shaded: BRAKE is sent. The curves "
        "of decisions break where none was made."
    )
    return Figure((panel,), legend, caption, _table(curves), wide=True)


def _paint(canvas: Canvas, *, curves: DriveCurves) -> None:
    distance, speed, stop, hard, jerk = canvas.subplots(
        5, 1, sharex=True, height_ratios=(1.3, 1.2, 0.9, 0.9, 0.9)
    )
    axes: Axes
    for axes in (distance, speed, stop, hard, jerk):
        for each in curves.braking:
            colour = VERMILLION if each.needless else INK
            hatch, alpha = (HATCHES[1], 0.3) if each.needless else ("", 0.15)
            if each.needless is None:
                hatch, alpha = HATCHES[3], 0.05
            axes.axvspan(
                each.since_s, each.until_s, facecolor=(colour, alpha), edgecolor=INK, hatch=hatch,
                lw=0,
            )  # fmt: skip
    _paint_distance(distance, curves)
    speed.plot(curves.t_s, curves.speed_mps, color=INK, lw=1.3)
    speed.plot(curves.decided_s, curves.reference_mps, color=BLUE, ls="--", lw=1.1)
    speed.set_ylabel("speed\n(m/s)")
    speed.set_ylim(bottom=0.0)
    stop.fill_between(
        curves.t_s, curves.stopping_m[:, 0], curves.stopping_m[:, 1], color=SKY, alpha=0.8, lw=0.5
    )
    stop.set_ylabel("to stand-\nstill (m)")
    stop.set_ylim(bottom=0.0)
    hard.plot(curves.t_s, curves.acceleration_mps2, color=INK, lw=1.1)
    hard.set_ylabel("acceleration\n(m/s²)")
    jerk.plot(curves.t_s, curves.jerk_mps3, color=PURPLE, lw=0.9)
    jerk.set_ylabel("jerk\n(m/s³)")
    jerk.set_xlabel("time (s)")
    jerk.set_xlim(0.0, float(curves.t_s[-1]))
    canvas.align_ylabels()


def _paint_distance(axes: Axes, curves: DriveCurves) -> None:
    near = np.where(curves.nearest_m <= _FAR_M, curves.nearest_m, np.nan)
    proved = np.where(curves.clearance_m <= _FAR_M, curves.clearance_m, np.nan)
    axes.plot(curves.t_s, near, color=INK, lw=1.3)
    axes.plot(curves.decided_s, proved, color=GREEN, ls="none", marker=".", markersize=3)
    axes.axhline(0.0, color=VERMILLION, lw=0.8)
    axes.set_ylabel("distance (m)")
    if not (np.isfinite(near).any() or np.isfinite(proved).any()):
        axes.set_ylim(0.0, _FAR_M)
        axes.text(
            0.5, 0.5, f"nobody within {_FAR_M:g} m", transform=axes.transAxes, ha="center",
            va="center",
        )  # fmt: skip


def _table(curves: DriveCurves) -> Table:
    headings = [
        "time (s)", "distance (m)", "speed (m/s)", "least way to standstill (m)",
        "greatest (m)", "acceleration (m/s²)", "jerk (m/s³)",
    ]  # fmt: skip
    columns = (
        curves.t_s, curves.nearest_m, curves.speed_mps, *curves.stopping_m.T,
        curves.acceleration_mps2, curves.jerk_mps3,
    )  # fmt: skip
    rows = [
        [None if np.isnan(column[k]) else float(column[k]) for column in columns]
        for k in thinned(len(curves.t_s), _TABLE_ROWS)
    ]
    return Table("the drive, turn by turn", headings, rows, folded=True)
