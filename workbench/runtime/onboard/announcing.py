"""What the monitor tells everybody on the bus: heartbeat, decision, and whom to warn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, final

from workbench.claims import Verdict
from workbench.runtime.decision import Action, Decision
from workbench.runtime.onboard.commands import Frame
from workbench.runtime.onboard.states import Mode, State
from workbench.runtime.onboard.times import seconds
from workbench.runtime.protocols import Refusal, encode, load_protocol

_OWN: Final = load_protocol("workbench")
_ACTIONS: Final = {Action.BRAKE: 1, Action.TRACK: 2}
_VERDICTS: Final = {Verdict.INVALID: 1, Verdict.UNPROVED: 2, Verdict.SAFE: 3}
_NOBODY, _PERSONS, _EVERYBODY = 1, 2, 3
_MOST_TRACK: Final = 0xFFFF
_WRAP_US: Final = 429_496_000_000
"""Stamps begin anew after so long (119 h): they are for the log, no age is taken from them."""


@final
class Announcer:
    """Makes our own frames and counts them; tag: first byte of the manifest's SHA-256."""

    def __init__(self, mode: Mode, tag: int) -> None:
        self._mode, self._tag = mode, tag
        self._beats = self._decisions = 0

    def heartbeat(self, at_us: int, state: State) -> Frame:
        """HEARTBEAT, on every turn."""
        values = {
            "COUNTER": self._beats, "STATE": state, "MODE": self._mode, "STAMP": _stamp(at_us),
            "BUNDLE_TAG": self._tag,
        }  # fmt: skip
        self._beats = (self._beats + 1) % 256
        return _frame("HEARTBEAT", values)

    def decision(
        self, decision: Decision | None, at_us: int, *, brakes: bool, people_set: int
    ) -> tuple[Frame, ...]:
        """DECISION, and ALERT for whom it warns. decision: None where nothing could be judged,
        which warns everybody; brakes: BRAKE is sent whatever was decided; people_set: number of the
        set that was judged."""
        action, verdict, alert = Action.BRAKE, Verdict.INVALID, _EVERYBODY
        tracks: tuple[int, ...] = ()
        if decision is not None:
            action = Action.BRAKE if brakes else decision.action
            verdict = decision.verdict
            alert, tracks = _alerted(decision)
        count = self._decisions
        self._decisions = (count + 1) % 256
        frames = [
            _frame(
                "DECISION",
                {
                    "COUNTER": count, "ACTION": _ACTIONS[action], "VERDICT": _VERDICTS[verdict],
                    "ALERT": alert, "STAMP": _stamp(at_us), "PEOPLE_SET": people_set,
                },
            )
        ]  # fmt: skip
        for index, track in enumerate(tracks):
            place = {"COUNTER": count, "COUNT": len(tracks), "INDEX": index}
            frames.append(_frame("ALERT", place | {"TRACK": track, "PEOPLE_SET": people_set}))
        return tuple(frames)


def _alerted(decision: Decision) -> tuple[int, tuple[int, ...]]:
    """Who is warned: nobody, somebody by their track, or everybody where no track is known."""
    if decision.alert is None:
        return _NOBODY, ()
    name = decision.alert.person
    if name is None or not name.isdecimal() or int(name) > _MOST_TRACK:
        return _EVERYBODY, ()
    return _PERSONS, (int(name),)


def _stamp(at_us: int) -> float:
    return seconds(at_us % _WRAP_US)


def _frame(name: str, values: Mapping[str, float]) -> Frame:
    data = encode(_OWN, name, values)
    assert not isinstance(data, Refusal), f"all values are within their ranges: {data}"
    return Frame(_OWN.by_name[name].frame_id, data)
