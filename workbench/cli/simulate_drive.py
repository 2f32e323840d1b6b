"""One drive of `workbench simulate`: in virtual time, at the desk, or in real time."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

from workbench.cli.common import output_folder
from workbench.cli.output import Progress, emit
from workbench.cli.simulate_localiser import built_localiser, localiser_notes, ranging_of
from workbench.cli.simulate_subject import (
    chosen_estimator,
    chosen_rig,
    chosen_scenario,
    chosen_vehicle,
    expected_of,
    require_goals,
    require_steerable,
)

if TYPE_CHECKING:
    from workbench.simulation.bus_drive import BusDrive
    from workbench.simulation.drive_outcomes import DriveOutcome
    from workbench.simulation.rig import Rig, Trial
    from workbench.simulation.scenarios.scenario import Expected


FAR_WORDS: Final = "within 12 m of nobody"
"""Farther off nobody's distance is measured: |dx| + |dy| from the middle of the rear axle."""


@final
@dataclass(frozen=True, slots=True)
class Found:
    """What one drive amounts to.

    rig, trial, policy: what drove; notes: what a reader must know; driven: turn by turn, None at
    the desk; outcome; undisturbed_m: how near a car that never brakes comes to anybody, inf for
    nobody near; took_s: time of the drive, without building; live: whether it was driven in real
    time; ranged: whether a localiser told where the car was.
    """

    rig: Rig
    trial: Trial
    policy: str
    notes: tuple[str, ...]
    driven: BusDrive | None
    outcome: DriveOutcome
    undisturbed_m: float
    took_s: float
    live: bool = False
    ranged: bool = False

    @property
    def expected(self) -> Expected:
        """Of the policy that decided."""
        return expected_of(self.trial.scenario, self.policy)

    @property
    def as_expected(self) -> bool:
        """Whether it went so."""
        return self.outcome.is_as(self.expected)

    @property
    def needless(self) -> bool:
        """Whether no BRAKE was needed: even a car that never brakes keeps clear of everybody."""
        from workbench.simulation.campaign.survey_drive import CLEAR_M

        return self.undisturbed_m >= CLEAR_M

    @property
    def faster(self) -> float:
        """Duration of the scenario over that of the drive."""
        return self.trial.scenario.duration_s / self.took_s


def drive_one(args: argparse.Namespace) -> int:
    """Drive it, write what came of it, and say so; 1 where it is not as expected."""
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.simulation.rig import Trial

    scenario, notes = chosen_scenario(args.scenario[0])
    require_steerable(scenario, chosen_vehicle(args))
    if args.intents:
        require_goals(scenario)
    trial = Trial(scenario, args.plant or "single-track", args.seed)
    if args.desk:
        found = _at_desk(args, trial, notes)
        files: dict[str, object] = {}
    else:
        from workbench.cli.simulate_page import write_files

        with output_folder(args.out) as folder, _kept(args):
            found = _driven(args, trial, notes)
            files = write_files(args, found, folder)
    emit(args, "\n".join([*summary(found), *(f"{k}: {v}" for k, v in files.items())]),
         _data(found) | files)  # fmt: skip
    return DONE if found.as_expected else CLAIM_FAILS


def _kept(args: argparse.Namespace) -> AbstractContextManager[None]:
    """What a drive in real time needs around it."""
    if not args.real_time:
        return nullcontext()
    from workbench.cli.simulate_live import live_folder

    return live_folder(args.out)


def summary(found: Found) -> list[str]:
    """What came of it, in a few lines."""
    trial, outcome = found.trial, found.outcome
    said = "as expected" if found.as_expected else "NOT as expected"
    pace = f"{found.faster:.1f} times as fast as real time"
    if found.live:
        pace = "start and end included"
    return [
        f"{trial.scenario.title}: {found.policy} on {trial.plant}, seed {trial.seed}",
        f"expected of {found.policy}: {found.expected.value}; found: {outcome.story}; {said}",
        _needless_words(found),
        f"{trial.scenario.duration_s:g} s driven in {found.took_s:.1f} s, {pace}",
        *found.notes,
    ]


def _needless_words(found: Found) -> str:
    from workbench.simulation.campaign.survey_drive import CLEAR_M

    brakes = len(found.outcome.brakes)
    near_m = found.undisturbed_m
    comes = FAR_WORDS if near_m == math.inf else f"as near as {near_m:.2f} m to somebody"
    if near_m < 0.0:
        comes = "into contact with somebody"
    return (
        f"BRAKE after TRACK: {brakes}, needless: {brakes if found.needless else 0}; a car that "
        f"never brakes comes {comes} (needless from {CLEAR_M:g} m on)"
    )


def _at_desk(args: argparse.Namespace, trial: Trial, notes: tuple[str, ...]) -> Found:
    from workbench.runtime import Deciding

    with Progress("simulate", 3) as bar:
        rig = chosen_rig(args)
        bar.advance()
        begun_s = time.monotonic()
        outcome = rig.at_desk(trial, rig.monitor(Deciding(args.policy)))
        took_s = time.monotonic() - begun_s
        bar.advance()
        undisturbed_m = _undisturbed_m(rig, trial)
    return Found(rig, trial, args.policy, notes, None, outcome, undisturbed_m, took_s)


def _undisturbed_m(rig: Rig, trial: Trial) -> float:
    from workbench.simulation.campaign.survey_drive import undisturbed

    return undisturbed(rig, trial).nearest_m


def _driven(args: argparse.Namespace, trial: Trial, notes: tuple[str, ...]) -> Found:
    from workbench.simulation.holding import holding_notes
    from workbench.simulation.rig import outcome_on_bus

    if args.real_time:
        from workbench.cli.simulate_live import driven_live as drive
    else:
        drive = _in_virtual_time
    seconds = int(trial.scenario.duration_s) + 1
    with Progress("simulate", seconds + 2) as bar:
        rig, driven, took_s, more = drive(args, trial, _advancing(bar))
        undisturbed_m = _undisturbed_m(rig, trial)
    outcome = outcome_on_bus(driven, trial.scenario)
    notes = (*notes, *more, *holding_notes(driven.instants))
    return Found(
        rig, trial, args.policy, notes, driven, outcome, undisturbed_m, took_s,
        live=args.real_time, ranged=args.localiser,
    )  # fmt: skip


Driven = tuple["Rig", "BusDrive", float, tuple[str, ...]]
"""Rig, drive, how long it took (s), and notes."""


def _advancing(bar: Progress) -> Callable[[int, int], None]:
    """Progress of a drive, on the bar: a step for each second."""

    def progress(_done: int, _total: int) -> None:
        bar.advance()

    return progress


def _in_virtual_time(
    args: argparse.Namespace, trial: Trial, progress: Callable[[int, int], None]
) -> Driven:
    from workbench.runtime import Deciding
    from workbench.simulation.bus_world import BusSetting

    rig = chosen_rig(args, ranged=args.localiser)
    progress(0, 1)
    estimator = chosen_estimator(rig, trial.scenario) if args.intents else None
    ranging = ranging_of(built_localiser(args)) if args.localiser else None
    setting = BusSetting(rig.settings.maker, estimator, ranging)
    begun_s = time.monotonic()
    driven = rig.on_bus(trial, deciding=Deciding(args.policy), setting=setting, progress=progress)
    took_s = time.monotonic() - begun_s
    notes = ("what people want is estimated, and told to LookAhead",) if args.intents else ()
    if args.localiser:
        notes = (*notes, *localiser_notes(driven))
    return rig, driven, took_s, notes


def _data(found: Found) -> dict[str, object]:
    trial, brakes = found.trial, len(found.outcome.brakes)
    return {
        "scenario": trial.scenario.name,
        "title": trial.scenario.title,
        "plant": trial.plant,
        "policy": found.policy,
        "seed": trial.seed,
        "expected": found.expected.value,
        "as_expected": found.as_expected,
        "story": found.outcome.story,
        "outcome": found.outcome,
        "never_braking_nearest_m": found.undisturbed_m,
        "needless_brakes": brakes if found.needless else 0,
        "duration_s": trial.scenario.duration_s,
        "took_s": found.took_s,
        "times_faster_than_real_time": found.faster,
        "notes": found.notes,
    }
