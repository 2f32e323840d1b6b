"""Pictures of what is proved from both sides: a tube, and the hull that it certainly contains."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.claims import Rigor
from workbench.report.curves import Values, require_shape
from workbench.report.drawing import BLUE, GREEN, Figure, Key, svg_panel, thinned
from workbench.report.page import MEANING
from workbench.report.tables import Table

_ROWS = 61


@final
@dataclass(frozen=True, slots=True)
class BothSides:
    """Sets at the instants, outer and inner, as plain arrays.

    names, units: of the n states; times_s (M,), s; outer_lower, outer_upper, inner_lower,
    inner_upper (M, n); rigor: the weaker one of both. InputError on other shapes.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    times_s: Values
    outer_lower: Values
    outer_upper: Values
    inner_lower: Values
    inner_upper: Values
    rigor: Rigor

    def __post_init__(self) -> None:
        for what in ("outer_lower", "outer_upper", "inner_lower", "inner_upper"):
            require_shape(what, getattr(self, what), (len(self.times_s), len(self.names)))


def both_sides_figure(sets: BothSides) -> Figure:
    """One picture per state: both sets about the tube's centre."""
    panels = tuple(
        svg_panel(
            partial(_paint, sets=sets, column=column),
            label=f"Reachable {name} over time, from outside and from inside",
        )
        for column, name in enumerate(sets.names)
    )
    legend = (
        Key("certainly reached between these", GREEN, filled=True),
        Key("never left at the instants", BLUE),
    )
    caption = (
        "The hull of the reachable states at each instant lies between both: it reaches at least "
        "as far as the green band and no farther than the lines; this holds with "
        f"rigor {sets.rigor.name} ({MEANING[sets.rigor]}). Drawn about the centre of the lines."
    )
    return Figure(panels, legend, caption, _numbers(sets))


def _numbers(sets: BothSides) -> Table:
    headings = ["time (s)"]
    for name, unit in zip(sets.names, sets.units, strict=True):
        headings += [f"{name} not below ({unit})", f"reached from ({unit})", f"reached to ({unit})",
                     f"not above ({unit})"]  # fmt: skip
    sides = (sets.outer_lower, sets.inner_lower, sets.inner_upper, sets.outer_upper)
    rows = [
        [float(sets.times_s[k]), *np.stack([side[k] for side in sides], axis=1).ravel().tolist()]
        for k in thinned(len(sets.times_s), _ROWS)
    ]
    return Table("both sets at some instants", headings, rows, folded=True)


def _paint(canvas: Canvas, *, sets: BothSides, column: int) -> None:
    axes: Axes = canvas.add_subplot()
    low, high = sets.outer_lower[:, column], sets.outer_upper[:, column]
    inner_low, inner_high = sets.inner_lower[:, column], sets.inner_upper[:, column]
    centre = 0.5 * (low + high)
    axes.fill_between(
        sets.times_s,
        inner_low - centre,
        np.maximum(inner_high, inner_low) - centre,
        facecolor=GREEN,
        alpha=0.45,
        linewidth=0.0,
    )
    for bound in (low, high):
        axes.plot(sets.times_s, bound - centre, color=BLUE, linewidth=1.4)
    axes.set_ylabel(f"{sets.names[column]} − centre ({sets.units[column]})")
    axes.set_xlabel("time (s)")
