"""What point Functions of the online kernel should give: series and difference quotients in balls.

Only the relaxed field and its drivers are taken from the kernel. States advance by power series of
balls, derivatives are quotients with differences of 2^-300 at 2000 bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import flint
import numpy as np

from workbench.reach.online.model import OnlineModel

Real = Any
BITS = 2000
_SMALL = 300

OPERATIONS: dict[str, Callable[..., Real]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "inv": lambda a: 1 / a,
    "neg": lambda a: -a,
    "sq": lambda a: a * a,
    "twice": lambda a: a + a,
    "fabs": abs,
    "sin": lambda a: a.sin(),
    "cos": lambda a: a.cos(),
    "tan": lambda a: a.tan(),
}


@dataclass(frozen=True)
class Truth:
    """One model at one point: x, p, w, slope, offset as doubles."""

    model: OnlineModel
    point: Sequence[np.ndarray[Any, Any]]

    def outputs(self, x: Sequence[Real], v: Sequence[Real]) -> tuple[list[Real], list[Real]]:
        """Field and drivers at states x and deviations v of the exogenous inputs."""
        n_w = self.model.n_w
        w = [flint.arb(a) + b for a, b in zip(self.point[2], v[:n_w], strict=True)]
        rest = [[flint.arb(float(a)) for a in block] for block in self.point]
        inputs = [list(x), rest[1], w, rest[3], rest[4], list(v[n_w:])]
        values: list[Real] = []
        for node in self.model.graph.nodes:
            if node.element is not None:
                values.append(inputs[node.element[0]][node.element[1]])
            elif node.constant is not None:
                values.append(flint.arb(node.constant))
            else:
                values.append(OPERATIONS[node.name](*[values[k] for k in node.operands]))
        field, drivers = ([values[k] for k in row] for row in self.model.graph.outputs)
        return field, drivers

    @property
    def x(self) -> list[Real]:
        return [flint.arb(float(a)) for a in self.point[0]]

    @property
    def still(self) -> list[Real]:
        return [flint.arb(0)] * self.model.n_v

    def advanced(self, x: Sequence[Real], h: float, order: int) -> list[Real]:
        """Taylor polynomial of this order of the flow at h."""
        coefficients = [[a] for a in x]
        for i in range(order):
            flint.ctx.cap = order + 2
            series = [flint.arb_series(c, prec=i + 1) for c in coefficients]
            field, _ = self.outputs(series, self.still)
            for own, rate in zip(coefficients, field, strict=True):
                known = rate[i] if isinstance(rate, flint.arb_series) else (rate if i == 0 else 0)
                own.append(flint.arb(known) / (i + 1))
        step = flint.arb(h)
        return [sum((c * step**i for i, c in enumerate(own)), flint.arb(0)) for own in coefficients]

    def transition(self, h: float, order: int) -> list[list[Real]]:
        """Its derivative, row by row."""
        columns = [
            quotient(lambda d: self.advanced(d, h, order), self.x, unit(self.model.n, j))
            for j in range(self.model.n)
        ]
        return [list(row) for row in zip(*columns, strict=True)]

    def joint(self, z: Sequence[Real]) -> list[Real]:
        """Field and drivers over z = (x, v)."""
        field, drivers = self.outputs(z[: self.model.n], z[self.model.n :])
        return field + drivers

    def second(self, a: Sequence[Real], b: Sequence[Real]) -> list[Real]:
        """D2(field, drivers)[a, b] over (x, v)."""
        return self.second_at([*self.x, *self.still], a, b)

    def second_at(self, z: Sequence[Real], a: Sequence[Real], b: Sequence[Real]) -> list[Real]:
        return quotient(lambda y: quotient(self.joint, y, b), z, a)

    def bent(self, a: Sequence[Real], b: Sequence[Real]) -> list[Real]:
        """d/dt D2f[a, b] - A D2f[a, b] with x' = f, a' = A a, b' = A b."""
        n, rest = self.model.n, self.still
        field, _ = self.outputs(self.x, rest)
        zero = [flint.arb(0)] * len(rest)
        here = [*self.x, *rest]

        def moved(direction: Sequence[Real]) -> list[Real]:
            return quotient(self.joint, here, [*direction, *zero])[:n]

        def along(tau: Sequence[Real]) -> list[Real]:
            t = tau[0]
            z = [*[x + t * f for x, f in zip(self.x, field, strict=True)], *rest]
            ends = [[*[c + t * m for c, m in zip(s, moved(s), strict=True)], *zero] for s in (a, b)]
            return self.second_at(z, *ends)[:n]

        rate = quotient(along, [flint.arb(0)], [flint.arb(1)])
        source = self.second([*a, *zero], [*b, *zero])[:n]
        return [r - m for r, m in zip(rate, moved(source), strict=True)]


def unit(size: int, k: int) -> list[Real]:
    return [flint.arb(int(i == k)) for i in range(size)]


def quotient(
    function: Callable[[list[Real]], list[Real]], z: Sequence[Real], direction: Sequence[Real]
) -> list[Real]:
    """Derivative along a direction, known to far more than a double's digits."""
    small = flint.arb(2) ** -_SMALL
    ahead = function([a + small * b for a, b in zip(z, direction, strict=True)])
    return [(p - q) / small for p, q in zip(ahead, function(list(z)), strict=True)]


def inside(value: float, exact: Real, radius: float) -> bool:
    """|value - exact| <= radius, for exact numbers known to about 2^-250."""
    slack = flint.arb(2) ** -250
    return bool(abs(flint.arb(float(value)) - exact) <= flint.arb(float(radius)) + slack)


def doubles(rows: Sequence[float] | np.ndarray[Any, Any]) -> list[Real]:
    return [flint.arb(float(a)) for a in rows]
