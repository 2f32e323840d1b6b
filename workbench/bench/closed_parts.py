"""The smallest part of a field that decides one state, with kinks that stay on one side removed."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from workbench.bench.taylor import TaylorField
from workbench.models.graph import Node
from workbench.sensitivity.vectorised import Index


@final
@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A field of its own.

    states, parameters, disturbances: indices in the whole field of all that the state can depend
    on, the state itself at `position` among the states.
    """

    states: Index
    parameters: Index
    disturbances: Index
    position: int
    field: TaylorField


def closed_part(
    whole: TaylorField, state: int, sides: Mapping[int, bool], absent: Container[int] = ()
) -> Part:
    """The part that decides `state` as long as the kinks in `sides` do not change side.

    sides: node of a kink -> whether its first operand is the smaller one (fmin), the larger one
    (fmax), or negative (fabs); absent: indices of parameters that are 0, as a gain may be.
    """
    zeros = {
        k
        for k, node in enumerate(whole.nodes)
        if node.element is not None and node.element[0] == 1 and node.element[1] in absent
    }
    nodes = [
        replace(node, name="const", operands=(), constant=0.0)
        if node.name == "mul" and zeros.intersection(node.operands)
        else _one_sided(node, sides.get(k))
        for k, node in enumerate(whole.nodes)
    ]
    states = {state}
    while True:
        used = _used(nodes, (whole.outputs[i] for i in states))
        inputs = {element for k in used if (element := nodes[k].element) is not None}
        grown = states | {position for which, position in inputs if which == 0}
        if grown == states:
            break
        states = grown
    members = [
        sorted(states),
        *(sorted(position for which, position in inputs if which == group) for group in (1, 2)),
    ]
    numbers = {k: number for number, k in enumerate(used)}
    kept = tuple(_renumbered(nodes[k], numbers, members) for k in used)
    field = TaylorField(kept, tuple(numbers[whole.outputs[i]] for i in members[0]))
    indices = [np.array(group, dtype=np.intp) for group in members]
    return Part(indices[0], indices[1], indices[2], members[0].index(state), field)


def _one_sided(node: Node, first: bool | None) -> Node:
    if first is None:
        return node
    if node.name == "fabs":
        return replace(node, name="neg" if first else "same")
    return replace(node, name="same", operands=(node.operands[0 if first else 1],))


def _used(nodes: list[Node], outputs: Iterable[int]) -> list[int]:
    """All nodes that the outputs need, in order."""
    needed, waiting = set[int](), list(outputs)
    while waiting:
        k = waiting.pop()
        if k not in needed:
            needed.add(k)
            waiting += nodes[k].operands
    return sorted(needed)


def _renumbered(node: Node, numbers: Mapping[int, int], members: list[list[int]]) -> Node:
    element = node.element
    if element is not None:
        element = (element[0], members[element[0]].index(element[1]))
    return replace(node, operands=tuple(numbers[k] for k in node.operands), element=element)
