"""Recorded people: one track each, and what had been measured of it by a given time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.estimation.tables import Row, Table

SAMPLE_COLUMNS = ("recording", "agent", "kind", "t", "x", "y")
MEASURED_COLUMNS = ("recording", "agent", "t", "x", "y")

_SAME_TIME_S = 1e-9


@final
@dataclass(frozen=True, slots=True, eq=False)
class PersonTrack:
    """Positions of one person over time.

    recording, agent: the key of the person; kind: ped, cyclist, skater, sitting or another word;
    t_s: (n,) s, strictly increasing; xy_m: (n, 2) m. n = 0 is a person of whom nothing is known
    yet. The arrays are read-only. Raises InputError when shapes, times or numbers cannot be used.
    """

    recording: str
    agent: str
    kind: str
    t_s: NDArray[np.float64]
    xy_m: NDArray[np.float64]

    def __post_init__(self) -> None:
        t_s = np.array(self.t_s, dtype=np.float64)
        xy_m = np.array(self.xy_m, dtype=np.float64)
        who = f"track of {self.agent!r} in {self.recording!r}"
        if t_s.ndim != 1 or xy_m.shape != (len(t_s), 2):
            raise InputError(
                f"{who}: expected times (n,) and positions (n, 2), got {t_s.shape} and {xy_m.shape}"
            )
        if not (np.isfinite(t_s).all() and np.isfinite(xy_m).all()):
            raise InputError(f"{who}: expected finite numbers; drop the samples that are not")
        if not (np.diff(t_s) > 0.0).all():
            at = int(np.argmin(np.diff(t_s) > 0.0)) + 1
            raise InputError(
                f"{who}: expected a time after {t_s[at - 1]}, got {t_s[at]}; "
                "sort the samples by time and drop repeated ones"
            )
        t_s.flags.writeable = xy_m.flags.writeable = False
        object.__setattr__(self, "t_s", t_s)
        object.__setattr__(self, "xy_m", xy_m)

    @property
    def key(self) -> tuple[str, str]:
        """Recording and agent."""
        return self.recording, self.agent

    def until(self, t_s: float) -> PersonTrack:
        """The samples with times <= t_s (+ 1e-9 s); none of the later ones is looked at."""
        n = int(np.searchsorted(self.t_s, t_s + _SAME_TIME_S, side="right"))
        return PersonTrack(self.recording, self.agent, self.kind, self.t_s[:n], self.xy_m[:n])


def load_tracks(folder: Path) -> tuple[PersonTrack, ...]:
    """Every person of `peds.csv[.gz]`, in the order of first rows, with the samples as they stand.

    Raises InputError when the table cannot be read or an agent's times do not increase.
    """
    table = Table.read(_folder(folder), "peds", SAMPLE_COLUMNS)
    return tuple(
        _track(key, rows[0].text("kind"), rows) for key, rows in _by_person(table.rows).items()
    )


def load_measured(folder: Path) -> tuple[PersonTrack, ...]:
    """What was measured of the people of `load_tracks`, in the same order.

    Samples may be interpolated between measurements, and then each of them knows the next one. A
    folder says so by a table `control_points.csv[.gz]` (recording, agent, t, x, y), which holds
    the measurements themselves; without it the samples are the measurements. A person without a
    control point is one of whom nothing was measured: an empty track.
    Raises InputError as `load_tracks` does.
    """
    tracks = load_tracks(folder)
    if not Table.exists(Path(folder), "control_points"):
        return tracks
    rows = _by_person(Table.read(Path(folder), "control_points", MEASURED_COLUMNS).rows)
    return tuple(_track(track.key, track.kind, rows.get(track.key, [])) for track in tracks)


def by_recording(tracks: Iterable[PersonTrack]) -> dict[str, list[PersonTrack]]:
    """Tracks by their recording, both in the order given."""
    recordings: dict[str, list[PersonTrack]] = {}
    for track in tracks:
        recordings.setdefault(track.recording, []).append(track)
    return recordings


def _folder(folder: Path) -> Path:
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(
            f"expected a folder of recordings at {folder}, found "
            f"{'a file' if folder.exists() else 'nothing'}; give the folder that holds peds.csv.gz"
        )
    return folder


def _by_person(rows: Iterable[Row]) -> dict[tuple[str, str], list[Row]]:
    people: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        people.setdefault((row.text("recording"), row.text("agent")), []).append(row)
    return people


def _track(key: tuple[str, str], kind: str, rows: list[Row]) -> PersonTrack:
    t_s = np.array([row.number("t") for row in rows])
    xy_m = np.array([(row.number("x"), row.number("y")) for row in rows]).reshape(-1, 2)
    return PersonTrack(*key, kind, t_s, xy_m)
