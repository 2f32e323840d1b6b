"""Entry point of reachability: a system, an initial set, a horizon and a method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, final

import numpy as np

from workbench.claims import weakest
from workbench.models.system import System
from workbench.reach.ranged_parameters import with_ranged_axes
from workbench.reach.tube import KinkRecord, ReachTube
from workbench.reach.validated.tube import ValidatedTube
from workbench.sets import Box


class TubeMethod(Protocol):
    """A way to compute a tube; adding one means adding one file."""

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """A tube from `initial_set` (axes = state names) over [0, horizon_s]."""


@final
@dataclass(frozen=True, slots=True)
class Partitioned:
    """Run `method` on every cell of a grid over the initial set and return the hull of the tubes.

    parts: number of cells along each named axis, a state or a parameter with a range (1 where not
    named). The cells share end points and cover the set, so the hull encloses every trajectory; it
    ends where the first cell's proof ends. Splitting shrinks second-order remainders quadratically.
    Rigor: that of `method`.
    """

    method: TubeMethod
    parts: Mapping[str, int]

    def cells(self, system: System, *, initial_set: Box, horizon_s: float) -> tuple[ReachTube, ...]:
        """One tube per cell."""
        cells = with_ranged_axes(system.ode, initial_set, self.parts).split(self.parts)
        if isinstance(self.method, ValidatedTube):
            return self.method.tubes(system, initial_sets=cells, horizon_s=horizon_s)
        return tuple(
            self.method.tube(system, initial_set=cell, horizon_s=horizon_s) for cell in cells
        )

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """The hull of all cells' tubes."""
        return hull(self.cells(system, initial_set=initial_set, horizon_s=horizon_s))


def hull(tubes: tuple[ReachTube, ...]) -> ReachTube:
    """The smallest boxes that contain all `tubes` (same grid and names), up to the shortest one."""
    shortest = min(tubes, key=lambda tube: len(tube.times))
    rows = len(shortest.times)
    return ReachTube(
        times=shortest.times,
        lower=np.min([tube.lower[: rows - 1] for tube in tubes], axis=0),
        upper=np.max([tube.upper[: rows - 1] for tube in tubes], axis=0),
        lower_at=np.min([tube.lower_at[:rows] for tube in tubes], axis=0),
        upper_at=np.max([tube.upper_at[:rows] for tube in tubes], axis=0),
        names=shortest.names,
        status=shortest.status,
        rigor=weakest(*(tube.rigor for tube in tubes)),
        message=shortest.message,
        kinks=_common_kinks(tubes, rows - 1),
    )


def _common_kinks(tubes: tuple[ReachTube, ...], rows: int) -> KinkRecord | None:
    records = [tube.kinks for tube in tubes if tube.kinks is not None]
    if len(records) < len(tubes):
        return None
    return KinkRecord(
        np.mean([record.decided_share[:rows] for record in records], axis=0),
        np.all([record.linear[:rows] for record in records], axis=0),
    )


def compute_tube(
    system: System,
    *,
    initial_set: Box,
    horizon_s: float,
    method: TubeMethod = ValidatedTube(),  # noqa: B008 - a frozen value
) -> ReachTube:
    """A tube that encloses every trajectory of `system` from `initial_set` over [0, horizon_s].

    Parameters with a range and disturbances take every admissible value. The default method proves
    all it says (Rigor ENCLOSED, see `ValidatedTube`). A proof that ends early is a value
    (`ReachTube.status`), wrong input is an InputError.

    >>> import casadi as ca
    >>> from workbench.models import system_from_casadi
    >>> x = ca.SX.sym("x")
    >>> decay = system_from_casadi(x, -x, ("x",))
    >>> tube = compute_tube(decay, initial_set=Box(("x",), (0.9,), (1.1,)), horizon_s=1.0)
    >>> bool(tube.lower_at[-1, 0] <= 0.9 * 2.718281828**-1 and tube.complete)
    True
    """
    return method.tube(system, initial_set=initial_set, horizon_s=horizon_s)
