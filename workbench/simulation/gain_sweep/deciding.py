"""From a sweep's rows to a decision: worst case by point, bounds, the front, the recommendation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, final

from workbench.simulation.gain_sweep.figures import FIGURES, Figure, figure
from workbench.simulation.gain_sweep.plan import GAINS, Decision

_SAME: Final = 1e-3


@final
@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """Gains with each figure's worst value over all cases, NaN where a case has none.

    stable: in every case, exact; fails: bounds of the study that it does not keep, in words.
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

    best: None where no point keeps the bounds.
    """

    decision: Decision
    points: tuple[Point, ...]
    front: tuple[Point, ...]
    present: Point
    best: Point | None

    @property
    def kept(self) -> int:
        """How many points keep all bounds."""
        return sum(point.keeps for point in self.points)

    @property
    def changes(self) -> bool:
        """Whether other gains than the present ones are recommended."""
        return self.best is not None and self.best is not self.present


def verdict(rows: Sequence[Mapping[str, Any]], decision: Decision) -> Verdict:
    """The decision on a sweep's rows; the vehicle's own gains are point 0.

    The best is the front's point with the best `choose`, then the rest of `trade` in its order.
    """
    by_point: dict[int, list[Mapping[str, Any]]] = {}
    for row in rows:
        by_point.setdefault(int(row["point"]), []).append(row)
    points = tuple(_point(k, each, decision) for k, each in sorted(by_point.items()))
    kept = [point for point in points if point.keeps]
    front = tuple(p for p in kept if not any(_beats(q, p, decision.trade) for q in kept))
    order = (decision.choose, *(name for name in decision.trade if name != decision.choose))
    best = min(front, key=lambda p: tuple(_costs(p, order)), default=None)
    return Verdict(decision, points, front, points[0], best)


def _point(index: int, rows: Sequence[Mapping[str, Any]], decision: Decision) -> Point:
    figures = {
        name: max((float(row[name]) for row in rows), key=each.cost)
        for name, each in FIGURES.items()
    }
    fails = [
        f"{FIGURES[name].label} {figures[name]:.4g} < {bound:g}"
        for name, bound in decision.at_least.items()
        if not figures[name] >= bound
    ] + [
        f"{FIGURES[name].label} {figures[name]:.4g} > {bound:g}"
        for name, bound in decision.at_most.items()
        if not figures[name] <= bound
    ]
    gains = {name: float(rows[0][name]) for name in GAINS}
    return Point(index, gains, all(bool(r["stable"]) for r in rows), figures, tuple(fails))


def _costs(point: Point, names: Sequence[str]) -> list[float]:
    return [figure(name).cost(point.figures[name]) for name in names]


def _beats(one: Point, other: Point, names: Sequence[str]) -> bool:
    """At least as good everywhere and better somewhere."""
    pairs = list(zip(_costs(one, names), _costs(other, names), strict=True))
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


def cost_rows(found: Verdict) -> list[tuple[Figure, float, float, str]]:
    """Every figure, the present and the recommended value, and in words how it changes: same up to
    a thousandth."""
    if found.best is None:
        return []
    rows = []
    for name, each in FIGURES.items():
        was, now = found.present.figures[name], found.best.figures[name]
        rows.append((each, was, now, _change(each.cost(was), each.cost(now))))
    return rows


def _change(was: float, now: float) -> str:
    if was == now or abs(now - was) <= _SAME * min(abs(was), abs(now)):
        return "same"
    return "better" if now < was else "worse"
