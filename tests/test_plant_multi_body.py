"""The multi-body plant runs the package's own equations, through standstill, starts and stops."""

from __future__ import annotations

import builtins
import math
import random
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from workbench.errors import InputError
from workbench.simulation.plants.chassis import Start
from workbench.simulation.plants.multi_body import (
    MultiBodyChassis,
    gem_e2_multi_body_path,
    multi_body_parameters,
)
from workbench.simulation.plants.traced import multi_body_field

pytest.importorskip("vehiclemodels", reason="extra commonroad")
from vehiclemodels.init_mb import init_mb
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

WHEELBASE_M, LIMIT_RAD = 1.75, 0.6
GEM = multi_body_parameters(gem_e2_multi_body_path(), WHEELBASE_M, LIMIT_RAD)


def car(speed_mps: float = 0.0) -> MultiBodyChassis:
    return MultiBodyChassis(WHEELBASE_M, LIMIT_RAD, start=Start(1.0, -2.0, 0.3, speed_mps))


def drawn_state(source: random.Random, *, creeps: bool) -> list[float]:
    """A state near rolling, with everything moved a little, in the precondition of the trace."""
    speed = source.uniform(0.0, 0.099) if creeps else source.uniform(0.12, 12.0)
    turning = source.uniform(-0.3, 0.3) * speed
    start = [source.uniform(-9.0, 9.0), source.uniform(-9.0, 9.0), source.uniform(-0.65, 0.65),
             speed, source.uniform(-7.0, 7.0), turning, source.uniform(-0.1, 0.1)]  # fmt: skip
    x = [float(value) for value in init_mb(start, GEM)]
    for i in range(5, 29):
        if i in (16, 21, 23, 24, 25, 26):
            x[i] *= source.uniform(0.8, 1.2)
        else:
            x[i] += source.gauss(0.0, 0.03)
    return x


@pytest.mark.parametrize("creeps", [False, True])
@pytest.mark.parametrize("drives", [False, True])
def test_the_traced_field_is_the_package_s_python(creeps: bool, drives: bool) -> None:
    traced = multi_body_field("field", GEM, creeps=creeps, drives=drives)
    source = random.Random(7)
    for _ in range(1500):
        x = drawn_state(source, creeps=creeps)
        least, most = (1e-6, 14.0) if drives else (-14.0, 0.0)
        u = [source.uniform(-1.4, 1.4), source.uniform(least, most)]
        if not drives and source.random() < 0.1:
            u[1] = 0.0
        # The package's function sets wheels that turn backwards to 0 in the list it is given.
        mine, theirs = np.array(traced(x, u)).ravel(), np.array(vehicle_dynamics_mb(x, u, GEM))
        assert np.all(np.abs(mine - theirs) <= 1e-9 * (1.0 + np.abs(theirs)))


def test_it_agrees_with_the_package_s_python_under_an_implicit_integrator() -> None:
    plant = car(2.5)
    x = np.array(init_mb([0.0, 0.0, 0.0, 2.5, 0.3, 0.0, 0.0], GEM), dtype=float)
    x[0] = 1.0 + GEM.b * math.cos(0.3)
    x[1] = -2.0 + GEM.b * math.sin(0.3)
    for acceleration, rate in ((0.4, 0.2), (-0.5, -0.1)):
        plant.advance(acceleration, rate, 0.4)
        x = solve_ivp(
            lambda _t, s, u=(rate, acceleration): vehicle_dynamics_mb(list(s), u, GEM),
            (0.0, 0.4), x, method="LSODA", rtol=1e-8, atol=1e-10,
        ).y[:, -1]  # fmt: skip
    m = plant.motion
    expected = [
        x[0] - GEM.b * math.cos(x[4]), x[1] - GEM.b * math.sin(x[4]), x[4], x[3],
        x[10] - GEM.b * x[5], x[5], x[2],
    ]  # fmt: skip
    found = [m.x_m, m.y_m, m.heading, m.speed_mps, m.lateral_mps, m.yaw_rate_radps,
             m.road_wheel_rad]  # fmt: skip
    # The package switches on the sign of small camber angles, where no integrator is exact.
    assert found == pytest.approx(expected, abs=2e-4)


def test_it_starts_from_rest_without_a_jump() -> None:
    plant = car()
    plant.advance(0.0, 0.2, 1.5)
    before = plant.motion
    assert (before.x_m, before.y_m, before.heading) == pytest.approx((1.0, -2.0, 0.3), abs=1e-12)
    for _ in range(400):
        plant.advance(0.7, 0.0, 0.005)
        now = plant.motion
        gained = now.speed_mps - before.speed_mps
        assert 0.3 * 0.7 * 0.005 < gained < 1.1 * 0.7 * 0.005
        assert abs(now.yaw_rate_radps - before.yaw_rate_radps) < 0.02
        before = now
    assert before.yaw_rate_radps == pytest.approx(
        before.speed_mps * math.tan(0.3) / WHEELBASE_M, rel=0.1
    )


def test_it_creeps_as_a_bicycle_does() -> None:
    plant = car()
    plant.advance(0.0, 0.25, 2.0)
    plant.advance(0.06, 0.0, 1.0)
    begin = plant.motion
    # The package counts the speed of the centre of mass, along its path.
    slip = math.atan(math.tan(0.5) * GEM.b / WHEELBASE_M)
    assert begin.speed_mps == pytest.approx(0.06 * math.cos(slip), rel=1e-6)
    plant.advance(0.0, 0.0, 5.0)
    end, way_m = plant.motion, 5.0 * begin.speed_mps
    turned = way_m * math.tan(0.5) / WHEELBASE_M
    assert end.heading - begin.heading == pytest.approx(turned, rel=1e-6)
    chord_m = math.hypot(end.x_m - begin.x_m, end.y_m - begin.y_m)
    assert chord_m == pytest.approx(2.0 * way_m / turned * math.sin(0.5 * turned), rel=1e-6)
    assert begin.lateral_mps == pytest.approx(0.0, abs=1e-15)


def test_shorter_steps_change_little() -> None:
    ends = []
    for step_s in (0.005, 0.00025):
        plant = car(1.5)
        for acceleration, rate in ((0.5, 0.2), (0.0, -0.2), (-2.0, 0.0)):
            for _ in range(round(0.6 / step_s)):
                plant.advance(acceleration, rate, step_s)
        ends.append(plant.motion)
    coarse, fine = ends
    assert coarse.x_m == pytest.approx(fine.x_m, abs=1e-5)
    assert coarse.y_m == pytest.approx(fine.y_m, abs=1e-5)
    assert coarse.speed_mps == pytest.approx(fine.speed_mps, abs=1e-4)


def test_its_wheels_stop_at_their_limit() -> None:
    plant = car(1.0)
    plant.advance(0.0, 0.5, 2.0)
    assert plant.motion.road_wheel_rad == LIMIT_RAD


@pytest.mark.parametrize("rate", [0.0, 0.2, -0.2])
def test_it_brakes_to_a_rest_that_absorbs(rate: float) -> None:
    plant = car(2.8)
    plant.advance(0.0, rate, 1.0)
    before = plant.motion.speed_mps
    for _ in range(400):
        plant.advance(-2.0, 0.0, 0.005)
        now = plant.motion.speed_mps
        assert 0.0 <= now <= before
        if now > 0.0:
            assert 0.7 * 0.01 < before - now < 1.3 * 0.01
        before = now
    stood = plant.motion
    assert (stood.speed_mps, stood.lateral_mps, stood.yaw_rate_radps) == (0.0, 0.0, 0.0)
    plant.advance(-2.0, 0.1, 2.0)
    later = plant.motion
    assert (later.x_m, later.y_m, later.heading) == (stood.x_m, stood.y_m, stood.heading)


def test_it_turns_to_the_side_to_which_its_wheels_turn() -> None:
    ends = []
    for rate in (0.1, -0.1):
        plant = MultiBodyChassis(WHEELBASE_M, LIMIT_RAD, start=Start(0.0, 0.0, 0.0, 2.8))
        plant.advance(0.0, rate, 2.0)
        ends.append(plant.motion)
    left, right = ends
    assert left.y_m > 0.5
    assert left.heading > 0.2
    # The package's tyres pull a little to one side.
    assert right.y_m == pytest.approx(-left.y_m, abs=0.05)
    assert right.heading == pytest.approx(-left.heading, abs=0.02)


def test_it_is_deterministic() -> None:
    ends = []
    for _ in range(2):
        plant = car(1.0)
        plant.advance(0.3, 0.1, 1.0)
        plant.advance(-1.0, -0.1, 0.4)
        ends.append(plant.motion)
    assert ends[0] == ends[1]


def test_without_the_extra_it_says_which_one(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any, **named: Mapping[str, Any]) -> Any:
        if name.startswith("vehiclemodels"):
            raise ModuleNotFoundError(f"No module named {name!r}", name="vehiclemodels")
        return real(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError, match=r"pip install 'reach-workbench\[commonroad\]'"):
        multi_body_parameters(gem_e2_multi_body_path(), WHEELBASE_M, LIMIT_RAD)


def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="stays finite"):
        car(1.0).advance(math.nan, 0.0, 0.01)
    text = gem_e2_multi_body_path().read_text()
    for old, new, said in (
        ("sprung_kg = 614.0", "sprung_kg = -1.0", "sprung_kg"),
        ("track_m", "track_ft", "track_ft"),
        ("[wheels]", "[whels]", "whels"),
    ):
        path = tmp_path / "car.toml"
        path.write_text(text.replace(old, new))
        with pytest.raises(InputError, match=said):
            multi_body_parameters(path, WHEELBASE_M, LIMIT_RAD)


def test_a_package_that_branches_otherwise_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def other(x: list[Any], u: list[Any], p: Any) -> list[Any]:
        return list(x) if abs(x[3]) < 0.2 else list(u)

    for branch in (other, lambda x, u, p: x if u[1] > 1.0 else u, lambda x, u, p: x[1] < 2.0):
        monkeypatch.setattr("vehiclemodels.vehicle_dynamics_mb.vehicle_dynamics_mb", branch)
        with pytest.raises(InputError, match=r"release 3\.0\.2"):
            multi_body_field("field", GEM, creeps=False, drives=False)
