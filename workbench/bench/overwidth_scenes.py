"""Proved clearance beside sampled clearance for benchmark tubes and people who walk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.bench.overwidth import body_gap, shipped_body
from workbench.bench.text import table
from workbench.models.benchmarks import Benchmark, b1, b1_small
from workbench.reach.compute import compute_tube
from workbench.reach.separation import Comparison, PlaneGround, check_separation
from workbench.reach.tube import Array
from workbench.reach.validated.tube import ValidatedTube
from workbench.runtime.contents import VehicleBody
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import PersonTube, RadiusBetween, TrackedPerson, timed_discs
from workbench.sensitivity.sampling import rollout, sample_initial_states

HORIZON_S = 3.0
_STEP_S = 0.05
_FINER = 4
_POSE = ("x", "y", "heading")


@final
@dataclass(frozen=True, slots=True)
class SceneOverwidth:
    """Clearance from one person over 3 s, in m: proved over a tube, and of sampled trajectories at
    the sampled instants and clocks. For a guard, of two bounds, the sampled one is from the nearer
    rim of the better bound at each instant, so at most as large as the true one."""

    loop: str
    scene: str
    skew_s: float
    proved_m: float
    sampled_m: float


def scene_overwidths(*, trajectories: int = 500, seed: int = 3) -> tuple[SceneOverwidth, ...]:
    """B1-small and B1 with steps of 0.05 s, four people, without skew and with +-0.05 s."""
    return tuple(
        row for benchmark in (b1_small(), b1()) for row in _of_loop(benchmark, trajectories, seed)
    )


def scene_text(rows: Sequence[SceneOverwidth]) -> str:
    """The scenes as a table, in m."""
    texts = [
        [row.loop, row.scene, f"{row.skew_s:g}", f"{row.proved_m:.3f}", f"{row.sampled_m:.3f}",
         f"{row.sampled_m - row.proved_m:.3f}"]
        for row in rows
    ]  # fmt: skip
    headings = ["loop", "person", "skew +- s", "proved m", "sampled m", "difference m"]
    title = f"clearance over {HORIZON_S:g} s, segments of {_STEP_S:g} s, tube and people together"
    return f"{title}\n{table(headings, texts)}"


def walkers() -> dict[str, PersonTube]:
    """A person who stands aside, one who crosses ahead, one alongside, and the guard of that."""
    times = [-0.25 + 0.25 * k for k in range(15)]

    def intent(x_m: float, y_m: float, vx_mps: float, vy_mps: float) -> PersonTube:
        xs, ys = [x_m + vx_mps * t for t in times], [y_m + vy_mps * t for t in times]
        radii = [0.5 + 0.1 * (t - times[0]) for t in times]
        return timed_discs(times, xs, ys, radii, between=RadiusBetween.LINE)

    seen = Guard(0.0, Disc(1.0, -8.0, 0.3), Disc(1.4, 0.0, 0.2), MotionLimits(2.5, 1.0))
    return {
        "standing aside": intent(6.0, 3.0, 0.0, 0.0),
        "crossing ahead": intent(16.0, 6.0, 0.0, -1.4),
        "alongside": intent(1.0, -3.0, 1.4, 0.0),
        "alongside, guard": guard_disc(seen, from_s=-0.25, until_s=3.25),
    }


def _of_loop(benchmark: Benchmark, trajectories: int, seed: int) -> list[SceneOverwidth]:
    body = shipped_body()
    tube = compute_tube(
        benchmark.system, initial_set=benchmark.initial_set, horizon_s=HORIZON_S,
        method=ValidatedTube(step_s=_STEP_S),
    )  # fmt: skip
    starts = sample_initial_states(benchmark.initial_set, count=trajectories, seed=seed)
    runs = rollout(benchmark.system, starts, horizon_s=HORIZON_S, step_s=_STEP_S / _FINER)
    poses = runs[..., [benchmark.system.ode.names.index(name) for name in _POSE]]
    times = np.linspace(0.0, HORIZON_S, poses.shape[1])
    rows = []
    for name, walker in walkers().items():
        for skew in (0.0, 0.05):
            found = check_separation(
                tube, ground=PlaneGround(), body=body,
                people=[TrackedPerson(name, (walker,))], clearance_required_m=0.0,
                comparison=Comparison(frozenset([walker.kind]), (-skew, skew)),
            )  # fmt: skip
            sampled = min(
                float(tube_gap(poses, body, walker, times + d).min()) for d in (-skew, 0.0, skew)
            )
            rows.append(SceneOverwidth(benchmark.name, name, skew, found.clearance_m, sampled))
    return rows


def tube_gap(poses: Array, body: VehicleBody, tube: PersonTube, times_s: Array) -> Array:
    """Signed distance (N, T) of the body at `poses` (N, T, 3) from a tube at `times_s` (T): from
    the better bound at each instant; floats, for measuring."""
    gaps = []
    for bound in tube.bounds:
        starts = [piece.from_s for piece in bound]
        at = np.searchsorted(starts, times_s, side="right") - 1
        per_piece = np.stack([body_gap(poses, body, piece, times_s) for piece in bound])
        gaps.append(np.take_along_axis(per_piece, np.maximum(at, 0)[None, None, :], axis=0)[0])
    return np.asarray(np.max(gaps, axis=0))
