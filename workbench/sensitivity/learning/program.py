"""Small linear programs solved to a vertex, and the few constraints that carry it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, Final, final

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from workbench.sensitivity.vectorised import Array

_TOLERANCE: Final = {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10}
# How far from active a constraint may seem in the solver's answer, and in the exact one.
_CLOSE: Final = 1e-5
_EXACT: Final = 1e-9
_ZERO: Final = 1e-10
_GOLDEN: Final = 0.6180339887498949
_TILT: Final = 1e-3


@final
@dataclass(frozen=True, slots=True, eq=False)
class Program:
    """Minimise linear x subject to rows x >= heights.

    linear (V,); rows (R, V); heights (R,); numbers of order one.
    """

    linear: Array
    rows: Array
    heights: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """x (V,), and carrying: the constraints under which alone x is the minimum too."""

    x: Array
    carrying: npt.NDArray[np.intp]


def solved(program: Program) -> Solution:
    """The minimum by cvxpy and Clarabel, made exact on the constraints that carry it.

    Those have positive multipliers that balance the cost (Karush-Kuhn-Tucker; by non-negative least
    squares, so at most V of them); x is moved onto them, and every other constraint is checked.
    Where that check fails, every constraint that seems active counts as carrying. Where many x have
    the least cost, slightly different costs decide among them; if not even these do, every
    constraint counts as carrying, as any may have moved the solver. Raises RuntimeError if the
    solver fails.
    """
    found, alone = _carried(program)
    if not alone:
        # Multiples of the golden ratio: no two costs keep their proportion.
        uneven = (np.arange(len(program.linear)) * _GOLDEN) % 1.0
        tilted = replace(program, linear=program.linear * (1.0 + _TILT * uneven))
        found, alone = _carried(tilted)
    return found if alone else Solution(found.x, np.arange(len(program.rows)))


def _carried(program: Program) -> tuple[Solution, bool]:
    """A minimum with what carries it, and whether there is no other."""
    answer = _answer(program)
    close = np.flatnonzero(program.rows @ answer - program.heights <= _CLOSE)
    multipliers, unbalanced = nnls(
        program.rows[close].T, program.linear, maxiter=100 * (len(answer) + len(close))
    )
    carrying = close[multipliers > _ZERO]
    rows = program.rows[carrying]
    exact = answer + np.linalg.lstsq(rows, program.heights[carrying] - rows @ answer, rcond=None)[0]
    alone = bool(np.linalg.matrix_rank(rows) == len(answer))
    if unbalanced > _EXACT or np.any(program.rows @ exact - program.heights < -_EXACT):
        return Solution(answer, close), alone
    return Solution(exact, carrying), alone


def _answer(program: Program) -> Array:
    # Half a second to import: whoever only proves or drives should not wait for it.
    cp: Any = import_module("cvxpy")
    x = cp.Variable(len(program.linear))
    problem = cp.Problem(cp.Minimize(program.linear @ x), [program.rows @ x >= program.heights])
    with warnings.catch_warnings():
        # That an answer may be inaccurate is found out here.
        warnings.simplefilter("ignore", UserWarning)
        problem.solve(solver=cp.CLARABEL, **_TOLERANCE)
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        raise RuntimeError(f"the fit of the learned bound did not solve: {problem.status}")
    return np.asarray(x.value)
