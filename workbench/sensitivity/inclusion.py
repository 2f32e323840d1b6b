"""Natural inclusion functions of SX graphs, as SX graphs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.errors import InputError
from workbench.models.continuity import branches_of_sum
from workbench.models.graph import Graph, Node, graph_of
from workbench.sensitivity import elementary, logic
from workbench.sensitivity.intervals import HIGHEST_POWER, SymbolicInterval
from workbench.sensitivity.validity import Validity

_UNARY: dict[str, Callable[[SymbolicInterval], SymbolicInterval]] = {
    "neg": SymbolicInterval.__neg__,
    "sq": SymbolicInterval.square,
    "sqrt": SymbolicInterval.sqrt,
    "fabs": SymbolicInterval.absolute,
    "twice": lambda x: x.scale(2.0),
    "inv": lambda x: 1.0 / x,
    "not": logic.logical_not,
    **{
        name: getattr(elementary, name)
        for name in elementary.__all__
        if name not in ("atan2", "power")
    },
}
_BINARY: dict[str, Callable[[SymbolicInterval, SymbolicInterval], SymbolicInterval]] = {
    "add": SymbolicInterval.__add__,
    "sub": SymbolicInterval.__sub__,
    "mul": SymbolicInterval.__mul__,
    "div": SymbolicInterval.__truediv__,
    "atan2": elementary.atan2,
    "pow": elementary.power,
    "constpow": elementary.power,
    "fmin": SymbolicInterval.minimum,
    "fmax": SymbolicInterval.maximum,
    "lt": logic.less,
    "le": logic.less_equal,
    "eq": logic.equal,
    "ne": logic.not_equal,
    "and": logic.logical_and,
    "or": logic.logical_or,
    "if_else_zero": logic.if_else_zero,
}


@final
@dataclass(frozen=True, slots=True)
class Lifted:
    """Bounds of each expression, in its shape and sparsity, and the flag 1 (valid) or 0."""

    lower: list[ca.SX]
    upper: list[ca.SX]
    valid: ca.SX


def inclusion(function: ca.Function) -> ca.Function:
    """Natural inclusion function of an SX function, as an SX function.

    {f(x) : x_lower <= x <= x_upper} is contained in [y_lower, y_upper] whenever valid is 1, where f
    is taken over the reals and literals of the graph stand for exactly their doubles.
    function: any SX function, of matrices too. Inputs of the result: `<name>_lower`, `<name>_upper`
    for each input; outputs: `<name>_lower`, `<name>_upper` for each output, then `valid`, 1 or 0.
    valid is 0 when an input is not finite or not ordered, when anything overflows, divides by an
    interval with 0, or leaves the domain or bounded range of a function; the bounds then mean
    nothing. Raises InputError, naming it, for an operation without an interval rule.
    Evaluate it with numbers, in MX graphs or as C; inside SX graphs use `lift`, because CasADi
    simplifies an SX function that is called with SX arguments. Rigor ENCLOSED under the premises of
    `intervals`.

    >>> x = ca.SX.sym("x")
    >>> square = inclusion(ca.Function("f", [x], [x * x], ["x"], ["y"]))
    >>> low, high, valid = square(-1, 2)
    >>> float(low), 4.0 <= float(high) < 4.0 + 1e-14, float(valid)
    (0.0, True, 1.0)
    """
    graph = graph_of(function)
    lower = [_symbols(function, i, "lower") for i in range(function.n_in())]
    upper = [_symbols(function, i, "upper") for i in range(function.n_in())]
    lifted = _lift(function, graph, lower, upper, outward=True)
    names_in = [f"{n}_{end}" for n in function.name_in() for end in ("lower", "upper")]
    names_out = [f"{n}_{end}" for n in function.name_out() for end in ("lower", "upper")]
    return ca.Function(
        f"{function.name()}_inclusion",
        _alternating(lower, upper),
        [*_alternating(lifted.lower, lifted.upper), lifted.valid],
        names_in,
        [*names_out, "valid"],
    )


def lift(
    expressions: Sequence[ca.SX],
    symbols: Sequence[ca.SX],
    lower: Sequence[ca.SX],
    upper: Sequence[ca.SX],
    *,
    outward: bool = True,
) -> Lifted:
    """Bounds of SX expressions where `symbols` range over [lower, upper], inside an SX graph.

    expressions: any shapes, sharing their common parts; symbols: SX symbol matrices; lower, upper:
    for each of them its bounds, arbitrary SX expressions of the same shape, checked as in
    `inclusion`; outward: as in `Validity`. A free symbol, unequal shapes or an operation without a
    rule raise InputError.
    """
    if not len(symbols) == len(lower) == len(upper):
        raise InputError(
            f"expected one lower and one upper bound per symbol matrix, got {len(symbols)} symbol "
            f"matrices, {len(lower)} lower and {len(upper)} upper bounds"
        )
    known = {s.element_hash() for block in symbols for s in ca.symvar(block)}
    used: list[ca.SX] = ca.symvar(ca.veccat(*expressions))
    free = [str(symbol) for symbol in used if symbol.element_hash() not in known]
    if free:
        raise InputError(f"the expressions use {free}, which have no bounds; add them to `symbols`")
    function = ca.Function("lifted", list(symbols), list(expressions))
    low = [_fitted(function, i, ca.SX(block)) for i, block in enumerate(lower)]
    high = [_fitted(function, i, ca.SX(block)) for i, block in enumerate(upper)]
    return _lift(function, graph_of(function), low, high, outward=outward)


@final
class FirstInvalid:
    """Names the operation that makes `inclusion` of an SX function invalid on given boxes."""

    __slots__ = ("_flags", "_names")

    def __init__(self, function: ca.Function) -> None:
        graph = graph_of(function)
        lower = [_symbols(function, i, "lower") for i in range(function.n_in())]
        upper = [_symbols(function, i, "upper") for i in range(function.n_in())]
        flags: list[ca.SX] = []
        _lift(function, graph, lower, upper, outward=True, flags=flags)
        self._names = [None if node.element else node.name for node in graph.nodes]
        self._flags = ca.Function("flags", _alternating(lower, upper), [ca.vertcat(*flags)])

    def __call__(self, *ends: ca.DM) -> str | None:
        """The first such operation; ends: the lower and upper end of every input in turn.

        None where all are valid, where an input is not, or where only the outputs overflow.
        """
        flags = self._flags(*ends).full().ravel().tolist()
        return next((n for n, flag in zip(self._names, flags, strict=True) if not flag), None)


def _lift(
    function: ca.Function,
    graph: Graph,
    lower: Sequence[ca.SX],
    upper: Sequence[ca.SX],
    *,
    outward: bool,
    flags: list[ca.SX] | None = None,
) -> Lifted:
    validity = Validity(outward=outward)
    inputs = [
        [
            SymbolicInterval.between(low, high, validity)
            for low, high in zip(below.nonzeros(), above.nonzeros(), strict=True)
        ]
        for below, above in zip(lower, upper, strict=True)
    ]
    values: list[SymbolicInterval] = []
    powers = _powers(graph)
    for node, (base, exponent) in zip(graph.nodes, powers, strict=True):
        if exponent > 1:
            values.append(values[base].power(exponent))
        else:
            values.append(_value(node, graph, values, inputs, validity))
        if flags is not None:
            flags.append(validity.result())
    low_outputs, high_outputs = [], []
    for j, row in enumerate(graph.outputs):
        ends = [values[index].watched() for index in row]
        sparsity = function.sparsity_out(j)
        low_outputs.append(_matrix(sparsity, [end.lower for end in ends]))
        high_outputs.append(_matrix(sparsity, [end.upper for end in ends]))
    return Lifted(low_outputs, high_outputs, validity.result())


def _value(
    node: Node,
    graph: Graph,
    values: Sequence[SymbolicInterval],
    inputs: Sequence[Sequence[SymbolicInterval]],
    validity: Validity,
) -> SymbolicInterval:
    if node.element is not None:
        return inputs[node.element[0]][node.element[1]]
    if node.constant is not None:
        return SymbolicInterval.exactly(node.constant, validity)
    operands = [values[index] for index in node.operands]
    if node.name in _UNARY:
        return _UNARY[node.name](operands[0])
    branches = branches_of_sum(node, graph)
    if branches is not None:
        return logic.if_else(*(values[index] for index in branches))
    if node.name in _BINARY:
        return _BINARY[node.name](operands[0], operands[1])
    raise InputError(
        f"no interval rule for the operation {node.name!r}; rules exist for "
        f"{', '.join(sorted({*_UNARY, *_BINARY}))}: rewrite the model with these"
    )


def _powers(graph: Graph) -> list[tuple[int, int]]:
    """(base node, exponent) of each node; CasADi writes x^5 as x (x^2)^2, which is not tight."""
    powers: list[tuple[int, int]] = []
    for index, node in enumerate(graph.nodes):
        factors = [powers[operand] for operand in node.operands]
        if node.name == "sq":
            factors *= 2
        bases = {base for base, _ in factors}
        exponent = sum(part for _, part in factors)
        known = node.name in ("sq", "mul") and len(bases) == 1 and exponent <= HIGHEST_POWER
        powers.append((bases.pop(), exponent) if known else (index, 1))
    return powers


def _symbols(function: ca.Function, index: int, end: str) -> ca.SX:
    return ca.SX.sym(f"{function.name_in(index)}_{end}", function.sparsity_in(index))


def _fitted(function: ca.Function, index: int, bound: ca.SX) -> ca.SX:
    sparsity = function.sparsity_in(index)
    if bound.shape != sparsity.shape:
        raise InputError(
            f"expected bounds of shape {sparsity.shape} for symbol matrix {index}, "
            f"got {bound.shape}"
        )
    return ca.project(bound, sparsity)


def _matrix(sparsity: ca.Sparsity, elements: Sequence[ca.SX]) -> ca.SX:
    return ca.SX(sparsity, ca.vertcat(*elements) if elements else ca.SX(0, 1))


def _alternating(lower: Sequence[ca.SX], upper: Sequence[ca.SX]) -> list[ca.SX]:
    return [end for pair in zip(lower, upper, strict=True) for end in pair]
