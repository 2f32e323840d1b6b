"""A tube of a way holds every disc that was sent, whenever it may have been meant, and is hardly
larger; ways that cannot be so are not used."""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass

import pytest
from onboard_intakes import give, intake
from onboard_sensors import BOUNDS
from ways_cases import A_WAY, WALKER, frames_of, sent

from workbench.runtime.onboard.mcap_scene import discs_of
from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.onboard.stamps import StampBounds
from workbench.runtime.onboard.way_tubes import NoWay, intended
from workbench.runtime.onboard.ways import WaysSeen
from workbench.runtime.person_guard import Disc, Guard, MotionLimits
from workbench.runtime.person_tubes import (
    FOREVER_S,
    PersonTube,
    TrackedPerson,
    TubeKind,
    fault_in_person,
)
from workbench.runtime.protocols import PeopleSeen, SentPerson, Way

LIMITS = MotionLimits(2.5, 1.5)
ANYWHERE = Guard(0.0, Disc(0.0, 0.0, 1e4), Disc(0.0, 0.0, 1.0), LIMITS)
EXACT = dataclasses.replace(
    BOUNDS, stamps=StampBounds(delay_us=(0, 0), drift_ppm=0, window_us=1_000_000)
)
NOW_US = 50_000_000


def received(
    ways: Sequence[Way], period_s: float, stamp_us: tuple[int, int], person: SentPerson = WALKER
) -> WaysSeen:
    """What arrives of ways, with a stamp whose instant is known so well."""
    people = PeopleSeen(1, 0.2, 40.0, (person,))
    found = intake()
    give(found, frames_of(people), 0)
    give(found, list(sent(people, {WALKER.track: ways}, period_s=period_s).frames), 0)
    seen = found.ways.seen
    assert isinstance(seen, WaysSeen)
    return dataclasses.replace(seen, stamp_us=stamp_us)


def tube_of(
    way: Way, period_s: float, stamp_us: tuple[int, int], settings: SensorBounds = BOUNDS
) -> PersonTube:
    """In times after NOW_US."""
    seen = received([way], period_s, stamp_us)
    tubes = intended(seen, WALKER.track, ANYWHERE, now_us=NOW_US, settings=settings)
    assert not isinstance(tubes, NoWay), tubes
    assert len(tubes) == 1
    return tubes[0]


def disc_at(tube: PersonTube, at_s: float) -> tuple[float, float, float]:
    (disc,) = discs_of(tube, (at_s,))
    return disc


@dataclass(frozen=True)
class Meant:
    """A way as its sender means it: knot j at start_s + j period_s after NOW_US."""

    way: Way
    start_s: float
    period_s: float

    @property
    def end_s(self) -> float:
        return self.start_s + (len(self.way) - 1) * self.period_s

    def at(self, at_s: float) -> tuple[float, float, float]:
        """Centre and radius; after the last knot, all that is reached at top speed."""
        if at_s >= self.end_s:
            x, y, radius = self.way[-1]
            return x, y, radius + LIMITS.speed_mps * (at_s - self.end_s)
        part = (at_s - self.start_s) / self.period_s
        j = min(max(math.floor(part), 0), len(self.way) - 2)
        (ax, ay, ar), (bx, by, br) = self.way[j : j + 2]
        s = part - j
        return ax + s * (bx - ax), ay + s * (by - ay), max(ar, br)


def over(tube: PersonTube, meant: Meant, at_s: float) -> float:
    """By how much the disc that is meant lies within the tube's, in metres."""
    (x, y, radius), (cx, cy, most) = meant.at(at_s), disc_at(tube, at_s)
    return most - radius - math.hypot(x - cx, y - cy)


def drawn_way(dice: random.Random, knots: int, step_m: float) -> Way:
    x, y, found = WALKER.x_m, WALKER.y_m, []
    for _ in range(knots):
        found.append((x, y, dice.uniform(0.0, 3.0)))
        x += dice.uniform(-step_m, step_m)
        y += dice.uniform(-step_m, step_m)
    return tuple(found)


@pytest.mark.parametrize("seed", range(60))
def test_every_disc_that_was_sent_is_held_whenever_it_was_meant(seed: int) -> None:
    dice = random.Random(seed)
    period_s = dice.choice((0.05, 0.1, 0.5, 1.275))
    knots = dice.choice((2, 3, 7, 16))
    way = drawn_way(dice, knots, 4.0 * period_s)
    last_us = NOW_US - dice.choice((0, 1, 300_000, 1_150_000))
    first_us = last_us - dice.choice((0, 3_000, 19_000, 160_000))
    bounds = dataclasses.replace(
        BOUNDS, stamps=dataclasses.replace(BOUNDS.stamps, drift_ppm=dice.choice((200, 10_000)))
    )
    tube = tube_of(way, period_s, (first_us, last_us), bounds)
    assert tube.kind is TubeKind.INTENT
    assert tube.until_s == FOREVER_S
    drift = bounds.stamps.drift_ppm * 1e-6
    for _ in range(60):
        stamp_us = dice.choice((first_us, last_us, dice.uniform(first_us, last_us)))
        rate = 1.0 + dice.choice((-drift, drift, dice.uniform(-drift, drift)))
        meant = Meant(way, (stamp_us - NOW_US) / 1e6, period_s * rate)
        for _ in range(20):
            near = meant.start_s + dice.randrange(knots) * meant.period_s
            at_s = dice.choice((dice.uniform(0.0, meant.end_s + 3.0), near, near + 1e-3))
            if at_s >= 0.0:
                assert over(tube, meant, at_s) >= 0.0, at_s


def test_the_tube_is_wider_by_what_is_not_known_and_no_more() -> None:
    way = tuple((WALKER.x_m + 0.7 * j, WALKER.y_m, 0.5 + 0.2 * j) for j in range(5))
    meant = Meant(way, 0.0, 0.5)
    tube = tube_of(way, 0.5, (NOW_US, NOW_US), EXACT)
    # 1 cm in x and y of a knot, half a centimetre in those of the person and in both radii.
    rounding_m = math.hypot(0.01, 0.01) + math.hypot(0.005, 0.005) + 0.005
    for k in range(60):
        assert 0.0 <= over(tube, meant, 0.05 * k) <= rounding_m + 0.001
    # 0.1 s in which the stamp may lie, at 1.4 m/s, and its earliest instant first.
    wide = tube_of(way, 0.5, (NOW_US - 100_000, NOW_US), EXACT)
    early = Meant(way, -0.1, 0.5)
    for k in range(38):
        spare = over(wide, early, 0.05 * k)
        assert 0.14 <= spare <= 0.14 + rounding_m + 0.001
    assert disc_at(wide, 1.85)[2] - disc_at(wide, 0.0)[2] == pytest.approx(0.6)


def test_what_widens_a_disc_adds_up() -> None:
    """1 s of way at 3 m/s: its stamp within 0.1 s, its clock off by 1 %, both ways, and 1 us, all
    in whole us."""
    drifting = dataclasses.replace(
        BOUNDS, stamps=StampBounds(delay_us=(0, 0), drift_ppm=10_000, window_us=1_000_000)
    )
    way = tuple((WALKER.x_m + 1.8 * j, WALKER.y_m + 2.4 * j, 0.5) for j in range(2))
    rounded = math.hypot(0.01, 0.01) + math.hypot(0.005, 0.005) + 0.005
    for period_s in (0.5, 1.0):
        tube = tube_of(way, period_s, (NOW_US - 100_000, NOW_US), drifting)
        slack_s = math.ceil(1e6 * period_s * 0.01 / 0.99) / 1e6 + 1e-6
        expected = 0.5 + 3.0 / period_s * (0.1 + 2 * slack_s) + rounded + 2.0**-37
        # The table's own roundings are widened by an ulp of the largest value.
        assert disc_at(tube, 0.0)[2] == pytest.approx(expected, abs=4e-12)
        assert tube.bounds[0][0].from_s == pytest.approx(-0.1 - slack_s, abs=1e-12)


def test_radii_of_as_long_before_are_taken_as_the_stamp_is_uncertain() -> None:
    radii = (3.0, 0.5, 0.5, 0.5, 0.5)
    way = tuple((WALKER.x_m, WALKER.y_m, radius) for radius in radii)
    for unsure_us, large in ((0, 2), (49_000, 2), (51_000, 3), (99_000, 3), (101_000, 4)):
        tube = tube_of(way, 0.05, (NOW_US - unsure_us, NOW_US), EXACT)
        begins_s = -unsure_us / 1e6
        found = [disc_at(tube, begins_s + 0.05 * j + 0.02)[2] > 3.0 for j in range(5)]
        assert found == [j < large for j in range(5)]


def test_after_the_last_knot_a_disc_grows_at_top_speed() -> None:
    tube = tube_of(A_WAY, 0.5, (NOW_US, NOW_US), EXACT)
    x, y, radius = disc_at(tube, 1.0)
    assert (x, y) == pytest.approx(A_WAY[-1][:2], abs=0.01)
    for after_s in (1e-4, 1.0, 30.0):
        later = disc_at(tube, 1.0 + after_s)
        assert later == pytest.approx((x, y, radius + 2.5 * after_s), abs=1e-5)
    assert len(tube.bounds) == 1
    assert len(tube.bounds[0]) == len(A_WAY)


def test_the_most_that_is_sent_is_what_a_decision_takes() -> None:
    dice = random.Random(3)
    ways = [drawn_way(dice, 16, 0.5) for _ in range(3)]
    seen = received(ways, 0.5, (NOW_US, NOW_US))
    tubes = intended(seen, WALKER.track, ANYWHERE, now_us=NOW_US, settings=BOUNDS)
    assert not isinstance(tubes, NoWay)
    assert [len(tube.bounds[0]) for tube in tubes] == [16, 16, 16]
    assert fault_in_person(TrackedPerson("", tubes)) is None


def test_who_was_sent_no_way_has_none() -> None:
    seen = received([A_WAY], 0.5, (NOW_US, NOW_US))
    found = intended(seen, WALKER.track + 1, ANYWHERE, now_us=NOW_US, settings=BOUNDS)
    assert found is NoWay.NOT_SENT


def test_a_way_that_no_tube_can_hold_is_not_used() -> None:
    """5 m in 0.05 s are 100 m/s."""
    for step_m, holds in ((4.96, True), (5.04, False)):
        fast = tuple((WALKER.x_m + step_m * j, WALKER.y_m, 9.0) for j in range(2))
        seen = received([A_WAY, fast], 0.05, (NOW_US, NOW_US))
        found = intended(seen, WALKER.track, ANYWHERE, now_us=NOW_US, settings=BOUNDS)
        assert (found is NoWay.UNUSABLE) is not holds


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5, 4.0])
@pytest.mark.parametrize("age_s", [0.0, 0.4])
def test_who_cannot_be_in_a_disc_of_now_has_left_their_ways(angle: float, age_s: float) -> None:
    """By the bound of speed (V = 2.5 m/s), or by that of acceleration (q + A t / 2)."""
    stays = tuple((WALKER.x_m, WALKER.y_m, 0.5) for _ in range(3))
    seen = received([stays], 0.5, (NOW_US, NOW_US))
    (tube,) = _used(seen, ANYWHERE)
    x, y, radius = disc_at(tube, 0.0)
    for velocity, reach in ((1.0, 1.0 * age_s + 0.75 * age_s**2), (9.0, 2.5 * age_s)):
        # Where they were, so that straight on they are `away` from the way's disc now.
        moving = (2.0, -1.5) if velocity == 1.0 else (0.0, 0.0)
        for more_m, left in ((-1e-6, False), (1e-6, True)):
            away = radius + 0.3 + reach + more_m
            there = (x + away * math.cos(angle), y + away * math.sin(angle))
            at = Disc(there[0] - moving[0] * age_s, there[1] - moving[1] * age_s, 0.3)
            limits = LIMITS if velocity == 9.0 else MotionLimits(50.0, 1.5)
            spread = Disc(*moving, velocity)
            guard = Guard(-age_s, at, spread, limits)
            found = intended(seen, WALKER.track, guard, now_us=NOW_US, settings=BOUNDS)
            assert (found is NoWay.LEFT) is left


def test_one_way_that_was_left_takes_all_with_it() -> None:
    away = tuple((WALKER.x_m + 30.0, WALKER.y_m, 0.5) for _ in range(3))
    here = Guard(0.0, Disc(WALKER.x_m, WALKER.y_m, 0.1), Disc(0.0, 0.0, 0.1), LIMITS)
    assert len(_used(received([A_WAY], 0.5, (NOW_US, NOW_US)), here)) == 1
    for ways in ([A_WAY, away], [away, A_WAY]):
        seen = received(ways, 0.5, (NOW_US, NOW_US))
        found = intended(seen, WALKER.track, here, now_us=NOW_US, settings=BOUNDS)
        assert found is NoWay.LEFT


def test_who_touches_a_disc_has_not_left_it() -> None:
    home = dataclasses.replace(WALKER, x_m=0.0, y_m=0.0)
    seen = received([((0.0, 0.0, 0.5),) * 3], 0.5, (NOW_US, NOW_US), home)
    (tube,) = _used(seen, ANYWHERE)
    away = disc_at(tube, 0.0)[2] + 0.25
    for x, left in ((away, False), (math.nextafter(away, 9.0), True)):
        guard = Guard(0.0, Disc(x, 0.0, 0.25), Disc(0.0, 0.0, 0.1), LIMITS)
        found = intended(seen, WALKER.track, guard, now_us=NOW_US, settings=BOUNDS)
        assert (found is NoWay.LEFT) is left


def test_it_is_the_disc_of_now_that_counts() -> None:
    """Somebody who should have walked on, and who did so or did not."""
    walks = tuple((WALKER.x_m + 0.75 * j, WALKER.y_m - 0.6 * j, 0.1) for j in range(5))
    for old_us in (0, 100_000, 300_000, 900_000, 1_250_000):
        seen = received([walks], 0.5, (NOW_US - old_us, NOW_US - old_us))
        gone = old_us / 5e5
        there = Disc(WALKER.x_m + 0.75 * gone, WALKER.y_m - 0.6 * gone, 0.02)
        assert _used(seen, Guard(0.0, there, Disc(0.0, 0.0, 0.1), LIMITS))
        here = Guard(0.0, Disc(WALKER.x_m, WALKER.y_m, 0.1), Disc(0.0, 0.0, 0.1), LIMITS)
        found = intended(seen, WALKER.track, here, now_us=NOW_US, settings=BOUNDS)
        assert (found is NoWay.LEFT) is (old_us >= 300_000)


def test_a_disc_that_begins_just_now_counts() -> None:
    """The last disc is large; 1 us of slack brings its piece to the instant of now."""
    opens = tuple((WALKER.x_m, WALKER.y_m, radius) for radius in (0.1, 0.1, 5.0))
    far = Guard(0.0, Disc(WALKER.x_m + 3.0, WALKER.y_m, 0.1), Disc(0.0, 0.0, 0.1), LIMITS)
    for age_us, left in ((500_000 - 2, True), (500_000 - 1, False)):
        seen = received([opens], 0.5, (NOW_US - age_us, NOW_US - age_us))
        found = intended(seen, WALKER.track, far, now_us=NOW_US, settings=EXACT)
        assert (found is NoWay.LEFT) is left


def test_who_is_within_reach_of_the_last_disc_has_not_left() -> None:
    """0.5 s after it: 1.25 m of it at 2.5 m/s."""
    stays = tuple((WALKER.x_m, WALKER.y_m, 0.1) for _ in range(2))
    seen = received([stays], 0.5, (NOW_US - 1_000_000, NOW_US - 1_000_000))
    for away_m, left in ((1.2, False), (1.7, True)):
        there = Disc(WALKER.x_m + away_m, WALKER.y_m, 0.1)
        guard = Guard(0.0, there, Disc(0.0, 0.0, 0.1), LIMITS)
        found = intended(seen, WALKER.track, guard, now_us=NOW_US, settings=EXACT)
        assert (found is NoWay.LEFT) is left


def _used(seen: WaysSeen, guard: Guard) -> tuple[PersonTube, ...]:
    found = intended(seen, WALKER.track, guard, now_us=NOW_US, settings=BOUNDS)
    assert not isinstance(found, NoWay), found
    return found
