"""`workbench intent --answers`: a table of questions answered in the order of time."""

from __future__ import annotations

import argparse
import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, final

from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.intent_folder import Folder
    from workbench.estimation.goals import Goal
    from workbench.estimation.intent_filter import Belief
    from workbench.estimation.likely_goals import TowardLikelyGoals
    from workbench.estimation.people_data import PersonTrack
    from workbench.estimation.tables import Row, Table

_GOAL_COLUMNS: Final = ("goal", "p")
_PLACE_COLUMNS: Final = ("x", "y")
_LONGEST_H_S: Final = 60.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """One row: about whom, the time until which measurements may be used, and the look-ahead h_s
    of a question for a place (None: a question for the goal)."""

    row: Row
    key: tuple[str, str]
    t_s: float
    h_s: float | None


def read_queries(path: Path) -> tuple[Query, ...]:
    """The rows in the order of the file.

    The header tells the kind: recording,agent,t asks for goals, recording,agent,t0,h for places; a
    table with t, t0 and h asks in each row for what is filled in. Raises InputError otherwise.
    """
    table = _table(path)
    goals, places = "t" in table.columns, {"t0", "h"} <= set(table.columns)
    if not (goals or places):
        raise InputError(
            f"{table.path}: expected the columns recording,agent,t (which goal) or "
            f"recording,agent,t0,h (which place), got {','.join(table.columns)}"
        )
    return tuple(_query(row, goals=goals, places=places) for row in table.rows)


def _table(path: Path) -> Table:
    from workbench.estimation.tables import Table

    for ending in (".csv.gz", ".csv"):
        if path.name.endswith(ending) and path.is_file():
            return Table.read(path.parent, path.name.removesuffix(ending), ("recording", "agent"))
    raise InputError(f"--answers: expected a table of questions (.csv or .csv.gz) at {path}")


def _query(row: Row, *, goals: bool, places: bool) -> Query:
    filled = {name: row.values.get(name, "").strip() for name in ("t", "t0", "h")}
    key = (row.text("recording"), row.text("agent"))
    asks_goal = goals and bool(filled["t"])
    asks_place = places and bool(filled["t0"] or filled["h"])
    if asks_goal and asks_place:
        raise InputError(f"{row.place('t')}: expected t, or t0 and h, got both; use two rows")
    if asks_place or not goals:
        h_s = row.number("h")
        if not 0.0 <= h_s <= _LONGEST_H_S:
            raise InputError(
                f"{row.place('h')}: expected 0 to {_LONGEST_H_S:g} s, got {row.text('h')}"
            )
        return Query(row, key, row.number("t0"), h_s)
    return Query(row, key, row.number("t"), None)


def answer_queries(args: argparse.Namespace, folder: Folder, queries: Sequence[Query]) -> str:
    """The table of answers, in the order of the questions, as CSV text."""
    measured = {track.key: track for track in folder.measured}
    for query in queries:
        _known(query, measured)
    order = sorted(range(len(queries)), key=lambda i: (queries[i].key[0], queries[i].t_s, i))
    places = any(query.h_s is not None for query in queries)
    predictor = _predictor(args) if places else None
    # One feed per recording: measurements enter it in the order of time, and none after t.
    feeds: dict[str, Feed] = {}
    found: dict[int, list[dict[str, str]]] = {}
    for index in order:
        query = queries[index]
        recording = query.key[0]
        if recording not in feeds:
            people = [track for track in folder.measured if track.recording == recording]
            feeds = {recording: Feed(args, folder, recording, people)}
        found[index] = list(_rows(query, feeds[recording], predictor))
    return _csv([row for index in range(len(queries)) for row in found[index]], queries)


def _known(query: Query, measured: dict[tuple[str, str], PersonTrack]) -> None:
    if query.key in measured:
        track = measured[query.key]
        if query.h_s is not None and not len(track.until(query.t_s).t_s):
            raise InputError(
                f"{query.row.place('t0')}: nothing was measured of {query.key[1]!r} by "
                f"{query.t_s:g} s; ask from {track.t_s[0]:g} s on"
                if len(track.t_s)
                else f"{query.row.place('agent')}: nothing was ever measured of {query.key[1]!r}"
            )
        return
    if query.key[0] not in {recording for recording, _ in measured}:
        names = ", ".join(sorted({recording for recording, _ in measured})[:20])
        raise InputError(
            f"{query.row.place('recording')}: no recording {query.key[0]!r}; the folder has {names}"
        )
    raise InputError(
        f"{query.row.place('agent')}: recording {query.key[0]!r} has no person {query.key[1]!r}"
    )


@final
class Feed:
    """The filters of one recording, fed with what was measured until the time of the question.

    Times of questions must not decrease.
    """

    def __init__(
        self,
        args: argparse.Namespace,
        folder: Folder,
        recording: str,
        people: Sequence[PersonTrack],
    ) -> None:
        import numpy as np

        from workbench.cli.intent_folder import chosen_filter

        self.people = {track.agent: track for track in people}
        self.goals: tuple[Goal, ...] = ()
        self.prior = np.zeros(0)
        if recording in folder.scenes:
            self.goals = folder.goals[folder.scenes[recording]]
            self.prior = folder.prior_of(recording, args.priors).probability
        self.settings, self._seed = chosen_filter(args), args.seed
        self._beliefs: dict[str, Belief] = {}

    def belief(self, agent: str, t_s: float) -> Belief | None:
        """Of one person after every measurement until t_s; None before the first."""
        from workbench.estimation.intent_cloud import NumpyUpdate
        from workbench.estimation.intent_filter import Intents, advance, begin

        seen = self.people[agent].until(t_s)
        belief = self._beliefs.get(agent)
        start = 0 if belief is None else belief.count
        for at_s, place in zip(seen.t_s[start:], seen.xy_m[start:], strict=True):
            if belief is None:
                intents = Intents.of_person(self.goals, seen.recording, agent, seed=self._seed)
                belief = begin(intents, at_s, place, self.settings)
            else:
                belief = advance(belief, at_s, place, self.settings, NumpyUpdate())
        if belief is not None:
            self._beliefs[agent] = belief
        return belief


def _predictor(args: argparse.Namespace) -> TowardLikelyGoals:
    from workbench.estimation.likely_goals import TowardLikelyGoals
    from workbench.estimation.motion_parameters import load_motion, shipped_motion_path

    return TowardLikelyGoals(load_motion(args.motion or shipped_motion_path()))


def _rows(
    query: Query, feed: Feed, predictor: TowardLikelyGoals | None
) -> Iterator[dict[str, str]]:
    agent = query.key[1]
    key = {"recording": query.key[0], "agent": query.key[1]}
    if query.h_s is not None and predictor is not None:
        history = feed.people[agent].until(query.t_s)
        goals = feed.goals
        likely = goal_answer(feed, agent, query.t_s) if goals else ()
        ((x_m, y_m),) = predictor.places_m(
            history, query.t_s, (query.h_s,), goals=goals, probability=likely
        )
        asked = {"t0": query.row.text("t0"), "h": query.row.text("h")}
        yield key | asked | {"x": f"{x_m:.4f}", "y": f"{y_m:.4f}"}
        return
    for goal, p in zip(feed.goals, goal_answer(feed, agent, query.t_s), strict=True):
        yield key | {"t": query.row.text("t"), "goal": goal.name, "p": f"{p:.9g}"}


def goal_answer(feed: Feed, agent: str, t_s: float) -> Sequence[float]:
    """Probability of each goal; before the first measurement the root of the prior."""
    import numpy as np

    from workbench.estimation.intent_filter import answer

    belief = feed.belief(agent, t_s)
    root = np.sqrt(feed.prior)
    given = root / root.sum() if belief is None else answer(belief, feed.prior, feed.settings)
    return [float(p) for p in given]


def _csv(rows: Sequence[dict[str, str]], queries: Sequence[Query]) -> str:
    goals = any(query.h_s is None for query in queries)
    places = any(query.h_s is not None for query in queries)
    columns = ["recording", "agent"]
    columns += ["t", *_GOAL_COLUMNS] if goals or not places else []
    columns += ["t0", "h", *_PLACE_COLUMNS] if places else []
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
