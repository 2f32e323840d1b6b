"""Small certificates, and an oracle that judges a certificate's claim by running its model."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import casadi as ca
import numpy as np

from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode
from workbench.reach.certified.certificate import spread_certificate, tube_certificate
from workbench.reach.certified.frame_tube import FrameTube
from workbench.sensitivity import GrowthMatrix, Inputs, Norm, WeightedNorm, derive_discrepancy
from workbench.sensitivity.block_growth import BlockGrowth, Effort
from workbench.sensitivity.discrepancy import DerivationMethod
from workbench.sensitivity.metric_bounds import Form
from workbench.sets import Box

Document = dict[str, Any]
REGION = Box(("angle", "rate"), (-0.8, -0.9), (0.8, 0.9))
RADIUS = {"angle": 0.1, "rate": 0.05}


@functools.cache
def pendulum() -> Ode:
    """A damped pendulum with a limited drive, a gain in a range and a disturbance."""
    x, p, w = ca.SX.sym("x", 2), ca.SX.sym("p", 1), ca.SX.sym("w", 1)
    drive = ca.fmin(ca.fmax(-p * x[0], -0.3), 0.3)
    field = ca.vertcat(x[1], -ca.sin(x[0]) - 0.7 * x[1] + drive + w)
    return Ode(
        "pendulum",
        (Signal("angle", "rad"), Signal("rate", "rad/s")),
        (Ranged("gain", "1/s^2", 0.5, 0.4, 0.6),),
        (Ranged.symmetric("push", "rad/s^2", 0.02),),
        x,
        p,
        w,
        field,
    )


METHODS: dict[str, DerivationMethod] = {
    "growth": GrowthMatrix(cells=4, inputs=Inputs.SAME_PARAMETERS),
    "max": WeightedNorm(norm=Norm.MAX, weights=None, cells=4, inputs=Inputs.SHARED),
    "sum": WeightedNorm(norm=Norm.SUM, weights=None, cells=4, inputs=Inputs.INDEPENDENT),
    "metric": BlockGrowth(
        blocks=(("angle", "rate"),),
        effort=Effort(form=Form.VERTICES, condition_max=1e4, cells=4),
        inputs=Inputs.SAME_PARAMETERS,
    ),
    "blocks": BlockGrowth(
        blocks=(("angle",), ("rate",)),
        effort=Effort(form=Form.VERTICES, condition_max=1e4, cells=4),
        inputs=Inputs.SAME_PARAMETERS,
    ),
}


@functools.cache
def spread(name: str) -> Document:
    """The pendulum's certificate by one method."""
    bound = derive_discrepancy(pendulum(), region=REGION, horizon_s=1.5, method=METHODS[name])
    return spread_certificate(
        pendulum(), bound, initial_radius=RADIUS, instants_s=(0.5, 1.5), slack=1e-9
    )


@functools.cache
def tube() -> Document:
    """Three steps of the pendulum's tube."""
    method = FrameTube(step_s=0.05, parts=1, condition_max=100.0)
    start = Box.around({"angle": 0.2, "rate": 0.1}, radius={"angle": 0.05, "rate": 0.02})
    return tube_certificate(method.prove(pendulum(), initial_set=start, horizon_s=0.15))


_OPERATIONS: dict[str, Any] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "fmin": np.minimum,
    "fmax": np.maximum, "sin": np.sin, "cos": np.cos, "tan": np.tan, "atan": np.arctan,
    "exp": np.exp, "log": np.log, "sqrt": np.sqrt,
}  # fmt: skip


def rates(model: Document, x: Any, u: Any) -> Any:
    """The model's field at states x (n, N) and inputs u (m, N)."""
    values = [*x, *u]
    for name, *operands in model["nodes"]:
        if name == "constant":
            values.append(np.full(x.shape[1], float(operands[0])))
        elif name == "pow":
            values.append(values[int(operands[0])] ** int(operands[1]))
        else:
            values.append(_OPERATIONS[name](*(values[int(k)] for k in operands)))
    return np.array([values[int(k)] for k in model["field"]])


def _advanced(model: Document, x: Any, u: Any, length_s: float) -> Any:
    k1 = rates(model, x, u)
    k2 = rates(model, x + length_s / 2 * k1, u)
    k3 = rates(model, x + length_s / 2 * k2, u)
    return x + length_s / 6 * (k1 + 2 * k2 + 2 * k3 + rates(model, x + length_s * k3, u))


def _corners_and_more(lower: Any, upper: Any, *, count: int, random: Any) -> Any:
    corners = np.array(list(itertools.product(*zip(lower, upper, strict=True)))).T
    inner = random.uniform(0.0, 1.0, (len(lower), count))
    return np.hstack(
        [corners[:, :64], np.array(lower)[:, None] + inner * np.subtract(upper, lower)[:, None]]
    )


def _near(pairs: Any) -> list[tuple[float, float]]:
    """Intervals cut to a size at which doubles and small steps still judge well."""
    ends = [pair or (-1.0, 1.0) for pair in pairs]
    return [(min(max(low, -5.0), 5.0), min(max(high, -5.0), 5.0)) for low, high in ends]


def spread_holds(document: Document) -> bool:
    """Whether pairs of runs that stay in the region keep to the widths; False: refuted."""
    model, claim, random = document["model"], document["claim"], np.random.default_rng(3)
    ends = _near(claim["region"])
    first = _corners_and_more(*np.array(ends).T, count=300, random=random)
    initial = np.minimum(np.array(claim["initial"]), 5.0)[:, None]
    apart = np.sign(random.uniform(-1, 1, first.shape)) * random.choice([0.3, 1.0], first.shape[1])
    second = first + initial * apart
    low, high = np.array(_near(claim["ranges"])).reshape(-1, 2).T[:, :, None]
    u = low + random.choice([0.0, 0.5, 1.0], (len(low), first.shape[1])) * (high - low)
    gap = np.array(claim["differences"], dtype=float)[:, None]
    v = np.clip(u + gap * random.choice([-1.0, 0.0, 1.0], u.shape), low, high)
    inside, t = np.ones(first.shape[1], dtype=bool), 0.0
    limits = np.array([pair or (-np.inf, np.inf) for pair in claim["region"]], dtype=float)
    for instant in sorted(claim["instants"], key=lambda each: each["time_s"]):
        steps = max(1, round((instant["time_s"] - t) / 0.02))
        length_s = (instant["time_s"] - t) / steps
        for _ in range(steps):
            for x in (first, second):
                inside &= ((x >= limits[:, :1]) & (x <= limits[:, 1:])).all(axis=0)
            first, second = (
                _advanced(model, first, u, length_s),
                _advanced(model, second, v, length_s),
            )
        for x in (first, second):
            inside &= ((x >= limits[:, :1]) & (x <= limits[:, 1:])).all(axis=0)
        t = instant["time_s"]
        excess = np.abs(first - second) - np.array(instant["widths"])[:, None] * (1 + 1e-9) - 1e-9
        if (excess[:, inside] > 0.0).any():
            return False
    return True


def rates_hold(document: Document) -> bool:
    """Whether the comparison covers sampled Jacobians (by differences); False: refuted."""
    model, claim, random = document["model"], document["claim"], np.random.default_rng(4)
    ends = _near(claim["region"])
    x = _corners_and_more(*np.array(ends).T, count=100, random=random)
    low, high = np.array(_near(claim["ranges"])).reshape(-1, 2).T[:, :, None]
    u = low + random.choice([0.0, 0.5, 1.0], (len(low), x.shape[1])) * (high - low)
    x = x + (np.array([sum(pair) / 2 for pair in ends])[:, None] - x) * 1e-5
    step, columns = 1e-6, []
    for j in range(len(x)):
        moved = np.zeros_like(x)
        moved[j] = step
        columns.append((rates(model, x + moved, u) - rates(model, x - moved, u)) / (2 * step))
    jacobian = np.array(columns).transpose(2, 1, 0)
    blocks = claim["blocks"]
    for (k, b), (j, c) in itertools.product(enumerate(blocks), repeat=2):
        rows, chosen = ([int(i) for i in each["states"]] for each in (b, c))
        part = jacobian[:, rows][:, :, chosen]
        p, q, bound = np.array(b["metric"]), np.array(c["metric"]), b["comparison"][j]
        if claim["norm"] == "quadratic":
            left = np.linalg.cholesky(p).T
            scaled = left @ part @ np.linalg.inv(np.linalg.cholesky(q).T)
            both = (scaled + scaled.transpose(0, 2, 1)) / 2 if k == j else scaled
            found = np.linalg.eigvalsh(both)[:, -1] if k == j else np.linalg.norm(scaled, 2, (1, 2))
        else:
            size = np.abs(part)
            if k == j:
                diagonal = np.arange(len(b["states"]))
                size[:, diagonal, diagonal] = part[:, diagonal, diagonal]
            size = size * np.diag(p)[:, None] / np.diag(q)
            found = size.sum(axis=2 if claim["norm"] == "max" else 1).max(axis=1)
        if (found > bound + 1e-6 * (1 + abs(bound))).any():
            return False
    return True


def tube_holds(document: Document) -> bool:
    """Whether runs from the initial set keep to rows and instants; False: refuted."""
    model, claim, random = document["model"], document["claim"], np.random.default_rng(5)
    lower, upper = np.array(claim["initial"], dtype=float).T
    x = _corners_and_more(lower, upper, count=200, random=random)
    low, high = np.array(_near(claim["ranges"])).reshape(-1, 2).T[:, :, None]
    u = low + random.choice([0.0, 0.5, 1.0], (len(low), x.shape[1])) * (high - low)
    times = claim["times_s"]
    for k, instant in enumerate(claim["instants"]):
        if not _lies(x, instant):
            return False
        if k + 1 < len(times):
            for _ in range(10):
                if not _lies(x, claim["rows"][k]):
                    return False
                x = _advanced(model, x, u, (times[k + 1] - times[k]) / 10)
            if not _lies(x, claim["rows"][k]):
                return False
    return True


def _lies(x: Any, box: Any) -> bool:
    lower, upper = np.array(box, dtype=float).T
    return bool(((x >= lower[:, None] - 1e-9) & (x <= upper[:, None] + 1e-9)).all())
