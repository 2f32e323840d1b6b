"""Random people, cars and clocks; where people can be, and who came nearer than was claimed."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache

import numpy as np
import numpy.typing as npt

from workbench.codegen.separation_source import CompiledSeparation
from workbench.reach.person_clearance import Nearest, nearest_people
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import (
    DiscPiece,
    PersonTube,
    TrackedPerson,
    TubeKind,
)

Array = npt.NDArray[np.float64]
SEGMENTS = 60
BOTH = frozenset(TubeKind)
INTENT = frozenset([TubeKind.INTENT])


@cache
def kernel() -> CompiledSeparation:
    return CompiledSeparation(SEGMENTS)


def random_person(rng: np.random.Generator, index: int = 0) -> TrackedPerson:
    """A jagged intent that jumps between its pieces, and a guard."""
    starts = np.cumsum([-1.0, *rng.uniform(0.03, 0.6, 11)])
    pieces = tuple(
        DiscPiece(
            float(start), *aside(rng), *rng.uniform(-4.0, 4.0, 2),
            rng.uniform(0.1, 0.5), rng.uniform(-1.0, 2.0), rng.uniform(0.0, 3.0),
        )
        for start in starts
    )  # fmt: skip
    intent = PersonTube(TubeKind.INTENT, (pieces,), 8.0)
    return TrackedPerson(f"person {index}", (intent, random_guard(rng)))


def aside(rng: np.random.Generator) -> tuple[float, float]:
    """A place somewhere around the cars."""
    way, far = rng.uniform(-np.pi, np.pi), rng.uniform(3.5, 8.0)
    return 2.0 + far * float(np.cos(way)), far * float(np.sin(way))


def random_guard(rng: np.random.Generator) -> PersonTube:
    place = Disc(*aside(rng), rng.uniform(0.0, 0.5))
    velocity = Disc(*rng.uniform(-1.5, 1.5, 2), rng.uniform(0.0, 0.4))
    limits = MotionLimits(rng.uniform(1.0, 3.0), rng.uniform(0.5, 3.0))
    guard = Guard(rng.uniform(-0.3, 0.3), place, velocity, limits)
    return guard_disc(guard, from_s=-1.0, until_s=8.0)


def random_rectangles(rng: np.random.Generator, count: int) -> Array:
    place = rng.uniform([0.0, -1.0, -3.2], [4.0, 1.0, 3.2])
    k = np.arange(count)[:, None]
    move = 0.1 * k * np.array([np.cos(place[2]), np.sin(place[2]), 0.1])
    size = rng.uniform([0.3, 0.2], [2.0, 1.2]) + 0.01 * k
    return np.concatenate([place + move, size], axis=1)


def disc_at(bound: Sequence[DiscPiece], tau: float) -> tuple[float, float, float] | None:
    """x, y, radius of one bound, straight from the definition; None before its first piece."""
    started = [piece for piece in bound if piece.from_s <= tau]
    if not started:
        return None
    piece = started[-1]
    s = tau - piece.from_s
    radius = piece.radius_m + piece.growth_mps * s + piece.growth2_mps2 * s * s / 2
    return piece.x_m + piece.vx_mps * s, piece.y_m + piece.vy_mps * s, max(radius, 0.0)


def exact_disc(piece: DiscPiece, tau: Fraction) -> tuple[Fraction, Fraction, Fraction]:
    from_s, x, y, vx, vy, r, g, q = map(Fraction, piece.numbers)
    s = tau - from_s
    return x + vx * s, y + vy * s, r + g * s + q * s * s / 2


def holds(outer: tuple[Fraction, ...], inner: tuple[Fraction, ...]) -> bool:
    """Whether one disc contains another, decided without rounding."""
    spare = outer[2] - inner[2]
    return spare >= 0 and (outer[0] - inner[0]) ** 2 + (outer[1] - inner[1]) ** 2 <= spare**2


def places_of(tube: PersonTube, tau: float, rng: np.random.Generator, count: int) -> Array:
    """Points (N, 2) that lie in every bound's disc: rims, insides and centres."""
    discs = [disc for bound in tube.bounds if (disc := disc_at(bound, tau)) is not None]
    around = min(discs, key=lambda disc: disc[2])
    angle = rng.uniform(-np.pi, np.pi, count)
    share = np.where(np.arange(count) % 3 == 0, np.sqrt(rng.random(count)), 1.0 - 1e-12)
    share[0] = 0.0
    points = np.array(around[:2]) + around[2] * share[:, None] * np.stack(
        [np.cos(angle), np.sin(angle)], axis=1
    )
    inside = [np.hypot(points[:, 0] - x, points[:, 1] - y) <= r + 1e-13 for x, y, r in discs]
    return np.asarray(points[np.all(inside, axis=0)])


def distance_to(rectangle: Array, points: Array) -> Array:
    """Distance of points (N, 2) from a rectangle (5): 0 inside."""
    c, s = np.cos(rectangle[2]), np.sin(rectangle[2])
    d = points - rectangle[:2]
    u = np.maximum(np.abs(c * d[:, 0] + s * d[:, 1]) - rectangle[3], 0.0)
    v = np.maximum(np.abs(c * d[:, 1] - s * d[:, 0]) - rectangle[4], 0.0)
    return np.hypot(u, v)


def escapes(shipped: CompiledSeparation, *, scenes: int = 100) -> tuple[int, int]:
    """Places of people that are nearer to the car than the clearance claimed for their kind, and
    how many of the 2 `scenes` claims are positive, so that something was claimed at all."""
    rng = np.random.default_rng(5)
    found = positive = 0
    for _ in range(scenes):
        count = int(rng.integers(1, 9))
        times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.02, 0.2, count))])
        rectangles = random_rectangles(rng, count)
        skew = tuple(sorted(rng.uniform(-0.3, 0.3, 2)))
        people = [random_person(rng, i) for i in range(rng.integers(1, 3))]
        query = shipped.query(
            people, times_s=times, rectangles=rectangles, kinds=BOTH, skew_s=(skew[0], skew[1])
        )
        answer = shipped.nearest(query)
        positive += sum(each.clearance_m > 0.0 for each in answer.values())
        for k in range(count):
            found += _nearer(people, rectangles[k], times[k : k + 2], skew, answer, rng)
    return found, positive


def _nearer(people, rectangle, times, skew, answer, rng):  # type: ignore[no-untyped-def]
    """Escapes in one segment, at its ends, at times within and just beside every piece's start."""
    found = 0
    low, high = times[0] + skew[0], times[1] + skew[1]
    for person in people:
        for tube in person.tubes:
            starts = [piece.from_s for bound in tube.bounds for piece in bound]
            beside = [s + d for s in starts for d in (-1e-9, 0.0) if low <= s + d <= high]
            for tau in [low, high, *beside, *rng.uniform(low, high, 2)]:
                points = places_of(tube, tau, rng, 40)
                if len(points):
                    nearest = float(distance_to(rectangle, points).min())
                    found += nearest < answer[tube.kind].clearance_m - 1e-9
    return found


STANDING = np.array([[0.0, 0.0, 0.0, 2.0, 1.0]])


def intent(*pieces: DiscPiece, until_s: float = 10.0) -> TrackedPerson:
    return TrackedPerson("p", (PersonTube(TubeKind.INTENT, (pieces,), until_s),))


def disc(from_s: float, y_m: float, vy_mps: float = 0.0) -> DiscPiece:
    return DiscPiece(from_s, 0.0, y_m, 0.0, vy_mps, 0.5, 0.0, 0.0)


def claimed(
    *people: TrackedPerson,
    times: tuple[float, ...] = (0.0, 0.1),
    skew: tuple[float, float] = (0.0, 0.0),
) -> Nearest:
    """The desk's answer about intents beside a car that stands, which the kernel must share."""
    rows = np.repeat(STANDING, len(times) - 1, axis=0)
    answers = []
    for ask in (nearest_people, asked):
        answers.append(
            ask(list(people), times_s=np.array(times), rectangles=rows, kinds=INTENT, skew_s=skew)
        )
    assert answers[0] == answers[1]
    return answers[0][TubeKind.INTENT]


def asked(people: list[TrackedPerson], **rest: object) -> dict[TubeKind, Nearest]:
    return kernel().nearest(kernel().query(people, **rest))  # type: ignore[arg-type]
