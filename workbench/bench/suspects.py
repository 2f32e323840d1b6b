"""Whether trajectories near a tube's boundary are inside or outside, by validated arithmetic."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import numpy as np
import numpy.typing as npt

from workbench.bench.balls import ONE, Ball
from workbench.bench.closed_parts import Part, closed_part
from workbench.bench.lanes import Inputs, Runs
from workbench.bench.taylor import TaylorField
from workbench.bench.validated_point import PointRun, enclose_point
from workbench.sensitivity.vectorised import Array, Index

Truths = npt.NDArray[np.bool_]

# A kink that is met later than this after the last time of interest plays no part.
_KINK_MARGIN_S = 1e-9


class Containment(enum.IntEnum):
    """INSIDE: the whole enclosure is in the tube at every time asked; ESCAPE: at some time it is
    outside altogether; UNDECIDED: neither was proved. In the order of their weight."""

    INSIDE = 0
    UNDECIDED = 1
    ESCAPE = 2


@final
@dataclass(frozen=True, slots=True, eq=False)
class Suspects:
    """Runs seen near the boundary in one state, which agree in all that it depends on meanwhile.

    part: what it depends on; lanes: their numbers, the one that is near for longest first; at:
    numbers of the times (ascending) at which one of them is near; near (len(lanes), len(at)): which
    of them, and when; gaps (len(at)): the least distance to the boundary in floats, negative
    outside, -inf for a run that left the numbers.
    """

    state: int
    part: Part
    lanes: Index
    at: Index
    near: Truths
    gaps: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What a block of runs showed at `times` (m,).

    near, gaps (m, n, N): whether a run is near the boundary or beyond it in a state, and the
    distance to the nearer face, negative outside.
    """

    field: TaylorField
    inputs: Inputs
    runs: Runs
    times: Array
    near: Truths
    gaps: Array


def gathered(seen: Seen) -> list[Suspects]:
    """All runs that are near, grouped, the worst first.

    Two runs are put together when they agree in everything that the state can depend on up to the
    last time at which it is near. Where a limit is in force all that time, it does not depend on
    what the limit cuts off. Which side of a kink a run is on is read off the float run; a kink that
    it meets before 1e-9 s have passed since that last time stays a kink.
    """
    parts: dict[tuple[int, bytes], Part] = {}
    groups: dict[tuple[int, bytes, bytes], list[int]] = {}
    absent = np.flatnonzero(~seen.inputs.parameters.any(axis=0)).tolist()
    for state in range(seen.near.shape[1]):
        lanes = np.flatnonzero(seen.near[:, state].any(axis=0))
        last = len(seen.times) - 1 - np.argmax(seen.near[::-1, state][:, lanes], axis=0)
        for place in np.argsort(-last, kind="stable").tolist():
            lane, until_s = int(lanes[place]), float(seen.times[last[place]])
            stays = seen.runs.crossed_s[:, lane] > until_s + _KINK_MARGIN_S
            first = seen.runs.first[:, lane]
            pattern = np.where(stays, first, 2).astype(np.int8).tobytes()
            if (state, pattern) not in parts:
                kinks = zip(seen.field.kinks, stays.tolist(), first.tolist(), strict=True)
                sides = {kink: side for kink, sure, side in kinks if sure}
                parts[state, pattern] = closed_part(seen.field, state, sides, absent)
            key = _key(seen.inputs, parts[state, pattern], lane, until_s)
            groups.setdefault((state, pattern, key), []).append(lane)
    found = [_suspects(seen, parts[key[:2]], key[0], lanes) for key, lanes in groups.items()]
    return sorted(found, key=lambda suspects: float(suspects.gaps.min()))


def _suspects(seen: Seen, part: Part, state: int, lanes: list[int]) -> Suspects:
    rows = np.array(lanes)
    near = seen.near[:, state, rows]
    at = np.flatnonzero(near.any(axis=1))
    gaps = np.nan_to_num(seen.gaps[at][:, state, rows], nan=-np.inf).min(axis=1)
    return Suspects(state, part, rows, at, near[at].T, gaps)


def _key(inputs: Inputs, part: Part, lane: int, until_s: float) -> bytes:
    switches, values = _felt(inputs, part, lane)
    begun = int(np.sum(switches < until_s))
    chosen = [
        inputs.states[lane, part.states],
        inputs.parameters[lane, part.parameters],
        switches[:begun],
        values[: begun + 1].ravel(),
    ]
    return np.concatenate(chosen).tobytes()


def _felt(inputs: Inputs, part: Part, lane: int) -> tuple[Array, Array]:
    """The switches (s) at which the part's own disturbances change, and their values around."""
    values = inputs.values[lane][:, part.disturbances]
    changes = np.flatnonzero((np.diff(values, axis=0) != 0.0).any(axis=1))
    changes = changes[np.isfinite(inputs.switches[lane, changes])]
    return inputs.switches[lane, changes], values[[0, *(changes + 1)]]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """What validated arithmetic says of each run, and a proved lower bound of the distance to the
    boundary at each of the suspects' times (the float one where nothing was proved)."""

    findings: tuple[Containment, ...]
    gaps: Array


def unsettled(suspects: Suspects) -> Settled:
    """Nothing is known of these runs."""
    return Settled((Containment.UNDECIDED,) * len(suspects.lanes), suspects.gaps)


def settle(suspects: Suspects, seen: Seen, bounds: tuple[Array, Array]) -> Settled:
    """Enclose the one trajectory of the group and hold it against the bounds (m, n)."""
    inputs, part, lane = seen.inputs, suspects.part, int(suspects.lanes[0])
    switches, values = _felt(inputs, part, lane)
    run = PointRun(
        part.field,
        inputs.states[lane, part.states].tolist(),
        inputs.parameters[lane, part.parameters].tolist(),
        switches.tolist(),
        values.tolist(),
    )
    enclosures = enclose_point(run, seen.times[suspects.at].tolist())
    if enclosures is None:
        return unsettled(suspects)
    balls = [row[part.position] for row in enclosures]
    ends = [bound[suspects.at, suspects.state] for bound in bounds]
    gaps = list(_gaps(balls, *ends))
    outside = np.array([farthest < 0 for _, farthest in gaps])
    doubtful = np.array([nearest < 0 for nearest, _ in gaps])
    escape, doubt = (suspects.near & outside).any(axis=1), (suspects.near & doubtful).any(axis=1)
    codes = np.where(
        escape, Containment.ESCAPE, np.where(doubt, Containment.UNDECIDED, Containment.INSIDE)
    )
    findings = tuple(Containment(code) for code in codes.tolist())
    return Settled(findings, np.array([float(nearest / ONE) for nearest, _ in gaps]))


def _gaps(balls: list[Ball], lower: Array, upper: Array) -> Iterator[tuple[Fraction, Fraction]]:
    """Least and greatest distance to the nearer face that the enclosure allows, per time, in units
    of the balls; exact, because a state that rests may lie within 1e-300 of its tube's face."""
    for ball, low, high in zip(balls, lower.tolist(), upper.tolist(), strict=True):
        floor, ceiling = Fraction(low) * ONE, Fraction(high) * ONE
        yield (
            min(ball.lower - floor, ceiling - ball.upper),
            min(ball.upper - floor, ceiling - ball.lower),
        )
