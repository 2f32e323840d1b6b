"""How far simulated cars leave the bicycle that a localiser takes them for: its slip per metre.

`python -m workbench.bench.driven_slip` (extra `analysis`; the multi-body plant with `commonroad`)
prints a table: bends driven at the desk by a car that nobody stops, and the largest change
of heading, and of the way aside and ahead, beside what speed and reported steering explain, over
the square root of the way. `street_beacons.toml` states more than half of the largest as its walks.
"""

from __future__ import annotations

import math
import sys
from typing import Final

import numpy as np

from workbench.bench.text import table
from workbench.estimation.lanes import Array
from workbench.runtime.onboard.pid import law_of
from workbench.runtime.onboard.times import TURN_US
from workbench.simulation.campaign.scripted_judges import NeverBrakes
from workbench.simulation.clock import SetClock
from workbench.simulation.desk_drive import DeskLoop, Driving
from workbench.simulation.plants.make import PLANTS
from workbench.simulation.rig import Rig, Trial
from workbench.simulation.scenarios.shipped import named
from workbench.simulation.simulated import build_rig

SCENARIOS: Final = ("nobody_tight_bend", "nobody_s_bend")
SEEDS: Final = range(1, 4)
WAYS_M: Final = (1.0, 3.0, 10.0, 20.0)
UNTIL_S: Final = 25.0
_TURN_S: Final = TURN_US / 1e6
_MOVES_MPS: Final = 0.2


def slips(rig: Rig, trial: Trial) -> Array:
    """Largest slip per sqrt(m) of heading (rad), aside and ahead (m), for each of `WAYS_M`."""
    scene = rig.scene(trial)
    curve, wheelbase_m = (
        rig.settings.drive_by_wire.steering.road_wheel, rig.vehicle.geometry.wheelbase_m,
    )  # fmt: skip
    law = law_of(rig.bundle.manifest.parameters)
    driving = Driving(NeverBrakes(), SetClock(), law, rig.settings, heeds_faults=False)
    loop, rows = DeskLoop(scene, driving, seed=trial.seed), []
    while scene.now_s < UNTIL_S:
        loop.turn()
        at, said = scene.car.motion, curve.middle(scene.car.wheel_rad)
        rows.append((at.x_m, at.y_m, at.heading, at.speed_mps, said))
    x, y, heading, speed, steering = np.asarray(rows).T
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * _TURN_S)])
    rate = speed * np.tan(steering) / wheelbase_m
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * _TURN_S)])
    middle = 0.5 * (heading[1:] + heading[:-1])
    c, s = np.cos(middle), np.sin(middle)
    aside = np.concatenate([[0.0], np.cumsum(np.diff(y) * c - np.diff(x) * s)])
    ahead = np.concatenate([[0.0], np.cumsum(np.diff(x) * c + np.diff(y) * s)]) - way
    beside = np.stack([heading - turned, aside, ahead])
    return np.stack([_largest(beside, way, speed, length_m) for length_m in WAYS_M])


def _largest(beside: Array, way: Array, speed: Array, length_m: float) -> Array:
    """Over every stretch of that length on which the car moves; `beside` (3, turns)."""
    ends = np.searchsorted(way, way + length_m)
    begins = np.flatnonzero((ends < len(way)) & (speed > _MOVES_MPS))
    changes = np.abs(beside[:, ends[begins]] - beside[:, begins])
    return np.asarray(changes.max(axis=1) / math.sqrt(length_m))


def main() -> None:
    """Print the table."""
    rig = build_rig()
    rows = []
    for plant in PLANTS:
        found = np.max(
            [slips(rig, Trial(named(n), plant, seed)) for n in SCENARIOS for seed in SEEDS], axis=0
        )
        rows += [
            [plant, f"{length_m:g} m", *(f"{value:.4f}" for value in each)]
            for length_m, each in zip(WAYS_M, found, strict=True)
        ]
    headings = ["plant", "way", "heading, rad/sqrt(m)", "aside, m/sqrt(m)", "ahead, m/sqrt(m)"]
    sys.stdout.write(table(headings, rows) + "\n")


if __name__ == "__main__":
    main()
