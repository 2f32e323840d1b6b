"""A heading is INVALID until driving shows it and grows at standstill; what contradicts is LOST."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from localisation_cases import WHEELBASE_M, changed, compiled_functions, fed, hall, localiser

from workbench.errors import InputError
from workbench.estimation.localisation import Car, Localiser, Status
from workbench.estimation.localisation_sets import LEVELS, UnionBound, initial_sets
from workbench.estimation.localisation_states import HYPOTHESES, WINDOW
from workbench.estimation.localisation_world import Drive, Faults, Leg, generated_drive

FAULTS = Faults(dropped=0.3, stray=0.1, stray_mean_m=1.0)
HEADING = 2


@functools.cache
def drive() -> Drive:
    """Stands until 12 s, drives until 20 s, stands until 30 s."""
    legs = (Leg(12.0, 0.0, 0.0), Leg(20.0, 2.0, 0.1), Leg(30.0, 0.0, 0.1))
    return generated_drive(hall(), legs, FAULTS, cars=1, wheelbase_m=WHEELBASE_M, seed=21)


def test_a_car_that_never_drove_has_no_heading_and_no_set() -> None:
    known = fed(drive(), 0, 12.0)
    assert known.placed.all()
    assert localiser().status(known) is Status.HEADING_INVALID
    assert initial_sets(
        localiser(), known, now_s=12.0, levels=LEVELS, shape=UnionBound()
    ) is Status.HEADING_INVALID  # fmt: skip
    assert known.hypotheses is not None
    place = known.hypotheses.mean[:, :2]
    # All headings at one antenna: none of them has been ruled out.
    assert len(place) == HYPOTHESES
    assert np.ptp(known.logs) < 3.0


def test_driving_makes_the_heading_valid_and_right() -> None:
    known = fed(drive(), 0, 16.0)
    assert localiser().status(known) is Status.VALID
    error = known.belief.mean[0, HEADING] - drive().truth[16 * 30, 0, HEADING]
    deviation = known.belief.covariance[0, HEADING, HEADING] ** 0.5
    assert abs(np.angle(np.exp(1j * error))) < 4 * deviation < 0.2


def test_a_standing_car_s_heading_never_becomes_surer_whatever_is_measured() -> None:
    known, variances, standing = fed(drive(), 0, 22.0), [], []
    for k in range(22 * 30 + 1, 30 * 30):
        known = fed(drive(), 0, drive().times_s[k], known)
        variances.append(known.belief.covariance[0, HEADING, HEADING])
        standing.append(known.standing[0])
    grown = np.diff(variances)[np.array(standing[:-1])]
    assert len(grown) > 200
    assert (grown >= -1e-15).all()
    wander2 = hall().motion.standing_heading ** 2 * len(grown) / 30
    assert grown.sum() == pytest.approx(wander2, rel=1e-3)


def test_a_heading_that_has_grown_too_wide_at_standstill_is_invalid_again() -> None:
    known = fed(drive(), 0, 25.0)
    variance = known.belief.covariance[0, HEADING, HEADING]
    limit = math.sqrt(variance + 1e-4)
    site = changed(hall(), "limits", heading_rad=limit, range_age_s=1e9)
    mine = Localiser.of(site, compiled_functions())
    assert known.standing.all()
    until_s = 25.0 + 1e-4 / hall().motion.standing_heading ** 2
    near, far = (mine.moved_on(known, at_s=until_s + more) for more in (-1.0, 1.0))
    assert mine.status(near) is Status.VALID
    assert mine.status(far) is Status.HEADING_INVALID


def test_coordinates_of_a_standing_car_stay_above_their_floor() -> None:
    known = fed(drive(), 0, 30.0)
    floor2 = hall().limits.still_m ** 2
    assert (known.belief.covariance[0, [0, 1], [0, 1]] > 0.5 * floor2).all()


@pytest.mark.parametrize(
    ("until_s", "before"), [(16.0, Status.VALID), (11.0, Status.HEADING_INVALID)]
)
def test_ranges_that_are_refused_in_a_row_are_a_lost_car(until_s: float, before: Status) -> None:
    """Also one that was placed wrongly and has no heading yet."""
    mine, known = localiser(), fed(drive(), 0, until_s)
    known.cars[0].refused = 0
    for count in range(int(hall().limits.lost_after)):
        assert mine.status(known) is before, count
        known = mine.ranged(
            known, at_s=known.stamp_s, beacon=count % 6, range_m=np.array([55.0]),
            received=np.array([True]),
        )  # fmt: skip
    assert mine.status(known) is Status.LOST


def test_without_ranges_there_is_soon_no_set() -> None:
    mine, known = localiser(), fed(drive(), 0, 16.0)
    assert isinstance(
        initial_sets(mine, known, now_s=17.0, levels=LEVELS, shape=UnionBound()), tuple
    )
    age = hall().limits.range_age_s
    assert mine.status(known, now_s=16.0 + age + 0.5) is Status.LOST


def test_a_car_that_moves_is_not_placed() -> None:
    legs = (Leg(6.0, 2.0, 0.0),)
    moving = generated_drive(hall(), legs, FAULTS, cars=1, wheelbase_m=WHEELBASE_M, seed=22)
    assert localiser().status(fed(moving, 0, 6.0)) is Status.UNPLACED


def test_ranges_from_before_a_car_moved_do_not_place_it() -> None:
    """Whoever drives on while it is being placed needs all of the ranges anew."""
    mine, beacons = Car(hall(), localiser().steps, at_s=0.0), hall().beacons
    at = (12.0, 9.0, hall().antenna.height_m)
    counts = []
    for k in range(150):
        speed = 1.0 if 30 <= k < 33 else 0.0
        mine.reported(at_s=0.125 * k, speed_mps=speed, steering_rad=0.0, commands=None)
        place = beacons[k % 6]
        mine.ranged(at_s=0.125 * k, beacon=k % 6,
                    range_m=math.dist(at, (place.x_m, place.y_m, place.height_m)))  # fmt: skip
        counts.append(mine.placed)
    # It counts as standing 0.4 s after its last motion, at the fourth report.
    assert counts.index(True) == 33 + 4 + WINDOW - 1


def test_ranges_to_one_beacon_do_not_place_a_car() -> None:
    """However many: they leave a circle. Those of three others then do."""
    mine = Car(hall(), localiser().steps, at_s=0.0)
    at = (12.0, 9.0, hall().antenna.height_m)
    for k in range(100):
        mine.reported(at_s=0.125 * k, speed_mps=0.0, steering_rad=0.0, commands=None)
        beacon = 0 if k < 70 else k % 4
        place = hall().beacons[beacon]
        range_m = math.dist(at, (place.x_m, place.y_m, place.height_m))
        mine.ranged(at_s=0.125 * k, beacon=beacon, range_m=range_m)
        if k < 70:
            assert mine.status(now_s=mine.stamp_s) is Status.UNPLACED
    assert mine.placed


def test_messages_out_of_order_are_refused() -> None:
    known = fed(drive(), 0, 2.0)
    with pytest.raises(InputError, match="sort them by their instants"):
        localiser().moved_on(known, at_s=1.0)
