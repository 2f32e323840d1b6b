"""A bundle with a learned tube decides TRACK by it and all else as before, says that it is SAMPLED,
and loads, replays and drives a `Monitor` like every other one."""

from __future__ import annotations

import functools
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from decision_fixture import HORIZON_S, STEP_S, real_files
from runtime_world import arc_table

from workbench.claims import Rigor, Verdict
from workbench.codegen import MonitorSpec
from workbench.codegen.bundle import bundle_files
from workbench.codegen.compiler import find_compiler
from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.vehicle import gem_e2
from workbench.reach import LearnedTube, ReachTube, compute_tube
from workbench.reach.learned.vehicle_beta import learn_vehicle_beta
from workbench.runtime import Bundle, Deciding, Monitor, Observation, Timing, Watched
from workbench.runtime.manifest import SOURCE_FILE
from workbench.sensitivity import LearnedExponential
from workbench.sets import Box
from workbench.simulation.paper.replayed import Asked
from workbench.simulation.paper.tubes import KernelTubes, loaded

VEHICLE = gem_e2()
PATH = arc_table(0.0)
LEVELS = 3


@functools.cache
def method() -> LearnedTube:
    beta = learn_vehicle_beta(
        VEHICLE,
        horizon_s=HORIZON_S,
        method=LearnedExponential(pairs=300, seed=1, step_s=STEP_S, delta=1e-6),
    )
    return LearnedTube(beta, {"offset": 2, "speed": 2}, STEP_S)


@functools.cache
def learned_files() -> dict[str, bytes]:
    return bundle_files(MonitorSpec(VEHICLE, HORIZON_S, STEP_S, learned=method()))


@functools.cache
def learned() -> Bundle:
    return loaded(learned_files())


@functools.cache
def proved() -> Bundle:
    return loaded(real_files())


def asked(share: float = 1.0, *, aside_m: float = 0.0) -> Asked:
    box = VEHICLE.initial_set
    center = dict(zip(box.names, box.center, strict=True))
    radius = dict(zip(box.names, box.radius, strict=True))
    center["offset"] += aside_m
    center["station"] = 25.0
    sides = {
        name: (center[name] - share * radius[name], center[name] + share * radius[name])
        for name in box.names
    }
    speed = VEHICLE.operation.reference_speed_mps
    return Asked(0, (Box.from_intervals(sides),) * LEVELS, speed)


def test_the_manifest_says_what_the_tubes_are_worth() -> None:
    manifest = learned().manifest
    assert manifest.rigor is Rigor.SAMPLED
    assert proved().manifest.rigor is Rigor.ENCLOSED
    assert manifest.tubes == "TRACK learned, others local, linear"
    premise = next(each for each in manifest.assumptions if each.name == "learned bound")
    assert "sampled runs" in premise.evidence
    assert "vertices" in premise.evidence


@pytest.mark.parametrize(("share", "bend"), [(1.0, 0.0), (0.3, 0.0), (0.3, 0.04)])
def test_the_kernels_track_is_the_python_tube(share: float, bend: float) -> None:
    """On a road of constant curvature, as far as it stays in the operating region."""
    question = asked(share)
    tubes = KernelTubes(learned(), VEHICLE, unsure=True, title="")
    rows = tubes.rows(arc_table(bend), question, 0)
    loop = VEHICLE.closed_loop(VEHICLE.track(), PathFrame(bend, bend))
    tube = compute_tube(loop, initial_set=question.sets[0], horizon_s=HORIZON_S, method=method())
    exits = [
        k
        for k in range(len(tube.lower))
        for name in VEHICLE.operation.region.names
        if not _within(tube, k, name)
    ]
    ends = min(exits, default=round(HORIZON_S / STEP_S))
    assert len(rows.lower) == ends >= 40
    assert bool(exits) is (share == 1.0)
    place = [tube.names.index("station"), tube.names.index("offset")]
    assert np.allclose(rows.lower, tube.lower[:ends, place], atol=1e-9)
    assert np.allclose(rows.upper, tube.upper[:ends, place], atol=1e-9)


def _within(tube: ReachTube, k: int, name: str) -> bool:
    low, high = VEHICLE.operation.region.interval(name)
    i = tube.names.index(name)
    return bool(tube.lower[k, i] >= low and tube.upper[k, i] <= high)


def test_other_steps_take_the_larger_of_two_entries() -> None:
    """Steps of 0.03 s lie between those of the table; this beta is monotone in between."""
    question = asked(0.3)
    tubes = KernelTubes(learned(), VEHICLE, unsure=True, title="")
    query = {**tubes.query(PATH, question, 0), "step_s": (0.03,), "horizon_s": (1.5,)}
    result = learned().call(query)
    assert result.scalar("track_rows") == 50.0
    loop = VEHICLE.closed_loop(VEHICLE.track(), PathFrame(0.0, 0.0))
    finer = LearnedTube(method().learned, method().regions, 0.03)
    tube = compute_tube(loop, initial_set=question.sets[0], horizon_s=1.5, method=finer)
    n = len(tube.names)
    lower, upper = (
        np.array(result.rows(f"track_{end}", width=n, count=50)) for end in ("lower", "upper")
    )
    assert (lower <= tube.lower + 1e-9).all()
    assert (upper >= tube.upper - 1e-9).all()
    assert (upper - lower <= 1.1 * (tube.upper - tube.lower)).all()


def test_stopping_and_braking_are_the_proved_ones_bit_for_bit() -> None:
    query = KernelTubes(proved(), VEHICLE, unsure=True, title="").query(PATH, asked(0.5), 0)
    one, other = (bundle.call(query) for bundle in (learned(), proved()))
    for kind in ("stop", "brake"):
        for field in ("lower", "upper", "verdicts", "rows"):
            name = f"{kind}_{field}"
            assert bytes(one.values(name)) == bytes(other.values(name)), name
    assert bytes(one.values("track_upper")) != bytes(other.values("track_upper"))


def test_a_set_outside_of_what_was_learned_has_no_tube() -> None:
    tubes = KernelTubes(learned(), VEHICLE, unsure=True, title="")
    low, high = method().learned.region.interval("offset")  # type: ignore[union-attr]
    inside = asked(aside_m=0.99 * high - VEHICLE.initial_set.interval("offset")[1])
    assert len(tubes.rows(PATH, inside, 0).lower) > 0
    assert len(tubes.rows(PATH, asked(aside_m=high), 0).lower) == 0
    assert low < 0.0 < high


def test_a_monitor_decides_with_it_and_grades_what_it_says() -> None:
    timing = Timing(period_s=0.1, latency_s=9.0, send_gap_s=0.04)
    monitor = Monitor(
        learned(), PATH, release_steps=1, clearance_required_m=0.2, timing=timing,
        deciding=Deciding.LOOK_AHEAD,
    )  # fmt: skip
    seen = Observation(
        (-0.05, 0.05), (-0.05, 0.05), (-0.01, 0.01), (-0.005, 0.005), (2.4, 2.5), (0, 0), (0, 0),
        2.5, people=(), stamp_s=time.monotonic(), watched=Watched(0.0, 0.0, 50.0),
    )  # fmt: skip
    decision = monitor.step(seen)
    assert decision.look_ahead.verdict is Verdict.SAFE, decision.reason
    assert decision.rigor is Rigor.SAMPLED


def test_the_c_text_compiles_without_a_warning(tmp_path: Path) -> None:
    (tmp_path / SOURCE_FILE).write_bytes(learned_files()[SOURCE_FILE])
    strict = ["-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-pedantic", "-Werror"]
    command = [find_compiler(), "-std=c99", "-O1", *strict, "-Wno-unused-parameter", "-c"]
    done = subprocess.run(
        [*command, SOURCE_FILE, "-o", "kernel.o"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_grids_and_horizons_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match="as the others"):
        MonitorSpec(VEHICLE, HORIZON_S, 0.025, learned=method())
    with pytest.raises(InputError, match="expected a time in"):
        bundle_files(MonitorSpec(VEHICLE, 4.0, STEP_S, learned=method()))
