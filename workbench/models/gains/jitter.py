"""Stability at samples whose times vary at will: proved by one quadratic function, or refuted."""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Final, final

import cvxpy as cp
import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workbench.controllers.sampling import Sampling
from workbench.models.gains.held import HeldLoop, Matrix, Timing, floats
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.schedules import Pattern, worst_pattern

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
_AT_ONCE: Final = 16
_ROUNDS: Final = 4
# Shares of the logarithm of the middle's own rate, fastest first.
_SHARES: Final = (0.9, 0.3, 0.0)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Contraction:
    """V(z+) <= rate^2 V(z), V(z) = z' P z, for every sample that the timing allows; proved.

    metric: P (n x n), its floating-point entries taken as exact; names: of the entries of z; rate:
    per sample, below 1; corners: how many matrices were checked. Rigor ENCLOSED, for the linearised
    loop at one speed: each corner's rate^2 P - F' P F, and P, has positive pivots in exact
    arithmetic; what lies in the corners' convex hull follows, because V(F z) is convex in F.
    """

    names: tuple[str, ...]
    metric: Array
    rate: float
    corners: int


def prove_contraction(
    loop: LateralLoop, sampling: Sampling, *, most_corners: int
) -> Contraction | None:
    """A common quadratic function for all that `sampling` allows; None where none was found.

    Proposed by semidefinite programs (cvxpy, Clarabel) in coordinates in which the middle of the
    timing already contracts, for ever slower rates until one holds in the exact check. None proves
    nothing; it is also the answer where more than `most_corners` matrices would have to be
    checked (4 for each time that is open, so that 64 are enough for three).
    """
    timing = Timing.of(sampling)
    held = HeldLoop.of(loop, timing)
    if held.corner_count(timing) > most_corners:
        return None
    corners = list(held.corners(timing))
    rounded = np.array([floats(corner) for corner in corners])
    middle = rounded.mean(axis=0)
    frame = _frame(middle)
    if frame is None:
        return None
    moved = frame @ rounded @ np.linalg.inv(frame)
    slowest = float(np.log(np.abs(np.linalg.eigvals(middle)).max()))
    for share in _SHARES:
        metric = _common(moved, target=float(np.exp(share * slowest)))
        if metric is not None:
            P = frame.T @ metric @ frame
            P = (P + P.T) / 2.0
            rate = _rate(P, rounded)
            if rate < 1.0 and _checked(P, corners, rate):
                return Contraction(held.names, P, rate, len(corners))
    return None


def _common(moved: Array, *, target: float) -> Array | None:
    """A metric in which all matrices contract, from programs with ever more of them."""
    flat = (moved - moved.mean(axis=0)).reshape(len(moved), -1)
    used = set(np.argsort(-np.linalg.norm(flat, axis=1))[:_AT_ONCE].tolist())
    metric = np.eye(moved.shape[-1])
    for _ in range(_ROUNDS):
        proposed = _proposed(moved[sorted(used)], target=target)
        if proposed is None:
            return None
        metric = proposed
        rest = target**2 * metric - moved.transpose(0, 2, 1) @ metric @ moved
        least = np.linalg.eigvalsh(rest)[:, 0]
        if least.min() > 0.0 or len(used) == len(moved):
            return metric
        used |= set(np.argsort(least)[:_AT_ONCE].tolist())
    return metric if _rate(metric, moved) < 1.0 else None


def _frame(middle: Array) -> Array | None:
    """T with |T z| falling along z+ = middle z; None where it does not contract."""
    found = float(np.abs(np.linalg.eigvals(middle)).max())
    if not found < 1.0:
        return None
    # Slowed a little less than it contracts, so that T is not as flat as a plain solution.
    eased = middle / np.sqrt(found)
    P = scipy.linalg.solve_discrete_lyapunov(eased.T, np.eye(len(middle)))
    try:
        return np.asarray(np.linalg.cholesky((P + P.T) / 2.0).T)
    except np.linalg.LinAlgError:
        return None


def _proposed(moved: Array, *, target: float) -> Array | None:
    size = moved.shape[-1]
    P, least = cp.Variable((size, size), symmetric=True), cp.Variable()
    eye = np.eye(size)
    limits = [P >> 1e-4 * eye, cp.trace(P) == size]
    limits += [target**2 * P - F.T @ P @ F >> least * eye for F in moved]
    problem = cp.Problem(cp.Maximize(least), limits)
    try:
        problem.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        return None
    if P.value is None or least.value is None or not least.value > 0.0:
        return None
    return np.asarray(P.value, dtype=float)


def _rate(P: Array, moved: Array) -> float:
    """The least common rate of V, a little rounded up."""
    grown = moved.transpose(0, 2, 1) @ P @ moved
    try:
        half = np.linalg.inv(np.linalg.cholesky(P))
    except np.linalg.LinAlgError:
        return np.inf
    largest = float(np.linalg.eigvalsh(half @ grown @ half.T).max())
    return float(np.sqrt(max(largest, 0.0)) * (1.0 + 1e-9) + 1e-9)


def _checked(P: Array, corners: Sequence[Matrix], rate: float) -> bool:
    exact = _whole([[Fraction(float(entry)) for entry in row] for row in P])[0]
    square = Fraction(rate) ** 2
    if not positive_definite(exact):
        return False
    for corner in corners:
        F, scale = _whole(corner)
        columns = list(zip(*F, strict=True))
        moved = [[_dot(row, column) for column in columns] for row in exact]
        grown = [[_dot(column, other) for other in zip(*moved, strict=True)] for column in columns]
        kept = square.numerator * scale * scale
        rest = [
            [kept * a - square.denominator * b for a, b in zip(one, other, strict=True)]
            for one, other in zip(exact, grown, strict=True)
        ]
        if not positive_definite(rest):
            return False
    return True


def _dot(left: Sequence[int], right: Sequence[int]) -> int:
    return sum(a * b for a, b in zip(left, right, strict=True) if a and b)


def _whole(matrix: Matrix) -> tuple[list[list[int]], int]:
    """The matrix times the returned scale > 0, in whole numbers."""
    scale = math.lcm(*(entry.denominator for row in matrix for entry in row))
    return [[e.numerator * (scale // e.denominator) for e in row] for row in matrix], scale


def positive_definite(matrix: Sequence[Sequence[int]]) -> bool:
    """Whether every leading minor of a symmetric matrix of whole numbers is > 0; exact (Bareiss).

    >>> positive_definite([[2, 1], [1, 1]]), positive_definite([[1, 2], [2, 1]])
    (True, False)
    """
    rows, before = [list(row) for row in matrix], 1
    for k, row in enumerate(rows):
        if row[k] <= 0:
            return False
        for other in rows[k + 1 :]:
            for j in range(len(row) - 1, k - 1, -1):
                other[j] = (row[k] * other[j] - other[k] * row[j]) // before
        before = row[k]
    return True


class Answer(enum.Enum):
    """What is known about a timing."""

    PROVED = "stable, proved"
    REFUTED = "not stable: a schedule that grows was found"
    OPEN = "open: neither proved nor refuted"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """One timing with its proof, if any, and the worst schedule that a search found."""

    sampling: Sampling
    proof: Contraction | None
    worst: Pattern

    @property
    def answer(self) -> Answer:
        """The proof counts first: a growth above 1 beside it would be a defect."""
        if self.proof is not None:
            return Answer.PROVED
        return Answer.REFUTED if self.worst.growth > 1.0 + 1e-9 else Answer.OPEN

    def row(self) -> dict[str, str | float | None]:
        """One line of a table."""
        return {
            "jitter_s": self.sampling.jitter_s,
            "answer": self.answer.value,
            "proved_rate_per_sample": self.proof.rate if self.proof else None,
            "worst_growth_found_per_sample": self.worst.growth,
            "corners": self.proof.corners if self.proof else None,
        }


@final
@dataclass(frozen=True, slots=True, eq=False)
class JitterStudy:
    """The same timing with growing jitter."""

    judged: tuple[Judged, ...]

    def rows(self) -> list[dict[str, str | float | None]]:
        """One row per jitter."""
        return [each.row() for each in self.judged]

    def plot(self) -> Figure:
        """Proved and found growth over jitter as a matplotlib figure."""
        from workbench.models.gains.pictures import figure, paint_jitter

        return figure(lambda canvas: paint_jitter(canvas, self))


def judge(
    loop: LateralLoop, sampling: Sampling, *, patterns: int, seed: int, most_corners: int = 64
) -> Judged:
    """Proof and search for one timing; `most_corners` bounds the work of the proof only."""
    return Judged(
        sampling,
        prove_contraction(loop, sampling, most_corners=most_corners),
        worst_pattern(loop, sampling, patterns=patterns, seed=seed),
    )


def jitter_study(
    loop: LateralLoop, sampling: Sampling, jitters_s: Sequence[float], *, patterns: int, seed: int
) -> JitterStudy:
    """`judge` for several jitters. Raises InputError for one that `Sampling` refuses."""
    return JitterStudy(
        tuple(
            judge(loop, dataclasses.replace(sampling, jitter_s=each), patterns=patterns, seed=seed)
            for each in jitters_s
        )
    )
