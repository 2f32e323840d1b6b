"""A rig and hand-made scenarios for the tests of surveys."""

from __future__ import annotations

import functools

from workbench.simulation.campaign.rows import Row
from workbench.simulation.rig import Rig
from workbench.simulation.scenarios.company import Company, Told
from workbench.simulation.scenarios.scenario import Scenario, Sensing
from workbench.simulation.simulated import build_rig
from workbench.simulation.walkers.cues import CarWithin
from workbench.simulation.walkers.moving import Who
from workbench.simulation.walkers.scripted import Leg, Script

RADIUS_M = 0.3


@functools.cache
def rig() -> Rig:
    return build_rig()


def straight(*scripts: Script, duration_s: float = 14.0) -> Scenario:
    """40 m straight on along x, with people."""
    people = tuple(
        Told(Who(f"person {k}", "ped", RADIUS_M), script) for k, script in enumerate(scripts)
    )
    waypoints = tuple((4.0 * k, 0.0) for k in range(11))
    sensing = Sensing(person_m=0.2)
    return Scenario("case", "Case", "", waypoints, duration_s, 26.0, Company(people), sensing)


def standing(x_m: float, y_m: float) -> Script:
    return Script((x_m, y_m))


def crossing(x_m: float, within_m: float) -> Script:
    """Crosses from the left once the car's body is so near."""
    return Script((x_m, 4.0), (Leg((x_m, -4.0), 1.5, CarWithin(within_m)),))


def row(index: int, contender: str = "FailSafe", **changed: object) -> Row:
    """A row as of a drive without anything to say of it."""
    values: dict[str, object] = {
        "index": index, "plant": "bicycle", "contender": contender, "seed": index + 1,
        "set_off": True, "passed": True, "contact": False, "avoidable": False, "contact_mps": 0.0,
        "contact_s": 0.0, "contact_person": "", "nearest_m": float("inf"), "undisturbed_m": 1.0,
        "stops": 0, "needless_stops": 0, "way_m": 26.0, "time_s": 15.0, "waited_s": 1.0,
        "stood_s": 0.0, "safe": 90, "unproved": 0, "invalid": 0, "out_of_region": 0,
        "violations": 0, "alerts": 0,
    }  # fmt: skip
    return Row(**{**values, **changed})  # type: ignore[arg-type]
