"""An optimiser that looks for the worst scenario of a contender, over the same cube as a survey."""

from __future__ import annotations

import dataclasses
import json
import logging
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

from workbench.errors import InputError
from workbench.simulation.campaign.contenders import Field
from workbench.simulation.campaign.parts import write_whole
from workbench.simulation.campaign.rows import Row, drive_all, trial_of
from workbench.simulation.campaign.sampled import DIMENSIONS, FAMILY, SampledScenario
from workbench.simulation.campaign.store import Store
from workbench.simulation.campaign.surveying import rigs_of
from workbench.simulation.campaign.workers import Workers
from workbench.simulation.plants.make import PLANTS

COLLISIONS: Final = "collisions"
NEEDLESS: Final = "needless-stops"
HUNTS: Final = (COLLISIONS, NEEDLESS)
_FARTHEST_M: Final = 20.0
_KEPT: Final = 10
_STARTUP: Final = 24
_LARGEST: Final = 1.0 - 1e-9


@final
@dataclass(frozen=True, slots=True)
class Quarry:
    """What is hunted: one of `HUNTS`, by whom it is driven, on what; seed: of the optimiser and of
    all scenarios' chance."""

    what: str
    contender: str
    plant: str
    seed: int

    @property
    def name(self) -> str:
        """A word for its folder."""
        return f"{self.what}-{self.contender}-{self.plant}-{self.seed}".replace(" ", "-")

    def worth(self, row: Row) -> float:
        """What the optimiser makes small: the distance in m while the car moves, where it touches
        somebody minus its speed in m/s; or minus the number of needless stops."""
        if self.what == NEEDLESS:
            return -float(row.needless_stops)
        return -row.contact_mps if row.contact else min(row.nearest_m, _FARTHEST_M)


@final
@dataclass(frozen=True, slots=True)
class Catch:
    """A scenario that was found: its point and seed, what it is worth, and what came of it."""

    quarry: Quarry
    family: int
    worth: float
    scenario: SampledScenario
    row: Row


@final
@dataclass(frozen=True, slots=True)
class _Try:
    """One drive for a worker."""

    folder: str
    quarry: Quarry
    parameters: tuple[tuple[str, float], ...]
    scenario: SampledScenario


def hunt(
    store: Store, quarry: Quarry, trials: int, crew: Workers, *, at_once: int,
    advance: Callable[[int], None],
) -> list[Catch]:  # fmt: skip
    """Go on until there are so many trials; all of them, what refutes a claim first: avoidable
    contacts, then by worth. The first ten are also written to best.json.

    Tree-structured Parzen estimator of Optuna, kept in its journal, so that a second start goes
    on. Raises InputError where the extra `study` is missing.
    """
    study = _study(store, quarry)
    for _ in range(min(trials, _told(study))):
        advance(1)
    tuned = store.parameters().get(quarry.plant, {})
    parameters = tuple((name, each["parameter"]) for name, each in tuned.items())
    while _told(study) < trials:
        asked = [study.ask() for _ in range(min(at_once, trials - _told(study)))]
        tries = []
        for each in asked:
            point = tuple(each.suggest_float(f"u{k:02d}", 0.0, _LARGEST) for k in range(DIMENSIONS))
            scenario = SampledScenario(point, 1 + quarry.seed)
            tries.append(_Try(str(store.folder), quarry, parameters, scenario))
        of = dict(zip([each.scenario.point for each in tries], asked, strict=True))
        for task, row in crew.done(_tried, tries):
            of[task.scenario.point].set_user_attr("row", dataclasses.asdict(row))
            study.tell(of[task.scenario.point], quarry.worth(row))
            advance(1)
    found = _caught(study, quarry)
    kept = [dataclasses.asdict(each) for each in found[:_KEPT]]
    for each in kept:
        each["row"] = {k: None if v == math.inf else v for k, v in each["row"].items()}
    text = json.dumps(kept, indent=1, allow_nan=False)
    write_whole(store.folder / "hunts" / quarry.name / "best.json", text + "\n")
    return found


def load_catches(path: Path) -> list[Catch]:
    """What a hunt has written; raises InputError for anything else, and for another family."""
    try:
        found = [_catch(each) for each in json.loads(path.read_text(encoding="utf-8"))]
        if not found or any(each.quarry.plant not in PLANTS for each in found):
            raise ValueError("no point on a plant that there is")
    except (OSError, ValueError, TypeError, KeyError) as fault:
        raise InputError(
            f"--point: expected the best.json of a hunt, got {path} ({fault}); "
            "`workbench survey --hunt` writes one"
        ) from fault
    for each in found:
        if each.family != FAMILY:
            raise InputError(f"{path}: expected points of family {FAMILY}, got {each.family}")
    return found


def _tried(task: _Try) -> Row:
    field = Field(rigs_of(task.folder), dict(task.parameters))
    quarry = task.quarry
    trial = trial_of(0, task.scenario, quarry.plant)
    (row,) = drive_all(0, trial, (quarry.contender,), field)
    return row


def _catch(data: dict[str, Any]) -> Catch:
    scenario = data["scenario"]
    row: dict[str, Any] = data["row"]
    # JSON has no infinity.
    row |= {name: math.inf for name, value in row.items() if value is None}
    return Catch(
        Quarry(**data["quarry"]), data["family"], data["worth"],
        SampledScenario(tuple(scenario["point"]), scenario["seed"]),
        Row(**row),
    )  # fmt: skip


def _study(store: Store, quarry: Quarry) -> Any:
    try:
        import optuna
        from optuna.storages.journal import JournalFileBackend
    except ImportError as error:
        raise InputError(
            "a hunt needs the study extra: pip install 'reach-workbench[study]'"
        ) from error
    optuna.logging.set_verbosity(logging.WARNING)
    place = store.folder / "hunts" / quarry.name
    place.mkdir(parents=True, exist_ok=True)
    _cut_torn(place / "journal.log")
    storage = optuna.storages.JournalStorage(JournalFileBackend(str(place / "journal.log")))
    study = optuna.create_study(storage=storage, study_name=quarry.name, load_if_exists=True)
    study.sampler = optuna.samplers.TPESampler(
        n_startup_trials=_STARTUP, seed=quarry.seed + len(study.trials), constant_liar=True
    )
    return study


def _cut_torn(journal: Path) -> None:
    """Drop a last line that a kill has torn: no later start could read it."""
    text = journal.read_bytes() if journal.exists() else b""
    whole = text.rfind(b"\n") + 1
    if whole < len(text):
        os.truncate(journal, whole)


def _told(study: Any) -> int:
    return sum(each.state.name == "COMPLETE" for each in study.trials)


def _caught(study: Any, quarry: Quarry) -> list[Catch]:
    done = [each for each in study.trials if each.state.name == "COMPLETE"]
    done.sort(key=lambda each: (each.value, each.number))
    found = [
        Catch(
            quarry, FAMILY, float(each.value),
            SampledScenario(
                tuple(each.params[f"u{k:02d}"] for k in range(DIMENSIONS)), 1 + quarry.seed
            ),
            Row(**each.user_attrs["row"]),
        )
        for each in done
    ]  # fmt: skip
    return sorted(found, key=lambda each: not each.row.avoidable)
