"""Which of the compared methods to use, and why, from their figures alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.claims import Rigor
from workbench.cli.comparison import Compared, Family, Setting

# A method within this share of the tightest one is as good if it costs at most that share of it.
_AS_GOOD, _CHEAPER = 0.10, 0.5


@final
@dataclass(frozen=True, slots=True)
class Recommendation:
    """A method and the reason for it; method is None where none qualifies."""

    method: str | None
    reason: str

    def told(self, what: str) -> str:
        """In one sentence that begins with `what`."""
        return f"{what}: {self.method or 'none'}, {self.reason}"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """All that was found; `condition` says whether the tube shows what the formulas need."""

    setting: Setting
    found: list[Compared]
    condition: str
    holds: bool
    best: Recommendation
    best_formula: Recommendation


def recommended(found: Sequence[Compared], *, condition_holds: bool) -> Recommendation:
    """The tightest ENCLOSED method that reaches the horizon, or one as good at half the cost.

    A bound over the region qualifies only where its condition is shown.
    """
    proved = [
        each
        for each in found
        if each.rigor is Rigor.ENCLOSED
        and math.isfinite(each.score)
        and (condition_holds or each.family is not Family.REGION)
    ]
    if not proved:
        return Recommendation(
            None, "no ENCLOSED method reaches the horizon; shorten it or shrink the initial set"
        )
    tightest = min(proved, key=lambda each: each.score)
    near = [
        each
        for each in proved
        if each.score <= (1.0 + _AS_GOOD) * tightest.score
        and each.cost_s <= _CHEAPER * tightest.cost_s
    ]
    best = min(near, key=lambda each: each.cost_s, default=tightest)
    if best is tightest:
        reason = f"the tightest ENCLOSED method to the horizon ({_figures(best)})"
    else:
        reason = (
            f"ENCLOSED to the horizon and within {_AS_GOOD:.0%} of the tightest, {tightest.name} "
            f"({_figures(tightest)}), at no more than half the cost ({_figures(best)})"
        )
    return Recommendation(best.name, reason + _beyond(proved, best))


def recommended_over_region(found: Sequence[Compared], *, condition_holds: bool) -> Recommendation:
    """The tightest bound that needs no run of its own: a fixed formula over the region."""
    fixed = [
        each for each in found if each.family is Family.REGION and each.rigor is Rigor.ENCLOSED
    ]
    if not fixed:
        return Recommendation(None, "no bound over the region is ENCLOSED")
    if not condition_holds:
        return Recommendation(
            None, "the tube does not show that trajectories stay in the region to the end"
        )
    best = min(fixed, key=lambda each: each.score)
    return Recommendation(best.name, f"the tightest formula over the region ({_figures(best)})")


def _beyond(proved: Sequence[Compared], best: Compared) -> str:
    others = [each for each in proved if each.family is not best.family]
    if not others:
        return ""
    next_best = min(others, key=lambda each: each.score)
    return f"; the best {next_best.family.value} is {next_best.name} ({_figures(next_best)})"


def _figures(each: Compared) -> str:
    return f"mean ratio {each.score:.4g}, {each.cost_s:.2g} s"
