"""Results in a notebook: `view(result)` plots itself, gives tidy rows, and shows itself."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Mapping, Sequence
from functools import singledispatch

import numpy as np

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.signals import Signal
from workbench.models.system import System
from workbench.reach import InnerHull, ReachTube
from workbench.report.curves import Growth, Origin, TubeCurves, Values
from workbench.report.figures import growth_figure, tube_figure
from workbench.report.gain_front import front_figure
from workbench.report.inner import BothSides, both_sides_figure
from workbench.report.survey import Bar, SurveyReport, needless_figure, share_figure
from workbench.report.tables import Cell
from workbench.report.timeline import verdict_timeline
from workbench.report.view import Row, View
from workbench.sensitivity import Discrepancy, Examination
from workbench.sets import Box
from workbench.simulation.campaign.tallies import Tally
from workbench.simulation.frames import Frame
from workbench.simulation.gain_sweep.deciding import Verdict

_INSTANTS = 61


@singledispatch
def view(result: object, system: System | None = None) -> View:
    """What a result shows in a notebook.

    result: a ReachTube, an Examination (both with the system that they are of, which names the
    units), the Verdict of a gain sweep, the Frames of a drive or a replay, the Tallies of a survey.
    Raises InputError for anything else; a gain study's parts have `plot()` and `rows()` themselves.
    """
    del system
    own = " It has plot() of its own." if callable(getattr(result, "plot", None)) else ""
    raise InputError(
        "view: expected a ReachTube, an Examination, a gain sweep's Verdict, Frames or Tallies, "
        f"got {type(result).__name__}.{own}"
    )


@view.register
def _(result: ReachTube, system: System | None = None) -> View:
    states = _states(result.names, system)
    if not len(result.lower):
        raise InputError(f"view: expected a tube with a step, got none to draw: {result.message}")
    curves = TubeCurves(
        result.names, tuple(s.unit for s in states), result.times, result.lower, result.upper,
        result.lower_at, result.upper_at, result.rigor,
    )  # fmt: skip
    ends = [*result.times[1:].tolist(), None]
    rows: list[Row] = [
        {
            "time_s": float(time), "until_s": end, "state": s.name, "unit": s.unit,
            "lower_at": float(result.lower_at[k, i]), "upper_at": float(result.upper_at[k, i]),
            "lower": None if end is None else float(result.lower[k, i]),
            "upper": None if end is None else float(result.upper[k, i]),
        }
        for k, (time, end) in enumerate(zip(result.times, ends, strict=True))
        for i, s in enumerate(states)
    ]  # fmt: skip
    return View(f"Reach tube ({result.rigor.name})", (tube_figure(curves),), tuple(rows))


@view.register
def _(result: Examination, system: System | None = None) -> View:
    states = _states(result.names, system)
    kinds = (
        ("sampled and searched", Origin.SAMPLES, result.driven),
        ("sampled", Origin.SAMPLES, result.sampled),
        ("learned", Origin.LEARNED, result.learned),
    )
    curves = [Growth(name, kind, Rigor.SAMPLED, result.times, v) for name, kind, v in kinds]
    curves += [
        Growth(
            each.name, Origin.PROVED, each.rigor, result.times,
            np.where(np.isfinite(each.half_widths), each.half_widths, np.nan),
        )
        for each in result.proved
    ]  # fmt: skip
    return _growths(f"Examination: {result.verdict.value}", curves, states)


@view.register
def _(result: Verdict, system: System | None = None) -> View:
    del system
    rows: list[Row] = [
        {
            "point": point.index, "recommended": point is result.best,
            "present": point is result.present, "on_front": point in result.front,
            "keeps": point.keeps, **point.gains, **point.figures,
        }
        for point in result.points
    ]  # fmt: skip
    return View("Gain sweep", (front_figure(result),), tuple(rows))


@view.register(tuple)
@view.register(list)
def _(result: Sequence[object], system: System | None = None) -> View:
    del system
    kinds = {type(each) for each in result}
    if kinds == {Frame}:
        return _decisions([each for each in result if isinstance(each, Frame)])
    if kinds == {Tally}:
        return _survey([each for each in result if isinstance(each, Tally)])
    raise InputError(
        "view: expected at least one Frame, or one Tally, and nothing else in the sequence, got "
        f"{', '.join(sorted(kind.__name__ for kind in kinds)) or 'nothing'}"
    )


def beside(
    bounds: Mapping[str, Discrepancy | ReachTube], system: System, *, initial_set: Box
) -> View:
    """Half widths of several bounds and tubes over time, side by side, by the names given here.

    A Discrepancy starts from the radii of `initial_set`. Raises InputError for none, and where one
    is of other states than the system's.
    """
    if not bounds:
        raise InputError("beside: expected at least one bound or tube, got none")
    states = system.ode.states
    start = initial_set.reordered(system.ode.names).radius
    curves = []
    for name, bound in bounds.items():
        _states(bound.names, system)
        if isinstance(bound, ReachTube):
            times, widths = bound.times, bound.half_width_at()
        else:
            times = np.linspace(0.0, bound.horizon_s, _INSTANTS)
            widths = np.array([bound.radius(start, t) for t in times.tolist()])
        origin = Origin.LEARNED if bound.rigor is Rigor.SAMPLED else Origin.PROVED
        curves.append(Growth(name, origin, bound.rigor, times, widths))
    return _growths("Bounds side by side", curves, states)


def both_sides(tube: ReachTube, inner: InnerHull, system: System) -> View:
    """A tube and what is certainly reached within it, at the instants that both have.

    Raises InputError where they have other states or other instants.
    """
    states = _states(tube.names, system)
    _states(inner.names, system)
    count = min(len(tube.times), len(inner.times))
    if not np.allclose(tube.times[:count], inner.times[:count], rtol=0.0, atol=1e-9):
        raise InputError(
            "both_sides: expected a tube and an inner hull at the same instants, got others; give "
            "both the same step"
        )
    sides = {
        "outer_lower": tube.lower_at[:count], "outer_upper": tube.upper_at[:count],
        "inner_lower": inner.lower_at[:count], "inner_upper": inner.upper_at[:count],
    }  # fmt: skip
    rigor = min(tube.rigor, inner.rigor)
    units = tuple(s.unit for s in states)
    figure = both_sides_figure(
        BothSides(tube.names, units, tube.times[:count], **sides, rigor=rigor)
    )
    rows: list[Row] = [
        {
            "time_s": float(tube.times[k]), "state": s.name, "unit": s.unit,
            **{name: float(side[k, i]) for name, side in sides.items()},
        }
        for k, (i, s) in itertools.product(range(count), enumerate(states))
    ]  # fmt: skip
    return View(f"From both sides ({rigor.name})", (figure,), tuple(rows))


def _states(names: Sequence[str], system: System | None) -> tuple[Signal, ...]:
    """The system's states, if they are these."""
    if system is None:
        raise InputError(
            "view: expected the system that this is a result of, which names the units, got none; "
            "view(result, system)"
        )
    if tuple(names) != system.ode.names:
        raise InputError(
            f"view: expected the system with the states {', '.join(names)}, got one with "
            f"{', '.join(system.ode.names)}"
        )
    return system.ode.states


def _growths(title: str, curves: Sequence[Growth], states: Sequence[Signal]) -> View:
    names, units = [s.name for s in states], [s.unit for s in states]
    rows: list[Row] = [
        {
            "time_s": float(curve.times_s[k]), "bound": curve.label, "rigor": curve.rigor.name,
            "state": s.name, "unit": s.unit, "half_width": _number(curve.half_widths, k, i),
        }
        for curve in curves
        for k, (i, s) in itertools.product(range(len(curve.times_s)), enumerate(states))
    ]  # fmt: skip
    return View(title, (growth_figure(curves, names=names, units=units),), tuple(rows))


def _number(values: Values, k: int, i: int) -> float | None:
    """None where nothing is proved."""
    return float(values[k, i]) if np.isfinite(values[k, i]) else None


def _decisions(frames: Sequence[Frame]) -> View:
    kept = (
        "t_s", "x_m", "y_m", "heading", "speed_mps", "action", "sent", "reason", "clearance_m",
        "alert",
    )  # fmt: skip
    rows: list[Row] = [
        {
            **{name: getattr(frame, name) for name in kept}, "verdict": frame.verdict.value,
            "people": len(frame.people), "violations": "; ".join(frame.violations),
            **{answer.policy: answer.verdict.value for answer in frame.policies},
        }
        for frame in frames
    ]  # fmt: skip
    return View("Decisions", (verdict_timeline(frames),), tuple(rows))


def _survey(tallies: Iterable[Tally]) -> View:
    found = list(tallies)
    report = SurveyReport("Survey", (), tuple(Bar.of(each) for each in found), (), ())
    rows: list[Row] = [dict(_flat(dataclasses.asdict(each))) for each in found]
    return View("Survey", (needless_figure(report), share_figure(report)), tuple(rows))


def _flat(values: Mapping[str, object], before: str = "") -> Iterable[tuple[str, Cell]]:
    """What is nested gets the outer name before its own."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{name}_")
        elif value is None or isinstance(value, str | int | float):
            yield before + name, value
