"""Golden vectors: queries with the results that this machine's build gave, bit for bit."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from workbench.codegen.native_calls import exported_size
from workbench.models.system import Ode
from workbench.runtime.manifest import Field, Golden, Kernel
from workbench.runtime.native import NativeKernel
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import FOREVER_S, Person, TrackedPerson, packed

if TYPE_CHECKING:
    from workbench.codegen.bundle import MonitorSpec

_SPACING_M = 0.5


def golden_vectors(
    library: bytes, query: Sequence[Field], result: Sequence[Field], spec: MonitorSpec, ode: Ode
) -> tuple[dict[str, int], tuple[Golden, ...]]:
    """The kernel's sizes and its answers to a few telling queries.

    They cover a free road, people in the way, aside and crossing, a bend, a path that ends too
    early, a start from standstill, more people than fit, and a NaN.
    """
    sizes = {
        "query_size": query[-1].offset + query[-1].count,
        "result_size": result[-1].offset + result[-1].count,
        "work_size": exported_size(library, "wb_work_size"),
    }
    kernel = NativeKernel(library, Kernel("wb_decide", **sizes))
    vectors = []
    for values in _questions(query, spec, ode):
        numbers = _laid_out(query, values)
        kernel.query[:] = memoryview(array("d", numbers))
        returns = kernel.run()
        vectors.append(Golden(tuple(numbers), tuple(kernel.result), returns))
    return sizes, tuple(vectors)


def _questions(
    query: Sequence[Field], spec: MonitorSpec, ode: Ode
) -> list[dict[str, Sequence[float]]]:
    nodes = next(field.count for field in query if field.name == "path_x")
    initial, body = spec.vehicle.initial_set, spec.vehicle.geometry
    box = initial.reordered(ode.names)
    base: dict[str, Sequence[float]] = {
        **_levels(spec, box.center, box.radius), "parameters": ode.parameter_values(),
        **_arc(0.0, nodes), "front_m": [body.front_m], "rear_m": [body.rear_m],
        "half_width_m": [body.half_width_m], "clearance_required_m": [0.2],
        "skew_s": [0.0, 0.02], "switch_s": [0.15, 0.19], "brake_s": [0.0, 0.09],
    }  # fmt: skip
    ahead = Person("ahead", 8.0, 0.0, 0.0, 0.0, 0.5, 0.3, 0.5)
    aside = Person("aside", 6.0, 9.0, 1.4, 0.0, 0.5, 0.3, 0.5)
    crossing = Person("crossing", 7.0, 4.0, 0.0, -1.4, 0.5, 0.3, 0.5)
    standing = [
        0.0 if name == "speed" else c for name, c in zip(ode.names, box.center, strict=True)
    ]
    return [
        base,
        base | _people(spec, ahead),
        base | _people(spec, aside, crossing),
        base | _arc(0.1, nodes) | _people(spec, aside),
        base | _arc(0.0, 12) | _people(spec, aside),
        base
        | _levels(spec, standing, box.radius)
        | {"start_s": [0.05, 0.09]}
        | _people(spec, aside),
        base | _people(spec, ahead) | {"people_count": [33.0]},
        base | {"initial_center": [math.nan] * len(base["initial_center"])},
    ]


def _levels(
    spec: MonitorSpec, center: Sequence[float], radius: Sequence[float]
) -> dict[str, Sequence[float]]:
    return {
        "initial_center": list(center) * len(spec.levels),
        "initial_radius": [level.share * r for level in spec.levels for r in radius],
    }


def _people(spec: MonitorSpec, *people: Person) -> dict[str, Sequence[float]]:
    """Each with what they intend and with the guard of the vehicle file, seen at the stamp."""
    limits = spec.vehicle.guard
    most = MotionLimits(limits.speed_max_mps, limits.accel_max_mps2)
    everybody = []
    for person in people:
        place = Disc(person.x_m, person.y_m, person.radius_m)
        guard = Guard(0.0, place, Disc(person.vx_mps, person.vy_mps, 0.2), most)
        tubes = (person.intent, guard_disc(guard, from_s=0.0, until_s=FOREVER_S))
        everybody.append(TrackedPerson(person.name, tubes))
    numbers = packed(everybody)
    return {
        "people_count": [float(numbers.count)], "tubes_count": [2.0 * len(people)],
        "people_tubes": numbers.tubes, "people_pieces": numbers.pieces,
    }  # fmt: skip


def _arc(curvature: float, count: int) -> dict[str, Sequence[float]]:
    """A path from 4 m behind the origin, straight or bending left with 1/curvature m radius."""
    stations = [_SPACING_M * k - 4.0 for k in range(count)]
    if curvature:
        x = [math.sin(curvature * s) / curvature for s in stations]
        y = [(1 - math.cos(curvature * s)) / curvature for s in stations]
    else:
        x, y = stations, [0.0] * count
    bins = [curvature] * (count - 1)
    return {
        "path_count": [float(count)], "path_start_m": [stations[0]], "path_spacing_m": [_SPACING_M],
        "path_x": x, "path_y": y, "path_heading": [curvature * s for s in stations],
        "path_curvature_lower": bins, "path_curvature_upper": bins,
    }  # fmt: skip


def _laid_out(query: Sequence[Field], values: Mapping[str, Sequence[float]]) -> list[float]:
    numbers: list[float] = []
    for field in query:
        given = list(values.get(field.name, field.default or ()))
        numbers += given[: field.count] + [0.0] * (field.count - len(given))
    return numbers
