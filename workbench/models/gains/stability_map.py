"""Maps of stability over two axes: exact along each line, eigenvalues on a grid as second route."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.models.gains.lateral import LateralLoop, axis, characteristic
from workbench.models.gains.routh import Piece, Reason, stability_pieces

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
# Eigenvalues closer to the axis than this share of the largest do not vote.
UNDECIDED: Final = 1e-9


@final
@dataclass(frozen=True, slots=True, eq=False)
class StabilityMap:
    """Stability of the lateral loop over two axes, the other values as in `loop`.

    x_name, y_name: names of `AXES`; x (n), y (m): the grid. pieces: for each x the exact pieces
    along y (ENCLOSED). abscissa (m x n): largest real part of the poles on the grid, 1/s, from
    eigenvalues (NUMERICAL). compared, disagreeing: grid points at which both routes were held
    against each other, and at which they differ.
    """

    loop: LateralLoop
    x_name: str
    y_name: str
    x: Array
    y: Array
    pieces: tuple[tuple[Piece, ...], ...]
    abscissa: Array
    compared: int
    disagreeing: int

    def rows(self) -> list[dict[str, str | float | bool]]:
        """One row per piece."""
        x, y = axis(self.x_name), axis(self.y_name)
        return [
            {
                x.label: float(value),
                f"{y.label} from": piece.low,
                f"{y.label} to": piece.high,
                "stable": piece.reason is Reason.STABLE,
                "reason": piece.reason.value,
            }
            for value, pieces in zip(self.x, self.pieces, strict=True)
            for piece in pieces
        ]

    def reasons(self) -> tuple[Reason, ...]:
        """The reasons that occur, in the order of `Reason`."""
        found = {piece.reason for pieces in self.pieces for piece in pieces}
        return tuple(reason for reason in Reason if reason in found)

    def plot(self) -> Figure:
        """The map as a matplotlib figure."""
        from workbench.models.gains.pictures import figure, paint_map

        return figure(lambda canvas: paint_map(canvas, self))


def stability_map(
    loop: LateralLoop,
    x_name: str,
    y_name: str,
    *,
    ranges: Mapping[str, tuple[float, float]],
    points: int,
) -> StabilityMap:
    """Exact pieces on `points` lines of constant x, and eigenvalues on the points x points grid.

    ranges: by axis name, (low, high). Raises InputError on two equal axes, an unknown one, a range
    that is empty, and fewer than 2 points.
    """
    axis(x_name)
    axis(y_name)
    if x_name == y_name:
        raise InputError(f"expected two different axes for a map, got {x_name!r} twice")
    if points < 2:
        raise InputError(f"expected at least 2 points per axis, got {points}")
    for name in (x_name, y_name):
        low, high = ranges[name]
        if not low < high:
            raise InputError(f"{name}: expected a range with LOW < HIGH, got {low:g} {high:g}")
    x, y = (np.linspace(*ranges[name], points) for name in (x_name, y_name))
    pieces = tuple(
        stability_pieces(loop.at({x_name: value}), y_name, *ranges[y_name]) for value in x
    )
    abscissa, size = _abscissa(loop, {x_name: x[None, :], y_name: y[:, None]})
    exact = _on_grid(pieces, y)
    votes = np.abs(abscissa) > UNDECIDED * size
    differ = votes & ((abscissa < 0.0) != exact)
    return StabilityMap(
        loop, x_name, y_name, x, y, pieces, abscissa, int(votes.sum()), int(differ.sum())
    )


def _on_grid(pieces: tuple[tuple[Piece, ...], ...], y: Array) -> NDArray[np.bool_]:
    stable = np.zeros((len(y), len(pieces)), dtype=bool)
    for column, parts in enumerate(pieces):
        for piece in parts:
            if piece.reason is Reason.STABLE:
                stable[(y >= piece.low) & (y <= piece.high), column] = True
    return stable


def _abscissa(loop: LateralLoop, values: Mapping[str, Array]) -> tuple[Array, Array]:
    """Largest real part, and largest modulus, of the eigenvalues of companion matrices."""
    fields = {name: np.array(float(v)) for name, v in loop.exact().items()}
    fields.update({axis(name).field: value for name, value in values.items()})
    coefficients = np.broadcast_arrays(*characteristic(fields))
    with_integral = bool(np.any(fields["integral"]))
    order = 4 if with_integral else 3
    companion = np.zeros((*coefficients[0].shape, order, order))
    for k in range(order):
        companion[..., 0, k] = -coefficients[k + 1] / coefficients[0]
        if k:
            companion[..., k, k - 1] = 1.0
    poles = np.linalg.eigvals(companion)
    return poles.real.max(axis=-1), np.maximum(1.0, np.abs(poles).max(axis=-1))
