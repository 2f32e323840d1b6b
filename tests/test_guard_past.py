"""What a person's own past says of the guard is what a plain loop over it finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.estimation.guard_motion import LONG_S, SHORT_S, motion_at
from workbench.estimation.people_data import PersonTrack


def _line(track: PersonTrack, newest: int, window_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and distances to the line through the window, by np.polyfit."""
    first = min(int(np.searchsorted(track.t_s, track.t_s[newest] - window_s - 1e-9)), newest - 1)
    if newest == 0:
        return np.zeros(2), np.zeros(1)
    span = slice(first, newest + 1)
    t = track.t_s[span] - track.t_s[newest]
    slope, start = np.polyfit(t, track.xy_m[span], 1)
    return slope, np.hypot(*(track.xy_m[span] - start - np.outer(t, slope)).T)


def _missed(track: PersonTrack, k: int, window_s: float, ahead_s: float) -> float:
    """Per second, how wrong the newest prediction was that was ahead_s old or older at k."""
    old = [j for j in range(1, k) if track.t_s[j] <= track.t_s[k] - ahead_s + 1e-9]
    if not old:
        return 0.0
    j = old[-1]
    apart = track.t_s[k] - track.t_s[j]
    told = track.xy_m[j] + _line(track, j, window_s)[0] * apart
    return float(np.hypot(*(track.xy_m[k] - told)) / apart)


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10**6), st.sampled_from([0.1, 0.4, 1.2]))
def test_the_past_is_that_of_plain_loops(seed: int, step_s: float) -> None:
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.5, 1.5, 30) * step_s)
    track = PersonTrack("r", "p", "ped", times, rng.normal(size=(30, 2)).cumsum(axis=0) + 700.0)
    motion = motion_at(track, times)
    speeds = [float(np.hypot(*_line(track, k, LONG_S)[0])) for k in range(30)]
    for k in range(30):
        short = [j for j in range(k + 1) if times[j] >= times[k] - 2.0 - 1e-9]
        long = [j for j in range(k + 1) if times[j] >= times[k] - 8.0 - 1e-9]
        missed = max(_missed(track, j, SHORT_S, 0.5) for j in short)
        missed_long = max(_missed(track, j, LONG_S, 1.0) for j in long)
        assert motion.missed_mps[k] == pytest.approx(missed, abs=1e-6)
        assert motion.missed_long_mps[k] == pytest.approx(missed_long, abs=1e-6)
        assert motion.fastest_mps[k] == pytest.approx(max(speeds[j] for j in long), abs=1e-6)
        apart = _line(track, k, LONG_S)[1]
        scatter = float(np.sqrt((apart * apart).mean()))
        assert motion.scatter_m[k] == pytest.approx(scatter, abs=1e-4)
        assert motion.seen_s[k] == pytest.approx(times[k] - times[0])


def test_who_walks_evenly_has_missed_nothing_and_who_jumped_has() -> None:
    times = np.arange(70) * 0.1
    even = np.column_stack([times * 1.3, times * 0.0])
    motion = motion_at(PersonTrack("r", "p", "ped", times, even), times)
    assert motion.missed_mps.max() < 1e-9
    assert motion.scatter_m.max() < 1e-6
    jumped = even.copy()
    jumped[30:, 1] += 0.7
    motion = motion_at(PersonTrack("r", "p", "ped", times, jumped), times)
    assert motion.missed_mps[29] < 1e-9
    assert motion.missed_mps[30] == pytest.approx(0.7 / 0.5)
    assert motion.missed_mps[-1] < 1e-6 < motion.missed_long_mps[-1]
