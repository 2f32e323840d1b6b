"""Who drives in a survey: the policies of the monitor, baselines, and a car that never brakes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime import Deciding
from workbench.simulation.campaign.baselines import BASELINES, baseline, judge_of
from workbench.simulation.campaign.scripted_judges import NeverBrakes
from workbench.simulation.rig import MakeJudge, Rig

NEVER: Final = "never brakes"
LONG: Final = "LookAhead 5 s"
"""Whose tubes take several times as long to compute as those of all others."""
_MONITORS: Final[Mapping[str, tuple[float, Deciding]]] = {
    "LookAhead 3 s": (3.0, Deciding.LOOK_AHEAD),
    LONG: (5.0, Deciding.LOOK_AHEAD),
    "FailSafe": (3.0, Deciding.FAIL_SAFE),
    "both": (3.0, Deciding.BOTH),
}
_FIRST_S: Final = 3.0
CONTENDERS: Final = (*_MONITORS, *(each.name for each in BASELINES), NEVER)


@final
@dataclass(frozen=True, slots=True)
class Field:
    """Everything a contender is made of: rigs by the horizon (s) of `LookAhead`, and the baselines'
    parameters by name."""

    rigs: Mapping[float, Rig]
    parameters: Mapping[str, float]

    def contender(self, name: str) -> tuple[Rig, MakeJudge]:
        """The rig it drives on and its judge; raises InputError for an unknown name and for a
        baseline without a parameter."""
        rig = self.rigs[_FIRST_S]
        if name in _MONITORS:
            horizon_s, deciding = _MONITORS[name]
            rig = self.rigs[horizon_s]
            return rig, rig.monitor(deciding)
        if name == NEVER:
            return rig, lambda _path, _clock: NeverBrakes()
        rule = baseline(name)
        if name not in self.parameters:
            raise InputError(f"{name}: expected a parameter in {rule.unit}, got none; tune it")
        return rig, judge_of(rule, self.parameters[name], rig.vehicle)


def is_baseline(name: str) -> bool:
    """Whether it has a parameter to be tuned."""
    return any(each.name == name for each in BASELINES)


def judged_half(index: int) -> bool:
    """Whether an index is none of those that baselines may be tuned on.

    By a hash, so that both halves have the same scenarios: whatever is linear in the bits of the
    index, such as odd and even, may be the first digit of a coordinate of the Sobol sequence.
    """
    return hashlib.sha256(str(index).encode()).digest()[0] % 2 == 1


def judged(name: str, index: int) -> bool:
    """Whether a contender's drive of a scenario counts."""
    return judged_half(index) or not is_baseline(name)


def proves(name: str) -> bool:
    """Whether its verdicts are the monitor's; others have none."""
    return name in _MONITORS


def horizons_s(contenders: Sequence[str]) -> tuple[float, ...]:
    """Horizons (s) of `LookAhead` for which they need bundles; the shortest is for everybody."""
    needed = {_MONITORS[name][0] for name in contenders if name in _MONITORS}
    return tuple(sorted({_FIRST_S, *needed}))
