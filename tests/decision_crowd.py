"""People beside a path, and how far runs of the car stay from everywhere they can be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from decision_answers import Array
from decision_fixture import BODY, STEP_S
from decision_paths import FINE, ExactPath, paths, plane_pose
from decision_stops import SPEED, Runs

from workbench.runtime.person_tubes import DiscPiece, TrackedPerson, TubeKind


def somebody(chance: np.random.Generator, where: str) -> list[float]:
    """Somebody beside the path who walks anywhere, and a disc that grows."""
    station, side = chance.uniform(-3.0, 12.0), chance.choice([-1.0, 1.0])
    x, y, heading = (float(part[0]) for part in paths()[where].pose(np.array([station])))
    offset = side * chance.uniform(1.0, 7.0)
    speed, way = chance.uniform(0.0, 2.0), chance.uniform(-np.pi, np.pi)
    x, y = x - offset * np.sin(heading), y + offset * np.cos(heading)
    growth = [chance.uniform(0.1, 0.5), chance.uniform(0.0, 0.3), chance.uniform(0.0, 0.3)]
    return [x, y, speed * np.cos(way), speed * np.sin(way), *growth]


def body_gap(pose: tuple[Array, Array, Array], disc: tuple[Array, Array, Array]) -> Array:
    """Signed distance of the car's body and a disc."""
    x, y, heading = pose
    dx, dy = disc[0] - x, disc[1] - y
    front, rear, half_width = BODY
    along = dx * np.cos(heading) + dy * np.sin(heading) - (front - rear) / 2
    across = dy * np.cos(heading) - dx * np.sin(heading)
    a, b = np.abs(along) - (front + rear) / 2, np.abs(across) - half_width
    outside = np.hypot(np.maximum(a, 0.0), np.maximum(b, 0.0))
    return np.asarray(outside + np.minimum(np.maximum(a, b), 0.0) - disc[2])


def disc_over(bound: Sequence[DiscPiece], times_s: Array) -> tuple[Array, Array, Array]:
    """Centre and radius of one bound, straight from the definition."""
    started = [times_s >= piece.from_s for piece in bound]
    s = [times_s - piece.from_s for piece in bound]
    x = np.select(started[::-1], [p.x_m + p.vx_mps * t for p, t in _later(bound, s)])
    y = np.select(started[::-1], [p.y_m + p.vy_mps * t for p, t in _later(bound, s)])
    radius = [
        p.radius_m + p.growth_mps * t + p.growth2_mps2 * t * t / 2 for p, t in _later(bound, s)
    ]
    size: Array = np.maximum(np.select(started[::-1], radius), 0.0)
    return np.asarray(x), np.asarray(y), size


def _later(bound: Sequence[DiscPiece], s: list[Array]) -> list[tuple[DiscPiece, Array]]:
    return list(zip(bound, s, strict=True))[::-1]


def intent_distance(fine: Array, where: str, person: list[float]) -> Array:
    """Signed distance of car body and predicted disc, (fine times, runs)."""
    px, py, vx, vy, radius, growth, growth2 = person
    tau: Array = (STEP_S / FINE * np.arange(len(fine), dtype=np.float64))[:, None]
    size = np.asarray(radius + growth * tau + growth2 / 2 * tau**2)
    return body_gap(plane_pose(paths()[where], fine), (px + vx * tau, py + vy * tau, size))


def distance(
    runs: Runs, path: ExactPath, person: TrackedPerson, kind: TubeKind, *, skew_s: float = 0.0
) -> Array:
    """Signed distance of the car's body and of one claim about a person, (instants, runs).

    The person is in all bounds at once, so the largest distance counts. Instants after a standstill
    are left out. skew_s: the person's time minus the car's.
    """
    (tube,) = [tube for tube in person.tubes if tube.kind is kind]
    pose, times = plane_pose(path, runs.states), runs.times_s + skew_s
    gaps = np.array([body_gap(pose, disc_over(bound, times)) for bound in tube.bounds])
    moves = np.cumsum(runs.states[::-1, SPEED] > 0.0, axis=0)[::-1] > 0
    return np.where(moves, gaps.max(axis=0), np.inf)
