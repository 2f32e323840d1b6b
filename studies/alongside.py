"""A person walks alongside: LookAhead does not stop for them 3 m from the path, FailSafe from a
distance that grows with the speed as the guard grows over the time to stop.

Near standstill the desk's tube, carried as one set, is wider than what runs show; the picture keeps
that apart. The paper's scenario has a person moving parallel to the path, in close proximity, near
the lane; it gives no distance. 3 m is our reading: somebody on a verge beside the lane.
Run with Python (extra `analysis`); an argument names the picture. It fails when the claim does.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.controllers import Track
from workbench.models import PlaneFrame
from workbench.models.vehicle import Vehicle, gem_e2
from workbench.reach import PlaneGround, ReachTube, ValidatedTube, check_separation, compute_tube
from workbench.reach.separation import covered_ground
from workbench.reach.switching.tube import Switched
from workbench.reach.tube import Array
from workbench.runtime import Person
from workbench.runtime.contents import VehicleBody
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import PersonTube, TrackedPerson
from workbench.runtime.policies import BrakeBounds, Timing, fail_safe_horizon_s
from workbench.sensitivity.sampling import rollout, sample_initial_states
from workbench.sets import Box

# Specification
SCENE_M = 3.0
LOOK_AHEAD_S = 3.0
SPEEDS_MPS = (0.5, 1.4, 2.8, 4.0)
TIMING = Timing(period_s=0.1, latency_s=0.05, send_gap_s=1.0 / 30.0)
# The person: walks like most people do; the paper's error of a position, and half a body's width.
WALK_MPS = 1.4
RADIUS_M = 0.5 + 0.3
VELOCITY_RADIUS_MPS = 0.2

# Analysis
STEP_S = 0.1
RUNS = 500
# The sampled runs' own error, by Runge-Kutta steps of the same length; vertices touch the tube.
RUN_ERROR = 1e-4
BISECTIONS = 14
# What the desk may add to the closed form: a guard counts with its size at a segment's end, swept.
DESK_EXCESS_M = 0.25


@dataclass(frozen=True)
class Row:
    """One speed: smallest distances (m) from path to person, and what FailSafe's is made of.

    horizon_s: the time to stop; side_m: farthest of the body from the path, along the fail-safe
    tube; sampled_side_m: the same of sampled runs; track: the tube of LookAhead.
    """

    speed_mps: float
    horizon_s: float
    side_m: float
    sampled_side_m: float
    look_ahead_m: float
    fail_safe_m: float
    track: ReachTube

    def closed_form_m(self, vehicle: Vehicle) -> float:
        """Half width + tube + radius + reach of the guard over the time to stop."""
        return self.side_m + RADIUS_M + reach_m(vehicle, self.horizon_s)


def reach_m(vehicle: Vehicle, time_s: float) -> float:
    """How far to the side a person can get who walked along: q t + a t^2 / 2."""
    return (VELOCITY_RADIUS_MPS + 0.5 * vehicle.guard.accel_max_mps2 * time_s) * time_s


def initial_set(speed_mps: float) -> Box:
    """On the path at this speed, as uncertain as the vehicle file says."""
    radius = dict(zip(gem_e2().initial_set.names, gem_e2().initial_set.radius, strict=True))
    plane = {"station": "x", "offset": "y", "heading_error": "heading"}
    radius = {plane.get(name, name): value for name, value in radius.items()}
    return Box.around({**dict.fromkeys(radius, 0.0), "speed": speed_mps}, radius=radius)


def analyse(vehicle: Vehicle, speed_mps: float) -> Row:
    """Both tubes and both distances at one speed."""
    start, method = initial_set(speed_mps), ValidatedTube(STEP_S)
    loop = vehicle.closed_loop(Track(speed_mps), PlaneFrame())
    track = compute_tube(loop, initial_set=start, horizon_s=LOOK_AHEAD_S, method=method)
    brake = vehicle.brake
    bounds = BrakeBounds(
        deceleration_min_mps2=brake.deceleration_min_mps2,
        delay_s=brake.delay_s,
        build_up_s=brake.build_up_s,
    )
    # The fastest of TRACK until the switch bounds the speed, so nothing is added for acceleration.
    fastest = track.upper[: int(TIMING.switch_s[1] / STEP_S) + 1, track.names.index("speed")].max()
    horizon_s = fail_safe_horizon_s(TIMING, bounds, speed_mps=float(fastest), accel_max_mps2=0.0)
    switched = Switched(
        then=vehicle.closed_loop(brake.mode(), PlaneFrame()).ode,
        between_s=TIMING.switch_s,
        reset={"speed_integral": 0.0, "brake_clock": 0.0},
        method=method,
    )
    stop = compute_tube(loop, initial_set=start, horizon_s=horizon_s, method=switched)
    assert track.complete, track.message
    assert stop.complete, stop.message
    assert stop.upper_at[-1, stop.names.index("speed")] <= 0.0, "the car does not stand in time"
    return Row(
        speed_mps, horizon_s, _side_m(vehicle, stop),
        _sampled_side_m(vehicle, speed_mps, horizon_s),
        _smallest(vehicle, track, lambda d: _expected(track, d)),
        _smallest(vehicle, stop, lambda d: _guarded(vehicle, stop, d)), track,
    )  # fmt: skip


def _body(vehicle: Vehicle) -> VehicleBody:
    g = vehicle.geometry
    return VehicleBody(vehicle.name, g.wheelbase_m, g.front_m, g.rear_m, g.half_width_m)


def _side_m(vehicle: Vehicle, tube: ReachTube) -> float:
    rows = covered_ground(tube, ground=PlaneGround(), body=_body(vehicle))
    _, y, heading, half_length, half_width = rows.T
    reaches = np.abs(y) + half_length * np.abs(np.sin(heading)) + half_width * np.cos(heading)
    return float(reaches.max())


def _sampled_side_m(vehicle: Vehicle, speed_mps: float, horizon_s: float) -> float:
    """Of runs that brake at the last switch, at the brake's mean deceleration."""
    loop = vehicle.closed_loop(Track(speed_mps), PlaneFrame())
    brake = vehicle.closed_loop(vehicle.brake.mode(), PlaneFrame())
    starts = sample_initial_states(initial_set(speed_mps), count=RUNS, seed=1)
    last_s = TIMING.switch_s[1]
    before = rollout(loop, starts, horizon_s=last_s, step_s=last_s / 4.0)
    switched = before[:, -1] * [name != "speed_integral" for name in loop.ode.names]
    switched = np.column_stack([switched, np.zeros(len(starts))])
    rest_s = horizon_s - last_s
    after = rollout(brake, switched, horizon_s=rest_s, step_s=rest_s / 100.0)
    runs = np.concatenate([before, after[..., :-1]], axis=1)
    y, heading = (runs[..., loop.ode.names.index(name)] for name in ("y", "heading"))
    corner = np.abs(y + vehicle.geometry.front_m * np.sin(heading))
    return float((corner + vehicle.geometry.half_width_m * np.cos(heading)).max())


def _meetings(tube: ReachTube, at_s: Sequence[float]) -> list[float]:
    """Where (x at time 0) people start who walk beside rear, middle or front at these times."""
    x = tube.names.index("x")
    found = []
    for time_s in at_s:
        k = min(int(np.searchsorted(tube.times, time_s)), len(tube.times) - 1)
        car = 0.5 * (tube.lower_at[k, x] + tube.upper_at[k, x])
        found += [float(car) + ahead - WALK_MPS * time_s for ahead in (0.0, 0.9, 1.8)]
    return found


def _expected(tube: ReachTube, distance_m: float) -> list[Person | TrackedPerson]:
    """As the paper has it: on they walk, within a disc of constant radius."""
    return [
        Person(f"{x:.1f}", x, distance_m, WALK_MPS, 0.0, RADIUS_M, 0.0, 0.0)
        for x in _meetings(tube, (0.0, 0.5 * LOOK_AHEAD_S, LOOK_AHEAD_S))
    ]


def _guarded(vehicle: Vehicle, tube: ReachTube, distance_m: float) -> list[Person | TrackedPerson]:
    """Anything within the bounds of the vehicle file."""
    limits = MotionLimits(vehicle.guard.speed_max_mps, vehicle.guard.accel_max_mps2)
    velocity = Disc(WALK_MPS, 0.0, VELOCITY_RADIUS_MPS)
    end_s = float(tube.times[-1])

    def tube_from(x: float) -> PersonTube:
        guard = Guard(0.0, Disc(x, distance_m, RADIUS_M), velocity, limits)
        return guard_disc(guard, from_s=0.0, until_s=end_s)

    starts = _meetings(tube, (0.0, 0.5 * end_s, end_s))
    return [TrackedPerson(f"{x:.1f}", (tube_from(x),)) for x in starts]


def _smallest(
    vehicle: Vehicle,
    tube: ReachTube,
    people: Callable[[float], Sequence[Person | TrackedPerson]],
) -> float:
    """Smallest distance, rounded up to a millimetre, at which the tube is SAFE."""
    low, high = 0.0, 12.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        found = check_separation(
            tube, ground=PlaneGround(), body=_body(vehicle), people=people(middle),
            clearance_required_m=0.0,
        )  # fmt: skip
        low, high = (low, middle) if found.verdict.name == "SAFE" else (middle, high)
    return float(np.ceil(high * 1e3) / 1e3)


def check(vehicle: Vehicle, rows: Sequence[Row]) -> str:
    """Assert the claim and return it in words."""
    for row in rows:
        assert row.sampled_side_m <= row.side_m, "sampled runs leave the fail-safe tube"
        assert row.look_ahead_m < SCENE_M, f"LookAhead stops within {row.look_ahead_m} m"
        excess_m = row.fail_safe_m - row.closed_form_m(vehicle)
        assert abs(excess_m) <= DESK_EXCESS_M, f"{row.speed_mps} m/s: off by {excess_m:.3f} m"
    distances = [row.fail_safe_m for row in rows]
    assert distances == sorted(distances), "the distance must grow with the speed"
    # The second route: sampled runs, all vertices of the initial set included, stay inside.
    row = next(row for row in rows if row.speed_mps == vehicle.operation.reference_speed_mps)
    loop = vehicle.closed_loop(Track(row.speed_mps), PlaneFrame())
    starts = sample_initial_states(initial_set(row.speed_mps), count=RUNS, seed=1)
    runs = rollout(loop, starts, horizon_s=LOOK_AHEAD_S, step_s=STEP_S)
    tube = row.track
    outside = np.any(
        (runs < tube.lower_at - RUN_ERROR) | (runs > tube.upper_at + RUN_ERROR), axis=(1, 2)
    ).sum()
    assert outside == 0, f"{outside} of {RUNS} sampled runs leave the tube"
    return (
        f"{tube.rigor.name}: walking alongside, a person does not stop LookAhead from "
        f"{max(row.look_ahead_m for row in rows):.2f} m (scene: {SCENE_M:g} m), FailSafe from "
        + ", ".join(f"{row.fail_safe_m:.2f} m at {row.speed_mps:g} m/s" for row in rows)
        + f"; {RUNS} sampled runs inside"
    )


def _parts(vehicle: Vehicle, rows: Sequence[Row], dense: Array, times: Array) -> dict[str, Array]:
    """What FailSafe's distance is made of; spreads are lines between their points."""
    half_width = vehicle.geometry.half_width_m
    speeds = [row.speed_mps for row in rows]
    side_m = np.interp(dense, speeds, [row.side_m for row in rows])
    sampled_m = np.interp(dense, speeds, [row.sampled_side_m for row in rows])
    return {
        "half width of the car": np.full_like(dense, half_width),
        "lateral spread of sampled runs": sampled_m - half_width,
        "what the tube, as one set, adds": side_m - sampled_m,
        "person: position error and body": np.full_like(dense, RADIUS_M),
        "velocity error × time to stop": VELOCITY_RADIUS_MPS * times,
        "acceleration bound × time to stop² / 2": 0.5 * vehicle.guard.accel_max_mps2 * times**2,
    }


def plot(vehicle: Vehicle, rows: Sequence[Row], file: Path) -> None:
    """Smallest distances over speed, FailSafe's as the sum of what it is made of."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (axes, lower) = pyplot.subplots(
        2, 1, sharex=True, figsize=(7.0, 7.0), height_ratios=(3, 1), layout="constrained"
    )
    speeds = [row.speed_mps for row in rows]
    dense = np.linspace(speeds[0], speeds[-1], 100)
    # The time to stop is linear in the speed.
    times = np.interp(dense, speeds, [row.horizon_s for row in rows])
    parts = _parts(vehicle, rows, dense, times)
    colours = ("#4d4d4d", "#7a7a7a", "#fdd0a2", "#a6a6a6", "#9ecae1", "#deebf7")
    axes.stackplot(dense, *parts.values(), labels=list(parts), colors=colours)
    axes.plot(dense, sum(parts.values()), "k-", linewidth=1.0, label="FailSafe, closed form")
    axes.plot(
        speeds, [row.fail_safe_m for row in rows], "ko", label="FailSafe, desk tubes", zorder=3
    )
    axes.plot(speeds, [row.look_ahead_m for row in rows], "C3s--", label="LookAhead, desk tubes")
    axes.axhline(SCENE_M, color="C3", linewidth=1.0, linestyle=":", label="beside the lane: 3 m")
    axes.set_ylabel("smallest distance path to person (m)")
    axes.set_ylim(bottom=0.0)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], loc="upper left", fontsize="small")
    axes.set_title(
        f"Person alongside at {WALK_MPS:g} m/s, guard {vehicle.guard.accel_max_mps2:g} m/s² "
        f"and {vehicle.guard.speed_max_mps:g} m/s"
    )
    lower.plot(dense, times, "k-")
    lower.set_ylabel("time to stop (s)")
    lower.set_xlabel("speed (m/s)")
    lower.set_xlim(0.0, 4.2)
    lower.set_ylim(bottom=0.0)
    lower.grid(alpha=0.3)
    figure.savefig(file, dpi=150)
    pyplot.close(figure)


def main(picture: Path | None) -> str:
    """Model, analysis, claim, plot."""
    vehicle = gem_e2()
    rows = [analyse(vehicle, speed_mps) for speed_mps in SPEEDS_MPS]
    claim = check(vehicle, rows)
    if picture is not None:
        plot(vehicle, rows, picture)
    return claim


if __name__ == "__main__":
    print(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
