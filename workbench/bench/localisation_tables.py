"""NEES, errors and coverage of the localisation in a generated hall, as docs/localisation shows.

Cars stand, drive, stop and drive again; ranges at 3 Hz are dropped and stray as each table says,
and the site states the share of strays that there is. Run with Python (extra `analysis`) and a C
compiler: `python -m workbench.bench.localisation_tables`; an argument sets the number of cars. It
fails when an entry of the hall's own tables leaves its chi-square band.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
import sys
import tempfile
import time
from pathlib import Path

import casadi as ca
import numpy as np

from workbench.codegen.c_source import FLOOR, function_text
from workbench.codegen.compiler import compile_shared
from workbench.estimation.lanes import Array, lanes
from workbench.estimation.localisation import Localiser
from workbench.estimation.localisation_filter import FilterFunctions, filter_functions
from workbench.estimation.localisation_scores import (
    ENTRIES,
    NeesRow,
    Run,
    alignment_instants,
    coverage_at,
    error_summary,
    estimated,
    half_widths,
    nees_table,
)
from workbench.estimation.localisation_sets import LEVELS, EllipsoidHull, UnionBound
from workbench.estimation.localisation_site import Site, hall_path, load_site
from workbench.estimation.localisation_world import Faults, Leg, figure_eight, generated_drive
from workbench.runtime.localiser.car import Car
from workbench.runtime.localiser.native_steps import SYMBOLS, native_steps

# Specification
WHEELBASE_M = 1.75
CERTAINTY = 0.99
WORLDS = ((0.0, 0.0), (0.3, 0.0), (0.0, 0.1), (0.3, 0.1))
STRAY_MEAN_M = 1.0
INSTANTS_S = (9.0, 15.0, 25.0, 35.0, 43.0)
# While a car comes to rest the filter allows for accelerations that are over: only too much NEES
# would be a fault of its speed then.
SEED = 7
PERCENTS = (50.0, 95.0, 99.0, 99.9, 100.0)
OTHER_DRIVE = (
    Leg(6.0, 0.0, 0.0), Leg(14.0, 1.5, -0.1), Leg(20.0, 3.5, 0.1), Leg(30.0, 0.0, 0.0),
    Leg(40.0, 1.0, 0.3),
)  # fmt: skip
RESTING = "coming to rest, 21.7 s"
ERROR_HEADER = ["dropped", "stray", "median", "95 %", "99 %", "99.9 %", "worst", "within 0.2 m",
                "heading 95 %", "99 %"]  # fmt: skip
COVERED_HEADER = ["dropped", "stray", "shape", *(f"{100 * level:g} %" for level in LEVELS)]
SIZE_HEADER = ["dropped", "stray", "shape", "x, m", "y, m", "heading, rad", "speed, m/s",
               "steering, rad"]  # fmt: skip


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")


def moments(run: Run) -> dict[str, Array]:
    """When NEES is taken, each car's own instant."""
    start = alignment_instants(run)
    at = {"start: heading becomes known": start, "start + 1 s": start + 1.0}
    for name, at_s in (("straight on, 9 s", 9.0), ("curve, 14 s", 14.0), ("curve, 18 s", 18.0),
                       (RESTING, 21.7), ("standing, 23 s", 23.0), ("standing, 30.9 s", 30.9),
                       ("off again, 31.5 s", 31.5), ("off again, 33 s", 33.0),
                       ("other curve, 37 s", 37.0), ("end, 43 s", 43.0)):  # fmt: skip
        at[name] = np.full(run.errors.shape[1], at_s)
    return at


def shared_object(site: Site) -> bytes:
    """The functions as they run on the vehicle."""
    made = filter_functions(site, wheelbase_m=WHEELBASE_M)
    text = "\n".join(["#include <math.h>", FLOOR, function_text(made.all())])
    return compile_shared(text).shared_object


def compiled(site: Site) -> FilterFunctions:
    """The same, as CasADi calls them."""
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        path = Path(folder) / "filter.so"
        path.write_bytes(shared_object(site))
        # Loaded here and now; the file is not asked for again.
        return FilterFunctions(*(ca.external(name, str(path)) for name in SYMBOLS))


def table(rows: list[list[str]]) -> str:
    """Markdown; the first row is the header."""
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])


def run_of(dropped: float, stray: float, cars: int) -> Run:
    """Drive the cars of one world through the filter."""
    site = load_site(hall_path())
    site = dataclasses.replace(site, ranges=dataclasses.replace(site.ranges, stray_share=stray))
    faults = Faults(dropped, stray, STRAY_MEAN_M)
    drive = generated_drive(
        site, figure_eight(), faults, cars=cars, wheelbase_m=WHEELBASE_M, seed=SEED
    )
    return estimated(Localiser.of(site, compiled(site)), drive)


def main(cars: int) -> bool:
    """Print all tables; True: everything is inside its band."""
    inside, errors, covered, sizes = True, [ERROR_HEADER], [COVERED_HEADER], [SIZE_HEADER]
    for dropped, stray in WORLDS:
        run, world = run_of(dropped, stray, cars), [f"{100 * dropped:g} %", f"{100 * stray:g} %"]
        found = nees_table(run, moments(run), certainty=CERTAINTY)
        _say(f"\n{world[0]} of ranges dropped, {world[1]} stray; {cars} cars, headings known "
              f"after {alignment_instants(run).max():.1f} s at the latest\n")  # fmt: skip
        rows = [[row.moment, *cells(row)] for row in found]
        _say(table([["", *ENTRIES], *rows, band(found[0])]))
        inside = inside and all(sound(row) for row in found)
        errors.append([*world, *error_cells(run)])
        for shape in (EllipsoidHull(), UnionBound()):
            name = type(shape).__name__
            shares = [coverage_at(run, at_s, shape, LEVELS) for at_s in INSTANTS_S]
            means = [np.mean([share[level] for share in shares]) for level in LEVELS]
            covered.append([*world, name, *(f"{100 * mean:.2f} %" for mean in means)])
            wide = half_widths(run, shape, 0.99, (50.0, 99.0))
            sizes.append([*world, name, *(f"{w[50.0]:.3f}, {w[99.0]:.3f}" for w in wide.values())])
    for title, rows in (("Errors, all instants with a known heading", errors),
                        ("Share of states in the joint sets", covered),
                        ("Half-widths of the 99 % set: median, 99 %", sizes)):  # fmt: skip
        _say(f"\n{title}\n\n{table(rows)}")
    other_worlds(cars)
    _say(f"\n{table(costs())}\n\n{table(message_costs())}")
    return inside


def other_worlds(cars: int) -> None:
    """Another drive, 30 % dropped and 10 % stray, where less is known: NEES, to be read only."""
    hall = load_site(hall_path())
    four = dataclasses.replace(
        hall, beacons=(hall.beacons[0], hall.beacons[1], *hall.beacons[2::2])
    )
    loose = dataclasses.replace(hall, motion=dataclasses.replace(
        hall.motion, heading_slip=0.01, forward_slip=0.03, lateral_slip=0.02, acceleration=0.3,
        steering_rate=0.03,
    ))  # fmt: skip
    unheard = dataclasses.replace(
        hall, motion=dataclasses.replace(hall.motion, acceleration=1.0, steering_rate=0.2)
    )
    errors = [["", *ERROR_HEADER[2:]]]
    for title, world, assumed in (("four beacons", four, four), ("a car that slips", loose, loose),
                                  ("commands unknown", hall, unheard)):  # fmt: skip
        faults = Faults(0.3, 0.1, STRAY_MEAN_M)
        drive = generated_drive(
            world, OTHER_DRIVE, faults, cars=cars, wheelbase_m=WHEELBASE_M, seed=SEED
        )
        if assumed is not world:
            drive = dataclasses.replace(drive, commands=np.zeros_like(drive.commands))
        run = estimated(Localiser.of(assumed, compiled(assumed)), drive)
        start = alignment_instants(run)
        at = {"start": start} | {f"{t:g} s": np.full(cars, t) for t in (12.0, 19.0, 26.0, 40.0)}
        found = nees_table(run, at, certainty=CERTAINTY)
        rows = [[row.moment, *cells(row)] for row in found]
        _say(f"\n{title}\n\n{table([['', *ENTRIES], *rows, band(found[0])])}")
        errors.append([title, *error_cells(run)])
    _say(f"\n{table(errors)}")


def error_cells(run: Run) -> list[str]:
    """One row of errors."""
    seen = error_summary(run, PERCENTS)
    return [
        *(f"{value:.3f} m" for value in seen.place_m.values()),
        f"{100 * seen.within_20_cm:.3f} %",
        *(f"{seen.heading_rad[p]:.4f} rad" for p in (95.0, 99.0)),
    ]


def costs() -> list[list[str]]:
    """Time of one call of each compiled function."""
    functions, n = compiled(load_site(hall_path())), 2000
    rows = [["function", "microseconds"]]
    for function in functions.all():
        call = lanes(function)
        given = [np.full((n, function.numel_in(k)), 0.01) for k in range(function.n_in())]
        call(*given)
        begun = time.perf_counter()
        call(*given)
        rows.append([function.name(), f"{(time.perf_counter() - begun) / n * 1e6:.2f}"])
    return rows


def message_costs() -> list[list[str]]:
    """Time that a message takes on the vehicle: Python, its copies and the compiled functions."""
    site = load_site(hall_path())
    drive = generated_drive(
        site, figure_eight(), Faults(0.3, 0.1, STRAY_MEAN_M), cars=1, wheelbase_m=WHEELBASE_M,
        seed=SEED,
    )  # fmt: skip
    car, spent = Car(site, native_steps(shared_object(site)), at_s=0.0), Spent()
    columns = (drive.times_s, drive.speed_mps[:, 0], drive.steering_rad[:, 0])
    for k, (at_s, speed, steering) in enumerate(zip(*(c.tolist() for c in columns), strict=True)):
        begun = time.perf_counter()
        car.reported(at_s=at_s, speed_mps=speed, steering_rad=steering, commands=None)
        spent.note("a pair of reports", car, begun)
        for beacon, range_m in enumerate(drive.ranges_m[k, 0].tolist()):
            if math.isfinite(range_m):
                begun = time.perf_counter()
                car.ranged(at_s=at_s, beacon=beacon, range_m=range_m)
                spent.note("a range", car, begun)
    return [["microseconds, median", *Spent.PHASES], *spent.rows()]


class Spent:
    """Times of messages, by kind and by what was known of the car after them."""

    PHASES = ("not placed", "32 headings followed", "one heading")

    def __init__(self) -> None:
        self._found: dict[tuple[str, str], list[float]] = {}

    def note(self, kind: str, car: Car, begun: float) -> None:
        """One message more, which has just ended."""
        took = time.perf_counter() - begun
        phase = self.PHASES[car.placed + car.aligned]
        self._found.setdefault((kind, phase), []).append(took)

    def rows(self) -> list[list[str]]:
        """One row for each kind."""
        kinds = dict.fromkeys(kind for kind, _ in self._found)
        return [
            [kind, *(f"{1e6 * statistics.median(self._found[kind, p]):.1f}" for p in self.PHASES)]
            for kind in kinds
        ]


def cells(row: NeesRow) -> list[str]:
    """Values; those outside their bands with a star."""
    return [
        f"{value:.2f}{'*' if name in row.outside else ''}" for name, value in row.values.items()
    ]


def band(row: NeesRow) -> list[str]:
    """Bands as a last row."""
    return ["band", *(f"{low:.2f}..{high:.2f}" for low, high in row.bands.values())]


def sound(row: NeesRow) -> bool:
    """Inside, or surer than said while coming to rest."""
    if row.moment != RESTING:
        return not row.outside
    return set(row.outside) <= {"speed"} and row.values["speed"] <= row.bands["speed"][1]


if __name__ == "__main__":
    sys.exit(0 if main(int(sys.argv[1]) if len(sys.argv) > 1 else 500) else 1)
