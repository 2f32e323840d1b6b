"""Inputs of the majorant, as magnitudes that its series start from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.errors import InputError
from workbench.reach.online.algebras import Magnitudes
from workbench.reach.online.model import OnlineModel
from workbench.reach.online.series import GraphSeries, Terms
from workbench.sensitivity.inclusion import lift

INPUTS = (
    "below", "above", "linear", "rest", "v", "guess", "small", "extra", "jump", "p", "w_mid",
    "slope", "offset",
)  # fmt: skip
"""Names of the majorant's inputs, in order."""


@final
@dataclass(frozen=True, slots=True)
class MajorantInputs:
    """Inputs of the majorant, see `majorant_function`."""

    below: ca.SX
    above: ca.SX
    linear: ca.SX
    rest: ca.SX
    v: ca.SX
    guess: ca.SX
    small: ca.SX
    extra: ca.SX
    jump: ca.SX
    p: ca.SX
    w_mid: ca.SX
    slope: ca.SX
    offset: ca.SX


def majorant_inputs(model: OnlineModel) -> MajorantInputs:
    """Symbols of the right sizes."""
    n, n_k = model.n, model.n_k
    sizes = dict.fromkeys(INPUTS, n) | {
        "v": model.n_v, "p": model.form.p.numel(), "w_mid": model.n_w, "slope": n_k, "offset": n_k,
    }  # fmt: skip
    return MajorantInputs(**{name: ca.SX.sym(name, size) for name, size in sizes.items()})


def seeds_of(
    model: OnlineModel,
    s: MajorantInputs,
    numbers: Magnitudes,
    direction: list[ca.SX] | None,
    v: list[ca.SX] | None,
) -> dict[tuple[int, int], Terms[ca.SX]]:
    """Magnitudes of all inputs, with directions of the states and of the exogenous inputs."""
    n_w, n_k, radii = model.n_w, model.n_k, elements(s.v)
    disturbances = [
        numbers.add(ca.fabs(middle), radius)
        for middle, radius in zip(elements(s.w_mid), radii, strict=False)
    ]
    blocks = [
        elements(ca.fmax(s.below, s.above)), elements(ca.fabs(s.p)), disturbances,
        elements(ca.fabs(s.slope)), elements(ca.fabs(s.offset)), radii[n_w:],
    ]  # fmt: skip
    seeds: dict[tuple[int, int], Terms[ca.SX]] = {
        (i, k): {(0, 0): value} for i, block in enumerate(blocks) for k, value in enumerate(block)
    }
    for k, value in enumerate(direction or []):
        seeds[0, k][0, 1] = value
    if v is not None:
        for k in range(n_w):
            seeds[2, k][0, 1] = v[k]
        for k in range(n_k):
            seeds[5, k][0, 1] = v[n_w + k]
    return seeds


def elements(column: ca.SX) -> list[ca.SX]:
    """The entries of a column."""
    return [column[k] for k in range(column.numel())]


def series_of(
    model: OnlineModel,
    s: MajorantInputs,
    numbers: Magnitudes,
    seeds: dict[tuple[int, int], Terms[ca.SX]],
) -> GraphSeries[ca.SX]:
    """The graph's series in magnitudes from `seeds`."""

    def lower_bound(index: int, _value: ca.SX) -> ca.SX:
        return least_magnitude(model, s, index)

    return GraphSeries(model.graph, numbers, seeds, lower_bound=lower_bound)


def least_magnitude(model: OnlineModel, s: MajorantInputs, index: int) -> ca.SX:
    """A lower bound of |node| over the box, by its natural inclusion function."""
    node = _expression(model, index)
    n_w = model.n_w
    moving = [*model.inputs[3:]]
    if any(ca.depends_on(node, block) for block in moving if block.numel()):
        raise InputError(
            "the online kernel cannot bound a denominator that holds a limited command; divide by "
            "states, disturbances and parameters only"
        )
    radii = [radius * (1 + 2.0**-40) + 2.0**-1000 for radius in elements(s.v)]
    around = ca.vertcat(*radii[:n_w]) if n_w else ca.SX(0, 1)
    gap = ca.vertcat(*radii[n_w:]) if model.n_k else ca.SX(0, 1)
    low = [-s.below, s.p, s.w_mid - around, s.slope, s.offset, -gap]
    high = [s.above, s.p, s.w_mid + around, s.slope, s.offset, gap]
    lifted = lift([node], list(model.inputs), low, high)
    return lifted.valid * ca.fmax(lifted.lower[0], -lifted.upper[0])


def _expression(model: OnlineModel, index: int) -> ca.SX:
    """The node as an expression of the model's inputs."""
    values: list[ca.SX] = []
    for node in model.graph.nodes[: index + 1]:
        operands = [values[k] for k in node.operands]
        if node.element is not None:
            values.append(ca.vec(model.inputs[node.element[0]])[node.element[1]])
        elif node.constant is not None:
            values.append(ca.SX(node.constant))
        elif len(operands) == 1:
            values.append(ca.SX.unary(node.operation, operands[0]))
        else:
            values.append(ca.SX.binary(node.operation, operands[0], operands[1]))
    return values[index]
