"""A survey from its beginning, or from where it was left."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

from workbench.errors import InputError
from workbench.simulation.campaign.baselines import baseline
from workbench.simulation.campaign.contenders import NEVER, Field, is_baseline, judged_half
from workbench.simulation.campaign.rows import Row, drive_all, missed, trial_of
from workbench.simulation.campaign.sampled import SampledScenario, sampled
from workbench.simulation.campaign.store import Manifest, Store
from workbench.simulation.campaign.tuning import tune
from workbench.simulation.campaign.workers import Workers
from workbench.simulation.rig import Rig

Advance = Callable[[int], None]
"""Called with the number of scenarios that are done more."""
_TUNING_PART: Final = 4


@final
@dataclass(frozen=True, slots=True)
class Task:
    """Indices for one worker: the survey's folder, its manifest, a plant, baselines' parameters;
    contender: the one to be tuned, None for all."""

    folder: str
    manifest: Manifest
    plant: str
    indices: tuple[int, ...]
    parameters: tuple[tuple[str, float], ...]
    contender: str | None = None


def drive_part(task: Task) -> list[Row]:
    """What a worker does: all contenders through the task's scenarios."""
    field = Field(rigs_of(task.folder), dict(task.parameters))
    return [
        row
        for index, scenario in _scenarios(task)
        for row in drive_all(
            index, trial_of(index, scenario, task.plant), task.manifest.drives(index), field
        )
    ]


def missed_part(task: Task) -> list[int]:
    """What a worker does while tuning: indices that the task's one contender misses."""
    field, name = Field(rigs_of(task.folder), dict(task.parameters)), task.contender or NEVER
    return [
        index
        for index, scenario in _scenarios(task)
        if missed(name, trial_of(index, scenario, task.plant), field)
    ]


@final
@dataclass(frozen=True, slots=True)
class Survey:
    """A survey under way."""

    store: Store
    manifest: Manifest
    workers: Workers

    def drive(self, plant: str, count: int, advance: Advance) -> None:
        """Drive what is missing of the first `count` scenarios; each part is stored when done."""
        tuned = self.store.parameters().get(plant, {})
        parameters = tuple((name, each["parameter"]) for name, each in tuned.items())
        tasks = [
            Task(str(self.store.folder), self.manifest, plant, tuple(part), parameters)
            for part in self.store.missing(plant, count)
        ]
        for task, rows in self.workers.done(drive_part, tasks):
            indices = range(task.indices[0], task.indices[-1] + 1)
            self.store.write(plant, indices, rows)
            advance(len(indices))

    def untuned(self, plant: str, training: int) -> tuple[str, ...]:
        """Baselines without a parameter for a plant, or with one tuned on fewer scenarios."""
        known = self.store.parameters().get(plant, {})
        return tuple(
            each for each in self.manifest.contenders
            if is_baseline(each) and known.get(each, {}).get("training", 0) < training
        )  # fmt: skip

    def tune(self, plant: str, training: Sequence[int], advance: Advance) -> None:
        """Find the parameters of the baselines for a plant, and store them: of those that have
        none, and of those that were tuned on fewer scenarios.

        training: indices of the half that is tuned on (see `training_half`). Raises InputError
        where a baseline was tuned on fewer and has driven."""
        tuned = self.store.parameters()
        known = tuned.get(plant, {})
        wanted = self.untuned(plant, len(training))
        if not wanted:
            return
        self._require_not_driven(plant, {each: known.get(each) for each in wanted}, training)
        hard = self._missed(plant, NEVER, 0.0, training)
        for name in wanted:
            misses = functools.partial(self._missed, plant, name)
            found = tune(baseline(name), training, hard, misses)
            tuned.setdefault(plant, {})[name] = dataclasses.asdict(found)
            self.store.keep_parameters(tuned)
            advance(1)

    def _require_not_driven(
        self, plant: str, known: Mapping[str, Mapping[str, Any] | None], training: Sequence[int]
    ) -> None:
        if not self.store.driven(plant):
            return
        lost = [name for name, each in known.items() if each is None]
        if lost:
            raise InputError(
                f"{self.store.folder}: expected the parameters that {', '.join(lost)} of {plant} "
                "drove with, found none in baselines.json; put the file back, or name another "
                "folder with --out"
            )
        least = min(each["training"] for each in known.values() if each is not None)
        raise InputError(
            f"{self.store.folder}: expected baselines of {plant} tuned on {len(training)} "
            f"scenarios, found ones tuned on {least} that have driven; keep them with --training "
            f"{least}, or name another folder with --out"
        )

    def _missed(self, plant: str, name: str, parameter: float, indices: Sequence[int]) -> list[int]:
        tasks = [
            Task(
                str(self.store.folder), self.manifest, plant, tuple(indices[k : k + _TUNING_PART]),
                ((name, parameter),), name,
            )
            for k in range(0, len(indices), _TUNING_PART)
        ]  # fmt: skip
        return sorted(k for _, found in self.workers.done(missed_part, tasks) for k in found)


def driven_again(store: Store, plant: str, index: int, scenario: SampledScenario) -> list[Row]:
    """One scenario by all of a survey's contenders but baselines that were not tuned."""
    tuned = store.parameters().get(plant, {})
    parameters = {name: each["parameter"] for name, each in tuned.items()}
    names = [name for name in store.manifest().contenders if not is_baseline(name) or name in tuned]
    field = Field(rigs_of(str(store.folder)), parameters)
    return drive_all(index, trial_of(index, scenario, plant), tuple(names), field)


def training_half(count: int, most: int) -> list[int]:
    """Indices the baselines are tuned on: below count, of the half that they are not judged on,
    the first `most` of them; at least one."""
    half = (k for k in itertools.count() if not judged_half(k))
    first = next(half)
    return [first, *itertools.takewhile(lambda k: k < count, half)][:most]


def _scenarios(task: Task) -> list[tuple[int, SampledScenario]]:
    first, last = task.indices[0], task.indices[-1]
    drawn = sampled(range(first, last + 1), task.manifest.seed)
    return [(k, drawn[k - first]) for k in task.indices]


@functools.lru_cache(maxsize=2)
def rigs_of(folder: str) -> dict[float, Rig]:
    """Of a survey's folder, loaded once per process."""
    return Store(Path(folder)).rigs()
