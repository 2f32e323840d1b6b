"""A typed single-assignment view of the instructions of an SX `Function`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.errors import InputError

OPERATION_NAMES: dict[int, str] = {
    getattr(ca, name): name.removeprefix("OP_").lower()
    for name in dir(ca)
    if name.startswith("OP_")
}


@final
@dataclass(frozen=True, slots=True)
class Node:
    """One value of the graph: what computes it and from which earlier nodes.

    name: CasADi's operation name in lower case ("add", "if_else_zero", ...). `constant` is set for
    "const" only, `element` = (input index, nonzero index) for "input" only.
    """

    operation: int
    name: str
    operands: tuple[int, ...]
    constant: float | None = None
    element: tuple[int, int] | None = None


@final
@dataclass(frozen=True, slots=True)
class Graph:
    """All nodes in an order of evaluation; `outputs[j][k]` is the node of nonzero k of output j."""

    nodes: tuple[Node, ...]
    outputs: tuple[tuple[int, ...], ...]


def graph_of(function: ca.Function) -> Graph:
    """Read the instructions of an SX function once; each node is assigned once.

    Equal operations on equal operands become one node: CasADi makes a new one each time that, say,
    sin(heading) is written down.

    Raises InputError when `function` is not an SX function.

    >>> x = ca.SX.sym("x")
    >>> [node.name for node in graph_of(ca.Function("f", [x], [2 + ca.sin(x)])).nodes]
    ['const', 'input', 'sin', 'add']
    """
    if not function.is_a("SXFunction"):
        raise InputError(
            f"expected an SX ca.Function, got {function!r}; build it from SX symbols, or call "
            ".expand()"
        )
    nodes: list[Node] = []
    numbers: dict[Node, int] = {}
    register: dict[int, int] = {}
    outputs = [[-1] * function.nnz_out(j) for j in range(function.n_out())]
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if len(target) > 1 and operation != ca.OP_OUTPUT and operation != ca.OP_INPUT:
            raise InputError(
                f"expected elementary operations, got the call of a function that is not inlined "
                f"in {function.name()!r}; call .expand() on it or drop its option never_inline"
            )
        if operation == ca.OP_OUTPUT:
            outputs[target[0]][target[1]] = register[source[0]]
            continue
        if operation == ca.OP_INPUT:
            node = Node(operation, "input", (), element=(source[0], source[1]))
        elif operation == ca.OP_CONST:
            node = Node(operation, "const", (), constant=function.instruction_constant(k))
        else:
            name = OPERATION_NAMES.get(operation, f"operation {operation}")
            node = Node(operation, name, tuple(register[index] for index in source))
        if node not in numbers:
            numbers[node] = len(nodes)
            nodes.append(node)
        register[target[0]] = numbers[node]
    return Graph(tuple(nodes), tuple(tuple(row) for row in outputs))
