"""Which operations a model may use; everything else is refused when the model is made."""

from __future__ import annotations

import math

import casadi as ca

from workbench.errors import InputError
from workbench.models.graph import Graph, graph_of

SMOOTH = frozenset({
    "add", "sub", "mul", "div", "neg", "inv", "sq", "twice", "sqrt", "sin", "cos", "tan", "asin",
    "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "pow", "constpow",
})  # fmt: skip
KINKS = frozenset({"fmin", "fmax", "fabs"})
BRANCHES = frozenset({"if_else_zero", "lt", "le", "not", "and", "or"})
_LISTED = (
    "+, -, *, /, powers, sqrt, exp, log, sin, cos, tan, asin, acos, atan, atan2, sinh, cosh, tanh, "
    "fabs, fmin, fmax and if_else on <, <=, >, >=, logic_and, logic_or, logic_not"
)


def checked_graph(function: ca.Function, where: str) -> Graph:
    """The graph of a model's function, after checking its operations and constants.

    where: what the function is, for the message. Raises InputError naming an operation without
    proved bounds and derivatives, or a constant that is not finite.
    """
    graph = graph_of(function)
    for node in graph.nodes:
        if node.constant is not None:
            if not math.isfinite(node.constant):
                raise InputError(
                    f"{where}: expected finite constants, got {node.constant}; CasADi folds "
                    "constants while an expression is built: look for a division by 0 or an "
                    "overflow"
                )
        elif node.element is None and node.name not in SMOOTH | KINKS | BRANCHES:
            raise InputError(
                f"{where}: the operation {node.name!r} has no proved bounds; supported are "
                f"{_LISTED}: rewrite the model with these"
            )
    return graph
