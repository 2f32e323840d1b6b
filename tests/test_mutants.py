"""Mutants are the changes that are listed, each alone, and whatever is a text or a type stays."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from scripts.mutants import mutants_of, row_of, rows_in

RUNTIME = Path(__file__).resolve().parent.parent / "workbench" / "runtime"


def changes(text: str) -> list[tuple[str, str]]:
    return [(each.before, each.after) for each in mutants_of(text)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a < b", [("a < b", "(a <= b)"), ("a < b", "(a >= b)")]),
        ("a == b", [("a == b", "(a != b)")]),
        ("a is not b", [("a is not b", "(a is b)")]),
        ("a - b", [("a - b", "(a + b)")]),
        ("a * b", [("a * b", "(a / b)")]),
        ("a and b", [("a and b", s) for s in ("(a or b)", "(not a and b)", "(a and (not b))")]),
        ("not a", [("not a", "(a)")]),
        ("-a", [("-a", "(a)")]),
        ("min(a, b)", [("min", "max")]),
        ("3", [("3", "4"), ("3", "2")]),
        ("0.5", [("0.5", "1.5"), ("0.5", "(-0.5)")]),
        ("1e6", [("1e6", "2000000.0"), ("1e6", "500000.0")]),
        ("True", [("True", "False")]),
        ("b if a else c", [("a", "(not (a))")]),
        ("'text'", []),
        ("f'{a - 1}'", []),
    ],
)
def test_every_listed_change_of_an_expression_is_made(
    text: str, expected: list[tuple[str, str]]
) -> None:
    assert changes(f"x = {text}\n") == expected


def test_statements_are_dropped_where_something_older_is_left() -> None:
    text = "def f(a: int = 1) -> int:\n    b = a\n    a = b\n    g(a)\n    raise E\n"
    found = [each for each in changes(text) if each[1] == "pass"]
    assert found == [("a = b", "pass"), ("g(a)", "pass"), ("raise E", "pass")]
    assert changes("def f():\n    return a\n") == [("return a", "return None")]


def test_each_mutant_differs_in_its_place_alone_and_is_a_program() -> None:
    text = (RUNTIME / "policies" / "plan.py").read_text()
    found = mutants_of(text)
    assert len({each.key for each in found}) == len(found) > 100
    for each in found:
        ast.parse(each.text)
        assert each.text != text
        before, after = text.splitlines(), each.text.splitlines()
        first, last = each.lines
        assert before[: first - 1] == after[: first - 1]
        assert before[last:] == after[len(after) - len(before) + last :]


def test_a_row_of_the_table_names_its_mutant() -> None:
    (mutant, _) = mutants_of("def f(a, b):\n    return a | b\n")[::-1]
    row = row_of("policies/plan", mutant)
    told = "| `{}` | `{}` | `{}` → `{}` | why |".format(*row)
    assert rows_in(f"text\n{told}\n") == {row}
