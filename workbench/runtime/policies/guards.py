"""Whether what is seen of people now agrees with the guards of the plan in force."""

from __future__ import annotations

import dataclasses
import enum
import math
from dataclasses import dataclass
from typing import final

from workbench.runtime.person_guard import Disc, Guard, guard_contains
from workbench.runtime.policies.cycle import Hypothesis, SeenPerson, Violation, Watched
from workbench.runtime.policies.horizon import GRAIN_S

# Positions are within 1e7 m, where each rounding errs by 2e-9 m at most.
_SLACK = 1e-6


class Relation(enum.IntEnum):
    """Of what is measured now to what was predicted for now.

    OUTSIDE: disjoint, one of the two is wrong. OVERLAPS: they agree in some state, nothing is
    refuted. INSIDE: the measurement alone shows that the prediction held.
    """

    OUTSIDE = 0
    OVERLAPS = 1
    INSIDE = 2


@final
@dataclass(frozen=True, slots=True)
class Scene:
    """Everybody known at one stamp, and the disc within which they are everybody."""

    stamp_s: float
    people: tuple[SeenPerson, ...]
    watched: Watched


def relation_to(before: Guard, now: Guard) -> Relation:
    """Of position and velocity of `now` to what `before` can have become by then.

    With t = now.at_s - before.at_s, primes for now, r, q the radii of position p and velocity w:
    |p' - (p + w t)| <= r' + r + q t + A t^2 / 2, |p' - p| <= r' + r + V t, |w' - w| <= q' + q + A t
    and |w'| <= q' + V hold if both contain the truth and the person kept to the limits A, V of
    `before`. One that fails, by more than a micrometre and what is walked in a grain of time, means
    OUTSIDE, and so does NaN. INSIDE is `guard_contains`. For t < 0, by more than a grain, both
    change places: what is `now` must have become what was `before`, and is never INSIDE.
    """
    if _too_fast(now, before.limits.speed_mps):
        return Relation.OUTSIDE
    if now.at_s < before.at_s - GRAIN_S:
        earlier = dataclasses.replace(now, limits=before.limits)
        return min(relation_to(earlier, before), Relation.OVERLAPS)
    if before == now or guard_contains(before, now):
        return Relation.INSIDE
    # One instant on two clocks' zeros differs by rounding.
    late_s = now.at_s - before.at_s
    t = max(late_s, 0.0)
    p, w, p1, w1 = before.position, before.velocity, now.position, now.velocity
    top, most = before.limits.speed_mps, before.limits.acceleration_mps2
    both = p.radius + p1.radius + _SLACK + top * GRAIN_S
    agree = (
        late_s > -math.inf
        and math.hypot(p1.x - p.x - w.x * t, p1.y - p.y - w.y * t)
        <= both + (w.radius + 0.5 * most * t) * t
        and math.hypot(p1.x - p.x, p1.y - p.y) <= both + top * t
        and math.hypot(w1.x - w.x, w1.y - w.y)
        <= w.radius + w1.radius + most * (t + GRAIN_S) + _SLACK
    )
    return Relation.OVERLAPS if agree else Relation.OUTSIDE


def people_violations(
    before: Scene, now: Scene, *, required: Relation, unseen_speed_mps: float
) -> tuple[Violation, ...]:
    """What `now` refutes of the guards in `before`, those of the plan in force.

    Nobody's guard may exceed its own speed limit. A person by the same name must relate to the
    earlier one as required. A new one must relate so to somebody assumed, or may have come from
    beyond the watched disc, at up to unseen_speed_mps. One who is missing must be within somebody
    assumed now, or beyond the watched disc.
    """
    known = {person.name: person.guard for person in before.people}
    seen = [person for person in now.people if not person.assumed]
    names = {person.name for person in seen}
    gone = (p for p in before.people if not p.assumed and p.name not in names)
    found: list[Violation] = []
    for person in seen:
        if _too_fast(person.guard, person.guard.limits.speed_mps):
            detail = f"{person.name} is faster than their own limit"
            found.append(Violation(Hypothesis.PEOPLE, detail, True))
        elif person.name in known:
            relation = relation_to(known[person.name], person.guard)
            if relation < required:
                found.append(_moved(person.name, relation))
        elif not (
            _assumed(person.guard, before, required)
            or _from_beyond(person.guard, before, now.stamp_s, unseen_speed_mps)
        ):
            detail = f"{person.name} was not covered"
            found.append(Violation(Hypothesis.NOBODY_NEW, detail, True))
    found += [
        Violation(Hypothesis.NOBODY_LOST, f"{person.name} is no longer known", False)
        for person in gone
        if not _covered(person.guard, now, beyond_m=_beyond_m(before, now))
    ]
    return tuple(found)


def remembered(before: Scene, now: Scene) -> Scene:
    """`now`, with everybody of `before` who is missing in it without being covered or beyond.

    A name is forgotten only where somebody assumed takes its place, or where it has left: not
    where the watched disc has shrunk. As long as somebody is missing, the larger disc counts.
    """
    beyond_m = _beyond_m(before, now)
    names = {person.name for person in now.people if not person.assumed}
    lost = tuple(
        p
        for p in before.people
        if not (p.assumed or p.name in names or _covered(p.guard, now, beyond_m=beyond_m))
    )
    if not lost:
        return now
    watched = dataclasses.replace(now.watched, radius_m=beyond_m)
    return dataclasses.replace(now, people=now.people + lost, watched=watched)


def _beyond_m(before: Scene, now: Scene) -> float:
    return max(before.watched.radius_m, now.watched.radius_m)


def _moved(name: str, relation: Relation) -> Violation:
    refuted = relation is Relation.OUTSIDE
    detail = "left the guard" if refuted else "is not shown to be inside the guard"
    return Violation(Hypothesis.PEOPLE, f"{name} {detail}", refuted)


def _too_fast(guard: Guard, top_mps: float) -> bool:
    velocity = guard.velocity
    slowest = math.hypot(velocity.x, velocity.y) - velocity.radius
    # Written so that NaN counts as too fast.
    return not slowest <= top_mps + _SLACK


def _assumed(new: Guard, before: Scene, required: Relation) -> bool:
    """Whether somebody assumed may have been this person."""
    return any(p.assumed and relation_to(p.guard, new) >= required for p in before.people)


def _from_beyond(new: Guard, before: Scene, now_s: float, unseen_speed_mps: float) -> bool:
    """Whether they may have been beyond what was watched, and no faster than is assumed there."""
    if _too_fast(new, unseen_speed_mps):
        return False
    watched, position = before.watched, new.position
    away = math.hypot(position.x - watched.x_m, position.y - watched.y_m)
    walked = unseen_speed_mps * (now_s - before.stamp_s)
    return away + position.radius + walked + _SLACK >= watched.radius_m


def _covered(missing: Guard, now: Scene, *, beyond_m: float) -> bool:
    """Whether somebody assumed now can do all that the missing one can, or they are beyond."""
    for moved in _at(missing, now.stamp_s):
        if any(p.assumed and _can_do(p.guard, moved) for p in now.people):
            return True
        away = math.hypot(moved.position.x - now.watched.x_m, moved.position.y - now.watched.y_m)
        if away - moved.position.radius >= beyond_m:
            return True
    return False


def _can_do(assumed: Guard, moved: Guard) -> bool:
    """Whether `assumed` contains `moved`, both at one instant.

    Where it has every velocity within the limits of `moved`, only the position is left to compare.
    """
    w = assumed.velocity
    if math.hypot(w.x, w.y) + moved.limits.speed_mps <= w.radius:
        moved = dataclasses.replace(moved, velocity=Disc(w.x, w.y, 0.0))
    return guard_contains(assumed, moved)


def _at(guard: Guard, instant_s: float) -> tuple[Guard, Guard]:
    """Everything the guard holds at a later instant, by its acceleration and its speed bound."""
    t = instant_s - guard.at_s
    p, w, limits = guard.position, guard.velocity, guard.limits
    grown = p.radius + (w.radius + 0.5 * limits.acceleration_mps2 * t) * t + _SLACK
    velocity = Disc(w.x, w.y, w.radius + limits.acceleration_mps2 * t)
    walked = Disc(p.x, p.y, p.radius + limits.speed_mps * t + _SLACK)
    accelerated = Guard(instant_s, Disc(p.x + w.x * t, p.y + w.y * t, grown), velocity, limits)
    return accelerated, dataclasses.replace(accelerated, position=walked)
