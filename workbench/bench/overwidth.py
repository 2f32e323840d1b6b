"""How much smaller the proved clearance from a person is than the true one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import final

import numpy as np

from workbench.bench.text import table
from workbench.models.vehicle import gem_e2
from workbench.reach.occupancy import occupancy_function
from workbench.reach.person_clearance import nearest_people
from workbench.reach.tube import Array
from workbench.runtime.contents import VehicleBody
from workbench.runtime.layout import KernelCause
from workbench.runtime.person_tubes import DiscPiece, PersonTube, TrackedPerson, TubeKind

_SPEED_MPS = 2.8
_GRID = np.linspace(-1.0, 1.0, 5)
_INSTANTS = 9
_OCCUPANCY = cache(occupancy_function)


@final
@dataclass(frozen=True, slots=True)
class Setting:
    """One segment of a tube: half_width_m along and across the path, heading_rad half the spread of
    the heading, segment_s its length, skew_s half the clock's uncertainty."""

    half_width_m: float
    heading_rad: float
    segment_s: float
    skew_s: float


@final
@dataclass(frozen=True, slots=True)
class Overwidth:
    """True clearance minus proved clearance in m, over random people near the car.

    over_set: car and person each anywhere in their sets of the segment, at any times of it; what
    the rectangle and the gap add to the sets. over_motion: car and person at the same instant, the
    car driving at 2.8 m/s; what the segment adds as well. True clearances are sampled, so each
    figure is at most too large. beyond: people whose proved clearance exceeds a sampled one: must
    be 0.
    """

    setting: Setting
    people: int
    over_set_mean_m: float
    over_set_worst_m: float
    over_motion_mean_m: float
    over_motion_worst_m: float
    beyond: int


_BASE = Setting(0.1, 0.02, 0.05, 0.0)
SETTINGS = (
    Setting(0.0, 0.0, 0.05, 0.0),
    _BASE,
    *(replace(_BASE, half_width_m=width) for width in (0.0, 0.3, 1.0)),
    *(replace(_BASE, heading_rad=spread) for spread in (0.0, 0.05, 0.2)),
    *(replace(_BASE, segment_s=length) for length in (0.01, 0.1, 0.2)),
    replace(_BASE, skew_s=0.05),
)


def overwidth(setting: Setting, *, people: int = 200, seed: int = 7) -> Overwidth:
    """Measure one setting: `people` random discs, 0.2 to 4 m from the body, walking up to 2 m/s,
    radius 0.3 to 1 m, growing by up to 1 m/s; dense samples of states, instants and clocks."""
    rng = np.random.default_rng(seed)
    body = shipped_body()
    gaps = np.array([_gaps(setting, body, rng) for _ in range(people)])
    proved, of_set, of_motion = gaps.T
    over_set, over_motion = of_set - proved, of_motion - proved
    return Overwidth(
        setting, people, float(over_set.mean()), float(over_set.max()),
        float(over_motion.mean()), float(over_motion.max()),
        int(np.sum(proved > np.minimum(of_set, of_motion))),
    )  # fmt: skip


def shipped_body() -> VehicleBody:
    """The body of the vehicle that comes with the project."""
    size = gem_e2().geometry
    return VehicleBody("body", size.wheelbase_m, size.front_m, size.rear_m, size.half_width_m)


def overwidth_text(rows: Sequence[Overwidth]) -> str:
    """The measurements as a table, in m, rad and s."""
    headings = [
        "half width m", "heading +- rad", "segment s", "skew +- s", "set: mean m", "worst m",
        "motion: mean m", "worst m", "beyond",
    ]  # fmt: skip
    texts = [
        [
            f"{row.setting.half_width_m:g}", f"{row.setting.heading_rad:g}",
            f"{row.setting.segment_s:g}", f"{row.setting.skew_s:g}",
            f"{row.over_set_mean_m:.3f}", f"{row.over_set_worst_m:.3f}",
            f"{row.over_motion_mean_m:.3f}", f"{row.over_motion_worst_m:.3f}", str(row.beyond),
        ]
        for row in rows
    ]  # fmt: skip
    title = (
        f"true minus proved clearance, {rows[0].people} random people per line; set: car and "
        "person anywhere in their sets of the segment; motion: at the same instant"
    )
    return f"{title}\n{table(headings, texts)}"


def _gaps(setting: Setting, body: VehicleBody, rng: np.random.Generator) -> Array:
    """Proved clearance of one random person, and the sampled ones: of the sets, of the motion."""
    heading = rng.uniform(-math.pi, math.pi)
    piece = _random_person(setting, body, heading, rng)
    starts = np.array(np.meshgrid(_GRID, _GRID, _GRID)).reshape(3, -1).T
    starts = starts * [setting.half_width_m, setting.half_width_m, setting.heading_rad]
    times = np.linspace(0.0, setting.segment_s, _INSTANTS)
    way = _SPEED_MPS * times
    moved = [way * np.cos(starts[:, 2:]), way * np.sin(starts[:, 2:]), np.zeros_like(way)]
    states = starts[:, None, :] + np.stack(np.broadcast_arrays(*moved), axis=-1)
    low, high = states.min(axis=(0, 1)), states.max(axis=(0, 1))
    size = [body.front_m, body.rear_m, body.half_width_m]
    rectangle, _ = _OCCUPANCY()(low, high, [0.0, 0.0, 0.0, heading], [0.0, 0.0], size)
    tube = PersonTube(TubeKind.INTENT, ((piece,),), 10.0)
    found = nearest_people(
        [TrackedPerson("p", (tube,))],
        times_s=np.array([0.0, setting.segment_s]),
        rectangles=np.array(rectangle).T,
        kinds=frozenset([TubeKind.INTENT]),
        skew_s=(-setting.skew_s, setting.skew_s),
    )[TubeKind.INTENT]
    assert found.cause is KernelCause.PROVED
    skews = np.linspace(-setting.skew_s, setting.skew_s, 3)
    of_motion = min(
        float(body_gap(turned(states, heading), body, piece, times + skew).min()) for skew in skews
    )
    share = np.array(np.meshgrid(_GRID, _GRID, _GRID)).reshape(3, -1).T * 0.5 + 0.5
    anywhere = turned(low + share * (high - low), heading)[:, None, :]
    clock = np.linspace(-setting.skew_s, setting.segment_s + setting.skew_s, _INSTANTS)
    of_set = float(body_gap(anywhere, body, piece, clock).min())
    return np.array([found.clearance_m, of_set, of_motion])


def _random_person(
    setting: Setting, body: VehicleBody, heading: float, rng: np.random.Generator
) -> DiscPiece:
    """A disc that is apart from the body at the middle of its set, by 0.2 to 4 m."""
    way, speed = rng.uniform(-math.pi, math.pi), rng.uniform(0.0, 2.0)
    radius, growth, apart = rng.uniform(0.3, 1.0), rng.uniform(0.0, 1.0), rng.uniform(0.2, 4.0)
    side, share = rng.integers(4), rng.uniform(-1.2, 1.2)
    half = 0.5 * (body.front_m + body.rear_m)
    wide = body.half_width_m
    reach = radius + growth + apart + setting.half_width_m
    u, v = [(half + reach, share * wide), (-half - reach, share * wide),
            (share * half, wide + reach), (share * half, -wide - reach)][side]  # fmt: skip
    u += 0.5 * (body.front_m - body.rear_m)
    c, s = math.cos(heading), math.sin(heading)
    return DiscPiece(
        -1.0, c * u - s * v - speed * math.cos(way), s * u + c * v - speed * math.sin(way),
        speed * math.cos(way), speed * math.sin(way), radius, growth, 0.0,
    )  # fmt: skip


def turned(states: Array, heading: float) -> Array:
    """Poses x, y, heading (..., 3) of path states about the origin of a path in that direction."""
    c, s = math.cos(heading), math.sin(heading)
    x, y = c * states[..., 0] - s * states[..., 1], s * states[..., 0] + c * states[..., 1]
    return np.stack([x, y, states[..., 2] + heading], axis=-1)


def body_gap(poses: Array, body: VehicleBody, piece: DiscPiece, times_s: Array) -> Array:
    """Signed distance (m) of the body at `poses` (..., 3) from a piece's disc at `times_s` (...);
    floats, for measuring."""
    since = times_s - piece.from_s
    x, y = piece.x_m + piece.vx_mps * since, piece.y_m + piece.vy_mps * since
    radius = piece.radius_m + piece.growth_mps * since + 0.5 * piece.growth2_mps2 * since**2
    c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    dx, dy = x - poses[..., 0], y - poses[..., 1]
    u, v = c * dx + s * dy, c * dy - s * dx
    a = np.maximum(u - body.front_m, -body.rear_m - u)
    b = np.abs(v) - body.half_width_m
    outside = np.hypot(np.maximum(a, 0.0), np.maximum(b, 0.0))
    inside = np.minimum(np.maximum(a, b), 0.0)
    return np.asarray(outside + inside - np.maximum(radius, 0.0))
