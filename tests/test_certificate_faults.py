"""Each demand of the checker binds: a certificate that misses one by a millionth is not proved."""

from __future__ import annotations

import functools
import itertools
import json
from typing import Any

import casadi as ca
import pytest
from certificate_cases import Document, spread, tube

from workbench.checker.arithmetic import UnprovedError
from workbench.checker.claims import check
from workbench.models import system_from_casadi
from workbench.reach.certified.certificate import spread_certificate, tube_certificate
from workbench.reach.certified.frame_tube import FrameTube
from workbench.sensitivity import Inputs, derive_discrepancy
from workbench.sensitivity.block_growth import BlockGrowth, Effort
from workbench.sensitivity.metric_bounds import Form
from workbench.sets import Box

LESS = 1.0 - 1e-6


@functools.cache
def fast_spin() -> Document:
    """Steps so long that what the exponential's series leaves out counts."""
    x = ca.SX.sym("x", 2)
    system = system_from_casadi(x, ca.vertcat(5 * x[1], -5 * x[0]), ("a", "b"))
    start = Box.around({"a": 1.0, "b": 0.0}, radius={"a": 0.1, "b": 0.1})
    method = FrameTube(step_s=0.12, parts=16, condition_max=1e3)
    return tube_certificate(method.prove(system, initial_set=start, horizon_s=0.24))


@functools.cache
def apart() -> Document:
    """Two states that do not feel each other, one quadratic norm each."""
    x = ca.SX.sym("x", 2)
    system = system_from_casadi(x, ca.vertcat(-x[0], -2 * x[1]), ("a", "b"))
    method = BlockGrowth(
        blocks=(("a",), ("b",)),
        effort=Effort(form=Form.VERTICES, condition_max=10.0, cells=1),
        inputs=Inputs.SHARED,
    )
    region = Box(("a", "b"), (-1.0, -1.0), (1.0, 1.0))
    bound = derive_discrepancy(system, region=region, horizon_s=1.0, method=method)
    return spread_certificate(
        system, bound, initial_radius={"a": 0.1, "b": 0.1}, instants_s=(1.0,), slack=1e-9
    )


def changed(document: Document, path: tuple[Any, ...], value: Any) -> Document:
    copy: Document = json.loads(json.dumps(document))
    place: Any = copy
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return copy


def unproved(document: Document) -> bool:
    try:
        check(json.dumps(document).encode())
    except UnprovedError:
        return True
    return False


@pytest.mark.parametrize("name", ["growth", "max", "sum"])
def test_rates_and_effects_of_inputs_have_no_room(name: str) -> None:
    document = spread(name)
    assert not unproved(document)
    for k, block in enumerate(document["claim"]["blocks"]):
        for j, value in enumerate(block["comparison"]):
            less = value - 1e-6 * abs(value) - 2e-9
            assert unproved(changed(document, ("claim", "blocks", k, "comparison", j), less))
    for i, value in enumerate(document["claim"]["mismatch"]):
        if value:
            assert unproved(changed(document, ("claim", "mismatch", i), value * LESS))


@pytest.mark.parametrize("name", ["growth", "max", "sum", "metric", "blocks"])
def test_widths_have_no_room(name: str) -> None:
    document = spread(name)
    assert not unproved(document)
    for k, instant in enumerate(document["claim"]["instants"]):
        for i, width in enumerate(instant["widths"]):
            path = ("claim", "instants", k, "widths", i)
            assert unproved(changed(document, path, width * LESS))


@pytest.mark.parametrize("name", ["metric", "blocks"])
def test_metric_rates_leave_little_room(name: str) -> None:
    for k, block in enumerate(spread(name)["claim"]["blocks"]):
        rate = block["comparison"][k]
        path = ("claim", "blocks", k, "comparison", k)
        assert unproved(changed(spread(name), path, rate - 1e-2 * (1.0 + abs(rate))))


def test_couplings_and_widths_are_never_negative() -> None:
    assert not unproved(apart())
    assert unproved(changed(apart(), ("claim", "blocks", 0, "comparison", 1), -0.5))
    width = apart()["claim"]["instants"][0]["widths"][0]
    assert unproved(changed(apart(), ("claim", "instants", 0, "widths", 0), -width))


@pytest.mark.parametrize("document", [tube(), fast_spin()], ids=["pendulum", "spin"])
def test_radii_rows_and_sets_have_no_room(document: Document) -> None:
    assert not unproved(document)
    for k, frame in enumerate(document["proof"]["frames"]):
        for i, radius in enumerate(frame["radius"]):
            path = ("proof", "frames", k, "radius", i)
            assert unproved(changed(document, path, radius * LESS))
    for part, i, end in itertools.product(("rows", "instants", "initial"), (0, 1), (0, 1)):
        where: tuple[Any, ...] = (part, i) if part == "initial" else (part, 1, i)
        side = document["claim"][part][i] if part == "initial" else document["claim"][part][1][i]
        inward = 1e-6 * (side[1] - side[0]) * (-1.0 if part == "initial" else 1.0)
        assert unproved(
            changed(document, ("claim", *where, end), side[end] + inward * (1 - 2 * end))
        )


def test_more_disturbance_or_other_gains_are_not_covered() -> None:
    for k, (low, high) in enumerate(tube()["claim"]["ranges"]):
        if high - low > 1e-3:
            assert unproved(changed(tube(), ("claim", "ranges", k, 1), high + 1e-3))


def test_a_priori_boxes_must_hold_the_motion() -> None:
    step, frame = tube()["proof"]["steps"][0], tube()["proof"]["frames"][0]
    still = [[c - 1e-7, c + 1e-7] for c in frame["center"]]
    assert unproved(changed(tube(), ("proof", "steps", 0, "cores"), [still]))
    sets = zip(step["cores"][0], tube()["claim"]["instants"][0], strict=True)
    box = [[min(a[0], b[0]) - 1e-7, max(a[1], b[1]) + 1e-7] for a, b in sets]
    assert unproved(changed(tube(), ("proof", "steps", 0, "box"), box))


def test_an_inverse_is_not_believed() -> None:
    frame = tube()["proof"]["frames"][1]
    smaller = frame | {
        "inverse": [[0.9 * v for v in row] for row in frame["inverse"]],
        "radius": [0.95 * v for v in frame["radius"]],
    }
    assert unproved(changed(tube(), ("proof", "frames", 1), smaller))
