"""The vehicle's steps, through ctypes, give CasADi's bits: call by call and over whole drives."""

from __future__ import annotations

import math
import random
from array import array

import numpy as np
import pytest
from localisation_cases import USUAL, compiled_functions, functions, hall
from localiser_cases import drives, spec, steps, unheard

from workbench.codegen.c_source import FLOOR, function_text
from workbench.codegen.compiler import compile_shared
from workbench.errors import InputError
from workbench.estimation.localisation import Localiser
from workbench.estimation.localisation_filter import filter_functions
from workbench.estimation.localisation_steps import casadi_steps
from workbench.estimation.localisation_world import Drive, figure_eight
from workbench.runtime.localiser.car import Car, Status
from workbench.runtime.localiser.folder import called
from workbench.runtime.localiser.native_steps import SYMBOLS, native_steps
from workbench.runtime.localiser.site import Site
from workbench.runtime.localiser.states import HYPOTHESES
from workbench.runtime.localiser.steps import FOUND, GIVEN, NAMES, Steps


def desk() -> Steps:
    """CasADi's own evaluation of the functions that were compiled."""
    made = filter_functions(spec().site, wheelbase_m=spec().vehicle.wheelbase_m)
    return casadi_steps(made)


def followed(site: Site, steps: Steps, drive: Drive, car: int) -> list[bytes]:
    """All that is known after each report, bit by bit."""
    mine, found = Car(site, steps, at_s=0.0), []
    for k, time in enumerate(drive.times_s.tolist()):
        mine.reported(
            at_s=time, speed_mps=float(drive.speed_mps[k, car]), commands=None,
            steering_rad=float(drive.steering_rad[k, car]),
        )  # fmt: skip
        for beacon, value in enumerate(drive.ranges_m[k, car].tolist()):
            if k % 10 == 0:
                mine.ranged(at_s=time, beacon=beacon, range_m=None if math.isnan(value) else value)
        parts = (mine.mean, mine.covariance, mine.each_mean, mine.each_covariance)
        flags = bytes([mine.placed, mine.aligned, mine.standing, mine.refused])
        found.append(b"".join(map(bytes, parts)) + array("d", mine.logs).tobytes() + flags)
    return found


@pytest.mark.parametrize("name", NAMES)
def test_any_numbers_give_the_same_bits(name: str) -> None:
    ours, theirs, chance = steps(), desk(), random.Random(name)
    for one in (name, *([f"each_{name}"] if name in NAMES[:4] else [])):
        count = sum(map(len, getattr(ours, one).given))
        for scale in (1e-3, 1.0, 30.0):
            given = array("d", (chance.gauss(0.0, scale) for _ in range(count)))
            a, b = (called(getattr(each, one), given) for each in (ours, theirs))
            assert np.array(a).tobytes() == np.array(b).tobytes() or np.isnan(a).any(), one
            assert np.array_equal(a, b, equal_nan=True), one


@pytest.mark.parametrize("seed", [51, 52])
def test_whole_drives_give_the_same_bits(seed: int) -> None:
    drive, theirs = drives(3, seed, figure_eight(), USUAL), desk()
    for car in range(3):
        ours = followed(unheard(), steps(), drive, car)
        assert ours == followed(unheard(), theirs, drive, car)
        assert ours[-1][-3] == 1, "it has been aligned"


def test_the_desk_s_many_cars_are_the_vehicle_s_one() -> None:
    """`Localiser` over n cars and a `Car` of its own, message by message."""
    drive, n = drives(3, 53), 3
    many = Localiser.of(hall(), compiled_functions())
    known = many.begin(at_s=0.0, cars=n)
    cars = [Car(hall(), many.steps, at_s=0.0) for _ in range(n)]
    for k in range(9 * 30):
        time, commands = float(drive.times_s[k]), drive.commands[k]
        known = many.reported(known, at_s=time, speed_mps=drive.speed_mps[k],
                              steering_rad=drive.steering_rad[k], commands=commands)  # fmt: skip
        for c, car in enumerate(cars):
            car.reported(
                at_s=time, speed_mps=float(drive.speed_mps[k, c]),
                steering_rad=float(drive.steering_rad[k, c]),
                commands=(float(commands[c, 0]), float(commands[c, 1])),
            )  # fmt: skip
        for beacon in range(6 if k % 10 == 0 else 0):
            came = drive.ranges_m[k, :, beacon]
            known = many.ranged(
                known, at_s=time, beacon=beacon, range_m=came, received=np.isfinite(came)
            )
            for car, value in zip(cars, came.tolist(), strict=True):
                car.ranged(at_s=time, beacon=beacon, range_m=None if math.isnan(value) else value)
    assert known.aligned.all()
    for c, car in enumerate(cars):
        assert known.belief.mean[c].tobytes() == bytes(car.mean)
        assert known.belief.covariance[c].tobytes() == bytes(car.covariance)
        assert many.status(known, c) is car.status(now_s=car.stamp_s) is Status.VALID


def test_reports_of_speed_and_of_steering_may_come_by_themselves() -> None:
    """Two messages of one instant say what one with both does."""
    drive = drives(1, 54)
    both, apart = (Car(hall(), steps(), at_s=0.0) for _ in range(2))
    for k in range(8 * 30):
        at_s, v = float(drive.times_s[k]), float(drive.speed_mps[k, 0])
        wheel = float(drive.steering_rad[k, 0])
        both.reported(at_s=at_s, speed_mps=v, steering_rad=wheel, commands=None)
        apart.reported(at_s=at_s, speed_mps=v, steering_rad=None, commands=None)
        apart.reported(at_s=at_s, speed_mps=None, steering_rad=wheel, commands=None)
        for beacon, value in enumerate(drive.ranges_m[k, 0].tolist()):
            if not math.isnan(value):
                both.ranged(at_s=at_s, beacon=beacon, range_m=value)
                apart.ranged(at_s=at_s, beacon=beacon, range_m=value)
    assert both.aligned
    assert apart.aligned
    assert np.allclose(both.mean, apart.mean, rtol=0, atol=1e-6)


def test_a_library_with_other_functions_is_refused() -> None:
    text = "\n".join(["#include <math.h>", FLOOR, function_text(functions().all()[:5])])
    with pytest.raises(InputError, match="does not export wb_loc_collapse"):
        native_steps(compile_shared(text).shared_object)
    swapped = text.replace("wb_loc_report_speed", "wb_loc_x").replace("wb_loc_range", "wb_loc_y")
    swapped = swapped.replace("wb_loc_x", "wb_loc_range").replace("wb_loc_y", "wb_loc_report_speed")
    with pytest.raises(InputError, match=r"wb_loc_report_speed of localiser\.so: expected"):
        native_steps(compile_shared(swapped).shared_object)
    with pytest.raises(InputError, match=r"localiser\.so cannot be loaded"):
        native_steps(b"no library")


def test_sizes_are_those_of_the_functions() -> None:
    made = functions().all()
    assert [f.name() for f in made] == list(SYMBOLS)
    assert [tuple(f.numel_in(k) for k in range(f.n_in())) for f in made] == list(GIVEN)
    assert [tuple(f.numel_out(k) for k in range(f.n_out())) for f in made] == list(FOUND)
    assert all(len(steps().each_predict.given[k]) == HYPOTHESES * GIVEN[0][k] for k in range(5))
