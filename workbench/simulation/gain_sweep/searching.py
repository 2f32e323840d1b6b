"""Search for gains with Optuna: rounds of points, each drawn from what those before were worth."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, final

from workbench.errors import InputError
from workbench.models.vehicle import Vehicle
from workbench.simulation.gain_sweep.deciding import NOT_DRIVEN, Point, costs, point_of
from workbench.simulation.gain_sweep.gains import GAINS, Gains
from workbench.simulation.gain_sweep.plan import Decision, Plan
from workbench.simulation.gain_sweep.points import held_gains

ROUND: Final = 32
"""Points that are drawn at once, whatever the number of workers: so the same study gives the same
points. Of NSGA-II a generation, of the Parzen estimator those of chance at its beginning."""
_NO_VALUE: Final = 1e6
_OUTSIDE: Final = 1e9
_LACKS: Final = 10.0


def rounds(count: int) -> Iterator[range]:
    """The vehicle's own gains by themselves, then points 1 to count."""
    yield range(1)
    for first in range(1, count + 1, ROUND):
        yield range(first, min(first + ROUND, count + 1))


def worth(point: Point, decision: Decision, names: Sequence[str]) -> list[float]:
    """What the sampler makes small, of each figure its cost.

    After Deb: whatever keeps the bounds comes before what does not, and of two that do not the one
    that misses them by less. A bound is missed by its distance over its size, at most and without
    a value by 10; unstable gains by 1 and by how fast they grow (1/s) besides.
    """
    short = [(point.figures[n], bound, -1.0) for n, bound in decision.at_least.items()]
    short += [(point.figures[n], bound, 1.0) for n, bound in decision.at_most.items()]
    missed = sum(_missed(sign * (value - bound), bound) for value, bound, sign in short)
    if not point.stable:
        missed += 1.0 + max(0.0, -point.figures["decay_per_s"])
    if missed > 0.0:
        return [_OUTSIDE + missed] * len(names)
    return [x if math.isfinite(x) else math.copysign(_NO_VALUE, x) for x in costs(point, names)]


def _missed(over: float, bound: float) -> float:
    """By how much of its size a bound is not kept, 0 where it is."""
    return _LACKS if math.isnan(over) else min(max(over / max(abs(bound), 1e-9), 0.0), _LACKS)


@final
class Search:
    """A sampler of Optuna that is asked for gains and told what they were worth.

    `tpe`, the tree-structured Parzen estimator, makes `choose` alone small; `nsga2` spans the front
    of all that is traded. Figures of drives are left out, since most points do not drive. Raises
    InputError where the extra `study` is missing.
    """

    def __init__(self, plan: Plan, vehicle: Vehicle) -> None:
        self._plan, self._held = plan, held_gains(plan, vehicle)
        self._decision = plan.decision.before_drives()
        one = plan.method == "tpe"
        self._names = (self._decision.choose,) if one else self._decision.trade
        self._study = _study(plan, len(self._names))
        self._asked: list[Any] = []

    def ask(self, count: int) -> list[Gains]:
        """Gains to be scored next, all of which must be told before others are asked for."""
        self._asked = [self._study.ask() for _ in range(count)]
        return [
            self._held
            | {name: trial.suggest_float(name, *self._plan.ranges[name])
               for name in self._plan.varied}
            for trial in self._asked
        ]  # fmt: skip

    def tell(self, rows: Sequence[Sequence[Mapping[str, Any]]]) -> None:
        """The rows of each point asked for, in that order."""
        for trial, each in zip(self._asked, rows, strict=True):
            point = point_of(int(each[0]["point"]), each, self._decision, NOT_DRIVEN)
            self._study.tell(trial, worth(point, self._decision, self._names))

    @staticmethod
    def require_same(asked: Sequence[Gains], stored: Sequence[Mapping[str, Any]]) -> None:
        """Raise InputError where stored points are not those that are asked for."""
        for wanted, row in zip(asked, stored, strict=True):
            if any(wanted[name] != row[name] for name in GAINS):
                raise InputError(
                    f"point {row['point']}: expected the gains that the sampler asks for, got "
                    "others; another version of Optuna has begun this search, so name another "
                    "folder with --out"
                )


def _study(plan: Plan, objectives: int) -> Any:
    try:
        import optuna
    except ImportError as error:
        raise InputError(
            "a search needs the study extra: pip install 'reach-workbench[study]'"
        ) from error
    optuna.logging.set_verbosity(logging.WARNING)
    if plan.method == "tpe":
        sampler = optuna.samplers.TPESampler(
            n_startup_trials=ROUND, seed=plan.seed, constant_liar=True
        )
    else:
        sampler = optuna.samplers.NSGAIISampler(population_size=ROUND, seed=plan.seed)
    return optuna.create_study(directions=["minimize"] * objectives, sampler=sampler)
