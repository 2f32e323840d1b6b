"""One drive of a survey at the desk, and the separate search for how its contact could be avoided.

Every drive ends at the first contact, when the car has gone `passed_m`, or with the scenario.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

from workbench.claims import Verdict
from workbench.runtime import Action
from workbench.runtime.onboard.pid import law_of
from workbench.runtime.onboard.times import TURN_US
from workbench.simulation.campaign.scripted_judges import Counted, NeverBrakes, Repeating, Script
from workbench.simulation.clock import SetClock
from workbench.simulation.desk_drive import DeskLoop, Driving
from workbench.simulation.measures import Judge
from workbench.simulation.rig import MakeJudge, Rig, Trial
from workbench.simulation.scene import Contact, Scene

CLEAR_M: Final = 0.5
"""A car that never brakes and keeps so far from everybody had no reason to."""
_STANDS_MPS: Final = 0.05
_STRIDE: Final = 18
_TURN_S: Final = TURN_US / 1e6
_SETTLED: Final = 8
"""Turns after which a car that stands under BRAKE stays so: longer than any delay of pedals."""


@final
@dataclass(frozen=True, slots=True)
class Drive:
    """What came of one drive.

    set_off: number of the first turn that sent TRACK, None for none; stops: times that BRAKE came
    after TRACK while the car moved; contact: None for none; nearest_m: smallest distance while it
    moved, inf with nobody near; way_m, time_s: until its end; waited_s: until TRACK came first;
    stood_s: at standstill after that; passed: whether it went `passed_m`; script: what was sent;
    the counts: see `Counted`.
    """

    set_off: int | None
    stops: int
    contact: Contact | None
    nearest_m: float
    way_m: float
    time_s: float
    waited_s: float
    stood_s: float
    passed: bool
    script: Script
    verdicts: dict[Verdict, int]
    out_of_region: int
    violations: dict[str, int]
    alerts: int


def drive(rig: Rig, trial: Trial, judge: MakeJudge) -> Drive:
    """Drive it; the same trial and judge give the same drive."""
    clock = SetClock()
    scene = rig.scene(trial)
    made = judge(scene.setting.path, clock)
    counted = Counted(made)
    loop = _loop(
        rig, trial, (counted, clock), scene, heeds_faults=not isinstance(made, NeverBrakes)
    )
    stops, moving_tracks, stood, waited = 0, False, 0, 0
    set_off: int | None = None
    turn, way_m, passed = 0, 0.0, False
    begin_m = scene.place().station_m
    while scene.now_s < trial.scenario.duration_s:
        loop.turn()
        tracks, speed_mps = loop.tracks, scene.car.motion.speed_mps
        if tracks and set_off is None:
            set_off = turn
        waited += set_off is None
        stood += set_off is not None and speed_mps <= _STANDS_MPS
        stops += moving_tracks and not tracks and speed_mps > _STANDS_MPS
        moving_tracks = tracks
        turn += 1
        station_m = scene.place().station_m
        way_m, passed = station_m - begin_m, station_m >= trial.scenario.passed_m
        if passed or scene.nearness.contact is not None:
            break
    return Drive(
        set_off, stops, scene.nearness.contact, scene.nearness.moving_m, way_m, turn * _TURN_S,
        waited * _TURN_S, stood * _TURN_S, passed, counted.script, dict(counted.verdicts),
        counted.out_of_region, dict(counted.violations), counted.alerts,
    )  # fmt: skip


def undisturbed(rig: Rig, trial: Trial) -> Drive:
    """The drive of a car that never brakes, from the first turn on."""
    return drive(rig, trial, lambda _path, _clock: NeverBrakes())


def avoidable(rig: Rig, trial: Trial, driven: Drive) -> bool:
    """Whether braking for good at an earlier period would have avoided a drive's contact.

    Brute force: the drive is repeated up to a period k and BRAKE sent from then on; and likewise
    with TRACK alone up to k; for every k from the period after the car set off to that of the
    contact. Avoided where the car stops without contact. To stay put is not one of the ways.
    """
    if driven.contact is None or driven.set_off is None:
        return False
    last = len(driven.script.turns)
    tracks = Script([Action.BRAKE] * driven.set_off)
    scripts = (driven.script, tracks)
    periods = list(_periods(driven.set_off, last))
    return any(
        _stops_clear(rig, trial, Repeating(script, until), until)
        for script in scripts
        for until in periods
    )


def _periods(first: int, last: int) -> Iterator[int]:
    """Every one from the period after the first to the last, the likeliest before the others."""
    period = 3
    numbers = range(first + period, last + 1, period)
    soon = [k for k in numbers if (last - k) % _STRIDE < period and last - k >= _STRIDE]
    yield from reversed(soon)
    yield from reversed([k for k in numbers if k not in set(soon)])


def _stops_clear(rig: Rig, trial: Trial, judge: Judge, until: int) -> bool:
    """Whether the car comes to a standstill after its brake without contact."""
    clock, scene = SetClock(), rig.scene(trial)
    loop = _loop(rig, trial, (judge, clock), scene, heeds_faults=True)
    turn = 0
    while scene.now_s < trial.scenario.duration_s:
        loop.turn()
        turn += 1
        if scene.nearness.contact is not None:
            return False
        if turn > until + _SETTLED and scene.car.motion.speed_mps <= _STANDS_MPS:
            return True
    return True


def _loop(
    rig: Rig, trial: Trial, asked: tuple[Judge, SetClock], scene: Scene, *, heeds_faults: bool
) -> DeskLoop:
    law = law_of(rig.bundle.manifest.parameters)
    driving = Driving(*asked, law, rig.settings, heeds_faults)
    return DeskLoop(scene, driving, seed=trial.seed)
