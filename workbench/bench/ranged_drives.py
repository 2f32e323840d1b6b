"""Drives with the vehicle's localiser among beacons: how many suffice, and whether its sets hold.

`python -m workbench.bench.ranged_drives` (extra `analysis`, a C compiler; the multi-body plant with
extra `commonroad`) prints two tables: bends among more and fewer beacons, and all plants
with many ranges lost. It fails when fewer sets hold the truth than their level says.
"""

from __future__ import annotations

import dataclasses
import itertools
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

from workbench.bench.text import table
from workbench.estimation.localisation_site import load_site
from workbench.runtime import Deciding
from workbench.runtime.localiser.site import Beacon, Site
from workbench.simulation.bus_drive import BusDrive, Recorded
from workbench.simulation.bus_world import BusSetting
from workbench.simulation.plants.make import PLANTS
from workbench.simulation.range_beacons import RANGED_US, RangeErrors
from workbench.simulation.ranged_place import Ranging
from workbench.simulation.rig import Rig, Trial, outcome_on_bus
from workbench.simulation.scenarios.shipped import named
from workbench.simulation.simulated import (
    build_localiser,
    build_rig,
    ranged_sensors,
    street_path,
)
from workbench.simulation.told_scores import ToldScores

SCENARIOS: Final = ("nobody_tight_bend", "nobody_s_bend", "paper_alongside_vehicle")
POLICY: Final = Deciding.LOOK_AHEAD
SEED: Final = 1
SEEDS: Final = range(1, 5)
DROPPED, OFTEN_DROPPED = 0.1, 0.3
_ACROSS_M, _ALONG_M = (-27.0, 23.0), (-10.0, 60.0)
_HEIGHTS_M: Final = (3.0, 2.5)


@final
@dataclass(frozen=True, slots=True)
class Street:
    """How many beacons stand along the street, half on either side, how far their ranges err
    (standard deviation), and how many times a second each of them ranges."""

    beacons: int
    deviation_m: float
    rate_hz: int

    def site(self) -> Site:
        """The shipped street's with these."""
        shipped = load_site(street_path())
        ranges = dataclasses.replace(shipped.ranges, deviation_m=self.deviation_m)
        return dataclasses.replace(shipped, beacons=tuple(self._places()), ranges=ranges)

    def _places(self) -> Iterator[Beacon]:
        many = self.beacons // 2
        apart_m = (_ALONG_M[1] - _ALONG_M[0]) / (many - 1)
        for side, k in itertools.product((0, 1), range(many)):
            name = f"{('south', 'north')[side]} {k + 1}"
            x_m = _ALONG_M[0] + apart_m * k
            yield Beacon(name, x_m, _ACROSS_M[side], _HEIGHTS_M[k % 2])


STREETS: Final = (
    Street(8, 0.2, 3), Street(12, 0.2, 3), Street(16, 0.2, 3), Street(24, 0.2, 3),
    Street(8, 0.2, 6), Street(8, 0.1, 3),
)  # fmt: skip


def ranged(rig: Rig, ranging: Ranging, trial: Trial) -> BusDrive:
    """A drive with the localiser in the loop."""
    return rig.on_bus(
        trial, deciding=POLICY, setting=BusSetting(rig.settings.maker, ranging=ranging),
        recorded=Recorded(pages=False),
    )  # fmt: skip


def main() -> bool:
    """Print both tables; True: the sets hold what they say."""
    rig = build_rig(sensors=ranged_sensors())
    _say("Beacons along the street, single-track plant, LookAhead, one range in ten lost\n")
    _say(table(["beacons", "range error", "rate", "scenario", "found", *_TOLD], _streets(rig)))
    _say("\nThe shipped street on every plant, three ranges in ten lost, nobody_s_bend\n")
    rows, holds = _plants(rig)
    _say(table(["plant", "seed", "found", *_TOLD], rows))
    return holds


def _streets(rig: Rig) -> list[list[str]]:
    rows = []
    for street in STREETS:
        built = build_localiser(site=street.site())
        errors = RangeErrors.stated(built.numbers.site, dropped=DROPPED)
        ranging = Ranging(built, errors, RANGED_US * 3 // street.rate_hz)
        for name in SCENARIOS:
            trial = Trial(named(name), "single-track", SEED)
            driven = ranged(rig, ranging, trial)
            found = outcome_on_bus(driven, trial.scenario).story
            setting = str(street.beacons), f"{street.deviation_m:g} m", f"{street.rate_hz} Hz"
            rows.append([*setting, name, found, *_told(ToldScores.of(driven.told))])
    return rows


def _plants(rig: Rig) -> tuple[list[list[str]], bool]:
    built = build_localiser()
    ranging = Ranging(built, RangeErrors.stated(built.numbers.site, dropped=OFTEN_DROPPED))
    rows, sets, held = [], 0, 0.0
    for plant, seed in itertools.product(PLANTS, SEEDS):
        trial = Trial(named("nobody_s_bend"), plant, seed)
        driven = ranged(rig, ranging, trial)
        scores = ToldScores.of(driven.told)
        if scores is not None:
            sets, held = sets + scores.sets, held + scores.sets * scores.holding
        found = outcome_on_bus(driven, trial.scenario).story
        rows.append([plant, str(seed), found, *_told(scores)])
    return rows, sets > 0 and held >= built.numbers.level * sets


_TOLD: Final = (
    "place off: 95 %, most", "radius: 95 %, most", "heading off: 95 %, most", "radius: 95 %, most",
    "sets", "held",
)  # fmt: skip


def _told(scores: ToldScores | None) -> tuple[str, ...]:
    if scores is None:
        return ("", "", "", "", "0", "")
    spreads = [
        f"{spread.most:.{digits}f}, {spread.worst:.{digits}f} {unit}"
        for spread, digits, unit in (
            (scores.error_m, 3, "m"), (scores.radius_m, 3, "m"),
            (scores.heading_error_rad, 4, "rad"), (scores.heading_radius_rad, 4, "rad"),
        )
    ]  # fmt: skip
    return (*spreads, str(scores.sets), f"{100 * scores.holding:.4g} %")


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")


if __name__ == "__main__":
    sys.exit(not main())
