"""From a sweep's rows to a decision: worst case by point, bounds, the front, the recommendation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, final

from workbench.simulation.gain_sweep.figures import DRIVEN, FIGURES, Figure, figure
from workbench.simulation.gain_sweep.gains import GAINS
from workbench.simulation.gain_sweep.plan import Decision, Plan

_SAME: Final = 1e-3
_Driven = Mapping[int, Mapping[str, float]]
_NOBODY: Final[_Driven] = MappingProxyType({})
NOT_DRIVEN: Final = MappingProxyType(dict.fromkeys(DRIVEN, math.nan))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """Gains with each figure's worst value over all cases, NaN where a case has none.

    Figures of drives are of all its drives together, NaN where it did not drive. stable: in every
    case, exact; fails: bounds of the study that it does not keep, in words.
    """

    index: int
    gains: Mapping[str, float]
    stable: bool
    figures: Mapping[str, float]
    fails: tuple[str, ...]

    @property
    def keeps(self) -> bool:
        """Whether it may be recommended."""
        return self.stable and not self.fails


@final
@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """Of a sweep: all points, those of the front, the present gains, the best within the bounds.

    best: None where no point keeps the bounds; driven: indices of the points that drove.
    """

    decision: Decision
    points: tuple[Point, ...]
    front: tuple[Point, ...]
    present: Point
    best: Point | None
    driven: frozenset[int] = frozenset()

    @property
    def kept(self) -> int:
        """How many points keep all bounds."""
        return sum(point.keeps for point in self.points)

    @property
    def changes(self) -> bool:
        """Whether other gains than the present ones are recommended."""
        return self.best is not None and self.best is not self.present


def verdict(
    rows: Sequence[Mapping[str, Any]], decision: Decision, driven: _Driven = _NOBODY
) -> Verdict:
    """The decision on a sweep's rows; the vehicle's own gains are point 0.

    driven: figures of drives by point, {} where nobody drives; else the best is one that drove. It
    is the front's point with the best `choose`, then the rest of `trade` in its order.
    """
    by_point: dict[int, list[Mapping[str, Any]]] = {}
    for row in rows:
        by_point.setdefault(int(row["point"]), []).append(row)
    points = tuple(
        point_of(k, each, decision, driven.get(k, NOT_DRIVEN))
        for k, each in sorted(by_point.items())
    )
    kept = [point for point in points if point.keeps]
    front = _front(kept, decision.trade)
    may = [point for point in front if not driven or point.index in driven]
    best = min(may, key=lambda p: tuple(costs(p, decision.order)), default=None)
    return Verdict(decision, points, front, points[0], best, frozenset(driven))


def finalists(rows: Sequence[Mapping[str, Any]], plan: Plan) -> tuple[int, ...]:
    """Indices of what drives: the present gains and the best of the front, as far as one can tell
    without drives; () where the study has none."""
    if plan.drives is None:
        return ()
    decision = plan.decision.before_drives()
    found = verdict(rows, decision)
    ranked = sorted(found.front, key=lambda p: tuple(costs(p, decision.order)))
    chosen = [p.index for p in ranked if p is not found.present][: plan.drives.finalists]
    return (found.present.index, *chosen)


def point_of(
    index: int, rows: Sequence[Mapping[str, Any]], decision: Decision, driven: Mapping[str, float]
) -> Point:
    """A point from its rows, one per case, and the figures of its drives."""
    figures = {
        name: max((float(row[name]) for row in rows), key=each.cost)
        for name, each in FIGURES.items()
    }
    figures |= driven
    fails = [
        f"{figure(name).label} {figures[name]:.4g} < {bound:g}"
        for name, bound in decision.at_least.items()
        if not figures[name] >= bound
    ] + [
        f"{figure(name).label} {figures[name]:.4g} > {bound:g}"
        for name, bound in decision.at_most.items()
        if not figures[name] <= bound
    ]
    gains = {name: float(rows[0][name]) for name in GAINS}
    return Point(index, gains, all(bool(r["stable"]) for r in rows), figures, tuple(fails))


def costs(point: Point, names: Sequence[str]) -> list[float]:
    """Of these figures, less is better."""
    return [figure(name).cost(point.figures[name]) for name in names]


def _front(points: Sequence[Point], names: Sequence[str]) -> tuple[Point, ...]:
    """Those that none beats, by index; gains that a search drew more than once stand there once.

    In the order of their costs a point can be beaten by earlier ones alone, and if by any, then by
    one of the front.
    """
    ranked = sorted(points, key=lambda p: (costs(p, names), p.index))
    front: list[tuple[list[float], Point]] = []
    for point in ranked:
        mine = costs(point, names)
        if not any(_beats(c, mine) or q.gains == point.gains for c, q in front):
            front.append((mine, point))
    return tuple(sorted((point for _, point in front), key=lambda p: p.index))


def _beats(one: Sequence[float], other: Sequence[float]) -> bool:
    """At least as good everywhere and better somewhere."""
    return one != other and all(a <= b for a, b in zip(one, other, strict=True))


def shown_figures(found: Verdict) -> dict[str, Figure]:
    """What there is to be shown; without those of drives where nobody drove."""
    return {**FIGURES, **DRIVEN} if found.driven else dict(FIGURES)


def cost_rows(found: Verdict) -> list[tuple[Figure, float, float, str]]:
    """Every figure that the study has, the present and the recommended value, and in words how it
    changes: same up to a thousandth."""
    if found.best is None:
        return []
    rows = []
    for name, each in shown_figures(found).items():
        was, now = found.present.figures[name], found.best.figures[name]
        rows.append((each, was, now, _change(each.cost(was), each.cost(now))))
    return rows


def _change(was: float, now: float) -> str:
    if was == now or abs(now - was) <= _SAME * min(abs(was), abs(now)):
        return "same"
    return "better" if now < was else "worse"
