"""The checker is small, alone, bounded and strict, and proves B1's bounds in seconds."""

from __future__ import annotations

import ast
import json
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from certificate_cases import spread, tube

import workbench.checker.claims
from workbench.checker.arithmetic import UnprovedError
from workbench.checker.claims import check
from workbench.models.benchmarks import b1
from workbench.reach.certified.certificate import (
    certificate_text,
    spread_certificate,
    tube_certificate,
)
from workbench.reach.certified.frame_tube import FrameTube
from workbench.sensitivity import Inputs, Norm, WeightedNorm, derive_discrepancy
from workbench.sets import Box

FILES = sorted(Path(workbench.checker.__file__).parent.glob("*.py"))


def test_it_is_under_600_lines() -> None:
    lengths = [len(file.read_text(encoding="utf-8").splitlines()) for file in FILES]
    assert sum(lengths) < 600
    assert max(lengths) <= 300


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_it_imports_the_standard_library_only(file: Path) -> None:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            names = [node.module or "."]
            assert node.level == 0
        for name in names:
            assert (
                name.startswith("workbench.checker.")
                or name.split(".")[0] in sys.stdlib_module_names
            )
        if isinstance(node, ast.Name | ast.Attribute):
            called = node.id if isinstance(node, ast.Name) else node.attr
            assert called not in {"__import__", "eval", "exec", "import_module", "sin", "cos"} or (
                file.name == "model.py" and called in {"sin", "cos"}
            )


def mathematical_calls(file: Path) -> set[str]:
    return {
        node.attr
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "math"
    }


def test_it_trusts_no_mathematical_library() -> None:
    exact = {"nextafter", "inf", "nan", "pi", "frexp", "ldexp", "ceil", "floor", "isfinite", "sqrt"}
    for file in FILES:
        assert mathematical_calls(file) <= exact


def test_it_says_the_same_again() -> None:
    data = certificate_text(spread("blocks")).encode()
    assert check(data) == check(data) == spread("blocks")["statement"]


def changed(path: list[Any], value: Any) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(json.dumps(spread("growth")))
    place: Any = document
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return document


FIRST = sum(len(spread("growth")["model"][key]) for key in ("states", "inputs"))
TEXT = certificate_text(spread("growth"))
WRONG = {
    "empty": b"",
    "no JSON": b"certificate",
    "not UTF-8": b'{"format": "\xff\xfe"}',
    "deep": b"[" * 100_000,
    "deep in an object": TEXT.replace('"proof": ', '"proof": ' + "[" * 9).encode(),
    "NaN": TEXT.replace('"horizon_s": 1.5', '"horizon_s": NaN').encode(),
    "infinity": TEXT.replace('"horizon_s": 1.5', '"horizon_s": Infinity').encode(),
    "overflow": TEXT.replace('"horizon_s": 1.5', '"horizon_s": 1e999').encode(),
    "digits": TEXT.replace('"horizon_s": 1.5', '"horizon_s": ' + "9" * 100_000).encode(),
    "twice": TEXT.replace('"horizon_s": 1.5', '"horizon_s": 1.5, "horizon_s": 2.5').encode(),
    "large": b" " * (2**24 + 1),
    "later node": json.dumps(changed(["model", "nodes", 0], ["sin", FIRST + 1])).encode(),
    "own node": json.dumps(changed(["model", "nodes", 0], ["sin", FIRST])).encode(),
    "negative node": json.dumps(changed(["model", "nodes", 0], ["sin", -1])).encode(),
    "half a node": json.dumps(changed(["model", "nodes", 0], ["sin", 0.5])).encode(),
    "no operation": json.dumps(changed(["model", "nodes", 0], ["__class__", 0])).encode(),
    "power 0": json.dumps(changed(["model", "nodes", 0], ["pow", 0, 0])).encode(),
    "strange node": json.dumps(changed(["model", "nodes", 0], [[], {}])).encode(),
    "missing output": json.dumps(changed(["model", "field", 0], 999)).encode(),
    "same name": json.dumps(changed(["model", "states"], ["angle", "angle"])).encode(),
    "other words": json.dumps(changed(["statement"], "It is safe.")).encode(),
    "work": json.dumps(changed(["proof", "splits"], [None] * 190_000)).encode(),
    "nodes": json.dumps(changed(["model", "nodes"], [["constant", 1.0]] * 5000)).encode(),
    "a tree that goes on": json.dumps(changed(["proof", "splits"], [None, None])).encode(),
    "a tree that stops": json.dumps(changed(["proof", "splits"], [])).encode(),
    "a cut outside": json.dumps(
        changed(["proof", "splits"], [{"axis": 0, "at": 9.0}, None, None])
    ).encode(),
    "an instant too late": json.dumps(changed(["claim", "horizon_s"], 1.0)).encode(),
    "range": json.dumps(changed(["claim", "ranges", 0], [])).encode(),
    "UTF-16": TEXT.encode("utf-16"),
    "deep behind half a character": ('{"\u0122": ' + "[" * 100_000).encode("utf-16-le"),
    "functions": json.dumps(
        changed(["model", "nodes"], [["sin", 0]] * 3000)
        | {"proof": {"splits": [{"axis": 0, "at": 0.0}] * 600 + [None] * 601}}
    ).encode(),
    "instants": json.dumps(
        changed(["claim", "instants"], [{"time_s": 1.0, "widths": [9.0, 9.0]}] * 8000)
    ).encode(),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_certificate_is_refused_at_once(name: str) -> None:
    started_s = time.process_time()
    with pytest.raises(ValueError, match=r"\w+"):
        check(WRONG[name])
    assert time.process_time() - started_s < 2.0


def test_a_claim_about_nothing_is_no_certificate() -> None:
    nothing: dict[str, Any] = json.loads(json.dumps(tube()))
    nothing["claim"] |= {"times_s": [], "instants": nothing["claim"]["instants"][:1], "rows": []}
    nothing["proof"] = {"frames": nothing["proof"]["frames"][:1], "steps": []}
    with pytest.raises(ValueError, match="shorter"):
        check(json.dumps(nothing).encode())
    stateless = json.loads(json.dumps(spread("growth")))
    stateless["model"] = {"states": [], "inputs": [], "nodes": [], "field": []}
    with pytest.raises(ValueError, match="too large"):
        check(json.dumps(stateless).encode())


def test_without_docstrings_nothing_is_proved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workbench.checker.claims.spread, "__doc__", None)
    for words in ("", spread("growth")["statement"]):
        with pytest.raises(ValueError, match="something else"):
            check(json.dumps(changed(["statement"], words)).encode())


FALSE: dict[str, tuple[list[Any], Any]] = {
    "widths": (["claim", "instants", 1, "widths", 0], 0.01),
    "comparison": (["claim", "blocks", 0, "comparison", 1], 0.5),
    "mismatch": (["claim", "mismatch", 1], 0.0),
    "wider initial set": (["claim", "initial", 0], 0.2),
    "unknown input": (["claim", "ranges", 0], None),
}


@pytest.mark.parametrize("name", FALSE)
def test_a_false_claim_is_not_proved(name: str) -> None:
    path, value = FALSE[name]
    with pytest.raises(UnprovedError):
        check(json.dumps(changed(path, value)).encode())


def test_a_narrower_row_or_a_larger_initial_set_is_not_proved() -> None:
    for key, part, value in (("rows", 0, 0.2), ("instants", 1, 0.2), ("initial", 0, 0.3)):
        document = json.loads(json.dumps(tube()))
        place = document["claim"][key] if key == "initial" else document["claim"][key][part]
        place[0] = [place[0][0], value] if key == "initial" else [value, place[0][1]]
        with pytest.raises(UnprovedError):
            check(json.dumps(document).encode())


def test_b1_is_checked_in_seconds() -> None:
    loop = b1()
    lower = (-1.0, -1.0, -0.4, 2.0, -0.5, -1.0, -1.0)
    upper = (9.0, 1.0, 0.4, 3.2, 0.5, 1.0, 2.0)
    region = Box(loop.initial_set.names, lower, upper)
    method = WeightedNorm(norm=Norm.MAX, weights=None, cells=256, inputs=Inputs.SHARED)
    bound = derive_discrepancy(loop.system, region=region, horizon_s=3.0, method=method)
    radius = dict(zip(loop.initial_set.names, loop.initial_set.radius, strict=True))
    document = spread_certificate(
        loop.system, bound, initial_radius=radius, instants_s=(1.0, 3.0), slack=1e-9
    )
    proof = FrameTube(step_s=0.02, parts=2, condition_max=1e3).prove(
        loop.system, initial_set=loop.initial_set, horizon_s=0.4
    )
    assert not proof.message
    started_s = time.process_time()
    check(certificate_text(document).encode())
    check(certificate_text(tube_certificate(proof)).encode())
    assert time.process_time() - started_s < 10.0
