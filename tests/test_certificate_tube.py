"""The moving-frame tube holds sampled runs, and the checker accepts its certificate."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from certificate_cases import tube_holds

from workbench.checker.claims import check
from workbench.errors import InputError
from workbench.models import system_from_casadi
from workbench.models.benchmarks import Benchmark, b1, b1_small, b2, b2_noise
from workbench.reach import TubeStatus
from workbench.reach.certified.certificate import certificate_text, tube_certificate
from workbench.reach.certified.frame_tube import FrameTube
from workbench.sets import Box

METHOD = FrameTube(step_s=0.02, parts=2, condition_max=1e3)


def scaled(loop: Benchmark, share: float) -> Box:
    start = loop.initial_set
    radius = {n: r * share for n, r in zip(start.names, start.radius, strict=True)}
    return Box.around(dict(zip(start.names, start.center, strict=True)), radius=radius)


@pytest.mark.parametrize(
    ("loop", "share", "horizon_s"),
    [(b1(), 1.0, 0.5), (b1_small(), 1.0, 0.5), (b2(), 0.1, 0.5), (b2_noise(), 0.1, 0.2)],
    ids=["b1", "b1-small", "b2", "b2-noise"],
)
def test_benchmark_tubes_hold_runs_and_are_proved(
    loop: Benchmark, share: float, horizon_s: float
) -> None:
    proof = METHOD.prove(loop.system, initial_set=scaled(loop, share), horizon_s=horizon_s)
    assert proof.tube().status is TubeStatus.COMPLETE
    document = tube_certificate(proof)
    assert tube_holds(document)
    assert check(certificate_text(document).encode()) == document["statement"]


def test_a_linear_tube_is_the_exact_one() -> None:
    x = ca.SX.sym("x", 2)
    spin = system_from_casadi(x, ca.vertcat(x[1], -x[0]), ("a", "b"))
    start = Box.around({"a": 1.0, "b": 0.0}, radius={"a": 0.1, "b": 0.2})
    method = FrameTube(step_s=0.02, parts=8, condition_max=1e3)
    tube = method.tube(spin, initial_set=start, horizon_s=3.0)
    cos, sin = np.abs(np.cos(tube.times)), np.abs(np.sin(tube.times))
    exact = np.stack([0.1 * cos + 0.2 * sin, 0.1 * sin + 0.2 * cos], axis=1)
    assert np.all(tube.half_width_at() >= exact)
    assert np.all(tube.half_width_at() <= exact + 1e-5)


def test_a_step_too_coarse_ends_the_proof_as_a_value() -> None:
    x = ca.SX.sym("x")
    tube = FrameTube(step_s=0.5, parts=1, condition_max=10.0).tube(
        system_from_casadi(x, x**2, ("x",)),
        initial_set=Box.around({"x": 1.0}, radius={"x": 0.3}),
        horizon_s=2.0,
    )
    assert tube.status is TubeStatus.ENCLOSURE_FAILED
    assert tube.times[-1] < 0.77
    assert "shorter step" in tube.message


def test_wrong_settings_are_refused() -> None:
    for wrong in ((0.0, 1, 10.0), (0.1, 0, 10.0), (0.1, 1, 0.5)):
        with pytest.raises(InputError):
            FrameTube(*wrong)
