"""Files of one simulated drive: the page, the run log, and a table of all turns."""

from __future__ import annotations

import argparse
import csv
import io
import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench import __version__
from workbench.cli.analysis_options import command_line
from workbench.cli.common import write_text
from workbench.cli.simulate_drive import FAR_WORDS, Found, summary

if TYPE_CHECKING:
    from workbench.models.vehicle_sections import Brake
    from workbench.report.simulation import SimulationReport
    from workbench.report.simulation_plots import Braking, DriveCurves
    from workbench.report.tables import Cell, Table
    from workbench.simulation.bus_drive import BusDrive, Instant

COLUMNS: Final = (
    "time_s", "station_m", "x_m", "y_m", "heading_rad", "speed_mps", "acceleration_mps2",
    "road_wheel_rad", "mode", "nearest_m", "nearest_person", "reference_mps",
)  # fmt: skip
_JERK_S: Final = 0.2
_STANDS_MPS: Final = 0.05
_SILENT_S: Final = 0.35
"""Curves of decisions break where none came for so long."""
_WORDS: Final = {True: "needless", False: "needed", None: "not judged: after it had passed"}


def write_files(args: argparse.Namespace, found: Found, folder: Path) -> dict[str, object]:
    """Write report.html, run.jsonl and turns.csv, each whole or not at all; where they are.

    Raises InputError, before anything is written, where nothing was decided.
    """
    from workbench.report.page import write_page
    from workbench.report.simulation import simulation_page
    from workbench.simulation.runlog import write_log

    driven = found.driven
    assert driven is not None, "at the desk nothing is written"
    trial = found.trial
    report = report_of(found)
    used = argparse.Namespace(**{**vars(args), "plant": trial.plant})
    command = command_line("simulate", used, positional=("scenario",))
    page = simulation_page(report, version=__version__, command=command).html()
    header = {
        "scenario": trial.scenario.name,
        "settings": {str(row[0]): row[1] for row in settings_table(found).rows},
        "notes": found.notes,
        "levels": {level.name: level.share for level in found.rig.bundle.manifest.levels},
        "undecided": [
            {"t_s": each.t_s, "sent": each.sent, "violations": each.violations}
            for each in report.frames
            if not each.decided
        ],
    }
    write_log(folder / "run.jsonl", header, driven.entries)
    write_text(folder / "turns.csv", turns_csv(found))
    write_page(folder / "report.html", page)
    return {
        "report": folder / "report.html",
        "log": folder / "run.jsonl",
        "turns": folder / "turns.csv",
    }


def nearest(found: Found, instant: Instant) -> tuple[float, str] | None:
    """True distance from the car's body to the nearest person's, and who; None for nobody."""
    from workbench.simulation.people import Body

    motion, shape = instant.motion, found.rig.vehicle.geometry
    body = Body(
        motion.x_m, motion.y_m, motion.heading, shape.front_m, shape.rear_m, shape.half_width_m
    )
    return min(
        ((body.distance(p.x_m, p.y_m) - p.body_radius_m, p.name) for p in instant.people),
        default=None,
    )


def turns_csv(found: Found) -> str:
    """A row per turn under `COLUMNS`; empty cells where nobody is there, and nothing was decided
    yet or any more."""
    assert found.driven is not None, "at the desk there are no turns"
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    seen, wanted = -math.inf, ""
    for each in found.driven.instants:
        motion, near = each.motion, nearest(found, each)
        if each.observation is not None:
            seen, wanted = each.t_s, f"{each.observation.reference_speed_mps:.6f}"
        reference = wanted if each.t_s - seen <= _SILENT_S else ""
        away_m, who = ("", "") if near is None else (f"{near[0]:.4f}", near[1])
        numbers = (
            each.t_s, each.station_m, motion.x_m, motion.y_m, motion.heading, motion.speed_mps,
            motion.acceleration_mps2, motion.road_wheel_rad,
        )  # fmt: skip
        figures = (f"{value:.6f}" for value in numbers)
        writer.writerow([*figures, each.state.name, away_m, who, reference])
    return stream.getvalue()


def braking(
    driven: BusDrive, *, needless: bool, passed_s: float | None = None
) -> tuple[Braking, ...]:
    """From each BRAKE that came after TRACK while the car moved, until TRACK comes again.

    passed_s: when the car had passed, None for never; of what came then, nothing says whether it
    was needless.
    """
    from workbench.report.simulation_plots import Braking

    def judged(since_s: float) -> bool | None:
        return None if passed_s is not None and since_s >= passed_s else needless

    found, since_s = [], None
    for before, after in itertools.pairwise(driven.instants):
        if before.tracks and not after.tracks and after.motion.speed_mps > _STANDS_MPS:
            since_s = after.t_s
        elif after.tracks and since_s is not None:
            found.append(Braking(since_s, after.t_s, judged(since_s)))
            since_s = None
    if since_s is not None:
        found.append(Braking(since_s, driven.instants[-1].t_s, judged(since_s)))
    return tuple(found)


def stopping_m(brake: Brake, speed_mps: float) -> tuple[float, float]:
    """Least and greatest way to standstill: speed times delay plus speed squared over twice the
    deceleration; the greatest has the build-up as a further delay."""
    speed = max(speed_mps, 0.0)
    least = speed * brake.delay_s + speed**2 / (2.0 * brake.deceleration_max_mps2)
    slow_s = brake.delay_s + brake.build_up_s
    return least, speed * slow_s + speed**2 / (2.0 * brake.deceleration_min_mps2)


def report_of(found: Found) -> SimulationReport:
    """The page's content."""
    from workbench.report.simulation import SimulationReport
    from workbench.simulation.recorded_path import corners
    from workbench.simulation.rig import path_table
    from workbench.simulation.undecided import undecided

    assert found.driven is not None, "at the desk there is no page"
    manifest, scenario = found.rig.bundle.manifest, found.trial.scenario
    decided = tuple(entry.frame for entry in found.driven.entries)
    silent = undecided(
        found.driven.instants, found.rig.vehicle.geometry, corners(path_table(scenario))
    )
    return SimulationReport(
        title=scenario.title,
        story=scenario.story,
        lead=tuple(summary(found)[1:4]),
        frames=tuple(sorted((*decided, *silent), key=lambda frame: frame.t_s)),
        levels=tuple(level.name for level in manifest.levels),
        curves=_curves(found, found.driven),
        numbers=(_figures(found), _braking_table(found)),
        settings=settings_table(found),
        notes=found.notes,
        assumptions=manifest.assumptions,
    )


def _curves(found: Found, driven: BusDrive) -> DriveCurves:
    import numpy as np

    from workbench.report.simulation_plots import DriveCurves

    instants = driven.instants
    near = [nearest(found, each) for each in instants]
    speeds = [each.motion.speed_mps for each in instants]
    hard = np.array([each.motion.acceleration_mps2 for each in instants])
    times = np.array([each.t_s for each in instants])
    decided = np.array(list(_decided(driven)), dtype=float).reshape(-1, 3)
    return DriveCurves(
        t_s=times,
        nearest_m=np.array([math.nan if each is None else each[0] for each in near]),
        speed_mps=np.array(speeds),
        stopping_m=np.array([stopping_m(found.rig.vehicle.brake, speed) for speed in speeds]),
        acceleration_mps2=hard,
        jerk_mps3=(np.interp(times + 0.5 * _JERK_S, times, hard)
                   - np.interp(times - 0.5 * _JERK_S, times, hard)) / _JERK_S,
        decided_s=decided[:, 0],
        clearance_m=decided[:, 1],
        reference_mps=decided[:, 2],
        braking=_judged(found, driven),
    )  # fmt: skip


def _decided(driven: BusDrive) -> Iterator[tuple[float, float | None, float]]:
    """Time, clearance and reference speed of each decision; NaN where none came for a while."""
    before_s = -math.inf
    for entry in driven.entries:
        t_s = entry.frame.t_s
        if before_s > -math.inf and t_s - before_s > _SILENT_S:
            yield 0.5 * (before_s + t_s), None, math.nan
        yield t_s, entry.frame.clearance_m, entry.reference_speed_mps
        before_s = t_s


def _judged(found: Found, driven: BusDrive) -> tuple[Braking, ...]:
    return braking(driven, needless=found.needless, passed_s=found.outcome.passed_s)


def _figures(found: Found) -> Table:
    from workbench.report.tables import Table

    outcome, brakes = found.outcome, len(found.outcome.brakes)
    far = FAR_WORDS if outcome.fastest_mps > _STANDS_MPS else "it did not move"
    near = _measured(outcome.nearest_m, far), _measured(found.undisturbed_m, FAR_WORDS)
    rows: list[list[Cell]] = [
        ["expected", found.expected.value, ""],
        ["as expected", "yes" if found.as_expected else "no", ""],
        ["first TRACK", outcome.set_off_s, "s"],
        ["passed", outcome.passed_s, "s"],
        ["BRAKE after TRACK, before it had passed", brakes, "times"],
        ["of these needless", brakes if found.needless else 0, "times"],
        ["at standstill on the way", outcome.stood_s, "s"],
        ["nearest to anybody while the car moved", *near[0]],
        ["nearest of a car that never brakes", *near[1]],
        ["way", outcome.way_m, "m"],
        ["highest speed", outcome.fastest_mps, "m/s"],
        ["strongest deceleration", outcome.hardest_mps2, "m/s²"],
        ["largest jerk", outcome.jerk_mps3, "m/s³"],
        ["times as fast as real time", found.faster, "1"],
    ]
    return Table("what came of the drive", ["figure", "value", "unit"], rows)


def _measured(distance_m: float, far: str) -> tuple[Cell, str]:
    """A distance and its unit, or words where nobody was near."""
    return (far, "") if distance_m == math.inf else (distance_m, "m")


def _braking_table(found: Found) -> Table:
    from workbench.report.tables import Table
    from workbench.simulation.campaign.survey_drive import CLEAR_M

    assert found.driven is not None, "at the desk there is no page"
    rows: list[list[Cell]] = []
    for each in _judged(found, found.driven):
        reason = why_braked(found.driven, each.since_s)
        rows.append(
            [each.since_s, each.until_s, each.until_s - each.since_s, _WORDS[each.needless], reason]
        )
    if not rows:
        rows = [[None, None, None, "the car did not brake after TRACK while it moved", ""]]
    caption = (
        "braking. Needless: a car that never brakes, in the same scenario, with the same plant and "
        f"seed, driven without frames until it has passed, never comes nearer than {CLEAR_M:g} m "
        "to anybody; this is one answer for the whole drive until it has passed"
    )
    return Table(caption, ["from (s)", "until (s)", "for (s)", "was it needed", "reason"], rows)


def why_braked(driven: BusDrive, since_s: float) -> str:
    """What stood first against TRACK when BRAKE came, and the faults of that turn."""
    from workbench.simulation.undecided import fault_words

    frames = [entry.frame for entry in driven.entries if entry.frame.t_s <= since_s]
    against = list(itertools.takewhile(lambda frame: frame.action == "BRAKE", reversed(frames)))
    said = [against[-1].reason] if against else []
    turn = next(each for each in driven.instants if each.t_s >= since_s)
    return "; ".join((*said, *fault_words(turn))) or "neither a decision nor a fault is on record"


def settings_table(found: Found) -> Table:
    """What was simulated."""
    from workbench.report.tables import Table

    trial, manifest = found.trial, found.rig.bundle.manifest
    sensing = trial.scenario.sensing
    rows: list[list[Cell]] = [
        ["scenario", trial.scenario.name],
        ["plant", trial.plant],
        ["seed", trial.seed],
        ["deciding", found.policy],
        ["vehicle", found.rig.vehicle.name],
        ["bundle", f"{manifest.name}, SHA-256 {found.rig.bundle.manifest_sha256[:16]}"],
        ["horizon of LookAhead (s)", manifest.horizon_s],
        ["reference speed (m/s)", found.rig.settings.reference_speed_mps],
        ["error of localised positions, at most (m)",
         "what the vehicle's localiser says" if found.ranged else sensing.position_m],
        ["error of people's positions, at most (m)", sensing.person_m],
        ["delay of sensors (s)", f"{sensing.delay_s[0]:g} to {sensing.delay_s[1]:g}"],
        ["people are reported within (m)", sensing.watched_m],
    ]  # fmt: skip
    return Table("settings", ["setting", "value"], rows)
