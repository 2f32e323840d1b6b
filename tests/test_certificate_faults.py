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
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode
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


def pushed(words: dict[str, Any]) -> Document:
    """x' = min(1e308 1e308 u, 1) with u the least double > 0, so that x' = 1."""
    frames = [{"center": [0], "frame": [[1]], "inverse": [[1]], "radius": [r]} for r in (1e-3, 0.1)]
    nodes = [["constant", 1e308], ["mul", 1, 2], ["mul", 3, 2], ["constant", 1], ["fmin", 4, 5]]
    least = 5e-324
    return tube() | {
        "model": {"states": ["x"], "inputs": ["u"], "nodes": nodes, "field": [6]},
        "claim": {
            "initial": [[-1e-4, 1e-4]], "ranges": [[least, least]], "times_s": [0, 1],
            "instants": [[[-0.2, 0.2]]] * 2, "rows": [[[-0.2, 0.2]]],
        } | words,
        "proof": {"frames": frames, "steps": [{"box": [[-2, 2]], "cores": [[[-1e-3, 1e-3]]]}]},
    }  # fmt: skip


def test_a_middle_is_never_outside_its_range() -> None:
    """Half of the least double rounds to 0, where this field is another one."""
    assert unproved(pushed({}))
    assert not unproved(pushed({"ranges": [[0.0, 0.0]]}))

    x, p, w = ca.SX.sym("x"), ca.SX.sym("p"), ca.SX.sym("w")
    gain, push = (
        Ranged("gain", "1", 1e300, 1e300, 1e300),
        Ranged("w", "m/s", 5e-324, 5e-324, 5e-324),
    )
    field = ca.fmin(w * p * p, 1)
    system = Ode("pushed", (Signal("x", "m"),), (gain,), (push,), x, p, w, field)
    start = Box.around({"x": 0.0}, radius={"x": 1e-3})
    tube_of = FrameTube(step_s=0.1, parts=1, condition_max=10.0).tube
    found = tube_of(system, initial_set=start, horizon_s=0.1)
    assert found.complete
    assert found.upper_at[-1, 0] >= 0.1


def test_what_inputs_do_is_taken_at_its_worst_corner() -> None:
    """Against the metric's long axis, sqrt(m' P m) is less than what inputs within m can do."""
    shape = [[1.0, -0.9], [-0.9, 1.0]]
    ends, field = [[-1.0, 1.0]] * 2, [2, 3]
    still = {"states": [0, 1], "metric": shape, "comparison": [1e-6]}
    claim = {
        "region": [None, None], "ranges": ends, "differences": [1.0, 1.0], "horizon_s": 1.0,
        "norm": "quadratic", "blocks": [still], "mismatch": [1.0, 1.0], "initial": [0.0, 0.0],
    }  # fmt: skip
    model = {"states": ["a", "b"], "inputs": ["u", "v"], "nodes": [], "field": field}
    # One state's share of a distance s is s / sqrt(0.19); the largest is sqrt(3.8), for (1, -1).
    for root, proved in ((0.2**0.5, False), (3.79**0.5, False), (3.81**0.5, True)):
        instants = [{"time_s": 1.0, "widths": [root / 0.19**0.5] * 2}]
        document = spread("metric") | {
            "model": model,
            "claim": claim | {"instants": instants},
            "proof": {"splits": [None]},
        }
        assert unproved(document) is not proved


def test_an_inverse_is_not_believed() -> None:
    frame = tube()["proof"]["frames"][1]
    smaller = frame | {
        "inverse": [[0.9 * v for v in row] for row in frame["inverse"]],
        "radius": [0.95 * v for v in frame["radius"]],
    }
    assert unproved(changed(tube(), ("proof", "frames", 1), smaller))
