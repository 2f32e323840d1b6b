"""Pictures of a gain study: each `draw_...` fills one pair of axes, each `paint_...` a canvas."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import matplotlib
import numpy as np
from matplotlib.axis import Axis
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure, FigureBase
from matplotlib.ticker import NullLocator, StrMethodFormatter
from numpy.typing import NDArray

from workbench.models.gains.lateral import Schedule, axis
from workbench.models.gains.over_speed import OverSpeed, SpeedPoint, continued
from workbench.models.gains.routh import Reason

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from workbench.models.gains.jitter import JitterStudy
    from workbench.models.gains.responses import Responses
    from workbench.models.gains.spectral import SampledMap
    from workbench.models.gains.stability_map import StabilityMap
    from workbench.models.gains.study import GainStudy

# Okabe and Ito's colours; every colour comes with another dash or with a letter in the picture.
BLUE, ORANGE, GREEN, VERMILLION, PURPLE, SKY, GREY = (
    "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#999999",
)  # fmt: skip
REASON_COLOURS: Final = {
    Reason.STABLE: SKY,
    Reason.NO_DAMPING: GREY,
    Reason.DRIFT: VERMILLION,
    Reason.NO_RESTORING: PURPLE,
    Reason.OSCILLATION: ORANGE,
}
REASON_LETTERS: Final = {
    Reason.STABLE: "S",
    Reason.NO_DAMPING: "N",
    Reason.DRIFT: "D",
    Reason.NO_RESTORING: "R",
    Reason.OSCILLATION: "O",
}
SCHEDULE_LINES: Final = {
    Schedule.FIXED: (BLUE, "-"),
    Schedule.DISTANCE: (VERMILLION, "--"),
    Schedule.TIME: (GREEN, "-."),
}
SPEED_LINES: Final = ((BLUE, "-"), (VERMILLION, "--"), (GREEN, "-."), (PURPLE, ":"))
MARGINS: Final[tuple[tuple[str, Callable[[SpeedPoint], float]], ...]] = (
    ("phase margin (deg)", lambda p: p.phase_deg),
    ("delay margin (s)", lambda p: p.delay_s),
    ("disk margin (1)", lambda p: p.disk),
    ("least damping ratio (1)", lambda p: p.damping),
    ("least gain factor (1)", lambda p: p.gain_low),
    ("slowest pole's real part (1/s)", lambda p: p.abscissa_per_s),
)


def figure(
    paint: Callable[[Figure], None], *, width_in: float = 6.0, height_in: float = 4.0
) -> Figure:
    """A new figure that `paint` has drawn on."""
    canvas = Figure(figsize=(width_in, height_in), layout="constrained")
    paint(canvas)
    return canvas


def ink() -> str:
    """The colour of text where the picture is drawn."""
    return str(matplotlib.rcParams["text.color"])


def paint_map(canvas: FigureBase, found: StabilityMap) -> None:
    """The exact regions over the two axes."""
    axes = canvas.add_subplot()
    half = float(found.x[1] - found.x[0]) / 2.0
    for reason in found.reasons():
        _strips(axes, found, reason, half)
    _boundary(axes, found)
    stable = np.where(found.abscissa < 0.0, found.abscissa, np.nan)
    if np.isfinite(stable).sum() > 4:
        lines = axes.contour(
            found.x, found.y, stable, levels=4, colors=ink(), linewidths=0.5, linestyles="solid"
        )
        axes.clabel(lines, fontsize=7, fmt="%.2g")
    here = found.loop.value(found.x_name), found.loop.value(found.y_name)
    axes.plot(*here, marker="x", color=ink(), markersize=9, markeredgewidth=2, linestyle="")
    axes.set_xlim(float(found.x[0]), float(found.x[-1]))
    axes.set_ylim(float(found.y[0]), float(found.y[-1]))
    axes.set_xlabel(axis(found.x_name).label)
    axes.set_ylabel(axis(found.y_name).label)
    axes.grid(False)


def _strips(axes: Axes, found: StabilityMap, reason: Reason, half: float) -> None:
    found_here = [
        (float(x), piece.low, piece.high)
        for x, pieces in zip(found.x, found.pieces, strict=True)
        for piece in pieces
        if piece.reason is reason
    ]
    verts = [
        [(x - half, low), (x + half, low), (x + half, high), (x - half, high)]
        for x, low, high in found_here
    ]
    colour = REASON_COLOURS[reason]
    axes.add_collection(
        PolyCollection(verts, facecolors=colour, edgecolors="none", linewidths=0, alpha=0.55)
    )
    # The middle of the region, where a letter fits.
    columns = [x for x, _, _ in found_here]
    middle = float(np.average(columns, weights=[high - low for _, low, high in found_here]))
    reach = (max(columns) - min(columns)) / 2.0 + half
    x, low, high = max(
        found_here, key=lambda each: (each[2] - each[1]) * (1.5 - abs(each[0] - middle) / reach)
    )
    if high - low > 0.06 * float(np.ptp(found.y)):
        axes.text(
            x, (low + high) / 2.0, REASON_LETTERS[reason],
            ha="center", va="center", fontweight="bold",
        )  # fmt: skip


def _boundary(axes: Axes, found: StabilityMap) -> None:
    """The exact points at which stability is lost or won, one or more per line."""
    points = [
        (float(x), one.high)
        for x, pieces in zip(found.x, found.pieces, strict=True)
        for one, other in pairwise(pieces)
        if (one.reason is Reason.STABLE) != (other.reason is Reason.STABLE)
    ]
    if points:
        axes.plot(*zip(*points, strict=True), linestyle="", marker=".", color=ink(), markersize=2.5)


def paint_margins(canvas: Figure, found: OverSpeed) -> None:
    """All margins over speed."""
    canvas.set_size_inches(9.0, 5.0)
    for axes, (label, value) in zip(canvas.subplots(2, 3).ravel(), MARGINS, strict=True):
        draw_margin(axes, found, label, value)


def draw_margin(
    axes: Axes, found: OverSpeed, label: str, value: Callable[[SpeedPoint], float]
) -> None:
    """One margin over speed, one line per schedule."""
    for schedule, (colour, dashes) in SCHEDULE_LINES.items():
        points = found.of(schedule)
        axes.plot(
            [p.speed_mps for p in points], [value(p) for p in points],
            color=colour, linestyle=dashes, linewidth=1.8,
        )  # fmt: skip
    axes.axvline(found.loop.speed_mps, color=ink(), linewidth=0.8, linestyle=":")
    axes.set_xlabel("speed (m/s)")
    axes.set_ylabel(label)


def draw_poles(axes: Axes, found: OverSpeed) -> None:
    """The poles of the fixed gains as the speed rises, thin to thick."""
    for branch in found.poles.T:
        axes.plot(branch.real, branch.imag, color=BLUE, linewidth=1.0)
        sizes = np.linspace(2.0, 22.0, len(branch))
        axes.scatter(branch.real, branch.imag, s=sizes, color=BLUE, linewidths=0)
    _complex_plane(axes)


def draw_locus(axes: Axes, found: Responses) -> None:
    """Poles as the loop gain changes from 0 to 5, at each speed; marked where the gain is 1."""
    for locus, (colour, dashes) in zip(found.loci, SPEED_LINES, strict=False):
        poles = continued(list(locus.poles))
        axes.plot(poles.real, poles.imag, color=colour, linestyle=dashes, linewidth=1.4)
        present = poles[int(np.argmin(np.abs(locus.factors - 1.0)))]
        axes.plot(present.real, present.imag, linestyle="", marker="x", color=ink())
    least = min(float(locus.poles[locus.factors <= 2.0].real.min()) for locus in found.loci)
    axes.set_xlim(1.1 * least, max(-0.3 * least, 0.1))
    _complex_plane(axes)


def _complex_plane(axes: Axes) -> None:
    axes.axvline(0.0, color=ink(), linewidth=1.0)
    axes.set_xlabel("real part (1/s)")
    axes.set_ylabel("imaginary part (1/s)")


def draw_nyquist(axes: Axes, found: Responses) -> None:
    """L(j w) near -1, with the point itself."""
    for each, (colour, dashes) in zip(found.frequency, SPEED_LINES, strict=False):
        near = np.where(np.abs(each.values) < 8.0, each.values, np.nan)
        axes.plot(near.real, near.imag, color=colour, linestyle=dashes, linewidth=1.6)
    turn = np.linspace(0.0, 2.0 * math.pi, 100)
    axes.plot(np.cos(turn), np.sin(turn), color=ink(), linewidth=0.5)
    axes.plot(-1.0, 0.0, marker="+", color=ink(), markersize=10, markeredgewidth=2)
    axes.set_xlim(-4.0, 1.5)
    axes.set_ylim(-3.0, 3.0)
    axes.set_xlabel("real part of L (1)")
    axes.set_ylabel("imaginary part of L (1)")


def draw_magnitude(axes: Axes, found: Responses) -> None:
    """Bode: |L| over frequency."""
    for each, (colour, dashes) in zip(found.frequency, SPEED_LINES, strict=False):
        axes.loglog(each.radps, np.abs(each.values), color=colour, linestyle=dashes, linewidth=1.6)
    axes.axhline(1.0, color=ink(), linewidth=0.8)
    _plain_logarithms(axes.xaxis, axes.yaxis)
    axes.set_xlabel("frequency (rad/s)")
    axes.set_ylabel("|L| (1)")


def draw_phase(axes: Axes, found: Responses) -> None:
    """Bode: phase of L over frequency, continued from high frequencies."""
    for each, (colour, dashes) in zip(found.frequency, SPEED_LINES, strict=False):
        axes.semilogx(
            each.radps, phase_deg(each.values), color=colour, linestyle=dashes, linewidth=1.6
        )
    axes.axhline(-180.0, color=ink(), linewidth=0.8)
    _plain_logarithms(axes.xaxis)
    axes.set_xlabel("frequency (rad/s)")
    axes.set_ylabel("phase of L (deg)")


def _plain_logarithms(*found: Axis) -> None:
    for each in found:
        each.set_major_formatter(StrMethodFormatter("{x:g}"))
        each.set_minor_locator(NullLocator())


def phase_deg(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Unwrapped from the highest frequency down, where L falls like 1/s."""
    unwrapped: NDArray[np.float64] = np.degrees(np.unwrap(np.angle(values[::-1])))[::-1]
    return unwrapped


def draw_steps(axes: Axes, found: Responses) -> None:
    """Offsets over time: the full loop bold, the linear one thin."""
    for step, (colour, dashes) in zip(found.steps, SPEED_LINES, strict=False):
        axes.plot(step.times_s, step.nonlinear_m, color=colour, linestyle=dashes, linewidth=1.8)
        axes.plot(step.times_s, step.linear_m, color=ink(), linewidth=0.6)
    axes.axhline(0.0, color=ink(), linewidth=0.6)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("offset (m)")


def paint_study(canvas: Figure, found: GainStudy) -> None:
    """The first picture to look at: two maps, margins, step responses, samples, jitter."""
    parts = np.ravel(np.asarray(canvas.subfigures(2, 3)))
    paint_map(parts[0], found.maps[0])
    paint_map(parts[1], found.maps[-1])
    draw_margin(parts[2].add_subplot(), found.over_speed, *MARGINS[0])
    draw_steps(parts[3].add_subplot(), found.responses)
    paint_sampled(parts[4], found.sampled[0])
    paint_jitter(parts[5], found.jitter)


def paint_responses(canvas: Figure, found: Responses) -> None:
    """Step responses, root locus, Nyquist curve, both halves of the Bode plot."""
    grid = canvas.subplots(2, 3).ravel()
    drawn = (draw_steps, draw_locus, draw_nyquist, draw_magnitude, draw_phase)
    for axes, draw in zip(grid, drawn, strict=False):
        draw(axes, found)
    grid[-1].remove()


def paint_sampled(canvas: FigureBase, found: SampledMap) -> None:
    """Where the spectral radius is below 1, with lines of equal radius."""
    axes = canvas.add_subplot()
    axes.contourf(
        found.x, found.y, found.radius, levels=[0.0, 1.0, np.inf], colors=[SKY, ORANGE],
        hatches=[None, "///"], alpha=0.55,
    )  # fmt: skip
    if found.radius.min() < 1.0 < found.radius.max():
        axes.contour(found.x, found.y, found.radius, levels=[1.0], colors=ink(), linewidths=2.0)
    lines = axes.contour(
        found.x, found.y, np.minimum(found.radius, 3.0), levels=7, colors=ink(), linewidths=0.5
    )
    axes.clabel(lines, fontsize=7, fmt="%.4g")
    axes.set_xlabel(found.x_label)
    axes.set_ylabel(found.y_label)
    axes.grid(False)


def paint_jitter(canvas: FigureBase, found: JitterStudy) -> None:
    """Rates per sample over jitter: proved from above, found by the search from below."""
    axes = canvas.add_subplot()
    jitters = [each.sampling.jitter_s for each in found.judged]
    proved = [each.proof.rate if each.proof else math.nan for each in found.judged]
    axes.plot(jitters, proved, color=BLUE, marker="o", linewidth=1.8)
    axes.plot(
        jitters, [each.worst.growth for each in found.judged],
        color=VERMILLION, linestyle="--", marker="s", linewidth=1.8,
    )  # fmt: skip
    axes.axhline(1.0, color=ink(), linewidth=1.0)
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.set_xlabel("jitter (s)")
    axes.set_ylabel("rate per sample (1)")
