"""Symbols and helpers that the Functions of a tube step share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.sensitivity.validity import verbatim


@final
@dataclass(frozen=True, slots=True)
class StepSymbols:
    """The inputs of every step Function, named as in `step_functions`."""

    x: ca.SX
    r: ca.SX
    p: ca.SX
    w_mid: ca.SX
    w_rad: ca.SX
    slope: ca.SX
    offset: ca.SX
    gap: ca.SX
    h: ca.SX


def shared(outputs: list[ca.SX]) -> list[ca.SX]:
    """Common subexpressions merged, without the simplifications that hold for reals only."""
    with verbatim():
        return list(ca.cse(outputs))


def rk4(field: ca.Function, x: ca.SX, h: ca.SX, others: list[ca.SX]) -> ca.SX:
    """One classical Runge-Kutta step of length h (s) of x' = field(x, *others)."""
    k1 = field(x, *others)
    k2 = field(x + h / 2 * k1, *others)
    k3 = field(x + h / 2 * k2, *others)
    k4 = field(x + h * k3, *others)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def nonzeros(matrix: ca.SX) -> ca.SX:
    """The structural nonzeros as a column."""
    return ca.vertcat(*matrix.nonzeros()) if matrix.nnz() else ca.SX(0, 1)
