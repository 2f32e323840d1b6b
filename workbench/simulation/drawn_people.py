"""People as a picture shows them: the discs of their tubes at a few times."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.estimation.people_estimator import Wanted
from workbench.runtime import ObservedPerson
from workbench.runtime.person_guard import guard_disc
from workbench.runtime.person_tubes import DiscPiece, PersonTube
from workbench.simulation.frames import Disc, PersonFrame

# As far as a car of the speeds driven here needs to stop.
_STOPPING_S = 2.0


def discs(tube: PersonTube, *, horizon_s: float, step_s: float) -> tuple[Disc, ...]:
    """The tube's discs (x, y, radius) at 0, step_s, ... up to horizon_s, as far as it holds.

    Where a tube has several bounds, the person is in all of them at once, and the smallest disc is
    given.
    """
    begins_s = max(bound[0].from_s for bound in tube.bounds)
    times = (k * step_s for k in range(round(horizon_s / step_s) + 1))
    return tuple(_disc(tube, tau) for tau in times if begins_s <= tau <= tube.until_s)


def as_frame(
    person: ObservedPerson, *, horizon_s: float, step_s: float, wanted: Sequence[Wanted] = ()
) -> PersonFrame:
    """The person as drawn in a report: all that was predicted, and the guard while a car stops.

    wanted: what was estimated of their intents, the likeliest of which comes first in the frame.
    """
    guard = guard_disc(person.guard, from_s=min(person.guard.at_s, 0.0), until_s=_STOPPING_S)
    guarded = discs(guard, horizon_s=_STOPPING_S, step_s=step_s)
    predicted = tuple(
        disc for tube in person.intent for disc in discs(tube, horizon_s=horizon_s, step_s=step_s)
    )
    # A prediction may begin later; the guard holds now.
    now = [disc for tube in person.intent for disc in discs(tube, horizon_s=0.0, step_s=step_s)]
    x_m, y_m, radius_m = (*now, *guarded)[0]
    ranked = sorted(wanted, key=lambda each: -each.probability)
    goals = tuple((each.goal, each.probability) for each in ranked)
    return PersonFrame(person.name, x_m, y_m, radius_m, predicted, guarded, goals)


def _disc(tube: PersonTube, tau: float) -> Disc:
    return min((_of_bound(bound, tau) for bound in tube.bounds), key=lambda disc: disc[2])


def _of_bound(bound: Sequence[DiscPiece], tau: float) -> Disc:
    piece = [piece for piece in bound if piece.from_s <= tau][-1]
    s = tau - piece.from_s
    radius = piece.radius_m + piece.growth_mps * s + piece.growth2_mps2 * s * s / 2
    return piece.x_m + piece.vx_mps * s, piece.y_m + piece.vy_mps * s, max(0.0, radius)
