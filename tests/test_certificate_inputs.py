"""What different inputs add to the rates is shown as tightly as it was derived, and no less."""

from __future__ import annotations

import functools
import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from certificate_cases import Document, rates, spread
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.checker.arithmetic import UnprovedError
from workbench.checker.claims import check
from workbench.cli.certificate import write_certificate
from workbench.models.benchmarks import b2_noise
from workbench.reach.certified.certificate import spread_certificate
from workbench.sensitivity import GrowthMatrix, Inputs, Norm, WeightedNorm, derive_discrepancy
from workbench.sensitivity.discrepancy import DerivationMethod, Discrepancy
from workbench.sets import Box

METHODS: dict[str, DerivationMethod] = {
    "growth": GrowthMatrix(cells=8, inputs=Inputs.SAME_PARAMETERS),
    "max": WeightedNorm(norm=Norm.MAX, weights=None, cells=8, inputs=Inputs.SAME_PARAMETERS),
}


@functools.cache
def noisy(name: str) -> Discrepancy:
    """B2 under estimation errors: each enters a limited command and, beside it, its integral."""
    box = b2_noise().initial_set
    region = Box(box.names, tuple(v - 0.1 for v in box.lower), tuple(v + 0.1 for v in box.upper))
    method = METHODS[name]
    return derive_discrepancy(b2_noise().system, region=region, horizon_s=0.3, method=method)


def accepted(document: Document) -> bool:
    try:
        check(json.dumps(document).encode())
    except UnprovedError:
        return False
    return True


@pytest.mark.parametrize("name", METHODS)
def test_a_noisy_loop_is_certified_with_the_widths_that_were_derived(
    name: str, tmp_path: Path
) -> None:
    start, file = b2_noise().initial_set, tmp_path / "noisy.json"
    radius = dict(zip(start.names, start.radius, strict=True))
    slack = write_certificate(
        file, b2_noise().system, noisy(name), initial_radius=radius, instants_s=(0.3,)
    )
    assert slack == 1e-9
    certified = json.loads(file.read_text(encoding="utf-8"))["claim"]["instants"][0]["widths"]
    assert certified == pytest.approx(noisy(name).radius(radius, 0.3), rel=1e-6)


def test_less_than_what_noise_adds_is_not_shown() -> None:
    document = spread_certificate(
        b2_noise().system, noisy("growth"), initial_radius={}, instants_s=(0.3,), slack=1e-9
    )
    assert accepted(document)
    for i, value in enumerate(document["claim"]["mismatch"]):  # type: ignore[index]
        if value:
            less = json.loads(json.dumps(document))
            less["claim"]["mismatch"][i] = value * (1.0 - 1e-6)
            assert not accepted(less)


def by_inputs(nodes: list[list[Any]], differences: list[float], mismatch: float) -> Document:
    """x' is the last node, a function of the inputs u, v in [-1, 1]."""
    claim = {
        "region": [None], "ranges": [[-1.0, 1.0]] * 2, "differences": differences,
        "horizon_s": 1.0, "norm": "max", "mismatch": [mismatch], "initial": [0.0],
        "blocks": [{"states": [0], "metric": [[1.0]], "comparison": [1e-9]}],
        "instants": [{"time_s": 1.0, "widths": [1.001 * mismatch + 1e-9]}],
    }  # fmt: skip
    model = {"states": ["x"], "inputs": ["u", "v"], "nodes": nodes, "field": [2 + len(nodes)]}
    return spread("max") | {"model": model, "claim": claim, "proof": {"splits": [None]}}


def test_an_input_that_enters_twice_counts_once() -> None:
    half = [["add", 1, 1], ["sub", 3, 1], ["constant", 0.5], ["mul", 4, 5]]
    limited = [["constant", 0.3], ["fmin", 1, 3], ["sub", 1, 4]]
    for nodes, share in ((half, 0.5), (limited, 1.0)):
        assert accepted(by_inputs(nodes, [0.2, 0.0], share * 0.2 * (1 + 1e-9)))
        assert not accepted(by_inputs(nodes, [0.2, 0.0], share * 0.2 * (1 - 1e-9)))


@st.composite
def fields(draw: st.DrawFn) -> list[list[Any]]:
    nodes: list[list[Any]] = [["constant", draw(st.sampled_from([-0.5, 0.25, 2.0]))]]
    for k in range(draw(st.integers(2, 7))):
        name = draw(st.sampled_from(["add", "sub", "mul", "fmin", "fmax", "sin"]))
        operands = st.integers(1, 3 + k)
        nodes.append([name, *(draw(operands) for _ in range(1 if name == "sin" else 2))])
    return nodes


@settings(max_examples=60, deadline=None)
@given(nodes=fields(), apart=st.tuples(*[st.sampled_from([0.0, 0.1, 0.7])] * 2))
def test_no_pair_of_inputs_refutes_what_is_shown(
    nodes: list[list[Any]], apart: tuple[float, float]
) -> None:
    grid = np.array(list(itertools.product(np.linspace(-1.0, 1.0, 21), repeat=2))).T
    model = by_inputs(nodes, [*apart], 1.0)["model"]
    most, still = 0.0, np.zeros((1, grid.shape[1]))
    for signs in itertools.product((-1.0, 0.0, 1.0), repeat=2):
        other = np.clip(grid + np.array(signs)[:, None] * np.array(apart)[:, None], -1.0, 1.0)
        gap = rates(model, still, grid) - rates(model, still, other)
        most = max(most, float(np.abs(gap).max()))
    if most > 1e-6:
        assert not accepted(by_inputs(nodes, [*apart], most * (1.0 - 1e-6)))
