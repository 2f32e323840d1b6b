"""A stamp's interval on our clock holds its instant for every clock and delay within the bounds."""

from __future__ import annotations

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.runtime.onboard.stamps import MOST_PAIRS, StampBounds, Stamped, Stamps

LEAST_US, MOST_US = 1_000, 20_000


def bounds(*, drift_ppm: int = 0, window_us: int = 5_000_000) -> StampBounds:
    return StampBounds(delay_us=(LEAST_US, MOST_US), drift_ppm=drift_ppm, window_us=window_us)


def shown_s(at_us: float, offset_us: int, drift_ppm: float) -> float:
    """What a sender's clock shows, in the frames' counts of 0.1 ms, rounded to nearest."""
    return round((at_us - offset_us - drift_ppm * 1e-6 * at_us) / 100.0) / 1e4


def taken(
    stamps: Stamps, at_us: int, delay_us: int, *, offset_us: int = -(10**9), drift_ppm: float = 0.0
) -> tuple[Stamps, Stamped]:
    """One frame, stamped at at_us of our clock."""
    return stamps.taking(shown_s(at_us, offset_us, drift_ppm), at_us + delay_us)


DELAYS = st.one_of(st.sampled_from([LEAST_US, MOST_US]), st.integers(LEAST_US, MOST_US))


@settings(max_examples=200, deadline=None)
@given(
    st.integers(-(10**9), -(10**7)),
    st.integers(-300, 300),
    st.lists(st.tuples(st.integers(MOST_US, 3_000_000), DELAYS), min_size=1, max_size=60),
)
def test_the_instant_is_in_the_interval(
    offset_us: int, drift_ppm: int, sets: list[tuple[int, int]]
) -> None:
    stamps, at_us = Stamps(bounds(drift_ppm=300)), 0
    for gap_us, delay_us in sets:
        at_us += gap_us
        stamps, found = taken(stamps, at_us, delay_us, offset_us=offset_us, drift_ppm=drift_ppm)
        low, high = found.within_us
        assert low <= at_us <= high <= at_us + delay_us
        assert not found.jumped
        assert found.late_us == 0
        assert len(stamps.pairs) <= MOST_PAIRS


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(st.integers(MOST_US, 300_000), DELAYS), min_size=1, max_size=20),
    st.integers(1, 10**6),
)
def test_the_instant_of_a_late_frame_is_in_the_interval_too(
    sets: list[tuple[int, int]], more_us: int
) -> None:
    """Once one frame was quick enough, the others may be as late as they like."""
    stamps, at_us = Stamps(bounds()), 0
    for index, (gap_us, delay_us) in enumerate(sets):
        at_us += gap_us
        late_us = more_us if index else 0
        stamps, found = taken(stamps, at_us, delay_us + late_us)
        assert found.within_us[0] <= at_us <= found.within_us[1]
        # All that is not proved late lies within what the delays may differ by.
        if late_us + delay_us > 2 * MOST_US + 200:
            assert found.late_us > 0


@given(DELAYS, st.integers(MOST_US + 200, 10**6))
def test_a_slow_line_stays_named(first_us: int, later_us: int) -> None:
    stamps, _ = taken(Stamps(bounds()), 0, first_us)
    assume(later_us - first_us > MOST_US - LEAST_US + 200)
    for at_us in range(10**6, 30 * 10**6, 10**6):
        stamps, found = taken(stamps, at_us, later_us)
        assert 0 < found.late_us <= later_us - MOST_US
        assert found.within_us[0] <= at_us <= found.within_us[1]


def test_a_clock_that_is_set_forward_jumps_once() -> None:
    stamps = Stamps(bounds())
    for at_us in range(0, 10**6, 10**5):
        stamps, found = taken(stamps, at_us, 5_000)
    stamps, found = taken(stamps, 10**6, 5_000, offset_us=-(10**9) - 10**6)
    assert found.jumped
    assert len(stamps.pairs) == 1
    assert found.within_us[0] <= 10**6 <= found.within_us[1]
    stamps, found = taken(stamps, 1_100_000, 5_000, offset_us=-(10**9) - 10**6)
    assert not found.jumped
    assert found.within_us[0] <= 1_100_000 <= found.within_us[1]


def test_a_clock_that_is_set_back_is_late() -> None:
    stamps, _ = taken(Stamps(bounds()), 0, 5_000)
    _, found = taken(stamps, 10**5, 5_000, offset_us=-(10**9) + 10**6)
    assert found.late_us > 900_000


def test_quick_frames_narrow_the_interval_to_the_delays() -> None:
    stamps = Stamps(bounds())
    for k in range(20):
        stamps, found = taken(stamps, k * 10**5, LEAST_US if k == 3 else MOST_US)
    low, high = found.within_us
    assert high - 1_900_000 <= 102
    assert high - low <= MOST_US - LEAST_US + 204


def test_old_frames_are_not_compared() -> None:
    stamps, _ = taken(Stamps(bounds(window_us=10**6)), 0, LEAST_US)
    stamps, _ = taken(stamps, 2 * 10**6, MOST_US)
    assert [at_us for at_us, _ in stamps.pairs] == [2 * 10**6 + MOST_US]


@pytest.mark.parametrize(
    ("delay_us", "drift_ppm", "window_us"),
    [((-1, 5), 0, 1), ((5, 4), 0, 1), ((0, 1), -1, 1), ((0, 1), 10_001, 1), ((0, 1), 0, 0)],
)
def test_bounds_that_make_no_sense_are_refused(
    delay_us: tuple[int, int], drift_ppm: int, window_us: int
) -> None:
    with pytest.raises(InputError):
        StampBounds(delay_us=delay_us, drift_ppm=drift_ppm, window_us=window_us)


def test_drift_is_rounded_up() -> None:
    assert bounds(drift_ppm=1).drifted_us(1) == 1
    # A slow clock's million microseconds are 300.09 longer than ours.
    assert bounds(drift_ppm=300).drifted_us(10**6) == 301
    assert bounds(drift_ppm=10_000).drifted_us(99_000_000) == 1_000_000
    assert bounds(drift_ppm=0).drifted_us(10**9) == 0
