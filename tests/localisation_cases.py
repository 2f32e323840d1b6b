"""Localisers made of compiled functions, and drives to try them on."""

from __future__ import annotations

import dataclasses
import functools
import tempfile
from collections.abc import Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from workbench.codegen.c_source import FLOOR, function_text
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.estimation.lanes import Array
from workbench.estimation.localisation import Localisation, Localiser
from workbench.estimation.localisation_filter import FilterFunctions, filter_functions
from workbench.estimation.localisation_site import Site, hall_path, load_site
from workbench.estimation.localisation_world import Drive, Faults

WHEELBASE_M = 1.75
QUICK = tuple("-O1" if flag == "-O2" else flag for flag in FLAGS)
USUAL = Faults(dropped=0.3, stray=0.1, stray_mean_m=1.0)


@functools.cache
def hall() -> Site:
    return load_site(hall_path())


def c_text(functions: Sequence[ca.Function]) -> str:
    return "\n".join(["#include <math.h>", FLOOR, function_text(functions)])


def compiled(*functions: ca.Function) -> tuple[ca.Function, ...]:
    shared = compile_shared(c_text(functions), flags=QUICK).shared_object
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        path = Path(folder) / "filter.so"
        path.write_bytes(shared)
        # Loaded here and now; the file is not asked for again.
        return tuple(ca.external(f.name(), str(path)) for f in functions)


@functools.cache
def functions() -> FilterFunctions:
    return filter_functions(hall(), wheelbase_m=WHEELBASE_M)


@functools.cache
def compiled_functions() -> FilterFunctions:
    return FilterFunctions(*compiled(*functions().all()))


@functools.cache
def localiser() -> Localiser:
    return Localiser.of(hall(), compiled_functions())


def fed(drive: Drive, car: int, until_s: float, known: Localisation | None = None) -> Localisation:
    """One car's messages up to an instant."""
    mine = localiser()
    known = known or mine.begin(at_s=0.0, cars=1)
    for k, time in enumerate(drive.times_s):
        if not known.stamp_s <= time <= until_s:
            continue
        one = slice(car, car + 1)
        known = mine.reported(
            known, at_s=float(time), speed_mps=drive.speed_mps[k, one],
            steering_rad=drive.steering_rad[k, one], commands=drive.commands[k, one],
        )  # fmt: skip
        for beacon, value in enumerate(drive.ranges_m[k, car]):
            if np.isfinite(value):
                known = mine.ranged(
                    known, at_s=float(time), beacon=beacon, range_m=np.array([value]),
                    received=np.array([True]),
                )  # fmt: skip
    return known


def changed(site: Site, section: str, **values: float) -> Site:
    part = dataclasses.replace(getattr(site, section), **values)
    return dataclasses.replace(site, **{section: part})


def beliefs(rng: np.random.Generator, count: int) -> tuple[Array, Array]:
    """Means in the hall and covariances with every correlation."""
    scale = np.array([0.3, 0.3, 0.1, 0.1, 0.02, 0.01, 0.01])
    mean = np.array([15.0, 10.0, 0.0, 1.5, 0.0, 0.0, 0.0]) + rng.normal(
        0.0, 1.0, (count, 7)
    ) * np.array([8.0, 6.0, 2.0, 0.7, 0.2, 0.01, 0.01])
    root = rng.normal(0.0, 1.0, (count, 7, 9)) * scale[:, None]
    return mean, root @ root.transpose(0, 2, 1)
