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

if TYPE_CHECKING:
    from workbench.codegen.bundle import MonitorSpec

_SPACING_M = 0.5


def golden_vectors(
    library: bytes, query: Sequence[Field], result: Sequence[Field], spec: MonitorSpec, ode: Ode
) -> tuple[dict[str, int], tuple[Golden, ...]]:
    """The kernel's sizes and its answers to a few telling queries.

    They cover a free road, a person in the way and one aside, a bend, a path that ends too early,
    more people than fit, and a NaN.
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
        "initial_center": box.center, "initial_radius": box.radius,
        **_arc(0.0, nodes), "front_m": [body.front_m], "rear_m": [body.rear_m],
        "half_width_m": [body.half_width_m], "people_count": [0.0],
        "clearance_required_m": [0.2],
    }  # fmt: skip
    ahead, aside = [8.0, 0.0, 0.0, 0.0, 0.5, 0.3, 0.5], [6.0, 9.0, 1.4, 0.0, 0.5, 0.3, 0.5]
    crossing = [7.0, 4.0, 0.0, -1.4, 0.5, 0.3, 0.5]
    return [
        base,
        base | {"people_count": [1.0], "people": ahead},
        base | {"people_count": [2.0], "people": [*aside, *crossing]},
        base | _arc(0.1, nodes) | {"people_count": [1.0], "people": aside},
        base | _arc(0.0, 12) | {"people_count": [1.0], "people": aside},
        base | {"people_count": [33.0], "people": ahead},
        base | {"initial_center": [math.nan, *box.center[1:]]},
    ]


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
