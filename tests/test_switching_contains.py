"""One tube holds every run that switches from TRACK to BRAKE at any time of an interval."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hybrid_runs import Array, Phase, switched_runs
from tube_cases import assert_contains, box, dense_times, disturbed, system_of

from workbench.controllers import ReferenceZeroBrake, VehicleBrake
from workbench.controllers.modes import Mode
from workbench.errors import InputError
from workbench.models import ClosedLoop, Ranged, System
from workbench.models.benchmarks import b1, b2
from workbench.reach import Partitioned, ReachTube, TubeStatus, ValidatedTube, compute_tube
from workbench.reach.switching.tube import Switched
from workbench.sensitivity.sampling import sample_initial_states
from workbench.sets import Box

VEHICLE = VehicleBrake(2.0, 3.0, delay_s=0.1, build_up_s=0.1, stop_speed_mps=0.2)
COARSE = ValidatedTube(step_s=0.1)


def braking(mode: Mode) -> ClosedLoop:
    loop = b2().system
    assert isinstance(loop, ClosedLoop)
    return ClosedLoop(loop.plant, loop.controller, mode)


def drawn(system: System, count: int, seed: int) -> Phase:
    """Disturbances at one end of their range for a while, then at the other."""
    rng = np.random.default_rng(seed)
    ode = system.ode
    low, high = (np.array([[getattr(d, end)] for d in ode.disturbances]) for end in ENDS)
    side = rng.integers(0, 2, (len(ode.disturbances), count))

    def draw(rows: int) -> Array:
        nonlocal side
        side = np.where(rng.random(side.shape) < 0.05, 1 - side, side)
        return np.where(side == 1, high, low) if rows else np.zeros((0, count))

    return Phase(system, draw)


ENDS = ("lower", "upper")


def switch_times(between_s: tuple[float, float], count: int) -> Array:
    rng = np.random.default_rng(5)
    ends = rng.choice(between_s, count)
    return np.where(rng.random(count) < 0.3, ends, rng.uniform(*between_s, count))


@pytest.mark.parametrize(
    ("mode", "between_s", "horizon_s"),
    [
        (VEHICLE, (0.2, 0.35), 0.6),
        (VEHICLE, (0.0, 0.08), 0.3),
        (VEHICLE, (0.3, 0.3), 0.5),
        (ReferenceZeroBrake(), (0.1, 0.3), 0.4),
    ],
)
def test_runs_of_the_saturated_loop_stay_inside(
    mode: Mode, between_s: tuple[float, float], horizon_s: float
) -> None:
    track, brake = b2(), braking(mode)
    reset = {n: 0.0 for n in ("speed_integral", "brake_clock") if n in brake.ode.names}
    tube = compute_tube(
        track.system,
        initial_set=track.initial_set,
        horizon_s=horizon_s,
        method=Switched(brake, between_s, reset, COARSE),
    )
    assert tube.complete, tube.message
    assert tube.names == track.system.ode.names
    states = sample_initial_states(track.initial_set, count=3000, seed=3)
    times = np.unique(np.concatenate([dense_times(tube), between_s]))
    runs = switched_runs(
        drawn(track.system, len(states), 1),
        drawn(brake, len(states), 2),
        states=states,
        switch_s=switch_times(between_s, len(states)),
        times=times,
        reset=reset,
    )
    assert_contains(tube, times, runs)


def test_standstill_lasts_and_the_tube_rests_with_it() -> None:
    loop = braking(VEHICLE)
    start = b2().initial_set
    intervals = {n: start.interval(n) for n in start.names}
    intervals |= {"speed": (0.8, 0.9), "brake_clock": (0.0, 0.0)}
    tube = compute_tube(
        loop, initial_set=Box.from_intervals(intervals), horizon_s=4.0, method=COARSE
    )
    assert tube.complete
    moving = [tube.names.index(n) for n in ("x", "y", "steering", "heading", "offset_integral")]
    standing = np.flatnonzero(tube.times >= 0.1 + 0.15 + 0.9 / 2.0)
    ends = tube.upper_at[standing][:, moving] - tube.lower_at[standing][:, moving]
    assert np.all(np.ptp(ends, axis=0) < 1e-9)
    assert tube.upper_at[-1, tube.names.index("speed")] < -6.0
    # Along the path: speed for the delay and half the build-up, then v^2 / (2 d).
    longest = 0.2 + 0.9 * 0.15 + 0.9**2 / 4.0
    shortest = -0.2 + 0.8 * 0.15 + 0.8**2 / 6.0
    assert longest - shortest < ends[0][0] < 1.05 * (longest - shortest)


def exact(tube: ReachTube, low: Array, high: Array, tolerance: float) -> None:
    """The tube encloses [low, high] at its instants and exceeds it by at most `tolerance`."""
    below, above = low - tube.lower_at[:, 0], tube.upper_at[:, 0] - high
    assert np.all(below >= 0.0), below.min()
    assert np.all(above >= 0.0), above.min()
    assert max(below.max(), above.max()) < tolerance


def test_closed_form_of_a_rise_that_turns_into_a_fall() -> None:
    """x' = 1, then x' = -2: x = x0 + s - 2 (t - s) for the switch s."""
    rise, fall = system_of(lambda _: [ca.SX(1)], "x"), system_of(lambda _: [ca.SX(-2)], "x")
    method = Switched(fall, (0.25, 0.75), {}, ValidatedTube(step_s=0.125))
    tube = compute_tube(rise, initial_set=box(x=(0.0, 0.1)), horizon_s=1.5, method=method)
    t = tube.times
    last, first = np.clip(t, None, 0.75), np.clip(t, None, 0.25)
    exact(tube, first - 2 * (t - first), 0.1 + last - 2 * (t - last), 1e-12)


def test_closed_form_of_a_disturbance_on_both_sides_and_a_reset() -> None:
    """|x'| <= 1, then |x'| <= 2 from a reset value on, by an arbitrary function of time."""
    w = (Ranged.symmetric("push", "m/s", 1.0),)
    first = disturbed(lambda _x, _p, w: [w[0]], ("x",), disturbances=w)
    then = disturbed(lambda _x, _p, w: [2 * w[0]], ("x",), disturbances=w)
    method = Switched(then, (0.5, 0.75), {"x": (4.0, 5.0)}, ValidatedTube(step_s=0.0625))
    tube = compute_tube(first, initial_set=box(x=(0.0, 0.0)), horizon_s=1.0, method=method)
    t = tube.times
    low = np.where(t <= 0.75, -t, 4.0 - 2 * (t - 0.5))
    high = np.where(t < 0.5, t, 5.0 + 2 * (t - 0.5))
    low = np.where((t >= 0.5) & (t <= 0.75), np.minimum(low, 4.0 - 2 * (t - 0.5)), low)
    exact(tube, low, high, 1e-9)


def test_an_unknown_constant_is_the_same_on_both_sides() -> None:
    """x' = p, then x' = -p: a switch at half time brings every run back."""
    p = (Ranged("rate", "m/s", 1.0, 0.0, 2.0),)
    there = disturbed(lambda _x, p, _w: [p[0]], ("x",), parameters=p)
    back = disturbed(lambda _x, p, _w: [-p[0]], ("x",), parameters=p)
    method = Switched(back, (0.5, 0.5), {}, ValidatedTube(step_s=0.25))
    tube = compute_tube(there, initial_set=box(x=(0.0, 0.0)), horizon_s=1.0, method=method)
    assert tube.upper_at[2, 0] - tube.lower_at[2, 0] == pytest.approx(1.0)
    assert tube.upper_at[-1, 0] - tube.lower_at[-1, 0] < 1e-12


def test_one_switch_is_narrower_than_either_mode_at_any_time() -> None:
    """Against the inclusion x' = (1 - s) f_track + s f_brake with s(t) in [0, 1] arbitrary."""
    track = b1()
    loop = track.system
    assert isinstance(loop, ClosedLoop)
    brake = ClosedLoop(loop.plant, loop.controller, ReferenceZeroBrake())
    first, then = loop.ode, brake.ode
    mix = ca.SX.sym("mix")
    own = {q.name: first.p[i] for i, q in enumerate(first.parameters)}
    known = [ca.SX(0.0) if q.name == "reference_speed" else own[q.name] for q in then.parameters]
    other = ca.substitute(
        then.field, ca.vertcat(then.x, then.p), ca.vertcat(first.x, ca.vertcat(*known))
    )
    rates = (1 - mix) * first.field + mix * other
    inclusion = type(first)(
        "either", first.states, first.parameters, (Ranged("mix", "1", 0.5, 0.0, 1.0),),
        first.x, first.p, mix, rates,
    )  # fmt: skip
    fine, arguments = ValidatedTube(0.05), {"initial_set": track.initial_set, "horizon_s": 0.8}
    either = compute_tube(inclusion, method=fine, **arguments)
    once = compute_tube(loop, method=Switched(brake, (0.0, 0.8), {}, fine), **arguments)
    assert either.complete
    assert once.complete
    wide, narrow = either.half_width_at()[-1], once.half_width_at()[-1]
    assert either.names == once.names
    assert np.all(narrow <= wide)
    assert narrow[once.names.index("steering")] < 0.5 * wide[once.names.index("steering")]


def test_a_proof_that_fails_in_either_mode_ends_the_tube_there() -> None:
    blow_up, calm = system_of(lambda x: [x**2], "x"), system_of(lambda x: [-x], "x")
    start = box(x=(0.9, 1.1))
    ends = {}
    for name, first, then in (("first", blow_up, calm), ("then", calm, blow_up)):
        method = Switched(then, (1.5, 1.75), {}, COARSE)
        tube = compute_tube(first, initial_set=start, horizon_s=9.0, method=method)
        assert tube.status is TubeStatus.ENCLOSURE_FAILED
        assert len(tube.lower_at) == len(tube.lower) + 1
        ends[name] = tube.times[-1]
    # The first run to blow up starts at 1.1: at 1 / 1.1, or as long after a switch at 1.5.
    assert 0.7 < ends["first"] < 1 / 1.1
    assert 5.3 < ends["then"] < 1.5 + np.exp(1.5) / 1.1


def test_a_region_and_cells_are_respected() -> None:
    rise, fall = system_of(lambda _: [ca.SX(1)], "x"), system_of(lambda _: [ca.SX(-1)], "x")
    inside = ValidatedTube(step_s=0.125, region=box(x=(-1.0, 0.5)))
    start = box(x=(0.0, 0.1))
    tube = compute_tube(
        rise, initial_set=start, horizon_s=2.0, method=Switched(fall, (0.25, 0.5), {}, inside)
    )
    assert tube.status is TubeStatus.LEFT_REGION
    assert tube.upper.max() <= 0.5
    cells = Partitioned(Switched(fall, (0.25, 0.375), {}, inside), {"x": 2})
    assert compute_tube(rise, initial_set=start, horizon_s=1.0, method=cells).complete


def test_a_failure_after_the_switch_says_what_its_times_count() -> None:
    rise, pole = system_of(lambda _: [ca.SX(1)], "x"), system_of(lambda x: [1 / x], "x")
    for between_s, clock in (((0.2, 0.4), "stands for a piece"), ((0.25, 0.25), "from the switch")):
        method = Switched(pole, between_s, {"x": (-1.0, 1.0)}, COARSE)
        tube = compute_tube(rise, initial_set=box(x=(0.0, 0.1)), horizon_s=1.0, method=method)
        assert tube.status is TubeStatus.SINGULAR
        assert clock in tube.message


def test_names_must_mean_the_same_in_both_systems() -> None:
    push = (Ranged.symmetric("push", "m/s", 1.0),)
    pushed = disturbed(lambda _x, _p, w: [w[0]], ("x",), disturbances=push)
    stateful = system_of(lambda x, push: [push, -x], "x", "push")
    foreign, fall = system_of(lambda z: [z], "z"), system_of(lambda _: [ca.SX(-1)], "x")
    elsewhere = ValidatedTube(step_s=0.1, region=box(z=(0.0, 1.0)))
    for then, reset, method, message in (
        (stateful, {"push": 0.0}, COARSE, "both as state"),
        (foreign, {"z": 0.0}, COARSE, "in common"),
        (fall, {}, elsewhere, "region over states"),
    ):
        with pytest.raises(InputError, match=message):
            compute_tube(
                pushed,
                initial_set=box(x=(0.0, 0.1)),
                horizon_s=1.0,
                method=Switched(then, (0.2, 0.4), reset, method),
            )


@pytest.mark.parametrize(
    ("between_s", "reset", "message"),
    [
        ((0.5, 0.2), {}, "0 <= t1 <= t2"),
        ((-0.1, 0.2), {}, "0 <= t1 <= t2"),
        ((0.5, 1.5), {}, "within the horizon"),
        ((0.1, 0.2), {"speed_integral": 0.0}, "brake_clock"),
        ((0.1, 0.2), {"brake_clock": 0.0, "sped": 0.0}, "sped"),
        ((0.1, 0.2), {"brake_clock": (1.0, 0.0)}, "low, high"),
    ],
)
def test_misuse_is_refused(
    between_s: tuple[float, float], reset: dict[str, float], message: str
) -> None:
    start = b2().initial_set
    with pytest.raises(InputError, match=message):
        compute_tube(
            b2().system,
            initial_set=start,
            horizon_s=1.0,
            method=Switched(braking(VEHICLE), between_s, reset, COARSE),
        )
