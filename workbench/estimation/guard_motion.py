"""What the past of a track says of a person's motion now, for many times at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from workbench.estimation.people_data import PersonTrack

SHORT_S = 0.5
LONG_S = 1.2
"""History that the two velocities are fitted to; two measurements where it holds fewer."""
AHEAD_SHORT_S, WITHIN_SHORT_S = 0.5, 2.0
AHEAD_LONG_S, WITHIN_LONG_S = 1.0, 8.0
"""How far ahead each velocity is tried on the person's own past, and how far back that counts."""

_SAME_TIME_S = 1e-9

Floats = NDArray[np.float64]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A person's motion at n times, each from what was measured by then.

    age_s: (n,) since the newest measurement; place_m: (n, 2) of that one; velocity_mps: (n, 2) by
    least squares over the last LONG_S; speed_mps: (n,) its size; unsteady_mps: (n,) its distance
    to the velocity over the last SHORT_S; lag_s: (n,) from the mean time of the long window to the
    newest measurement; noise_gain: (n,) 1/s, standard error of that velocity per metre of
    independent error in each measurement, 1 / sqrt(sum d_i^2) with d_i the times relative to their
    mean; known: (n,) whether two measurements existed, the velocities being 0 where not; seen_s:
    (n,) from the first measurement to the newest; scatter_m: (n,) root mean square distance of the
    measurements of the last LONG_S to their line; missed_mps: (n,) by how much, per second, the
    short velocity missed this very person AHEAD_SHORT_S later, the largest within the last
    WITHIN_SHORT_S; missed_long_mps: (n,) the same of the long one; fastest_mps: (n,) the largest
    long velocity within the last WITHIN_LONG_S.
    """

    age_s: Floats
    place_m: Floats
    velocity_mps: Floats
    speed_mps: Floats
    unsteady_mps: Floats
    lag_s: Floats
    noise_gain: Floats
    known: NDArray[np.bool_]
    seen_s: Floats
    scatter_m: Floats
    missed_mps: Floats
    missed_long_mps: Floats
    fastest_mps: Floats


def motion_at(measured: PersonTrack, times_s: Floats) -> Motion:
    """The motion at each of `times_s` from the measurements at or before it, and no later one.

    times_s: (n,), none before the first measurement.
    """
    newest = np.searchsorted(measured.t_s, times_s + _SAME_TIME_S, side="right") - 1
    every = np.arange(int(newest.max()) + 1 if len(newest) else 0)
    slow, fast = _line(measured, every, LONG_S), _line(measured, every, SHORT_S)
    speed = np.hypot(*slow.velocity_mps.T)
    missed = _missed(measured, fast.velocity_mps, AHEAD_SHORT_S)
    missed_long = _missed(measured, slow.velocity_mps, AHEAD_LONG_S)
    t = measured.t_s[: len(every)]
    return Motion(
        age_s=np.maximum(times_s - measured.t_s[newest], 0.0),
        place_m=measured.xy_m[newest],
        velocity_mps=slow.velocity_mps[newest],
        speed_mps=speed[newest],
        unsteady_mps=np.hypot(*(fast.velocity_mps - slow.velocity_mps).T)[newest],
        lag_s=slow.lag_s[newest],
        noise_gain=slow.noise_gain[newest],
        known=newest > 0,
        seen_s=measured.t_s[newest] - measured.t_s[0],
        scatter_m=slow.scatter_m[newest],
        missed_mps=_largest(t, missed, newest, WITHIN_SHORT_S),
        missed_long_mps=_largest(t, missed_long, newest, WITHIN_LONG_S),
        fastest_mps=_largest(t, speed, newest, WITHIN_LONG_S),
    )


def _missed(measured: PersonTrack, velocity_mps: Floats, ahead_s: float) -> Floats:
    """For each measurement, the error per second of the place predicted for it from ahead_s
    before; 0 where nothing was predicted, (n,) m/s."""
    n = len(velocity_mps)
    t, xy = measured.t_s[:n], measured.xy_m[:n]
    before = np.searchsorted(t, t - ahead_s + _SAME_TIME_S, side="right") - 1
    told = before >= 1
    before = np.maximum(before, 0)
    apart = np.where(told, t - t[before], 1.0)
    missed = xy - xy[before] - velocity_mps[before] * apart[:, None]
    return np.where(told, np.hypot(*missed.T) / apart, 0.0)


def _largest(t: Floats, values: Floats, at: NDArray[np.intp], within_s: float) -> Floats:
    """The largest of the values within the within_s up to each place of `at`, (n,)."""
    first = np.searchsorted(t, t[at] - within_s - _SAME_TIME_S)
    ends = np.column_stack([first, at + 1]).ravel()
    return np.asarray(np.maximum.reduceat(np.append(values, -np.inf), ends)[::2])


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Line:
    velocity_mps: Floats
    lag_s: Floats
    noise_gain: Floats
    scatter_m: Floats


def window_velocity(measured: PersonTrack, newest: NDArray[np.intp], window_s: float) -> Floats:
    """Least-squares velocity (n, 2) over the window_s before each newest measurement; over the two
    newest ones where the window holds one, and 0 for the first of all."""
    return _line(measured, newest, window_s).velocity_mps


def _line(measured: PersonTrack, newest: NDArray[np.intp], window_s: float) -> _Line:
    """The line through each window: velocity, lag, noise gain and scatter (`Motion`)."""
    t, xy = measured.t_s - measured.t_s[0], measured.xy_m - measured.xy_m[0]
    first = np.minimum(np.searchsorted(t, t[newest] - window_s - _SAME_TIME_S), newest - 1)
    first = np.maximum(first, 0)

    def summed(values: Floats) -> Floats:
        sums = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
        return np.asarray(sums[newest + 1] - sums[first])

    count = newest - first + 1
    mean, middle = summed(t) / count, summed(xy) / count[:, None]
    squares = summed(t * t) - count * mean * mean
    moments = summed(t[:, None] * xy) - mean[:, None] * summed(xy)
    # One measurement has no spread; its velocity stays 0.
    spread = np.where(count > 1, squares, np.inf)
    velocity = moments / spread[:, None]
    around = (summed(xy * xy) - count[:, None] * middle * middle - velocity * moments).sum(axis=1)
    scatter = np.sqrt(np.maximum(around, 0.0) / count)
    return _Line(velocity, t[newest] - mean, 1.0 / np.sqrt(spread), scatter)


@final
@dataclass(frozen=True, slots=True, eq=False)
class MotionRows:
    """Motions of many people with where they were `horizon_s` later.

    motion: n rows; moved_m: (n, 2) from the newest measurement to the later position; recording,
    person: (n,) numbers; velocities_mps: for each window asked for, (n, 2), see `motion_rows`.
    """

    motion: Motion
    moved_m: Floats
    recording: NDArray[np.intp]
    person: NDArray[np.intp]
    horizon_s: float
    velocities_mps: tuple[Floats, ...]

    @property
    def reach_s(self) -> Floats:
        """From the newest measurement to the later position, s."""
        return np.asarray(self.motion.age_s + self.horizon_s)

    def take(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> MotionRows:
        """The rows named by a mask or by numbers."""
        motion = Motion(*(getattr(self.motion, name)[which] for name in Motion.__slots__))
        velocities = tuple(velocity[which] for velocity in self.velocities_mps)
        return MotionRows(
            motion, self.moved_m[which], self.recording[which], self.person[which],
            self.horizon_s, velocities,
        )  # fmt: skip


def motion_rows(
    tracks: Sequence[PersonTrack],
    measured: Sequence[PersonTrack],
    horizon_s: float,
    *,
    windows_s: Sequence[float] = (),
) -> MotionRows:
    """One row per sample of `tracks` that has a measurement before it and a position horizon_s
    after it (interpolated between samples).

    tracks, measured: of the same people in the same order. The motion is that of `measured` at the
    sample's time. windows_s: for each, `velocities_mps` holds the velocity over that window.
    """
    parts = [
        part
        for number, (track, seen) in enumerate(zip(tracks, measured, strict=True))
        if (part := _rows_of(track, seen, horizon_s, windows_s, number)) is not None
    ]
    names = {name: i for i, name in enumerate(dict.fromkeys(t.recording for t in tracks))}
    person = np.concatenate([part[2] for part in parts]) if parts else np.zeros(0, np.intp)
    of_person = np.array([names[track.recording] for track in tracks], np.intp)
    return MotionRows(
        _joined([part[0] for part in parts]),
        np.concatenate([part[1] for part in parts]) if parts else np.zeros((0, 2)),
        of_person[person] if len(person) else person,
        person,
        horizon_s,
        tuple(np.concatenate(window) for window in zip(*(part[3] for part in parts), strict=True)),
    )


def _rows_of(
    track: PersonTrack,
    seen: PersonTrack,
    horizon_s: float,
    windows_s: Sequence[float],
    number: int,
) -> tuple[Motion, Floats, NDArray[np.intp], list[Floats]] | None:
    if not len(seen.t_s) or not len(track.t_s):
        return None
    first, last = seen.t_s[0] - _SAME_TIME_S, track.t_s[-1] - horizon_s + _SAME_TIME_S
    times = track.t_s[(track.t_s >= first) & (track.t_s <= last)]
    if not len(times):
        return None
    motion = motion_at(seen, times)
    later = np.column_stack(
        [np.interp(times + horizon_s, track.t_s, track.xy_m[:, axis]) for axis in (0, 1)]
    )
    newest = np.searchsorted(seen.t_s, times + _SAME_TIME_S, side="right") - 1
    velocities = [window_velocity(seen, newest, window) for window in windows_s]
    return motion, later - motion.place_m, np.full(len(times), number, np.intp), velocities


def _joined(parts: Sequence[Motion]) -> Motion:
    if not parts:
        none, pairs = np.zeros(0), np.zeros((0, 2))
        return Motion(
            none, pairs, pairs, none, none, none, none, np.zeros(0, np.bool_), none, none, none,
            none, none,
        )  # fmt: skip
    return Motion(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in Motion.__slots__)
    )
