"""Evaluate a CasADi SX Function on many points at once, with numpy arrays in place of scalars."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, final

import casadi as ca
import numpy as np
import numpy.typing as npt

from workbench.errors import InputError
from workbench.models.graph import Node, graph_of

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

_BINARY: dict[int, Callable[..., Any]] = {
    ca.OP_ADD: np.add, ca.OP_SUB: np.subtract, ca.OP_MUL: np.multiply, ca.OP_DIV: np.divide,
    ca.OP_POW: np.power, ca.OP_CONSTPOW: np.power, ca.OP_FMIN: np.fmin, ca.OP_FMAX: np.fmax,
    ca.OP_ATAN2: np.arctan2, ca.OP_HYPOT: np.hypot, ca.OP_FMOD: np.fmod,
    ca.OP_COPYSIGN: np.copysign, ca.OP_LT: np.less, ca.OP_LE: np.less_equal, ca.OP_EQ: np.equal,
    ca.OP_NE: np.not_equal, ca.OP_AND: np.logical_and, ca.OP_OR: np.logical_or,
    ca.OP_IF_ELSE_ZERO: lambda condition, value: np.where(condition, value, 0.0),
}  # fmt: skip
_UNARY: dict[int, Callable[..., Any]] = {
    ca.OP_ASSIGN: lambda value: value, ca.OP_NEG: np.negative, ca.OP_EXP: np.exp, ca.OP_LOG: np.log,
    ca.OP_SQRT: np.sqrt, ca.OP_SQ: np.square, ca.OP_TWICE: lambda value: 2.0 * value,
    ca.OP_INV: lambda value: 1.0 / value, ca.OP_SIN: np.sin, ca.OP_COS: np.cos, ca.OP_TAN: np.tan,
    ca.OP_ASIN: np.arcsin, ca.OP_ACOS: np.arccos, ca.OP_ATAN: np.arctan, ca.OP_SINH: np.sinh,
    ca.OP_COSH: np.cosh, ca.OP_TANH: np.tanh, ca.OP_ASINH: np.arcsinh, ca.OP_ACOSH: np.arccosh,
    ca.OP_ATANH: np.arctanh, ca.OP_FABS: np.fabs, ca.OP_SIGN: np.sign, ca.OP_FLOOR: np.floor,
    ca.OP_CEIL: np.ceil, ca.OP_NOT: np.logical_not, ca.OP_LOG1P: np.log1p, ca.OP_EXPM1: np.expm1,
}  # fmt: skip


@final
class Vectorised:
    """An SX Function whose inputs are stacks of points.

    `self(a, b, ...)`: argument k has shape (entries of input k, N) or (entries, 1); the result has
    one array (entries of output j, N) per output, dense outputs flattened by columns as CasADi
    does. The operations are those of the Function, in its order, in numpy's doubles: sums,
    products, quotients, roots, minima and comparisons agree with CasADi's bit for bit, elementary
    functions up to their last bits. Raises InputError on an operation that numpy lacks or on an
    output with structural zeros.
    """

    __slots__ = ("_graph", "_program")

    def __init__(self, function: ca.Function) -> None:
        sparse = [
            function.name_out(j)
            for j in range(function.n_out())
            if not function.sparsity_out(j).is_dense()
        ]
        if sparse:
            raise InputError(
                f"expected dense outputs, got sparse {sparse}; wrap them in casadi.densify"
            )
        self._graph = graph_of(function)
        self._program = [
            (k, _operation(node), node.operands)
            for k, node in enumerate(self._graph.nodes)
            if node.constant is None and node.element is None
        ]

    def __call__(self, *arguments: Array) -> list[Array]:
        """The outputs at every point."""
        count = max((a.shape[1] for a in arguments if a.shape[0]), default=1)
        work: list[Any] = [node.constant for node in self._graph.nodes]
        for k, node in enumerate(self._graph.nodes):
            if node.element is not None:
                work[k] = arguments[node.element[0]][node.element[1]]
        for k, apply, operands in self._program:
            work[k] = apply(*[work[source] for source in operands])
        results = []
        for output in self._graph.outputs:
            result = np.empty((len(output), count))
            for row, k in enumerate(output):
                result[row] = work[k]
            results.append(result)
        return results


def _operation(node: Node) -> Callable[..., Any]:
    apply = _BINARY.get(node.operation) or _UNARY.get(node.operation)
    if apply is None:
        raise InputError(
            f"expected elementary operations, got {node.name!r}; "
            "write it with sums, products and the usual functions"
        )
    return apply


def columns(values: Sequence[float] | Array, count: int) -> Array:
    """Values for all points (m,) or one row per point (count, m), as (m, 1) or (m, count)."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 1:
        return array[:, None]
    if array.shape[0] != count:
        raise InputError(f"expected one row per point ({count}), got {array.shape[0]} rows")
    return np.ascontiguousarray(array.T)
