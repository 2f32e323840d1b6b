"""The set-normalised exponential of a system's own runs, in one object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.models.system import System
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.learning.evidence import APriori
from workbench.sensitivity.learning.exponential import SetExponential
from workbench.sensitivity.learning.learn import learn_from_pairs
from workbench.sensitivity.learning.model_simulator import ModelSimulator
from workbench.sensitivity.learning.simulated_pairs import SimulatedPairs
from workbench.sensitivity.sampling import ordered_box
from workbench.sensitivity.scenario import pairs_needed
from workbench.sets.box import Box


@final
@dataclass(frozen=True, slots=True)
class LearnedExponential:
    """`SetExponential` fitted to `pairs` independent pairs of a system's runs, stated a priori.

    Each pair is one draw of two states (independent, uniform on the box) and of the parameters
    (uniform on their ranges, shared by the two); disturbances stay at their nominal values. pairs,
    seed: the sample; step_s: spacing of the instants; delta: 1 - confidence of the statement.
    Rigor SAMPLED. For other forms, sources and statements: `learn_from_pairs`.
    """

    pairs: int
    seed: int
    step_s: float
    delta: float

    def __post_init__(self) -> None:
        if self.pairs < 1 or not 0.0 < self.delta < 1.0:
            raise InputError(
                "expected pairs >= 1 and 0 < delta < 1, "
                f"got pairs={self.pairs}, delta={self.delta!r}"
            )

    @classmethod
    def promising(
        cls, epsilon: float, *, delta: float, system: System, seed: int, step_s: float
    ) -> LearnedExponential:
        """As many pairs as (epsilon, delta) needs with two fitted parameters per state."""
        parameters = 2 * len(system.ode.states)
        pairs = pairs_needed(epsilon, delta=delta, parameters=parameters)
        return cls(pairs=pairs, seed=seed, step_s=step_s, delta=delta)

    def learn(self, system: System, *, initial_set: Box, horizon_s: float) -> Discrepancy:
        """The envelope of these runs, with its (epsilon, delta)."""
        box = ordered_box(system.ode, initial_set, "initial set")
        simulator = ModelSimulator.of(system, horizon_s=horizon_s, step_s=self.step_s)
        return learn_from_pairs(
            SimulatedPairs(simulator, box, self.seed),
            count=self.pairs,
            form=SetExponential(),
            evidence=[APriori(self.delta)],
            region=box,
        )
