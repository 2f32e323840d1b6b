"""The trajectories of a campaign: corners, faces, interior and attacks, with inputs in time."""

from __future__ import annotations

import numpy as np

from workbench.bench.adversary import adversarial_inputs, joined
from workbench.bench.lanes import Inputs
from workbench.bench.random_loops import RandomLoop
from workbench.models.signals import Ranged
from workbench.sensitivity.ascent import gradient_states
from workbench.sensitivity.sampling import (
    face_states,
    parameter_states,
    uniform_states,
    vertex_states,
)
from workbench.sensitivity.vectorised import Array
from workbench.sets import Box

_MOST_VERTICES = 512
_MOST_SWITCHES = 5
_ASCENT_STEPS = 8
_ASCENT_EVERY = 4


def pressing_inputs(loop: RandomLoop, *, count: int, horizon_s: float, seed: int) -> Inputs:
    """`count` rows: attacks (at most a third), all corners of states and parameters together (512
    random ones where there are more, at most a third), then faces and interior in equal shares.

    Attacks are `adversarial_inputs` and the states of `gradient_states`. Elsewhere a third of the
    disturbances is constant at a corner; the others jump between corners, and now and then to
    points between them, at up to five random instants.
    """
    ode = loop.system.ode
    rng = np.random.default_rng(seed)
    box = loop.initial_set.reordered(ode.names)
    attacks = adversarial_inputs(ode, box, horizon_s)
    climbed = gradient_states(
        ode, box, horizon_s=horizon_s, step_s=horizon_s / _ASCENT_STEPS, every=_ASCENT_EVERY,
        seed=seed,
    )  # fmt: skip
    known = parameter_states(ode.parameters, len(climbed), rng)
    first = joined([attacks, _with_disturbance(climbed, known, loop, horizon_s, rng)])
    most = count // 3
    if len(first.states) > most:
        first = first.take(np.sort(rng.choice(len(first.states), size=most, replace=False)))
    both = _with_parameters(box, ode.parameters)
    vertices = vertex_states(both, most=min(_MOST_VERTICES, count // 3), rng=rng)
    others = count - len(first.states) - len(vertices)
    points = np.concatenate([
        vertices,
        face_states(both, others // 2, rng),
        uniform_states(both, others - others // 2, rng),
    ])  # fmt: skip
    states, parameters = np.split(points, [len(ode.states)], axis=1)
    return joined([first, _with_disturbance(states, parameters, loop, horizon_s, rng)])


def _with_parameters(box: Box, parameters: tuple[Ranged, ...]) -> Box:
    """The product of the initial set and the parameters' ranges."""
    return Box(
        (*box.names, *(f"parameter {p.name}" for p in parameters)),
        (*box.lower, *(p.lower for p in parameters)),
        (*box.upper, *(p.upper for p in parameters)),
    )


def _with_disturbance(
    states: Array, parameters: Array, loop: RandomLoop, horizon_s: float, rng: np.random.Generator
) -> Inputs:
    count, ranges = len(states), loop.system.ode.disturbances
    if not any(r.lower < r.upper for r in ranges):
        held = np.tile(np.array([r.nominal for r in ranges]), (count, 1, 1))
        return Inputs(states, parameters, np.zeros((count, 0)), held)
    lower, upper = (np.array([getattr(r, end) for r in ranges]) for end in ("lower", "upper"))
    number = np.where(rng.random(count) < 1 / 3, 0, rng.integers(1, _MOST_SWITCHES + 1, count))
    size = (count, _MOST_SWITCHES + 1, len(ranges))
    corners = np.where(rng.random(size) < 0.5, lower, upper)
    inside = np.clip(lower + rng.random(size) * (upper - lower), lower, upper)
    between = (rng.random(size) < 0.1) & (number > 0)[:, None, None]
    switches = np.sort(rng.uniform(0.0, horizon_s, (count, _MOST_SWITCHES)), axis=1)
    unused = np.arange(_MOST_SWITCHES) >= number[:, None]
    values = np.where(between, inside, corners)
    return Inputs(states, parameters, np.where(unused, np.inf, switches), values)
