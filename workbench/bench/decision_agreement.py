"""Whether the whole decision has the same bits unoptimised and optimised, on random scenes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.bench.decision_kernel import DecisionCaller, DecisionKernel, compiled_again
from workbench.bench.decision_scenes import random_scenes
from workbench.bench.online_agreement import same_bits

PAUSES: Final = 100


@final
@dataclass(frozen=True, slots=True)
class DecisionAgreement:
    """inputs: random scenes; differing: with any other bit of the result at -O2 than at -O0; safe,
    unproved, invalid: the worse verdict of TRACK and TRACK-then-BRAKE on the deciding level, so
    that all kinds of answers were compared; method, budget: of the kernel."""

    method: str
    budget: int
    inputs: int
    differing: int
    safe: int
    unproved: int
    invalid: int


def decision_agreement(
    kernel: DecisionKernel, *, inputs: int, seed: int, advance: Callable[[], None] = lambda: None
) -> DecisionAgreement:
    """Decide `inputs` random scenes with the kernel and with its text compiled at -O0.

    One in fifty holds a NaN in front of its people.

    `advance` is called after every hundredth of them.
    """
    plain_build = compiled_again(kernel.source, level="-O0")
    callers = DecisionCaller(kernel, plain_build), DecisionCaller(kernel)
    rng = np.random.default_rng(seed)
    pauses = {(k + 1) * inputs // PAUSES for k in range(PAUSES)}
    differing, verdicts = 0, []
    for k, scene in enumerate(random_scenes(inputs, seed=seed)):
        query = kernel.numbers(scene.values)
        if rng.random() < 1 / 50:
            query[rng.integers(kernel.spans(kernel.query)["people_count"].start)] = np.nan
        plain, optimised = (caller(query) for caller in callers)
        differing += not same_bits(plain[None], optimised[None])[0]
        both = (callers[0].field(plain, name) for name in ("track_verdicts", "stop_verdicts"))
        verdicts.append(max(verdict[kernel.sizes.deciding] for verdict in both))
        if k + 1 in pauses:
            advance()
    kinds = [verdicts.count(float(number)) for number in range(3)]
    sizes = kernel.sizes
    return DecisionAgreement(str(sizes.method), sizes.budget, inputs, differing, *kinds)
