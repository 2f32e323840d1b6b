"""The numbers of a gain study as tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

from workbench.models.control_view import QuickStudy
from workbench.models.gains.jitter import JitterStudy
from workbench.models.gains.lateral import axis
from workbench.models.gains.over_speed import OverSpeed
from workbench.models.gains.responses import Responses
from workbench.models.gains.spectral import SampledMap
from workbench.models.gains.stability_map import StabilityMap
from workbench.models.gains.study import GainStudy
from workbench.models.gains.three_routes import Checked
from workbench.report.drawing import thinned
from workbench.report.tables import Cell, Table

_LINES = 13


def _shown(value: float) -> float | None:
    return None if math.isnan(value) else value


def quick_table(quick: QuickStudy) -> Table:
    """Classical margins of both loops at the reference speed."""
    rows: list[list[Cell]] = [
        [name, each.gain_margin, _shown(each.phase_margin_deg), each.delay_margin_s,
         _shown(each.crossover_radps)]
        for name, each in (("steering", quick.steering_margins), ("speed", quick.speed_margins))
    ]  # fmt: skip
    return Table(
        f"margins of both loops of the linearised model at {quick.speed_mps:g} m/s",
        ["loop", "gain margin (factor)", "phase margin (deg)", "delay margin (s)",
         "crossover (rad/s)"],
        rows,
    )  # fmt: skip


def margin_table(over: OverSpeed) -> Table:
    """Margins over speed, all schedules."""
    headings = [
        "gains", "speed (m/s)", "slowest pole (1/s)", "damping (1)", "least gain factor",
        "largest gain factor", "phase margin (deg)", "delay margin (s)", "disk margin (1)",
        "disk gain from (factor)", "disk gain to (factor)", "disk phase (deg)",
    ]  # fmt: skip
    rows: list[list[Cell]] = [
        [p.schedule.value, *(_shown(value) for value in (
            p.speed_mps, p.abscissa_per_s, p.damping, p.gain_low, p.gain_high, p.phase_deg,
            p.delay_s, p.disk, p.disk_gain_low, p.disk_gain_high, p.disk_phase_deg,
        ))]
        for p in over.points
    ]  # fmt: skip
    return Table("poles and margins over speed", headings, rows, folded=True)


def pole_table(over: OverSpeed) -> Table:
    """Poles of the fixed gains at some speeds."""
    order = over.poles.shape[1]
    headings = ["speed (m/s)"]
    for k in range(1, order + 1):
        headings += [f"pole {k} (1/s)", "imaginary (1/s)"]
    rows: list[list[Cell]] = []
    for k in thinned(len(over.speeds_mps), _LINES):
        row: list[Cell] = [float(over.speeds_mps[k])]
        for pole in over.poles[k]:
            row += [float(pole.real), float(pole.imag)]
        rows.append(row)
    return Table("poles of the fixed gains over speed", headings, rows, folded=True)


def step_table(found: Responses) -> Table:
    """Settling, overshoot and saturation at each speed."""
    headings = [
        "speed (m/s)", "settled within 5 %, linear (s)", "full loop (s)",
        "overshoot, linear (share)", "full loop (share)", "at the rate limit (share of time)",
    ]  # fmt: skip
    rows: list[list[Cell]] = [
        [s.speed_mps, _shown(s.settling_s[0]), _shown(s.settling_s[1]), *s.overshoot, s.saturated]
        for s in found.steps
    ]
    return Table("answers to a start beside the path", headings, rows)


def along_table(study: GainStudy) -> Table:
    """Exact pieces along each axis through the gains as they are."""
    rows: list[list[Cell]] = [
        [axis(name).label, piece.low, piece.high, piece.reason.short]
        for name, pieces in study.along
        for piece in pieces
    ]
    return Table(
        "stability along each axis, the other values as they are (exact)",
        ["axis", "from", "to", "there"], rows,
    )  # fmt: skip


def boundary_table(found: StabilityMap) -> Table:
    """The exact pieces on some lines of a map."""
    x, y = axis(found.x_name), axis(found.y_name)
    headings = [x.label, f"{y.label} from", "to", "there"]
    rows: list[list[Cell]] = [
        [float(found.x[k]), piece.low, piece.high, piece.reason.short]
        for k in thinned(len(found.x), _LINES)
        for piece in found.pieces[k]
    ]
    return Table(
        f"where stability changes along {y.words}, over {x.words}; look-ahead "
        f"{found.loop.look_ahead_m:g} m unless it is an axis",
        headings, rows, folded=True,
    )  # fmt: skip


def checked_table(found: Sequence[Checked]) -> Table:
    """Three routes, side by side."""
    headings = ["point", "exact conditions", "slowest pole (1/s)", "full loop (1/s)", "agree"]
    rows: list[list[Cell]] = [
        [c.where, c.reason.short, c.abscissa_per_s, c.simulated_per_s, "yes" if c.agree else "NO"]
        for c in found
    ]
    return Table("points beside boundaries: growth per second by three routes", headings, rows)


def sampled_table(found: Sequence[SampledMap]) -> Table:
    """Spectral radii on a coarse grid of each map."""
    rows: list[list[Cell]] = [
        [each.x_label, float(each.x[i]), each.y_label, float(each.y[j]), float(each.radius[j, i])]
        for each in found
        for i in thinned(len(each.x), 6)
        for j in thinned(len(each.y), 6)
    ]
    headings = ["over", "value", "and", "its value", "spectral radius per sample"]
    return Table("spectral radii", headings, rows, folded=True)


def jitter_table(found: JitterStudy) -> Table:
    """Proof and search for each jitter."""
    headings = [
        "jitter (s)", "answer", "proved rate per sample", "worst growth found per sample",
        "matrices checked",
    ]  # fmt: skip
    rows: list[list[Cell]] = [
        [
            each.sampling.jitter_s,
            each.answer.value,
            each.proof.rate if each.proof else None,
            each.worst.growth,
            each.proof.corners if each.proof else None,
        ]
        for each in found.judged
    ]
    return Table("proof and search, by jitter", headings, rows)
