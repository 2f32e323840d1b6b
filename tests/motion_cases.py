"""Generated people: walkers with a steady pace, some standing, in a small folder of recordings."""

import csv
from pathlib import Path

import numpy as np

from workbench.estimation.motion_filter import MotionNumbers
from workbench.estimation.people_data import PersonTrack

NUMBERS = MotionNumbers(0.03, 1.2, 60.0, 0.2, 1.0, 0.2, 3.0)


def walker(rng, recording, agent, *, duration_s=9.0, every_s=0.2):
    """A person who keeps a pace, turns a little, and is measured with 3 cm of noise."""
    t_s = rng.uniform(0.0, 5.0) + np.arange(0.0, duration_s, every_s)
    speed = rng.choice([0.0, 1.3, 1.6])
    turns = 0.1 * np.sqrt(every_s) * rng.normal(size=len(t_s))
    heading = rng.uniform(-np.pi, np.pi) + np.cumsum(turns)
    steps = every_s * speed * np.column_stack([np.cos(heading), np.sin(heading)])
    place = rng.uniform(-10.0, 10.0, 2) + np.cumsum(steps, axis=0)
    return PersonTrack(recording, agent, "ped", t_s, place + 0.03 * rng.normal(size=place.shape))


def crowd(seed, *, recordings=2, people=6, **kwargs):
    """Tracks of all recordings."""
    rng = np.random.default_rng(seed)
    return tuple(
        walker(rng, f"r{r}", f"p{k}", **kwargs) for r in range(recordings) for k in range(people)
    )


def write_peds(folder: Path, tracks, stem="peds"):
    """The tracks as a table of the data layout."""
    with (folder / f"{stem}.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["recording", "agent", "kind", "t", "x", "y"])
        for track in tracks:
            for t_s, (x, y) in zip(track.t_s, track.xy_m, strict=True):
                writer.writerow([track.recording, track.agent, track.kind, t_s, x, y])
