"""One decision of each of the paper's four scenarios, as its figure of results shows it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.models.vehicle_sections import Geometry
from workbench.runtime import Deciding
from workbench.runtime.decision import Action
from workbench.runtime.measuring import Measuring
from workbench.simulation.drawn_people import as_frame
from workbench.simulation.frames import Disc, Point, Rectangle
from workbench.simulation.paper.replayed import TURN_S, Asked, Replayed, turns
from workbench.simulation.paper.tubes import PathTubes, nested
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.rig import Rig, Trial

PANELS: Final = (
    "paper_alongside_simulation", "paper_alongside_vehicle", "paper_crossing_simulation",
    "paper_crossing_vehicle",
)  # fmt: skip
_MOVES_MPS: Final = 0.5
_NEAR_M: Final = 9.0
_DISC_STEP_S: Final = 0.5


@final
@dataclass(frozen=True, slots=True)
class Panel:
    """The decision at t_s of one scenario.

    path, travelled: points (m) of the path and of the car's true way so far; body: the car;
    speed_mps; tubes: ground that the body may cover until horizon_s from each nested set, the
    largest first; verdicts: of these sets; tracks: whether TRACK was decided; reason: why; shares:
    of the measured set's radii that the nested sets have; seen:
    by person, where they were measured until then, true_way: where they went in the whole run;
    predicted: discs of what they intend, to horizon_s; proved_s: by set, how far its tube reaches.
    """

    scenario: str
    title: str
    t_s: float
    horizon_s: float
    path: tuple[Point, ...]
    travelled: tuple[Point, ...]
    body: Rectangle
    speed_mps: float
    tubes: tuple[tuple[Rectangle, ...], ...]
    verdicts: tuple[Verdict, ...]
    tracks: bool
    reason: str
    shares: tuple[float, ...]
    seen: tuple[tuple[Point, ...], ...]
    true_way: tuple[tuple[Point, ...], ...]
    predicted: tuple[Disc, ...]
    proved_s: tuple[float, ...]


def panel(
    rig: Rig, trial: Trial, tubes: PathTubes, *, horizon_s: float,
    advance: Callable[[], None] = lambda: None,
) -> Panel:  # fmt: skip
    """Drive with the paper's policy and choose the decision: the first BRAKE of a moving car, and
    where there is none until the scenario is passed the first with somebody within 9 m. InputError
    where none is; `advance` after every turn."""
    taken, way_m = [], 0.0
    for each in turns(rig, trial, deciding=Deciding.LOOK_AHEAD):
        way_m += TURN_S * each.motion.speed_mps
        if way_m > trial.scenario.passed_m:
            break
        taken.append(each)
        advance()
    at = _chosen(taken)
    if at is None:
        raise InputError(
            f"{trial.scenario.name}: expected a decision of a moving car near somebody, got none; "
            "choose another seed"
        )
    return _panel(rig, trial, taken, at, tubes, horizon_s)


def _chosen(taken: list[Replayed]) -> int | None:
    moving = [
        k for k, each in enumerate(taken)
        if each.decision is not None and each.motion.speed_mps > _MOVES_MPS
    ]  # fmt: skip
    for k in moving:
        decision = taken[k].decision
        if decision is not None and decision.action is Action.BRAKE:
            return k
    return next((k for k in moving if _nearest_m(taken[k]) < _NEAR_M), None)


def _nearest_m(each: Replayed) -> float:
    place = each.motion.x_m, each.motion.y_m
    return min((math.dist(place, (p.x_m, p.y_m)) for p in each.people), default=math.inf)


def _panel(
    rig: Rig, trial: Trial, taken: list[Replayed], at: int, tubes: PathTubes, horizon_s: float
) -> Panel:
    now = taken[at]
    observation, decision = now.observation, now.decision
    assert observation is not None, "only decisions are chosen"
    assert decision is not None, "only decisions are chosen"
    path = rig.scene(trial).setting.path
    shares = [level.share for level in rig.bundle.manifest.levels]
    boxes = Measuring(path, shares, station_m=None).boxes(observation)
    asked = Asked(at, boxes, observation.reference_speed_mps)
    rows = round(horizon_s / tubes.rows(path, asked, 0).step_s)
    step_s = horizon_s / rows
    ground = tuple(each[:rows] for each in nested(tubes, path, asked))
    frames = [as_frame(p, horizon_s=horizon_s, step_s=_DISC_STEP_S) for p in observation.people]
    names = [p.name for p in observation.people]
    motion = now.motion
    return Panel(
        trial.scenario.name, trial.scenario.title, now.t_s, horizon_s,
        tuple(zip(path.x, path.y, strict=True)),
        tuple((each.motion.x_m, each.motion.y_m) for each in taken[: at + 1]),
        _body(motion, rig.vehicle.geometry),
        motion.speed_mps, ground, decision.level_verdicts.get("track", ()),
        decision.action is Action.TRACK, decision.reason, tuple(shares),
        tuple(_seen(taken[: at + 1], name) for name in names),
        tuple(_true(taken, p.name) for p in now.people),
        tuple(disc for frame in frames for disc in frame.predicted),
        tuple(step_s * len(each) for each in ground),
    )  # fmt: skip


def _body(motion: Motion, shape: Geometry) -> Rectangle:
    ahead = 0.5 * (shape.front_m - shape.rear_m)
    return (
        motion.x_m + ahead * math.cos(motion.heading),
        motion.y_m + ahead * math.sin(motion.heading),
        motion.heading,
        0.5 * (shape.front_m + shape.rear_m),
        shape.half_width_m,
    )


def _seen(taken: list[Replayed], name: str) -> tuple[Point, ...]:
    """Middles of the discs that were measured of somebody."""
    return tuple(
        (person.guard.position.x, person.guard.position.y)
        for each in taken
        if each.observation is not None
        for person in each.observation.people
        if person.name == name
    )


def _true(taken: list[Replayed], name: str) -> tuple[Point, ...]:
    return tuple((p.x_m, p.y_m) for each in taken for p in each.people if p.name == name)
