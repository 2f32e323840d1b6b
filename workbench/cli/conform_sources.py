"""What `workbench conform` fits to: recordings, or runs of a closed loop."""

from __future__ import annotations

import argparse
import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, final

from workbench.cli.common import chosen_vehicle
from workbench.cli.conform_elsewhere import check_drivers, check_folders, windows_elsewhere
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle
    from workbench.models.vehicle_sections import Uncertainty
    from workbench.simulation.conformance.fit import Advance
    from workbench.simulation.conformance.verdict import Verdict
    from workbench.simulation.conformance.windows import Measured, MotionModel, Split
    from workbench.simulation.recording import Recording

_W: Final = ("acceleration_mps2", "steering_rate_radps", "wheelbase_m")
_N: Final = ("lateral_m", "heading_rad", "speed_mps")
# Of the wheelbase: beyond it a bicycle of another length is no better than another steering.
_MOST_WHEELBASE: Final = 0.25
# What no car does: bounds beyond these explain a defect of the measurement, not motion.
_MOST_OF_A_CAR: Final = {"acceleration_mps2": 10.0, "steering_rate_radps": 2.0}


@final
@dataclass(frozen=True, slots=True)
class LeftOut:
    """A window that the fit did without; inside: whether its real tube contains it after all."""

    recording: str
    start_s: float
    inside: bool

    def __str__(self) -> str:
        after_all = " (inside its tube after all)" if self.inside else ""
        return f"{self.recording} from {self.start_s:g} s{after_all}"


@final
@dataclass(frozen=True, slots=True)
class Candidate:
    """A model, what it is called, the windows that it sees of SOURCE, and of each folder to test
    on besides, by the folder as it was given."""

    name: str
    model: MotionModel
    measured: Measured
    elsewhere: tuple[tuple[str, Measured], ...]


@final
@dataclass(frozen=True, slots=True)
class Subject:
    """Models with the windows that each of them sees, and how to speak of them.

    candidates: the one whose tubes about the training windows have the least mean area is taken.
    most: limits on bounds. discs: whether windows are in the plane, so that discs can be compared;
    disc_error_m: their radius at the beginning.
    """

    kind: str
    source: Path
    vehicle: Vehicle
    vehicle_file: Path
    candidates: tuple[Candidate, ...]
    split: Split
    most: dict[str, float]
    discs: bool
    disc_error_m: float

    def judged(self, outliers: int, *, advance: Advance) -> tuple[MotionModel, Measured, Verdict]:
        """The tightest candidate's verdict. Raises NoFitError where none has one."""
        from workbench.simulation.conformance.fit import NoFitError, fit
        from workbench.simulation.conformance.verdict import judge

        found: list[tuple[float, Candidate, Verdict]] = []
        failure: NoFitError | None = None
        for candidate in self.candidates:
            model, measured = candidate.model, candidate.measured
            try:
                fitted = fit(
                    model, measured.of(self.split.training), outliers=outliers, most=self.most,
                    advance=advance,
                )  # fmt: skip
            except NoFitError as error:
                failure = error
            else:
                verdict = judge(
                    model, measured, self.split, fitted, candidates=len(self.candidates),
                    advance=advance,
                )  # fmt: skip
                found.append((verdict.training.mean_area_m2, candidate, verdict))
        if failure is not None and not found:
            raise failure
        _, best, verdict = min(found, key=lambda each: each[0])
        verdict = verdict.tested_on(best.elsewhere, advance=advance)
        return best.model, best.measured, verdict

    def candidate_of(self, verdict: Verdict) -> Candidate:
        """Whose verdict this is."""
        return next(each for each in self.candidates if each.model is verdict.model)

    def about(self, verdict: Verdict) -> str:
        """Data, counts, split, outliers, model, in a few sentences."""
        training, held_out = verdict.training, verdict.held_out
        left_out = self.left_out(verdict)
        return (
            f"{self.kind} of {self.source.resolve().name}; model: "
            f"{self.candidate_of(verdict).name}. Fitted to {training.windows.of} windows of "
            f"{training.recordings.of} recordings, tested on {held_out.windows.of} windows of "
            f"{held_out.recordings.of} others ({self.split.rule})"
            + "".join(
                f", and on {found.windows.of} windows of all {found.recordings.of} of {name}"
                for name, found in verdict.elsewhere
            )
            + ". Windows left out: "
            + (", ".join(map(str, left_out)) or "none")
            + f". Bounds to first order times {verdict.fit.inflation:.3g}."
        )

    def left_out(self, verdict: Verdict) -> list[LeftOut]:
        """Each window that was left out."""
        windows = self.candidate_of(verdict).measured.of(self.split.training).windows
        found = verdict.fit
        return [
            LeftOut(windows[k].recording, windows[k].start_s, k in found.inside_after_all)
            for k in found.linear.left_out
        ]

    def section(self, model: MotionModel, verdict: Verdict, *, command: str) -> Uncertainty:
        """The vehicle file's section with the fitted figures."""
        found = {key: getattr(verdict.fit.uncertainty, key) for key in model.fitted}
        text = "\n".join(
            [self.about(verdict), f"{_held_out(verdict)} Statement: {verdict.said}.",
             f"Made by `{command}`."]
        )  # fmt: skip
        return dataclasses.replace(self.vehicle.uncertainty, **found, provenance=text)

    def refusal(self, section: Uncertainty) -> str:
        """Why the vehicle cannot take these figures; empty where it can."""
        try:
            dataclasses.replace(self.vehicle, uncertainty=section)
        except InputError as error:
            return str(error)
        return ""

    def vehicle_text(self, section: Uncertainty) -> str:
        """The vehicle file with this section."""
        from workbench.simulation.conformance.section import with_section

        return with_section(self.vehicle_file.read_text(encoding="utf-8"), section)


def _held_out(verdict: Verdict) -> str:
    return " ".join(
        f"Inside the tubes of {name}: {found.steps.inside} of {found.steps.of} steps, "
        f"{found.windows.inside} of {found.windows.of} windows; mean area "
        f"{found.mean_area_m2:.3g} m^2."
        for name, found in verdict.tested
    )


def chosen_subject(args: argparse.Namespace) -> Subject:
    """What SOURCE holds. Raises InputError for folders that hold neither."""
    from workbench.estimation.tables import Table
    from workbench.models.vehicle import gem_e2_path
    from workbench.simulation.conformance.driven_runs import holds_runs

    source: Path = args.source
    if not source.is_dir():
        raise InputError(
            f"SOURCE: expected a folder of runs or recordings at {source}, found "
            f"{'a file' if source.exists() else 'nothing'}"
        )
    beside = source / "vehicle.toml"
    if args.vehicle is None and holds_runs(source) and beside.is_file():
        args.vehicle = beside
    vehicle, file = chosen_vehicle(args), args.vehicle or gem_e2_path()
    if holds_runs(source):
        check_folders(args, holds_runs, "runs.csv, as SOURCE has it")
        check_drivers(args.test_on, vehicle)
        return _of_runs(args, vehicle, file)
    if Table.exists(source, "vehicles"):
        check_folders(
            args, lambda folder: Table.exists(folder, "vehicles"), "vehicles.csv, as SOURCE has it"
        )
        return _of_recordings(args, vehicle, file)
    raise InputError(
        f"SOURCE: expected runs.csv (closed-loop runs) or vehicles.csv (recordings), plain or "
        f".gz, in {source}"
    )


def _split(args: argparse.Namespace, measured: Measured) -> Split:
    from workbench.simulation.conformance.windows import alternating, named

    if args.train:
        return named(measured.recordings, args.train)
    return alternating(measured.recordings)


def _of_runs(args: argparse.Namespace, vehicle: Vehicle, file: Path) -> Subject:
    from workbench.simulation.conformance.driven_runs import load_runs
    from workbench.simulation.conformance.track_loop import RunErrors, RunWindows, TrackLoop
    from workbench.simulation.conformance.windows import instants

    model = TrackLoop(vehicle, _W if args.fit == "w" else (*_N, *_W))
    windows = RunWindows(instants(args.window, args.step), RunErrors())

    def cut(folder: Path) -> Measured:
        return windows.of(load_runs(folder), model)

    measured = cut(args.source)
    most = {
        "acceleration_mps2": vehicle.brake.deceleration_min_mps2,
        "speed_mps": vehicle.brake.stop_speed_mps,
        "wheelbase_m": _MOST_WHEELBASE * vehicle.geometry.wheelbase_m,
    }
    elsewhere = windows_elsewhere(args, measured, cut)
    return Subject(
        "Closed-loop runs", args.source, vehicle, file,
        (Candidate("the vehicle's TRACK loop", model, measured, elsewhere),),
        _split(args, measured), most, discs=False, disc_error_m=0.0,
    )  # fmt: skip


def _of_recordings(args: argparse.Namespace, vehicle: Vehicle, file: Path) -> Subject:
    from workbench.simulation.conformance.held_bicycle import (
        DriveErrors,
        DriveWindows,
        HeldBicycle,
    )
    from workbench.simulation.conformance.windows import instants

    if args.fit != "w":
        raise InputError(
            "--fit: expected w for recordings, got nw; nobody knows what their drivers read"
        )
    recordings = {folder: _recordings(folder) for folder in (args.source, *args.test_on)}
    shapes = {each.shape for folder in recordings for each in recordings[folder]}
    if len(shapes) != 1:
        raise InputError(
            f"{', '.join(map(str, recordings))}: expected recordings of one car, got {len(shapes)} "
            "shapes; keep one car's recordings in a folder"
        )
    shape = shapes.pop()
    candidates = []
    for name, holds in (("holding steering and acceleration", True), ("holding steering", False)):
        model = HeldBicycle(shape.wheelbase_m, args.ahead, shape.front_m)
        windows = DriveWindows(
            instants(args.window, args.step), args.speed_max, DriveErrors(), holds
        )

        def cut(folder: Path, windows: DriveWindows = windows) -> Measured:
            return windows.of(recordings[folder])

        measured = cut(args.source)
        elsewhere = windows_elsewhere(args, measured, cut)
        candidates.append(Candidate(f"bicycle {name}", model, measured, elsewhere))
    return Subject(
        "Recordings", args.source, vehicle, file, tuple(candidates),
        _split(args, candidates[0].measured),
        {**_MOST_OF_A_CAR, "wheelbase_m": _MOST_WHEELBASE * shape.wheelbase_m},
        discs=True, disc_error_m=DriveErrors().position_m * 2.0**0.5,
    )  # fmt: skip


def _recordings(folder: Path) -> tuple[Recording, ...]:
    from workbench.estimation.tables import Table
    from workbench.simulation.recording import VEHICLE_COLUMNS, load_recording

    rows = Table.read(folder, "vehicles", VEHICLE_COLUMNS).rows
    names = sorted({row.text("recording") for row in rows})
    return tuple(load_recording(folder, name) for name in names)
