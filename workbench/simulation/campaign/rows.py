"""One row of a survey's table: who drove what, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

from workbench.claims import Verdict
from workbench.simulation.campaign.contenders import NEVER, Field
from workbench.simulation.campaign.sampled import SampledScenario
from workbench.simulation.campaign.survey_drive import CLEAR_M, Drive, avoidable, drive
from workbench.simulation.rig import Trial

PER_RUN: Final = ("index", "plant", "contender")
"""What names a row."""


@final
@dataclass(frozen=True, slots=True)
class Row:
    """One drive, counted.

    contact, contact_mps, contact_person: the first touch of the moving car; avoidable: whether
    braking at an earlier period would have avoided it; stops: BRAKE after TRACK while the car
    moved; needless_stops: those of a scenario that a car which never brakes goes through no nearer
    than 0.5 m to anybody; undisturbed_m: how near that one came, inf for to nobody. decisions are
    safe + unproved + invalid; out_of_region: of the invalid ones, those outside of the proof's
    region; violations: named hypotheses, all counted; nearest_m: inf for nobody.
    """

    index: int
    plant: str
    contender: str
    seed: int
    set_off: bool
    passed: bool
    contact: bool
    avoidable: bool
    contact_mps: float
    contact_s: float
    contact_person: str
    nearest_m: float
    undisturbed_m: float
    stops: int
    needless_stops: int
    way_m: float
    time_s: float
    waited_s: float
    stood_s: float
    safe: int
    unproved: int
    invalid: int
    out_of_region: int
    violations: int
    alerts: int


def trial_of(index: int, scenario: SampledScenario, plant: str) -> Trial:
    """What an index stands for on a plant."""
    return Trial(scenario.scenario(f"{index}"), plant, scenario.seed)


def drive_all(index: int, trial: Trial, contenders: tuple[str, ...], field: Field) -> list[Row]:
    """All contenders through one scenario on one plant."""
    alone = _driven(NEVER, trial, field)
    rows = []
    for name in contenders:
        driven = alone if name == NEVER else _driven(name, trial, field)
        rig, _ = field.contender(name)
        rows.append(_row(index, name, trial, (driven, alone), avoidable(rig, trial, driven)))
    return rows


def missed(name: str, trial: Trial, field: Field) -> bool:
    """Whether a contender drives into somebody although that was avoidable."""
    rig, judge = field.contender(name)
    return avoidable(rig, trial, drive(rig, trial, judge))


def _driven(name: str, trial: Trial, field: Field) -> Drive:
    rig, judge = field.contender(name)
    return drive(rig, trial, judge)


def _row(
    index: int, name: str, trial: Trial, drives: tuple[Drive, Drive], was_avoidable: bool
) -> Row:  # fmt: skip
    driven, alone = drives
    contact = driven.contact
    needless = alone.contact is None and alone.nearest_m >= CLEAR_M
    return Row(
        index=index, plant=trial.plant, contender=name, seed=trial.seed,
        set_off=driven.set_off is not None, passed=driven.passed,
        contact=contact is not None, avoidable=was_avoidable,
        contact_mps=0.0 if contact is None else contact.speed_mps,
        contact_s=0.0 if contact is None else contact.t_s,
        contact_person="" if contact is None else contact.person,
        nearest_m=driven.nearest_m, undisturbed_m=alone.nearest_m,
        stops=driven.stops, needless_stops=driven.stops if needless else 0,
        way_m=driven.way_m, time_s=driven.time_s, waited_s=driven.waited_s,
        stood_s=driven.stood_s,
        safe=driven.verdicts.get(Verdict.SAFE, 0),
        unproved=driven.verdicts.get(Verdict.UNPROVED, 0),
        invalid=driven.verdicts.get(Verdict.INVALID, 0),
        out_of_region=driven.out_of_region, violations=sum(driven.violations.values()),
        alerts=driven.alerts,
    )  # fmt: skip
