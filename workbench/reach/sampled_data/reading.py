"""How far a state can move between the earliest instant of its measurement and the true one."""

from __future__ import annotations

from typing import final

import numpy as np

from workbench.reach.sampled_data.held_loop import HeldLoop
from workbench.reach.sampled_data.image import Noise
from workbench.reach.validated.algebra import UNIT, Array, upward
from workbench.reach.validated.bounds import BatchInclusion, Range
from workbench.reach.validated.picard import enclosure
from workbench.reach.validated.sets import PolynomialSet


@final
class Shift:
    """x(m) - x(m0) for m in [m0, m0 + width]: the width's part s times a mean rate f.

    f lies in the range F of the field over an a priori enclosure of the window, under any command
    that holds, waits or begins to act, s in [0, width]. With F = mid +- rad,
        s f = width / 2 mid (1 + xi) + box,  |box| <= width rad:
    all states move along mid together. A command that this very reading leads to acts later than m.
    """

    def __init__(self, held: HeldLoop) -> None:
        ode = held.free()
        self._held, self._ode = held, ode
        self._field = BatchInclusion.of([ode.x, ode.p, ode.w], [ode.field])
        self._p = np.array([ode.parameter_values()]).reshape(1, -1)
        known = ode.disturbances[:-2]
        self._w = [np.array([[getattr(d, end) for d in known]]).reshape(1, -1) for end in _ENDS]

    def noise(self, source: PolynomialSet, width_s: float, *, opening: bool) -> Noise:
        """The shift of `pose_rows` for one set. Raises NoEnclosureError."""
        hull = source.hull()
        commands = self._commands(hull, opening=opening)
        w = tuple(
            np.concatenate([own, end], axis=1) for own, end in zip(self._w, commands, strict=True)
        )

        def field(box: Range) -> tuple[Range, Array]:
            found, valid = self._field([box, (self._p, self._p), (w[0], w[1])])
            return found[0], valid

        with np.errstate(all="ignore"):
            _, rates = enclosure(hull, field, width_s)
        low, high = (end[0, self._held.pose_rows] for end in rates)
        middle = 0.5 * low + 0.5 * high
        radius = np.maximum(high - middle, middle - low)
        center = 0.5 * width_s * middle
        box = upward(width_s * (radius * (1.0 + 4.0 * UNIT) + 8.0 * UNIT * np.abs(middle)))
        return Noise(center, np.concatenate([center[:, None], np.diag(box)], axis=1))

    def _commands(self, hull: Range, *, opening: bool) -> Range:
        """Range (1, 2) of every command that may be in force within the window."""
        pairs = [list(self._held.pair(k)) for k in range(self._held.slots + 1)]
        low = np.min([hull[0][:, pair] for pair in pairs], axis=0)
        high = np.max([hull[1][:, pair] for pair in pairs], axis=0)
        if opening:
            holds, jump = pairs[0], list(self._held.pair(self._held.slots + 1))
            low = np.minimum(low, np.nextafter(hull[0][:, holds] + hull[0][:, jump], -np.inf))
            high = np.maximum(high, np.nextafter(hull[1][:, holds] + hull[1][:, jump], np.inf))
        return low, high


_ENDS = ("lower", "upper")
