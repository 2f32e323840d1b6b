"""The loop of stopping is TRACK's field in one mode and the vehicle's BRAKE in the other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("casadi", reason="needs the optional package casadi")

import casadi as ca

from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.signals import Ranged, Signal
from workbench.models.stopping import (
    BRAKE_SPEED,
    BRAKING,
    FREE_STEERING,
    INTEGRAL_SHARE,
    INTEGRATING,
    MAY_DISTURB,
    STEERING_SHARE,
    TRACKING,
    stopping_loop,
)
from workbench.models.system import Ode
from workbench.models.vehicle import gem_e2
from workbench.models.vehicle_sections import Uncertainty
from workbench.reach.ranged_parameters import with_ranged_parameters_as_disturbances

Array = NDArray[np.float64]
_COUNT = 2000
_SPEEDS = (-1.0, 4.0)


def _loops() -> tuple[Ode, Ode, Ode]:
    """TRACK, BRAKE, and both in one."""
    vehicle, frame = gem_e2(), PathFrame(-0.5, 0.5)
    track = vehicle.closed_loop(vehicle.track(), frame).ode
    brake = vehicle.closed_loop(vehicle.brake.mode(), frame).ode
    return track, brake, stopping_loop(track, speeds_mps=_SPEEDS)


def _states(chance: np.random.Generator) -> Array:
    """Within and outside of every limit of the commands; at rest, rolling back, about to stand."""
    most = np.array([50.0, 1.4, 0.6, 4.0, 0.6, 3.0, 3.0])
    x: Array = chance.uniform(-most[:, None], most[:, None], (7, _COUNT))
    x[3, ::4] = chance.uniform(0.0, 0.5, x[3, ::4].shape)
    x[3, ::50] = 0.0
    return x


def _steered(share: Array) -> dict[str, Array]:
    """The steering's disturbances while the loop steers."""
    return {STEERING_SHARE: share, INTEGRAL_SHARE: share, FREE_STEERING: np.zeros(1)}


def _rates(ode: Ode, x: Array, p: dict[str, float], w: dict[str, Array]) -> Array:
    parameters = [p.get(q.name, q.nominal) for q in ode.parameters]
    columns = x.shape[1]
    disturbances = [np.broadcast_to(w[d.name], columns) for d in ode.disturbances]
    tiled = np.tile(np.array(parameters)[:, None], columns)
    return np.asarray(ode.function().map(columns)(x, tiled, np.array(disturbances)))


def test_while_tracking_it_is_the_track_loop_whatever_the_brake_does() -> None:
    track, _, loop = _loops()
    chance = np.random.default_rng(1)
    x, curvature = _states(chance), chance.uniform(-0.5, 0.5, _COUNT)
    w = {
        "curvature": curvature,
        BRAKE_SPEED: chance.uniform(*_SPEEDS, _COUNT),
        **_steered(np.ones(1)),
    }
    p = {
        TRACKING: 1.0, BRAKING: 0.0, INTEGRATING: 1.0,
        "reference_speed": 1.7, "acceleration_min": -1.5, "steering_rate_max": 0.3,
    }  # fmt: skip
    expected = _rates(track, x, p, w)
    assert len(np.unique(expected[3])) > 100
    np.testing.assert_allclose(_rates(loop, x, p, w), expected, rtol=1e-14, atol=1e-15)


def test_while_braking_it_is_the_brake_loop_in_all_states_but_the_speed() -> None:
    _, brake, loop = _loops()
    chance = np.random.default_rng(2)
    x, curvature = _states(chance), chance.uniform(-0.5, 0.5, _COUNT)
    moving = np.maximum(x[3], 0.0)
    stop_mps = gem_e2().brake.stop_speed_mps
    share = np.clip(moving / stop_mps - 1.0, 0.0, 1.0)
    assert min((share == 0.0).sum(), (share == 1.0).sum(), ((share > 0) & (share < 1)).sum()) > 30
    clock, d = chance.uniform(0.0, 0.4, _COUNT), chance.uniform(2.0, 3.0, _COUNT)
    w = {
        "curvature": curvature, "brake_deceleration": d,
        BRAKE_SPEED: moving, **_steered(share),
    }  # fmt: skip
    p = {TRACKING: 0.0, BRAKING: 1.0, INTEGRATING: 0.0, "reference_speed": 2.0}
    assert brake.names[:7] == loop.names
    expected = _rates(brake, np.vstack([x, clock]), p, w)[:7]
    got = _rates(loop, x, p, w)
    others = [i for i, name in enumerate(loop.names) if name != "speed"]
    np.testing.assert_allclose(got[others], expected[others], rtol=1e-14, atol=1e-15)
    assert (got[3] == 0.0).all()
    assert (expected[3] < 0.0).any()
    # The state `speed` no longer enters.
    x[3] = chance.uniform(*_SPEEDS, _COUNT)
    np.testing.assert_array_equal(_rates(loop, x, p, w), got)


def test_any_rate_that_brake_gives_the_steering_is_a_free_one() -> None:
    _, brake, loop = _loops()
    chance = np.random.default_rng(5)
    x, curvature = _states(chance), chance.uniform(-0.5, 0.5, _COUNT)
    moving = np.maximum(x[3], 0.0)
    share = np.clip(moving / gem_e2().brake.stop_speed_mps - 1.0, 0.0, 1.0)
    w = {"curvature": curvature, "brake_deceleration": np.full(1, 2.5), BRAKE_SPEED: moving}
    expected = _rates(brake, np.vstack([x, np.zeros(_COUNT)]), {}, w)[:7]
    free = next(d for d in loop.disturbances if d.name == FREE_STEERING)
    assert (free.lower * share - 1e-15 <= expected[2]).all()
    assert (expected[2] <= free.upper * share + 1e-15).all()
    assert np.ptp(expected[2]) > 0.9 * (free.upper - free.lower)
    w |= {STEERING_SHARE: np.zeros(1), INTEGRAL_SHARE: share, FREE_STEERING: expected[2]}
    got = _rates(loop, x, {TRACKING: 0.0, BRAKING: 1.0, INTEGRATING: 0.0}, w)
    others = [i for i, name in enumerate(loop.names) if name != "speed"]
    np.testing.assert_allclose(got[others], expected[others], rtol=1e-14, atol=1e-15)


def test_waiting_for_the_command_it_is_track_with_the_speed_it_is_given() -> None:
    """What the kernel integrates while BRAKE may have been commanded or not."""
    track, _, loop = _loops()
    chance = np.random.default_rng(3)
    x, curvature = _states(chance), chance.uniform(-0.5, 0.5, _COUNT)
    w = {"curvature": curvature, BRAKE_SPEED: x[3].copy(), **_steered(np.ones(1))}
    p = {TRACKING: 0.0, BRAKING: 1.0, INTEGRATING: 1.0}
    expected = _rates(track, x, {}, w)
    expected[3] = 0.0
    x[3] = 0.7
    np.testing.assert_allclose(_rates(loop, x, p, w), expected, rtol=1e-14, atol=1e-15)


def test_new_signals_come_last_and_say_their_ranges() -> None:
    track, _, loop = _loops()
    assert loop.states == track.states
    assert loop.parameters[:-3] == track.parameters
    assert loop.disturbances[:-4] == track.disturbances
    assert [q.name for q in loop.parameters[-3:]] == [TRACKING, BRAKING, INTEGRATING]
    assert [(q.lower, q.upper) for q in loop.parameters[-3:]] == [(0.0, 1.0)] * 3
    speed, share, integral_share, free = loop.disturbances[-4:]
    assert (speed.name, speed.lower, speed.upper) == (BRAKE_SPEED, *_SPEEDS)
    assert (share.name, share.lower, share.upper) == (STEERING_SHARE, 0.0, 1.0)
    assert (integral_share.name, integral_share.lower) == (INTEGRAL_SHARE, 0.0)
    assert (free.name, free.lower, free.upper) == (FREE_STEERING, -0.2, 0.2)
    # As it comes it tracks.
    x = _states(np.random.default_rng(4))
    w = {d.name: np.full(1, d.nominal) for d in loop.disturbances}
    np.testing.assert_allclose(_rates(loop, x, {}, w)[:3], _rates(track, x, {}, w)[:3], rtol=1e-14)


_UNSURE = Uncertainty(0.05, 0.02, 0.1, 0.3, 0.04, 0.05)


def _unsure_loops() -> tuple[Ode, Ode, Ode]:
    """The same with estimation errors, disturbances, an uncertain wheelbase and a reference speed
    that changes."""
    changing = dataclasses.replace(gem_e2().operation, reference_change_mps=(-0.5, 0.7))
    vehicle = dataclasses.replace(gem_e2(), uncertainty=_UNSURE, operation=changing)
    frame = PathFrame(-0.5, 0.5)
    track, brake = (
        with_ranged_parameters_as_disturbances(vehicle.uncertain_loop(mode, frame).ode)
        for mode in (vehicle.track(), vehicle.brake.mode())
    )
    return track, brake, stopping_loop(track, speeds_mps=_SPEEDS)


def _felt(chance: np.random.Generator, ode: Ode) -> dict[str, Array]:
    return {d.name: chance.uniform(d.lower, d.upper, _COUNT) for d in ode.disturbances}


def test_what_disturbs_the_track_loop_disturbs_it_the_same_while_tracking() -> None:
    track, _, loop = _unsure_loops()
    assert {d.name for d in track.disturbances} == MAY_DISTURB
    chance = np.random.default_rng(6)
    x, w = _states(chance), _felt(chance, track)
    more = {BRAKE_SPEED: chance.uniform(*_SPEEDS, _COUNT), **_steered(np.ones(1))}
    p = {TRACKING: 1.0, BRAKING: 0.0, INTEGRATING: 1.0}
    expected = _rates(track, x, p, w)
    calm = {d.name: np.full(1, d.nominal) for d in track.disturbances} | {
        "curvature": w["curvature"]
    }
    assert (np.abs(expected - _rates(track, x, p, calm))[[2, 3, 4, 5, 6]].max(axis=1) > 0.01).all()
    np.testing.assert_allclose(_rates(loop, x, p, w | more), expected, rtol=1e-13, atol=1e-14)


def test_while_braking_the_steering_is_disturbed_as_much_as_ever() -> None:
    """The share that is left of the steering scales what is commanded, not what disturbs it, and
    it follows the speed that is read."""
    _, brake, loop = _unsure_loops()
    chance = np.random.default_rng(7)
    x = _states(chance)
    w = _felt(chance, brake)
    moving = np.maximum(x[3], 0.0)
    stop_mps = gem_e2().brake.stop_speed_mps
    share = np.clip((moving + w["speed_estimate_error"]) / stop_mps - 1.0, 0.0, 1.0)
    assert ((share > 0.0) & (share < 1.0)).sum() > 30
    p = {TRACKING: 0.0, BRAKING: 1.0, INTEGRATING: 0.0}
    expected = _rates(brake, np.vstack([x, np.full(_COUNT, 0.3)]), {}, w)[:7]
    # Nor does BRAKE follow a reference speed.
    changes = {"reference_speed_change": chance.uniform(-0.5, 0.7, _COUNT)}
    got = _rates(loop, x, p, w | changes | {BRAKE_SPEED: moving, **_steered(share)})
    others = [i for i, name in enumerate(loop.names) if name != "speed"]
    np.testing.assert_allclose(got[others], expected[others], rtol=1e-13, atol=1e-14)
    frozen = share == 0.0
    assert frozen.sum() > 100
    np.testing.assert_allclose(got[2, frozen], w["steering_rate_disturbance"][frozen])


def test_a_loop_that_anything_else_disturbs_is_refused() -> None:
    """Bounds on the speed in closed form would miss what it does to the speed."""
    track, _, _ = _loops()
    wind = Ranged("wind", "1/m", 0.0, -0.5, 0.5)
    other = dataclasses.replace(track, disturbances=(wind,))
    with pytest.raises(InputError, match=r"disturb, .* has \['wind'\]"):
        stopping_loop(other, speeds_mps=_SPEEDS)


@pytest.mark.parametrize("name", ["speed", "speed_integral", "steering", "offset_integral"])
def test_a_loop_without_what_brake_changes_is_refused(name: str) -> None:
    track, _, _ = _loops()
    states = tuple(Signal("other", s.unit) if s.name == name else s for s in track.states)
    other = dataclasses.replace(track, states=states)
    with pytest.raises(InputError, match=f"lacks .*'{name}'"):
        stopping_loop(other, speeds_mps=_SPEEDS)


def test_a_loop_of_something_else_is_refused() -> None:
    x = ca.SX.sym("x")
    falls = Ode("falls", (Signal("height", "m"),), (), (), x, ca.SX(0, 1), ca.SX(0, 1), -x)
    with pytest.raises(InputError, match="expected a loop of plant and PIDs, falls lacks"):
        stopping_loop(falls, speeds_mps=_SPEEDS)
