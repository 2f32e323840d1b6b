"""How far simulated cars move from what the law commands: what a W without any N would have to be.

Run with Python (extra `analysis`); it prints a Markdown table. Drives at the desk, turn by turn:
realised less commanded acceleration and road-wheel rate under TRACK, on the way up to speed and
after it.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime import Deciding
from workbench.runtime.onboard.pid import law_of
from workbench.runtime.onboard.times import TURN_US
from workbench.simulation.clock import SetClock
from workbench.simulation.desk_drive import DeskLoop, Driving
from workbench.simulation.plants.make import PLANTS
from workbench.simulation.rig import Rig, Trial
from workbench.simulation.scenarios.shipped import named
from workbench.simulation.simulated import build_rig

SCENARIOS: Final = ("nobody_tight_bend", "nobody_s_bend", "crossing_straight")
SEEDS: Final = range(1, 4)
_TURN_S: Final = TURN_US / 1e6


@final
@dataclass(frozen=True, slots=True)
class Gap:
    """Realised less commanded over one turn; risen: whether the reference speed was reached."""

    acceleration_mps2: float
    steering_rate_radps: float
    risen: bool


def gaps(rig: Rig, trial: Trial) -> Iterator[Gap]:
    """Of every turn but the first of each stretch under TRACK, until the path is over."""
    scene, clock = rig.scene(trial), SetClock()
    judge = rig.monitor(Deciding.FAIL_SAFE)(scene.setting.path, clock)
    driving = Driving(judge, clock, law_of(rig.bundle.manifest.parameters), rig.settings)
    loop, target_mps = DeskLoop(scene, driving, seed=trial.seed), _reference_mps(rig)
    seen = []
    while scene.now_s < trial.scenario.duration_s:
        loop.turn()
        seen.append((loop.tracks, loop.command, scene.car.motion, loop.reference_mps))
    for (tracked, _, before, _), (tracks, command, after, reference) in itertools.pairwise(seen):
        if tracked and tracks:
            yield Gap(
                (after.speed_mps - before.speed_mps) / _TURN_S - command.acceleration_mps2,
                (after.road_wheel_rad - before.road_wheel_rad) / _TURN_S
                - command.steering_rate_radps,
                reference >= target_mps,
            )


def _reference_mps(rig: Rig) -> float:
    return rig.vehicle.operation.reference_speed_mps


def table(rig: Rig, plants: Sequence[str]) -> str:
    """The largest magnitudes by plant, over all scenarios and seeds."""
    rows = [
        "| plant | acceleration, rising (m/s^2) | at speed | steering rate, rising "
        "(rad/s) | at speed |",
        "| --- | --- | --- | --- | --- |",
    ]
    for plant in plants:
        found = [
            gap
            for name in SCENARIOS
            for seed in SEEDS
            for gap in gaps(rig, Trial(named(name), plant, seed))
        ]
        parts = [[gap for gap in found if gap.risen is risen] for risen in (False, True)]
        pushed = [max(abs(gap.acceleration_mps2) for gap in part) for part in parts]
        turned = [max(abs(gap.steering_rate_radps) for gap in part) for part in parts]
        rows.append(
            f"| {plant} | {pushed[0]:.3f} | {pushed[1]:.3f} | {turned[0]:.4f} | {turned[1]:.4f} |"
        )
    return "\n".join(rows)


if __name__ == "__main__":
    sys.stdout.write(table(build_rig(), PLANTS) + "\n")
