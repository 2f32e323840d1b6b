"""Claim: validated tubes agree with interval Euler over many tiny cells, which shares no step."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from tube_cases import Array, box, system_of

from workbench.models import Ode
from workbench.reach import Partitioned, ReachTube
from workbench.reach.validated.tube import ValidatedTube
from workbench.sensitivity.inclusion import inclusion
from workbench.sets import Box


@dataclass(frozen=True)
class Cells:
    """Boxes (n, N) that cover an initial set, moved together."""

    lower: Array
    upper: Array

    @classmethod
    def covering(cls, start: Box, per_axis: int) -> Cells:
        edges = [
            np.linspace(low, high, per_axis + 1)
            for low, high in zip(start.lower, start.upper, strict=True)
        ]
        lower = np.stack([g.ravel() for g in np.meshgrid(*(e[:-1] for e in edges))])
        upper = np.stack([g.ravel() for g in np.meshgrid(*(e[1:] for e in edges))])
        return cls(lower, upper)

    def stepped(self, bounds: ca.Function, h: float) -> Cells:
        """x + h f(B) for a box B that x + [0, h] f(B) does not leave, checked for every cell."""
        low, high = self.lower, self.upper
        for slack in (0.0, 0.5, 1.0, 2.0):
            rate_low, rate_high, valid = (np.array(v) for v in bounds(low, high))
            assert np.all(valid == 1.0)
            down, up = h * np.minimum(rate_low, 0.0), h * np.maximum(rate_high, 0.0)
            if slack and np.all((self.lower + down >= low) & (self.upper + up <= high)):
                return Cells(self.lower + h * rate_low, self.upper + h * rate_high)
            extra = (0.05 + slack * h) * (up - down) + 1e-12
            low, high = self.lower + down - extra, self.upper + up + extra
        raise AssertionError("take a shorter step")


SYSTEMS: dict[str, tuple[Ode, Box]] = {
    "van der Pol": (
        system_of(lambda x, y: [y, (1 - x * x) * y - x], "x", "y"),
        box(x=(1.25, 1.55), y=(2.35, 2.45)),
    ),
    "limited pendulum": (
        system_of(lambda x, y: [y, -ca.sin(x) + ca.fmin(ca.fmax(-2 * x - y, -0.4), 0.4)], "x", "y"),
        box(x=(-0.2, 0.5), y=(-0.3, 0.3)),
    ),
    "absolute damping": (
        system_of(lambda x, y: [y, -x - y * ca.fabs(y)], "x", "y"),
        box(x=(0.4, 0.6), y=(-0.3, 0.2)),
    ),
}
STEP_S, FINE = 0.1, 50


def both(name: str, per_axis: int = 24, horizon_s: float = 0.5) -> tuple[ReachTube, list[Cells]]:
    """The tube of the whole set, and the cells at its instants."""
    system, start = SYSTEMS[name]
    tube = ValidatedTube(STEP_S).tube(system, initial_set=start, horizon_s=horizon_s)
    assert tube.complete
    cells = [Cells.covering(start.reordered(system.names), per_axis)]
    bounds = inclusion(ca.Function("f", [system.x], [ca.densify(system.field)]))
    mapped = bounds.map(cells[0].lower.shape[1])
    for _ in range(len(tube.times) - 1):
        moved = cells[-1]
        for _ in range(FINE):
            moved = moved.stepped(mapped, STEP_S / FINE)
        cells.append(moved)
    return tube, cells


@pytest.mark.parametrize("name", SYSTEMS)
def test_no_cell_lies_outside_and_the_hulls_agree(name: str) -> None:
    """A cell holds a true state, so one that the tube does not meet would disprove the tube."""
    tube, cells = both(name)
    for k, now in enumerate(cells):
        low, high = tube.lower_at[k][:, None], tube.upper_at[k][:, None]
        assert np.all((now.upper >= low) & (now.lower <= high))
        width = (now.upper - now.lower).max(axis=1)
        hull = now.lower.min(axis=1), now.upper.max(axis=1)
        size = hull[1] - hull[0]
        # Cells grow outward and the tube's polynomials too; neither by more than a little.
        assert np.all(hull[0] >= tube.lower_at[k] - 1.5 * width)
        assert np.all(hull[1] <= tube.upper_at[k] + 1.5 * width)
        assert np.all(tube.lower_at[k] >= hull[0] - 0.1 * size)
        assert np.all(tube.upper_at[k] <= hull[1] + 0.1 * size)


@pytest.mark.parametrize("name", SYSTEMS)
def test_every_part_of_a_partition_meets_its_own_cells(name: str) -> None:
    system, start = SYSTEMS[name]
    _, cells = both(name, per_axis=8, horizon_s=0.3)
    parts = Partitioned(ValidatedTube(STEP_S), {"x": 2, "y": 4})
    tubes = parts.cells(system, initial_set=start, horizon_s=0.3)
    met = 0
    for tube in tubes:
        inside = np.all(
            (cells[0].lower >= tube.lower_at[0][:, None] - 1e-12)
            & (cells[0].upper <= tube.upper_at[0][:, None] + 1e-12),
            axis=0,
        )
        met += int(inside.sum())
        for k, now in enumerate(cells):
            low, high = tube.lower_at[k][:, None], tube.upper_at[k][:, None]
            assert np.all(now.upper[:, inside] >= low)
            assert np.all(now.lower[:, inside] <= high)
    assert met == 64
    whole = ValidatedTube(STEP_S).tube(system, initial_set=start, horizon_s=0.3)
    together = parts.tube(system, initial_set=start, horizon_s=0.3)
    assert np.all(together.upper_at - together.lower_at <= whole.upper_at - whole.lower_at + 1e-12)
