"""The desk judges tubes against people with several tubes and a skewed clock, never too kindly."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from workbench.bench.overwidth import (
    SETTINGS,
    Setting,
    overwidth,
    overwidth_text,
    shipped_body,
)
from workbench.bench.overwidth_scenes import scene_overwidths, scene_text, walkers
from workbench.bench.separation_cost import separation_cost_text, separation_costs
from workbench.claims import Rigor, Verdict
from workbench.errors import InputError
from workbench.reach import PlaneGround, ReachTube, Separation, TubeStatus, check_separation
from workbench.reach.separation import Comparison
from workbench.runtime.layout import KernelCause
from workbench.runtime.observation import Person
from workbench.runtime.person_tubes import TrackedPerson, TubeKind, tracked

DOCUMENT = Path(__file__).parent.parent / "docs" / "separation.md"
INTENT, GUARD = frozenset([TubeKind.INTENT]), frozenset([TubeKind.GUARD])


def driving(steps: int = 10) -> ReachTube:
    """Along x at 2.8 m/s, known within 0.1 m and 0.02 rad."""
    times = np.linspace(0.0, 0.05 * steps, steps + 1)
    centre = np.stack([2.8 * times, 0.0 * times, 0.0 * times], axis=1)
    radius = np.array([0.1, 0.1, 0.02])
    lower, upper = centre - radius, centre + radius
    return ReachTube(
        times, np.minimum(lower[:-1], lower[1:]), np.maximum(upper[:-1], upper[1:]), lower, upper,
        ("x", "y", "heading"), TubeStatus.COMPLETE, Rigor.ENCLOSED,
    )  # fmt: skip


def judged(
    *people: Person | TrackedPerson, comparison: Comparison | None = None, required_m: float = 0.2
) -> Separation:
    rest = {} if comparison is None else {"comparison": comparison}
    return check_separation(
        driving(), ground=PlaneGround(), body=shipped_body(), people=people,
        clearance_required_m=required_m, **rest,
    )  # fmt: skip


ASIDE = Person("aside", 2.0, 4.0, 0.3, -0.5, 0.4, 0.2, 0.1)


def test_a_disc_is_a_tube_of_one_piece() -> None:
    plain, as_tube = judged(ASIDE), judged(tracked(ASIDE))
    assert plain.clearance_m == as_tube.clearance_m > 0.0
    assert (plain.person, plain.tube, plain.time_s) == ("aside", 0, as_tube.time_s)
    assert plain.verdict is Verdict.SAFE
    assert plain.by_kind[TubeKind.GUARD].cause is KernelCause.NOT_ASKED
    explicit = judged(ASIDE, comparison=Comparison(INTENT, (0.0, 0.0)))
    assert explicit.clearance_m == plain.clearance_m


def test_the_nearest_of_several_tubes_counts_and_kinds_are_told_apart() -> None:
    walker = walkers()
    both = TrackedPerson("both", (walker["alongside"], walker["alongside, guard"]))
    alone = [
        judged(TrackedPerson("one", (walker[name],))) for name in ("alongside", "alongside, guard")
    ]
    together = judged(both, comparison=Comparison(INTENT | GUARD, (0.0, 0.0)))
    assert together.clearance_m == min(each.clearance_m for each in alone)
    assert together.by_kind[TubeKind.INTENT].clearance_m == alone[0].clearance_m
    assert together.by_kind[TubeKind.GUARD].clearance_m == alone[1].clearance_m
    only = judged(both, comparison=Comparison(GUARD, (0.0, 0.0)))
    assert (only.clearance_m, only.tube) == (alone[1].clearance_m, 1)
    mixed = judged(ASIDE, both)
    assert mixed.by_kind[TubeKind.GUARD].person == 1
    assert mixed.clearance_m == min(together.clearance_m, judged(ASIDE).clearance_m)


def test_skew_only_takes_clearance_away_and_beyond_the_tube_nothing_is_safe() -> None:
    walker = TrackedPerson("w", (walkers()["alongside"],))
    clearances = [
        judged(walker, comparison=Comparison(INTENT, (-skew, skew))).clearance_m
        for skew in (0.0, 0.01, 0.05, 0.2)
    ]
    assert clearances == sorted(clearances, reverse=True)
    lost = judged(walker, comparison=Comparison(INTENT, (-0.3, 0.3)), required_m=0.0)
    assert (lost.verdict, lost.clearance_m) == (Verdict.UNPROVED, -math.inf)
    assert lost.by_kind[TubeKind.INTENT].cause is KernelCause.NOT_PREDICTED
    early = judged(ASIDE, comparison=Comparison(None, (-1e-9, 0.0)), required_m=0.0)
    assert early.verdict is Verdict.UNPROVED


def test_somebody_without_a_guard_is_not_clear_of_guards() -> None:
    lost = judged(ASIDE, comparison=Comparison(GUARD, (0.0, 0.0)), required_m=0.0)
    assert (lost.verdict, lost.clearance_m, lost.person) == (Verdict.UNPROVED, -math.inf, "aside")


def test_misuse_is_answered() -> None:
    with pytest.raises(InputError, match="at most 32 people, got 33"):
        judged(*[ASIDE] * 33)
    with pytest.raises(InputError, match="vx_mps"):
        judged(dataclasses.replace(ASIDE, vx_mps=math.nan))
    for kinds, skew in ((frozenset(), (0.0, 0.0)), (None, (0.1, 0.0)), (None, (0.0, math.nan))):
        with pytest.raises(InputError, match="skew_s in order"):
            Comparison(kinds, skew)


def test_sampled_trajectories_stay_clear_and_little_is_lost() -> None:
    rows = scene_overwidths(trajectories=200)
    assert len(rows) == 16
    for row in rows:
        assert row.proved_m <= row.sampled_m + 1e-9
        assert row.sampled_m - row.proved_m < (0.08 if row.loop == "B1-small" else 0.25)
    assert len(scene_text(rows).splitlines()) == 18


def test_without_a_spread_of_the_heading_the_sets_distance_is_exact() -> None:
    exact, wide = (overwidth(Setting(0.1, spread, 0.05, 0.02), people=60) for spread in (0.0, 0.1))
    assert (exact.beyond, wide.beyond) == (0, 0)
    # The occupancy's rectangle is padded by 1e-5 m on either side.
    assert exact.over_set_worst_m < 1e-4
    assert exact.over_set_mean_m < wide.over_set_mean_m < 0.15
    assert wide.over_set_mean_m <= wide.over_motion_mean_m


def test_the_document_shows_what_is_measured() -> None:
    rows = overwidth_text([overwidth(SETTINGS[0]), overwidth(SETTINGS[1])]).splitlines()
    shown = [" ".join(line.split()) for line in DOCUMENT.read_text().splitlines()]
    for row in (rows[0], *rows[2:]):
        assert " ".join(row.split()) in shown


def test_the_cost_grows_with_people_and_never_beyond_the_worst() -> None:
    costs = separation_costs()
    assert len(separation_cost_text(costs).splitlines()) == len(costs) + 2
    worst, street = costs[2], [cost for cost in costs if cost.case == "street"]
    assert [cost.people for cost in street] == [0, 1, 2, 4, 8, 16, 32]
    assert all(cost.median_us > 0.0 for cost in costs)
    if worst.instructions is None:
        return
    counts = [cost.instructions or 0 for cost in street]
    assert counts == sorted(counts)
    assert counts[-1] - counts[0] <= 32 * (counts[1] - counts[0])
    assert worst.instructions > max(counts)
