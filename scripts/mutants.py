"""Small changes of a module's text, each of which a test that means what it says must notice."""

from __future__ import annotations

import ast
import copy
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, final

_EDGES: Final[dict[type, tuple[type, ...]]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
_OPERATORS: Final[dict[type, type]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
}
_CALLS: Final = {"min": "max", "max": "min", "any": "all", "all": "any"}
# Texts, what only a type checker reads and how a value prints move no car.
_UNTOUCHED: Final = {"annotation", "returns", "decorator_list", "type_params"}
_FUNCTIONS: Final = (ast.FunctionDef, ast.AsyncFunctionDef)


@final
@dataclass(frozen=True, slots=True)
class Mutant:
    """One change. place: qualified name of the function or class around it, with a number where
    the same change is made again in it; lines: first and last line that it stands on; before,
    after: the changed text in one line; text: the whole module."""

    place: str
    lines: tuple[int, int]
    before: str
    after: str
    text: str

    @property
    def key(self) -> tuple[str, str, str]:
        """What names it when lines move."""
        return self.place, self.before, self.after


def mutants_of(text: str) -> tuple[Mutant, ...]:
    """All changes of a module's text, one at a time, in the order of the text.

    A comparison: its edge moves, its sense turns round. `+ - * / // % ** & | ^ << >>`: another
    operator. `and`, `or`, `min`, `max`, `any`, `all`: the other one. `not` and signs: dropped.
    Conditions that are no comparison: negated. Numbers: one more, one less (floats above 100:
    twice, half); True and False: the other one. A returned value, if it is no constant that is
    false: None. Calls, raises, yields, assignments to what exists already, `continue` and `break`:
    dropped. Texts, types, decorators and imports stay.
    """
    places, met = _Places(text), Counter[tuple[str, str, str]]()
    found = []
    for where, node, afters in _walked(ast.parse(text), "", frozenset()):
        for mutant in (places.mutant(where, node, after) for after in afters):
            met[mutant.key] += 1
            again = f" ({met[mutant.key]})" if met[mutant.key] > 1 else ""
            found.append(replace(mutant, place=f"{mutant.place}{again}"))
    return tuple(found)


def rows_in(table: str) -> set[tuple[str, str, str, str]]:
    """(module, place, before, after) of every row of a table or a report."""
    return set(re.findall(r"\| `([^`]+)` \| `([^`]+)` \| `([^`]+)` → `([^`]+)` \|", table))


def row_of(module: str, mutant: Mutant) -> tuple[str, str, str, str]:
    """A table's cell holds no bar."""
    place, before, after = (each.replace("|", "¦") for each in mutant.key)
    return module, place, before, after


@final
class _Places:
    """Where the nodes of a text stand in it."""

    def __init__(self, text: str) -> None:
        self._bytes = text.encode()
        starts = [0]
        for line in self._bytes.splitlines(keepends=True):
            starts.append(starts[-1] + len(line))
        self._starts = starts

    def mutant(self, where: str, node: ast.expr | ast.stmt, after: str) -> Mutant:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        begin = self._starts[node.lineno - 1] + node.col_offset
        end = self._starts[node.end_lineno - 1] + node.end_col_offset
        text = self._bytes[:begin] + after.encode() + self._bytes[end:]
        before = " ".join(self._bytes[begin:end].decode().split())
        said = " ".join(after.split())
        return Mutant(
            where or "module", (node.lineno, node.end_lineno), before, said, text.decode()
        )


_Change = tuple[str, ast.expr | ast.stmt, tuple[str, ...]]


def _walked(node: ast.AST, where: str, bound: frozenset[str]) -> Iterator[_Change]:
    """Every node that can be changed, with what it can become."""
    if isinstance(node, (*_FUNCTIONS, ast.ClassDef)):
        where = f"{where}.{node.name}" if where else node.name
        bound = _bound_again(node) if isinstance(node, _FUNCTIONS) else frozenset()
    if isinstance(node, ast.JoinedStr) or _skipped(node):
        return
    if isinstance(node, ast.expr | ast.stmt):
        afters = (*_expression(node), *_statement(node, bound), *_negated(node))
        if afters:
            yield where, node, afters
    tests: list[ast.expr] = []
    if isinstance(node, ast.If | ast.IfExp | ast.While):
        tests = [node.test]
    elif isinstance(node, ast.comprehension):
        tests = node.ifs
    for test in filter(_plain, tests):
        yield where, test, (f"(not ({ast.unparse(test)}))",)
    for name, value in ast.iter_fields(node):
        if name not in _UNTOUCHED:
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from _walked(child, where, bound)


def _skipped(node: ast.AST) -> bool:
    if isinstance(node, ast.If):
        return isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
    if isinstance(node, ast.keyword):
        return node.arg == "repr"
    if isinstance(node, ast.Assign):
        return any(isinstance(each, ast.Name) and each.id == "__all__" for each in node.targets)
    return isinstance(node, ast.Import | ast.ImportFrom)


def _expression(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Compare):
        for k, operator in enumerate(node.ops):
            for other in _EDGES[type(operator)]:
                changed = copy.deepcopy(node)
                changed.ops[k] = other()
                yield f"({ast.unparse(changed)})"
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        changed_op = copy.deepcopy(node)
        changed_op.op = _OPERATORS[type(node.op)]()
        yield f"({ast.unparse(changed_op)})"
    elif isinstance(node, ast.BoolOp):
        changed_bool = copy.deepcopy(node)
        changed_bool.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield f"({ast.unparse(changed_bool)})"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield f"({ast.unparse(node.operand)})"
    elif isinstance(node, ast.Name) and node.id in _CALLS:
        yield _CALLS[node.id]
    elif isinstance(node, ast.Constant):
        yield from _number(node.value)


def _number(value: object) -> Iterator[str]:
    if isinstance(value, bool):
        yield repr(not value)
    elif isinstance(value, int | float):
        # One more or less of a large float is next to nothing.
        large = isinstance(value, float) and value > 100.0
        more, less = (2.0 * value, 0.5 * value) if large else (value + 1, value - 1)
        yield from (repr(more), repr(less) if less >= 0 else f"({less!r})")


def _statement(node: ast.AST, bound: frozenset[str]) -> Iterator[str]:
    if isinstance(node, ast.Return):
        # None is no less false than a constant that is false.
        constant = isinstance(node.value, ast.Constant) and not node.value.value
        if node.value is not None and not constant:
            yield "return None"
    elif isinstance(node, ast.Expr):
        if not isinstance(node.value, ast.Constant):
            yield "pass"
    elif isinstance(node, ast.AugAssign | ast.Raise | ast.Continue | ast.Break) or (
        isinstance(node, ast.Assign) and all(_again(each, bound) for each in node.targets)
    ):
        yield "pass"


def _negated(node: ast.AST) -> Iterator[str]:
    """A part of `and` or `or` that is a plain value is negated within it."""
    if isinstance(node, ast.BoolOp):
        for k, part in enumerate(node.values):
            if _plain(part):
                changed = copy.deepcopy(node)
                changed.values[k] = ast.UnaryOp(ast.Not(), part)
                yield f"({ast.unparse(changed)})"


def _plain(test: ast.AST | None) -> bool:
    return isinstance(test, ast.Name | ast.Attribute | ast.Call | ast.Subscript)


def _again(target: ast.expr, bound: frozenset[str]) -> bool:
    """Whether leaving out an assignment leaves an older value rather than none."""
    if isinstance(target, ast.Tuple):
        return all(_again(each, bound) for each in target.elts)
    if isinstance(target, ast.Name):
        return target.id in bound
    return True


def _bound_again(function: ast.FunctionDef | ast.AsyncFunctionDef) -> frozenset[str]:
    every = function.args
    names = [each.arg for each in (*every.posonlyargs, *every.args, *every.kwonlyargs)]
    for node in ast.walk(function):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.append(node.id)
    return frozenset(name for name in names if names.count(name) > 1)
