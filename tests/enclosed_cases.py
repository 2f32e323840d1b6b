"""Loops, points and calls for tests of the enclosed kernel's Functions."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from workbench.controllers import VehicleBrake
from workbench.models import ClosedLoop, Ode
from workbench.models.benchmarks import b1, b2, b2_path
from workbench.reach.online.budget import Ranges
from workbench.reach.online.enclosed import enclosed_functions
from workbench.reach.online.functions import OnlineFunctions
from workbench.reach.online.model import OnlineModel
from workbench.sets import Box

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
AXES = ("x", "y", "steering", "speed", "heading", "station", "offset", "heading_error")


def braking() -> Ode:
    loop = b2_path().system
    assert isinstance(loop, ClosedLoop)
    return ClosedLoop(loop.plant, loop.controller, VehicleBrake(2.0, 3.0, 0.1, 0.1, 0.2)).ode


ODES = {
    "B1": lambda: b1().system.ode,
    "B2": lambda: b2().system.ode,
    "B2-path": lambda: b2_path().system.ode,
    "brake": braking,
}


def ranges_of(ode: Ode) -> Ranges:
    p = np.array(OnlineModel.of(ode).form.parameter_values())
    low, high = (np.array([getattr(d, e) for d in ode.disturbances]) for e in ("lower", "upper"))
    box = Box.from_intervals(dict.fromkeys(ode.names, (-1.0, 1.0)))
    return Ranges(box, (p, p), (low, high), 0.1)


_BUILT: dict[tuple[str, bool], OnlineFunctions] = {}


def built(name: str, *, quadratic: bool) -> OnlineFunctions:
    if (name, quadratic) not in _BUILT:
        ode = ODES[name]()
        axes = tuple(n for n in ode.names if n in AXES) if quadratic else ()
        _BUILT[name, quadratic] = enclosed_functions(ode, ranges_of(ode), quadratic=axes)
    return _BUILT[name, quadratic]


def points(model: OnlineModel, count: int) -> list[list[Array]]:
    """x, p, w, slope, offset: states of all sizes, lines of all slopes."""
    rng = np.random.default_rng(7)
    p = np.array(model.form.parameter_values())
    ode, n, n_k = model.ode, model.n, model.n_k
    found = []
    for _ in range(count):
        x = rng.uniform(-1.0, 1.0, n) * 10.0 ** rng.choice([-300, -9, -2, 0, 0, 0], n)
        # Speeds stay where the speed controller works, parameters as they are.
        x = np.where([name == "speed" for name in ode.names], 2.0 + abs(x), x)
        w = np.array([rng.choice([d.lower, d.nominal, d.upper]) for d in ode.disturbances])
        slope = rng.choice([0.0, 1.0, rng.uniform()], n_k)
        found.append([x, p, w, slope, rng.uniform(-0.4, 0.4, n_k) * (slope < 1.0)])
    return found


def called(function: ca.Function, arguments: Sequence[Array | float]) -> dict[str, Array]:
    outputs = function.call([ca.DM(a) for a in arguments])
    found = dict(zip(function.name_out(), outputs, strict=True))
    return {name: np.array(value.nonzeros(), float) for name, value in found.items()}
