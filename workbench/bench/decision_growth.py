"""How the cost of a decision grows: with the horizon, with the cells, with the people."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.bench.decision_cost import instructions, timed_calls
from workbench.bench.decision_kernel import (
    DecisionCaller,
    DecisionKernel,
    decision_kernel,
    shipped_sizes,
)
from workbench.bench.decision_scenes import (
    PEOPLE,
    Scene,
    Start,
    crowd,
    initial_start,
    scene,
    standing_person,
)
from workbench.runtime.layout import TUBES

# Distances at which somebody stands beside the road, until the largest partition is found.
_ASIDE_M: Final = tuple(2.0 - 0.005 * k for k in range(90))
_SEED: Final = 5


@final
@dataclass(frozen=True, slots=True)
class GrowthPoint:
    """value: of what grows; spent: attempted steps; us: median of the quicker of two calls;
    instructions: of one call, None without valgrind."""

    value: float
    spent: int
    us: float
    instructions: int | None


@final
@dataclass(frozen=True, slots=True)
class Growth:
    """What the cost does over one thing that grows, everything else the same."""

    over: str
    points: tuple[GrowthPoint, ...]

    @property
    def slope(self) -> float:
        """Exponent of the best power law through instructions, or time, where the value is not 0.

        1: in proportion; below: a part of the cost is the same for all.
        """
        points = [point for point in self.points if point.value > 0.0]
        costs = [point.instructions or point.us for point in points]
        return float(np.polyfit(np.log([p.value for p in points]), np.log(costs), 1)[0])

    @property
    def slope_at_end(self) -> float:
        """The exponent between the last two points: what the rest of the cost no longer hides."""
        before, last = self.points[-2:]
        costs = [point.instructions or point.us for point in (before, last)]
        return float(np.log(costs[1] / costs[0]) / np.log(last.value / before.value))


def horizon_growth(
    horizons_s: Sequence[float], *, calls: int, advance: Callable[[], None] = lambda: None
) -> Growth:
    """A third of the initial set at 0.5 m/s on a straight road, with 8 people.

    So slow that the car can stop within any horizon of 1 s or more: only TRACK grows. A kernel is
    built for every horizon.
    """
    people = crowd(PEOPLE, np.random.default_rng(_SEED), nearest_m=12.0)
    slow = Start((0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0), initial_start(1 / 3).radius)
    subject = scene("slow", slow, people)
    points = []
    for horizon_s in horizons_s:
        kernel = decision_kernel(shipped_sizes(horizon_s=horizon_s))
        points.append(_point(kernel, subject, horizon_s, calls))
        advance()
    return Growth("horizon (s)", tuple(points))


def people_growth(
    kernel: DecisionKernel, people: Sequence[int], *, calls: int,
    advance: Callable[[], None] = lambda: None,
) -> Growth:  # fmt: skip
    """The third of the initial set on a straight road, with people of 3 tubes each beside it."""
    everybody = crowd(max(people), np.random.default_rng(_SEED), nearest_m=12.0)
    points = []
    for count in people:
        subject = scene("people", initial_start(1 / 3), everybody[:count])
        points.append(_point(kernel, subject, count, calls))
        advance()
    return Growth("people", tuple(points))


def cell_growth(
    kernel: DecisionKernel, *, calls: int, advance: Callable[[], None] = lambda: None
) -> Growth:
    """The initial set at 1.5 m/s, and somebody who stands ever nearer to the road, so that TRACK
    needs ever more cells and the other two tubes none; over the tubes computed for TRACK.

    A set that is cut into c cells has taken 2 c - 1 tubes. Only scenes that are proved count: what
    is given up has no result to compare.
    """
    caller = DecisionCaller(kernel)
    slow = Start((0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0), initial_start(1.0).radius)
    found: dict[int, Scene] = {}
    for aside_m in _ASIDE_M:
        subject = scene(f"{aside_m:.3f} m aside", slow, [standing_person(aside_m)])
        answer = caller(kernel.numbers(subject.values))
        proved = all(caller.field(answer, f"{tube}_verdicts")[0] == 0.0 for tube in TUBES)
        track, *others = (int(caller.field(answer, f"{tube}_cells")[0]) for tube in TUBES)
        if proved and others == [1, 1]:
            found.setdefault(2 * track - 1, subject)
    points = []
    for tubes in sorted(found):
        points.append(_point(kernel, found[tubes], tubes, calls))
    advance()
    return Growth("tubes computed for TRACK", tuple(points))


def _point(kernel: DecisionKernel, subject: Scene, value: float, calls: int) -> GrowthPoint:
    found = timed_calls(kernel, [subject] * calls)
    return GrowthPoint(
        value, int(found.spent[0]), float(np.median(found.quickest_us)),
        instructions(kernel, [subject]),
    )  # fmt: skip
