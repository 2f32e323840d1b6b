"""In the loop with the real monitor: FailSafe keeps every moving car clear of who changes their
mind, whatever was believed of them, where the paper's single intent with a constant radius does
not; and the study refuses to claim it of runs in which it is not so."""

from __future__ import annotations

import dataclasses
import functools
import math
import tempfile
from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")
pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

from decision_fixture import write_real_bundle

from studies import changed_goals as study
from workbench.estimation.motion_parameters import shipped_motion
from workbench.estimation.people_guards import LimitsGuards
from workbench.models.vehicle import gem_e2
from workbench.runtime import Bundle, MotionLimits, load_bundle
from workbench.simulation.changing_minds import Change, Way, mind
from workbench.simulation.mind_outcomes import Outcome

VEHICLE = gem_e2()
BOTH, SAFE, FITTED, _, LIKELIEST, _ = study.setups(VEHICLE, shipped_motion())


@functools.cache
def bundle() -> Bundle:
    with tempfile.TemporaryDirectory() as folder:
        return load_bundle(write_real_bundle(Path(folder) / "bundle"))


def driven(setup: study.Setup, change: Change = Change.ACROSS, seed: int = 0) -> Outcome:
    scene = mind(change, VEHICLE, Way.of(VEHICLE), seed)
    return study.drive(bundle(), VEHICLE, setup, scene, seed)


@pytest.mark.parametrize("setup", [BOTH, SAFE, FITTED], ids=lambda setup: setup.name)
def test_no_moving_car_of_fail_safe_touches_who_turns_across(setup: study.Setup) -> None:
    outcome = driven(setup)
    assert outcome.nearest_m >= study.CLEARANCE_M
    assert outcome.broken == 0
    assert outcome.way_m > 5.0
    assert outcome.wait_s is not None
    assert 0.0 <= outcome.wait_s < 4.0


def test_the_likeliest_intent_alone_hits_them() -> None:
    """What is checked above can fail."""
    assert driven(LIKELIEST).nearest_m < 0.0


def test_who_breaks_the_limits_of_a_guard_that_is_too_small_is_named_while_driving() -> None:
    """The monitor holds everybody to no less than the bundle's limits: nobody is met even so."""
    wide = study.MODELS.guards(study.limits_of(VEHICLE)).on_foot
    law = dataclasses.replace(wide, limits=MotionLimits(1.0, 0.2))
    small = dataclasses.replace(SAFE, name="small", guards=LimitsGuards(law, law))
    outcome = driven(small)
    assert outcome.broken > 0
    assert outcome.nearest_m >= study.CLEARANCE_M


def made(nearest_m: float, *, broken: int = 0) -> study.Results:
    """Runs as they must be, but for one of FailSafe alone."""
    good = Outcome("turns", 0.5, 1.0, 2.0, 2, 1, 9.0, 0)
    names = [setup.name for setup in study.setups(VEHICLE, shipped_motion())]
    results = {name: {change: [good, good] for change in Change} for name in names}
    bad = dataclasses.replace(good, nearest_m=nearest_m, broken=broken)
    results[SAFE.name][Change.STAYS] = [good, bad]
    return results


def test_the_claim_is_refused_where_a_promised_run_comes_near_or_breaks_the_limits() -> None:
    assert "inside the limits" in study.check(VEHICLE, made(0.2))
    with pytest.raises(AssertionError, match=r"FailSafe alone: assumed limits: 0\.19 m"):
        study.check(VEHICLE, made(0.19))
    with pytest.raises(AssertionError, match="broke the limits"):
        study.check(VEHICLE, made(0.2, broken=1))


def test_the_tables_count_what_the_runs_say(tmp_path: Path) -> None:
    results = made(-0.1)
    waits = [0.5, 0.75, 1.0, math.inf]
    good = results[BOTH.name][Change.ACROSS][0]
    results[BOTH.name] = {
        Change.ACROSS: [dataclasses.replace(good, wait_s=wait, stops=k) for k, wait in
                        enumerate(waits)]
    }  # fmt: skip
    lines = study.tables(results).splitlines()
    assert "| turns | 4 | 75% | 0.8 s | never |" in lines
    row = "| both: every intent, assumed limits | turns across, to a goal of the set | 0 of 4 |"
    assert f"{row} 1.00 m | 1.5 | 67% | 9.0 m |" in lines
    assert any("| 1 of 2 | -0.10 m | 2.0 | 50% | 9.0 m |" in line for line in lines)
    study.plot(results, tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 1000
