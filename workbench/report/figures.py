"""Plots over time: the reach tube, and the growth of bounds beside sampled trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from workbench.claims import Rigor
from workbench.report.curves import (
    Growth,
    Origin,
    SampledRuns,
    TubeCurves,
    Values,
    first_escape_s,
    mean_ratio,
    require_shape,
)
from workbench.report.drawing import (
    BLUE,
    DASHES,
    GREEN,
    INK,
    PURPLE,
    SKY,
    VERMILLION,
    Dashes,
    Figure,
    Key,
    svg_panel,
    thinned,
)
from workbench.report.page import MEANING
from workbench.report.tables import Cell, Table

_DRAWN_RUNS = 24
_TABLE_INSTANTS = 61
# A tube thinner than this share of the distance it travels is drawn about its own centre.
_THIN = 0.25
# Curves that end further apart than this factor are drawn on a logarithmic scale.
_WIDE_SPREAD = 15.0
_SOLID, _DASHED, _DASH_DOT, _DOTTED, _LONG, _DASH_DOTS, _CLOSE, _SPARSE = DASHES
_PROVED_COLOURS = (BLUE, GREEN, SKY, PURPLE)
_PROVED_DASHES = (_SOLID, _DASH_DOT, _LONG, _DASH_DOTS)
_SAMPLED_DASHES = (_DOTTED, _SPARSE)


def tube_figure(tube: TubeCurves, samples: SampledRuns | None = None) -> Figure:
    """One picture per state: the band over time, with sampled trajectories inside.

    A state whose tube is thin beside its travel is drawn as deviation from the tube's centre at
    the instants. Raises InputError when the samples have another number of states.
    """
    if samples is not None:
        runs, instants, _ = samples.states.shape
        require_shape("sampled runs", samples.states, (runs, instants, len(tube.names)))
    panels = tuple(
        svg_panel(
            partial(_paint_state, tube=tube, samples=samples, column=column),
            label=f"Reach tube of {name} over time",
        )
        for column, name in enumerate(tube.names)
    )
    sampled = tube.rigor is Rigor.SAMPLED
    legend = [
        Key(
            "between two instants" if sampled else "bound for every time of the step",
            SKY,
            filled=True,
        ),
        Key("at the instants" if sampled else "bound at the instants", BLUE),
    ]
    if samples is not None:
        legend.append(Key("sampled trajectories", INK))
    claim = (
        "Trajectories that start in the initial set may leave the shaded band"
        if sampled
        else "Every trajectory that starts in the initial set stays in the shaded band"
    )
    caption = (
        f"{claim}: rigor {tube.rigor.name} ({MEANING[tube.rigor]}). Where the band "
        "would be too thin to see, the picture shows the deviation from the tube's centre instead."
    )
    return Figure(panels, tuple(legend), caption, _tube_table(tube))


def _paint_state(
    canvas: Canvas, *, tube: TubeCurves, samples: SampledRuns | None, column: int
) -> None:
    axes: Axes = canvas.add_subplot()
    times = tube.times_s
    low, high = tube.lower_at[:, column], tube.upper_at[:, column]
    middle = 0.5 * (low + high)
    thin = float(np.max(high - low)) < _THIN * float(np.ptp(middle))
    centre = middle if thin else np.zeros_like(middle)
    edges = np.stack([times[:-1], times[1:]], axis=1).ravel()
    shift = np.stack([centre[:-1], centre[1:]], axis=1).ravel()
    if not thin:
        axes.fill_between(
            edges,
            np.repeat(tube.lower[:, column], 2) - shift,
            np.repeat(tube.upper[:, column], 2) - shift,
            facecolor=SKY,
            alpha=0.45,
            linewidth=0.0,
        )
    else:
        axes.fill_between(
            times, low - centre, high - centre, facecolor=SKY, alpha=0.45, linewidth=0
        )
    for bound in (low, high):
        axes.plot(times, bound - centre, color=BLUE, linewidth=1.4)
    if samples is not None:
        shown = samples.times_s <= times[-1]
        seen = samples.times_s[shown]
        for run in thinned(len(samples.states), _DRAWN_RUNS):
            values = samples.states[run][shown, column] - np.interp(seen, times, centre)
            axes.plot(seen, values, color=INK, linewidth=0.5, alpha=0.55)
    name, unit = tube.names[column], tube.units[column]
    axes.set_ylabel(f"{name} − centre ({unit})" if thin else f"{name} ({unit})")
    axes.set_xlabel("time (s)")


def _tube_table(tube: TubeCurves) -> Table:
    headings = ["time (s)"]
    for name, unit in zip(tube.names, tube.units, strict=True):
        headings += [f"{name} from ({unit})", f"to ({unit})"]
    rows = [
        [
            float(tube.times_s[k]),
            *(float(v) for v in np.stack([tube.lower_at[k], tube.upper_at[k]], axis=1).ravel()),
        ]
        for k in thinned(len(tube.times_s), _TABLE_INSTANTS)
    ]
    return Table("the tube at some instants", headings, rows, folded=True)


def growth_figure(
    growths: Sequence[Growth], *, names: Sequence[str], units: Sequence[str]
) -> Figure:
    """One picture per state: half widths over time of sampled, learned and proved bounds.

    growths: the curves, each (M, n) over its own times; names, units: of the n states. The scale
    is logarithmic, and says so, where the curves end far apart.
    """
    for growth in growths:
        require_shape(
            f"half widths of {growth.label!r}",
            growth.half_widths,
            (len(growth.times_s), len(names)),
        )
    styles = _styles(growths)
    panels = tuple(
        svg_panel(
            partial(
                _paint_growth, growths=growths, styles=styles, column=column, signal=(name, unit)
            ),
            label=f"Growth of the half width of {name} over time",
        )
        for column, (name, unit) in enumerate(zip(names, units, strict=True))
    )
    legend = tuple(
        Key(f"{growth.label} ({growth.rigor.name})", colour, DASHES[dashes])
        for growth, (colour, dashes) in zip(growths, styles, strict=True)
    )
    caption = (
        "Half width of the set of reachable states. A bound below the sampled curve is wrong; "
        "a bound far above it makes the car brake without need."
    )
    return Figure(panels, legend, caption, _growth_table(growths, names, units))


def _styles(growths: Sequence[Growth]) -> list[tuple[str, Dashes]]:
    styles: list[tuple[str, Dashes]] = []
    proved, sampled = 0, 0
    for growth in growths:
        if growth.origin is Origin.SAMPLES:
            styles.append((INK, _SAMPLED_DASHES[sampled % len(_SAMPLED_DASHES)]))
            sampled += 1
        elif growth.origin is Origin.REACHED:
            styles.append((INK, _CLOSE))
        elif growth.origin is Origin.LEARNED:
            styles.append((VERMILLION, _DASHED))
        else:
            turn, index = divmod(proved, len(_PROVED_COLOURS))
            dashes = _PROVED_DASHES[(index + turn) % len(_PROVED_DASHES)]
            styles.append((_PROVED_COLOURS[index], dashes))
            proved += 1
    return styles


def _paint_growth(
    canvas: Canvas,
    *,
    growths: Sequence[Growth],
    styles: Sequence[tuple[str, Dashes]],
    column: int,
    signal: tuple[str, str],
) -> None:
    axes: Axes = canvas.add_subplot()
    columns = [growth.half_widths[:, column] for growth in growths]
    curves = [np.where(values > 0.0, values, np.nan) for values in columns]
    logarithmic = _spread(curves) > _WIDE_SPREAD
    for growth, curve, (colour, dashes) in zip(growths, curves, styles, strict=True):
        values = curve if logarithmic else growth.half_widths[:, column]
        axes.plot(growth.times_s, values, color=colour, linestyle=dashes, linewidth=1.8)
    if logarithmic:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xlabel("time (s)")
    name, unit = signal
    axes.set_title(name)
    axes.set_ylabel(f"half width ({unit})" + (", log scale" if logarithmic else ""))


def _spread(curves: Sequence[Values]) -> float:
    """Largest ratio between the curves' largest values (1 where fewer than two are positive)."""
    tops = [float(np.nanmax(curve)) for curve in curves if np.isfinite(curve).any()]
    return max(tops) / min(tops) if tops else 1.0


def _growth_table(growths: Sequence[Growth], names: Sequence[str], units: Sequence[str]) -> Table:
    headings = ["time (s)", "bound"]
    headings += [f"{name} ({unit})" for name, unit in zip(names, units, strict=True)]
    longest = max(growths, key=lambda growth: float(growth.times_s[-1]))
    instants = longest.times_s[list(thinned(len(longest.times_s), 7))]
    rows: list[list[Cell]] = [
        [float(t), growth.label, *(float(value) for value in growth.at(np.array([t]))[0])]
        for t in instants
        for growth in growths
    ]
    return Table("half widths at some instants", headings, rows, folded=True)


def comparison_table(growths: Sequence[Growth], *, names: Sequence[str]) -> Table:
    """The bounds side by side: rigor, finding, first escape of a sample, mean ratio per state.

    Columns that would stay empty are left out.
    The ratio is bound / largest sampled deviation, averaged over time; 1 would be perfect.
    Without a curve of sampled trajectories among `growths` the ratios stay empty.
    """
    sampled = [growth for growth in growths if growth.origin is Origin.SAMPLES]
    headings = ["bound", "kind", "rigor", "finding", "a sample escapes at (s)"]
    headings += [f"{name} ratio (1)" for name in names] + ["detail"]
    rows: list[list[Cell]] = []
    for growth in growths:
        if growth.origin in (Origin.SAMPLES, Origin.REACHED):
            continue
        escape = first_escape_s(growth, sampled[0]) if sampled else None
        ratios = mean_ratio(growth, sampled[0]) if sampled else np.full(len(names), np.nan)
        rows.append(
            [growth.label, growth.origin.value, growth.rigor.name, growth.finding or "–"]
            + [escape if escape is not None else ("never" if sampled else None)]
            + [float(ratio) for ratio in ratios]
            + [growth.detail]
        )
    kept = [k for k in range(len(headings)) if any(row[k] not in ("", "–") for row in rows)]
    return Table(
        "bounds side by side; ratio: bound over the largest sampled deviation, mean over time, "
        "1 would be perfect",
        [headings[k] for k in kept],
        [[row[k] for k in kept] for row in rows],
    )
