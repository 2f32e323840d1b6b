"""What a run of decisions amounts to, for replay and simulation alike."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, final

from workbench.claims import Verdict
from workbench.estimation.people_estimator import PeopleNow
from workbench.runtime import Action, Decision, Observation
from workbench.runtime.policies import Alert, Outcome, Turn
from workbench.simulation.drawn_people import as_frame
from workbench.simulation.frames import Frame, LevelVerdicts, Point, PolicyAnswer
from workbench.simulation.people import Body, PeopleModel
from workbench.simulation.recording import Track
from workbench.simulation.runlog import Entry

Progress = Callable[[int, int], None]
"""Called with (done, total)."""
LIMITS = "LIMITS"
"""By this name a frame says that a person broke the limits of their guard."""
_SAME_SAMPLE_S = 0.06


class Judge(Protocol):
    """What decides: a `Monitor`, or anything with its `step` and its `turn`."""

    def step(self, observation: Observation) -> Decision:
        """Judge one observation."""

    def turn(self, now_s: float) -> Turn:
        """What to send at now_s."""


@final
@dataclass(frozen=True, slots=True)
class Closest:
    """The smallest distance from car body to a person's body disc over the judged samples."""

    separation_m: float
    t_s: float
    person: str


@final
@dataclass(frozen=True, slots=True)
class Measures:
    """Counts of each verdict, share of BRAKE, smallest separation that was and that was proved.

    safe_shares: share of SAFE of each policy, deciding or not; violations: decisions that named
    each hypothesis; alerts: decisions that warned somebody. smallest_clearance_m: smallest proved
    clearance of a SAFE decision, None without one; closest: None when nobody was seen;
    decision_median_s, decision_p99_s: time per decision.
    """

    queries: int
    verdicts: tuple[tuple[Verdict, int], ...]
    braked_share: float
    safe_shares: tuple[tuple[str, float], ...]
    violations: tuple[tuple[str, int], ...]
    alerts: int
    people_seen: int
    closest: Closest | None
    smallest_clearance_m: float | None
    decision_median_s: float
    decision_p99_s: float

    @classmethod
    def of(cls, entries: Sequence[Entry]) -> Measures:
        """Measure at least one entry."""
        frames = [entry.frame for entry in entries]
        counts = Counter(frame.verdict for frame in frames)
        separations = [
            Closest(entry.separation_m, entry.frame.t_s, entry.nearest)
            for entry in entries
            if entry.separation_m is not None and entry.nearest is not None
        ]
        proved = [
            frame.clearance_m
            for frame in frames
            if frame.verdict is Verdict.SAFE and frame.clearance_m is not None
        ]
        elapsed = [entry.elapsed_s for entry in entries]
        return cls(
            queries=len(entries),
            verdicts=tuple((verdict, counts[verdict]) for verdict in Verdict),
            braked_share=sum(frame.action == Action.BRAKE.name for frame in frames) / len(frames),
            safe_shares=_safe_shares(frames),
            violations=tuple(sorted(Counter(_hypotheses(frames)).items())),
            alerts=sum(frame.alert is not None for frame in frames),
            people_seen=len({person.name for frame in frames for person in frame.people}),
            closest=min(separations, key=lambda c: c.separation_m, default=None),
            smallest_clearance_m=min(proved, default=None),
            decision_median_s=percentile(elapsed, 0.5),
            decision_p99_s=percentile(elapsed, 0.99),
        )

    def summary(self) -> str:
        """All of it in one line."""
        nearest = "no people seen"
        if self.closest is not None:
            nearest = (
                f"smallest separation {self.closest.separation_m:.2f} m "
                f"({self.closest.person} at {self.closest.t_s:.1f} s)"
            )
        counts = ", ".join(f"{count} {verdict.value}" for verdict, count in self.verdicts)
        policies = "".join(f", {name} SAFE {share:.0%}" for name, share in self.safe_shares)
        named = "".join(f", {count} {name}" for name, count in self.violations)
        return (
            f"{self.queries} queries ({counts}), braked {100.0 * self.braked_share:.1f} %"
            f"{policies}, violations {named[2:] or 'none'}, alerts {self.alerts}, "
            f"{nearest}, time per decision median {1e3 * self.decision_median_s:.2f} ms, "
            f"p99 {1e3 * self.decision_p99_s:.2f} ms"
        )


@final
@dataclass(frozen=True, slots=True)
class Drawing:
    """What entries keep for the report: people's discs up to horizon_s every step_s, the route."""

    horizon_s: float
    step_s: float
    route: tuple[Point, ...]


@final
@dataclass(frozen=True, slots=True)
class Moment:
    """What was true when a decision was asked for; turns: of the sender since the decision before,
    the last one at t_s; `people` with all their samples; told: what the monitor was told of them.
    """

    t_s: float
    turns: Sequence[Turn]
    body: Body
    speed_mps: float
    people: Sequence[Track]
    models: PeopleModel
    told: PeopleNow

    def entry(self, observation: Observation, decision: Decision, drawing: Drawing) -> Entry:
        """The decision on record."""
        body = self.body
        turned = [turn.violation for turn in self.turns if turn.violation is not None]
        frame = Frame(
            t_s=self.t_s,
            x_m=body.x_m,
            y_m=body.y_m,
            heading=body.heading,
            front_m=body.front_m,
            rear_m=body.rear_m,
            half_width_m=body.half_width_m,
            speed_mps=self.speed_mps,
            verdict=decision.verdict,
            action=decision.action.name,
            reason=decision.reason,
            clearance_m=decision.clearance_m,
            occupancy=tuple((x, y, h, a, b) for x, y, h, a, b in decision.occupancy),
            people=tuple(
                as_frame(
                    person,
                    horizon_s=drawing.horizon_s,
                    step_s=drawing.step_s,
                    wanted=self.told.wanted.get(person.name, ()),
                )
                for person in observation.people
            ),
            path=drawing.route,
            stop_occupancy=tuple((x, y, h, a, b) for x, y, h, a, b in decision.stop_occupancy),
            sent=self.turns[-1].action.name,
            policies=tuple(map(_answer, (decision.look_ahead, decision.fail_safe))),
            levels=tuple(
                LevelVerdicts(tube, verdicts) for tube, verdicts in decision.level_verdicts.items()
            ),
            violations=(
                *dict.fromkeys(map(str, (*turned, *decision.violations))),
                *(f"{LIMITS}: {broken}" for broken in self.told.violations),
            ),
            alert=None if decision.alert is None else _warning(decision.alert),
        )
        closest = nearest_person(self.people, body, self.t_s, self.models)
        return Entry.of(frame, decision, closest, observation)


def _answer(outcome: Outcome) -> PolicyAnswer:
    return PolicyAnswer(outcome.policy, outcome.verdict, outcome.action.name, outcome.reason)


def _warning(alert: Alert) -> str:
    return f"{alert.person or 'everybody'}: {alert.reason}"


def _safe_shares(frames: Sequence[Frame]) -> tuple[tuple[str, float], ...]:
    said = [answer for frame in frames for answer in frame.policies]
    asked, safe = (
        Counter(answer.policy for answer in said if answer.verdict in wanted)
        for wanted in (tuple(Verdict), (Verdict.SAFE,))
    )
    return tuple((policy, safe[policy] / count) for policy, count in asked.items())


def _hypotheses(frames: Sequence[Frame]) -> Iterator[str]:
    """The name of every hypothesis that a frame names, once per frame."""
    for frame in frames:
        yield from dict.fromkeys(text.partition(":")[0] for text in frame.violations)


def nearest_person(
    people: Sequence[Track], body: Body, t_s: float, models: PeopleModel
) -> tuple[float, str] | None:
    """Distance in m from the body to the nearest body disc of a person sampled at t_s, and who.

    Uses the sample nearest to t_s, at most 0.06 s away, no prediction; negative when disc and body
    overlap. None when nobody is sampled then.
    """
    found = []
    for track in people:
        index = bisect_right(track.samples, t_s, key=lambda sample: sample.t_s)
        beside = track.samples[max(index - 1, 0) : index + 1]
        sample = min(beside, key=lambda s: abs(s.t_s - t_s))
        if abs(sample.t_s - t_s) <= _SAME_SAMPLE_S:
            reach_m = models.of(track.kind).body_radius_m
            found.append((body.distance(sample.x_m, sample.y_m) - reach_m, track.name))
    return min(found, default=None)


def percentile(values: Sequence[float], share: float) -> float:
    """The smallest of `values` that at least `share` of them do not exceed.

    >>> percentile([3.0, 1.0, 2.0], 0.5)
    2.0
    """
    ordered = sorted(values)
    rank = math.ceil(share * len(ordered) - 1e-9)
    return ordered[min(max(rank, 1), len(ordered)) - 1]
