"""The paper's own tubes: its method with a beta that was learned before, as a bundle's TRACK."""

from __future__ import annotations

import dataclasses
from typing import Final

from workbench.codegen.bundle import MonitorSpec
from workbench.models.vehicle import Vehicle
from workbench.reach.learned.tube import LearnedTube
from workbench.reach.learned.vehicle_beta import learn_vehicle_beta
from workbench.sensitivity import LearnedExponential
from workbench.simulation.paper.tubes import STEP_S, paper_spec

REGIONS: Final = {"station": 2, "offset": 2, "steering": 2, "speed": 2, "heading_error": 2}
"""Every state that a measured set has a width along is halved: only then does the largest share of
the learned radii halve too, which is what this beta grows with."""
PAIRS: Final = 39_396
"""What a probability of violation of 1e-3 with confidence 1 - 1e-6 needs with the fourteen numbers
fitted: two for each of seven states."""
PAIRS_QUICK: Final = 1_000
_DELTA: Final = 1e-6
_SEED: Final = 1


def learned_spec(vehicle: Vehicle, *, horizon_s: float, pairs: int) -> MonitorSpec:
    """`paper_spec` with TRACK's tubes by a beta that is learned from so many pairs, all drawn with
    one seed from the paper's model, the car's bicycle under its controller; some seconds."""
    learned = learn_vehicle_beta(
        vehicle,
        horizon_s=horizon_s,
        method=LearnedExponential(pairs=pairs, seed=_SEED, step_s=STEP_S, delta=_DELTA),
    )
    return dataclasses.replace(
        paper_spec(vehicle, horizon_s), learned=LearnedTube(learned, REGIONS, STEP_S)
    )
