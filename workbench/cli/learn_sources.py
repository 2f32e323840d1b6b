"""Whose runs `workbench learn` learns from: a model's, a plant's, recorded ones, a function's."""

from __future__ import annotations

import argparse
import hashlib
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, final

from workbench.cli.analysis_options import Subject, chosen_subject, number
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.sensitivity.learning.drawing import Workforce
    from workbench.sensitivity.learning.pairs import PairSource, Simulator
    from workbench.sets import Box

MODEL: Final = "model"
COMPILED: Final = "compiled"
PLANTS: Final = ("bicycle", "single-track", "multi-body")
_FUNCTION: Final = re.compile(r"(?P<file>.+\.py):(?P<name>[A-Za-z_]\w*)")
# Pairs per block: a block of the slow ones is seconds of work, which an interruption loses.
_FAST_BLOCK: Final = 1024
_SLOW_BLOCK: Final = 32


@final
@dataclass(frozen=True, slots=True)
class Source:
    """Pairs of runs and what they are of.

    kind: what `--from` said; title: for headings; units: of the states; identity: JSON values that
    change with whatever changes the runs; box: both ends are from, None for recordings; simulator:
    None for recordings; workforce: who draws.
    """

    kind: str
    title: str
    units: tuple[str, ...]
    identity: Mapping[str, Any]
    pairs: PairSource
    box: Box | None
    simulator: Simulator | None
    workforce: Workforce

    @property
    def names(self) -> tuple[str, ...]:
        """The states."""
        return self.pairs.names


def add_source_options(parser: argparse.ArgumentParser) -> None:
    """Add `--from`, `--start`, `--radius` and `--jobs`; `chosen_source` reads them."""
    parser.add_argument(
        "--from", dest="source", default=MODEL, metavar="SOURCE",
        help="whose runs: model (default) or compiled (the model in C); bicycle, single-track or "
        "multi-body (that plant under the simulated vehicle's controller and drive-by-wire); a "
        "folder of drives (`workbench drives`) or recordings; FILE.py:FUNCTION, called as "
        "function(state, times, seed) and giving one row of states per time",
    )  # fmt: skip
    parser.add_argument(
        "--start", nargs=3, action="append", metavar=("STATE", "LOW", "HIGH"), default=[],
        help="a state of the function and the range it starts from; once per state, in their order",
    )  # fmt: skip
    parser.add_argument(
        "--radius", nargs=2, action="append", metavar=("STATE", "R"), default=[],
        help="of a folder's runs: two starts make a pair if both are within R of a common state",
    )  # fmt: skip
    parser.add_argument(
        "--jobs", type=int, metavar="N", help="processes that draw (default: one per core)"
    )


def chosen_source(args: argparse.Namespace, subject: Subject | None = None) -> Source:
    """What `--from` names; subject: the model, None to read it from the options.

    Raises InputError for options that do not belong to it, and for a source that is not there.
    """
    kind: str = args.source
    found = _FUNCTION.fullmatch(kind)
    if args.jobs is not None and args.jobs < 1:
        raise InputError(f"--jobs: expected a whole number >= 1, got {args.jobs}")
    _refuse_foreign(args, function=found is not None)
    if kind in (MODEL, COMPILED):
        return _model(args, subject or chosen_subject(args))
    if kind in PLANTS:
        return _plant(args)
    if found is not None:
        return _function(args, Path(found["file"]), found["name"])
    if Path(kind).is_dir():
        return _recorded(args, Path(kind))
    raise InputError(
        f"--from: expected {MODEL}, {COMPILED}, {', '.join(PLANTS)}, a folder of runs, or "
        f"FILE.py:FUNCTION, got {kind!r}, which is no folder"
    )


def _refuse_foreign(args: argparse.Namespace, *, function: bool) -> None:
    """Options of another source."""
    kind = args.source
    simulated = kind in (MODEL, COMPILED, *PLANTS)
    if args.start and not function:
        raise InputError(f"--start: expected --from FILE.py:FUNCTION, got --from {kind}")
    if args.radius and (simulated or function):
        raise InputError(f"--radius: expected --from with a folder of runs, got --from {kind}")
    model_only = ("system",) if kind in PLANTS else ("system", "vehicle", "curvature")
    for option in () if kind in (MODEL, COMPILED) else model_only:
        if getattr(args, option) is not None:
            raise InputError(
                f"--{option}: expected --from {MODEL}, got --from {kind}; leave one of them out"
            )


def _workforce(args: argparse.Namespace, chunk: int, *, isolated: bool = False) -> Workforce:
    from workbench.sensitivity.learning.drawing import Workforce

    jobs = args.jobs or len(os.sched_getaffinity(0))
    return Workforce(jobs, chunk, isolated)


def _model(args: argparse.Namespace, subject: Subject) -> Source:
    from workbench.cli.learned_file import loop_of
    from workbench.codegen.compiled_simulator import CompiledSimulator
    from workbench.sensitivity.learning.model_simulator import ModelSimulator
    from workbench.sensitivity.learning.simulated_pairs import SimulatedPairs

    ode = subject.system.ode
    make = ModelSimulator.of if args.source == MODEL else CompiledSimulator.of
    simulator: Simulator = make(subject.system, horizon_s=args.horizon, step_s=args.step)
    return Source(
        args.source, subject.name, tuple(state.unit for state in ode.states), loop_of(subject),
        SimulatedPairs(simulator, subject.initial_set, args.seed), subject.initial_set, simulator,
        _workforce(args, _FAST_BLOCK),
    )  # fmt: skip


def _plant(args: argparse.Namespace) -> Source:
    from workbench.cli.common import chosen_vehicle
    from workbench.models.bicycle import PathFrame
    from workbench.models.vehicle import load_vehicle
    from workbench.sensitivity.learning.simulated_pairs import SimulatedPairs
    from workbench.sensitivity.sampling import instants
    from workbench.simulation.plant_simulator import PlantSimulator
    from workbench.simulation.simulated import simulated_path

    low, high = args.curvature or (0.0, 0.0)
    if low != high:
        raise InputError(
            f"--curvature: expected one curvature for --from {args.source}, LOW = HIGH, got "
            f"{low:g} {high:g}; a run follows one road"
        )
    vehicle = chosen_vehicle(args) if args.vehicle else load_vehicle(simulated_path())
    times = instants(args.horizon, args.step)
    simulator = PlantSimulator(args.source, vehicle, low, times)
    box = vehicle.initial_set
    states = vehicle.closed_loop(vehicle.track(), PathFrame(low, high)).ode.states
    digest = hashlib.sha256(repr(vehicle).encode()).hexdigest()
    identity = {
        "plant": args.source, "curvature_per_m": low, "states": list(simulator.names),
        "initial_set": _intervals(box),
        "vehicle": vehicle.name, "vehicle_sha256": digest,
    }  # fmt: skip
    return Source(
        args.source, f"{args.source} plant, {vehicle.name}", tuple(s.unit for s in states),
        identity, SimulatedPairs(simulator, box, args.seed), box, simulator,
        _workforce(args, _SLOW_BLOCK),
    )  # fmt: skip


def _function(args: argparse.Namespace, file: Path, name: str) -> Source:
    from workbench.sensitivity.learning.function_simulator import FunctionSimulator
    from workbench.sensitivity.learning.simulated_pairs import SimulatedPairs
    from workbench.sensitivity.sampling import instants

    if not args.start:
        raise InputError(
            "--start: expected the states of the function, each with the range it starts from, "
            "got none; add for example --start position 0.9 1.1"
        )
    try:
        text = file.read_bytes()
    except OSError as error:
        raise InputError(
            f"--from: expected a Python file that can be read, got {file} ({error.strerror}); "
            "check the path"
        ) from error
    box = _started(args.start)
    simulator = FunctionSimulator(file, name, box.names, instants(args.horizon, args.step))
    identity = {
        "file": file.name, "function": name, "sha256": hashlib.sha256(text).hexdigest(),
        "states": list(box.names), "initial_set": _intervals(box),
    }  # fmt: skip
    return Source(
        args.source, f"{file.name}:{name}", ("",) * len(box.names), identity,
        SimulatedPairs(simulator, box, args.seed), box, simulator,
        _workforce(args, _SLOW_BLOCK, isolated=True),
    )  # fmt: skip


def _started(starts: list[list[str]]) -> Box:
    from workbench.sets import Box

    intervals: dict[str, tuple[float, float]] = {}
    for state, low, high in starts:
        interval = _number("--start", low), _number("--start", high)
        if not interval[0] <= interval[1]:
            raise InputError(f"--start {state}: expected LOW <= HIGH, got {low} {high}; swap them")
        if state in intervals:
            raise InputError(f"--start: expected each state once, got {state} twice")
        intervals[state] = interval
    return Box.from_intervals(intervals)


def _recorded(args: argparse.Namespace, folder: Path) -> Source:
    from workbench.sensitivity.sampling import instants
    from workbench.simulation.recorded_stretches import recorded_pairs, unit_of

    radius = {state: _number("--radius", value) for state, value in args.radius}
    negative = [state for state, value in radius.items() if value < 0.0]
    if negative:
        raise InputError(f"--radius: expected numbers >= 0, got one below for {negative[0]}")
    pairs = recorded_pairs(folder, instants(args.horizon, args.step), radius, args.seed)
    digest = hashlib.sha256()
    for file in sorted(folder.glob("*.csv*")):
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    identity = {
        "folder": folder.resolve().name, "sha256": digest.hexdigest(),
        "radius": dict(zip(pairs.names, pairs.radius, strict=True)),
    }  # fmt: skip
    return Source(
        args.source, f"runs of {folder.resolve().name}", tuple(map(unit_of, pairs.names)),
        identity, pairs, None, None, _workforce(args, _SLOW_BLOCK),
    )  # fmt: skip


def _number(option: str, text: str) -> float:
    try:
        return number(text)
    except argparse.ArgumentTypeError as error:
        raise InputError(f"{option}: {error}") from None


def _intervals(box: Box) -> dict[str, list[float]]:
    return {name: list(box.interval(name)) for name in box.names}
