"""A replay gives the core what it got on the vehicle, to the microsecond, in every form of log; and
whatever differs is found and named."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_cases import TURN_US, TURNS, EchoCore, Frame, drive, header, own, recorded

from workbench.errors import InputError
from workbench.runtime.onboard.core import Request
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.playback import (
    BusErrorSeen,
    Compared,
    DecisionLogged,
    Received,
    RequestSeen,
    Turn,
    compare,
    play,
)
from workbench.runtime.onboard.playback_logs import EndOfLog, events_of, open_log
from workbench.runtime.onboard.recorder import RecordedCore, Recorder, RecorderSettings
from workbench.runtime.onboard.recorder_entries import (
    LoggedFrame,
    Mark,
    digest,
    turn_record,
)

FORMS = (".asc", ".blf", ".log")


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The same drive on record in every form: by the ending of the file's name."""
    found = {}
    for suffix in FORMS:
        folder = tmp_path_factory.mktemp("logs") / "log"
        recorder = Recorder.start(header(), RecorderSettings(folder, suffix))
        core = RecordedCore(EchoCore(), recorder)  # type: ignore[arg-type]
        core.request(Request.REARM, 1)
        core.bus_error(BusError.OVERFLOW, 2)
        drive(core, turns=TURNS, details=recorder.details)
        assert recorder.close().in_order
        found |= {suffix: folder / f"can{suffix}", ".mcap": folder / "monitor.mcap"}
    return found


def again(lines: Iterable[Any], core: Any = None) -> Compared:
    events = events_of([*lines, EndOfLog(True)])
    return compare(core or EchoCore(), events, exact=True)


@pytest.mark.parametrize("suffix", [*FORMS, ".mcap"])
def test_every_form_of_log_replays_to_the_same_bits(suffix: str, logs: dict[str, Path]) -> None:
    log = open_log(logs[suffix])
    assert log.exact
    assert log.header == header()
    compared = compare(EchoCore(), log.events, exact=log.exact)
    assert compared.mismatches == ()
    # A raw log does not say that its last turn is whole.
    assert compared.turns == (TURNS if suffix == ".mcap" else TURNS - 1)
    assert compared.decisions == TURNS // 3
    assert compared.compared == (TURNS // 3 if suffix == ".mcap" else 0)


def test_all_that_the_core_was_told_comes_back(logs: dict[str, Path]) -> None:
    events = list(open_log(logs[".mcap"]).events)
    assert events[:3] == [
        RequestSeen(Request.REARM, 1),
        BusErrorSeen(BusError.OVERFLOW, 2),
        Received(0x6F, b"\x00\x00", 0),
    ]
    assert events[4] == Received(0x71, b"\x00\x02", 14)
    assert events[3] == Received(0x70, b"\x00\x01", 7, upstream=True)
    turns = [event for event in events if isinstance(event, Turn)]
    assert [turn.at_us for turn in turns] == [k * TURN_US + TURN_US - 11 for k in range(TURNS)]
    assert [turn.decided_us for turn in turns[:4]] == [
        turns[0].at_us + 1234, None, None, turns[3].at_us + 1234
    ]  # fmt: skip


def test_playing_gives_the_results_of_the_drive() -> None:
    kept: list[Any] = []
    drive(EchoCore(), turns=TURNS, details=kept.append)
    assert list(play(EchoCore(), events_of([*recorded(), EndOfLog(True)]))) == kept


CHANGES: dict[str, Callable[[Any], Any]] = {
    "a microsecond": lambda f: dataclasses.replace(f, at_us=f.at_us + 1),
    "an identifier": lambda f: dataclasses.replace(f, identifier=f.identifier ^ 1),
    "a bit": lambda f: dataclasses.replace(f, data=bytes([f.data[0] ^ 1]) + f.data[1:]),
    "the bus": lambda f: dataclasses.replace(f, upstream=not f.upstream),
}


@pytest.mark.parametrize("change", CHANGES)
@given(st.data())
@settings(max_examples=25)
def test_any_change_of_what_was_received_is_found(change: str, data: st.DataObject) -> None:
    lines = recorded()
    places = [k for k, f in enumerate(lines) if isinstance(f, LoggedFrame) and not f.made]
    place = data.draw(st.sampled_from(places))
    lines[place] = CHANGES[change](lines[place])
    assert again(lines).mismatches


@given(st.data())
@settings(max_examples=25)
def test_whatever_is_left_out_or_swapped_is_found(data: st.DataObject) -> None:
    lines = recorded()
    # Without the end of its last turn the log is only shorter.
    place = data.draw(st.integers(0, len(lines) - 8))
    if data.draw(st.booleans()):
        left_out = lines.pop(place)
        if isinstance(left_out, DecisionLogged):
            assert again(lines).compared == TURNS // 3 - 1
            return
    else:
        one, two = lines[place : place + 2]
        if isinstance(one, DecisionLogged):
            # Where it stands after its turn says nothing.
            return
        lines[place : place + 2] = [two, one]
    assert again(lines).mismatches


def test_the_instant_of_a_turn_and_the_end_of_a_decision_count() -> None:
    for name in ("HEARTBEAT", "DECISION"):
        lines = recorded()
        identifier = own_id(name)
        place = [getattr(line, "identifier", 0) for line in lines].index(identifier)
        lines[place] = dataclasses.replace(lines[place], at_us=lines[place].at_us + 1)
        assert again(lines).mismatches


def own_id(name: str) -> int:
    if name == "HEARTBEAT":
        return own(name, COUNTER=0, STATE=1, MODE=1, STAMP=0.0, BUNDLE_TAG=0).identifier
    return own(
        name, COUNTER=0, ACTION=1, VERDICT=1, ALERT=1, STAMP=0.0, PEOPLE_SET=0
    ).identifier  # fmt: skip


class Otherwise(EchoCore):
    """Differs from what is on record by one thing on one turn."""

    def __init__(self, change: Callable[[Any], Any]) -> None:
        super().__init__()
        self._change = change

    def turn(self, at_us: int, clock: Callable[[], int]) -> Any:
        result = super().turn(at_us, clock)
        return self._change(result) if at_us == 4 * TURN_US - 11 else result


def frames_with(result: Any, at: int, data: bytes) -> Any:
    frames = list(result.frames)
    frames[at] = Frame(frames[at].identifier, data)
    return dataclasses.replace(result, frames=tuple(frames))


def decision_with(result: Any, **values: Any) -> Any:
    decision = dataclasses.replace(result.decision, **values)
    return dataclasses.replace(result, decision=decision)


def last_bit(rows: Any) -> Any:
    import math

    changed = [list(row) for row in rows]
    changed[20][2] = math.nextafter(changed[20][2], 1e9)
    return tuple(map(tuple, changed))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda r: frames_with(r, 0, bytes(8)), ["0x6B"]),
        (lambda r: frames_with(r, 1, bytes(8)), ["HEARTBEAT"]),
        (lambda r: frames_with(r, 2, bytes(8)), ["DECISION"]),
        (lambda r: dataclasses.replace(r, frames=r.frames[1:]), ["0x6B", "DECISION"]),
        (lambda r: decision_with(r, reason="else"), ["decision, digest", "decision, reason"]),
        (lambda r: decision_with(r, brake_from_s=1.0),
         ["decision, brake_from_s", "decision, digest"]),
        (lambda r: decision_with(r, tube_upper=last_bit(r.decision.tube_upper)),
         ["decision, digest"]),
        (lambda r: decision_with(r, clearance_m=-0.0),
         ["decision, clearance_m", "decision, digest"]),
        (lambda r: dataclasses.replace(r, observation=None), ["decision, digest"]),
        (lambda r: dataclasses.replace(r, decision=None), ["decision"]),
        (lambda r: decision_with(r, elapsed_s=99.0), []),
    ],
)  # fmt: skip
def test_what_the_core_makes_otherwise_is_named(
    change: Callable[[Any], Any], named: list[str]
) -> None:
    compared = again(recorded(), Otherwise(change))
    found = {mismatch.what for mismatch in compared.mismatches}
    assert found == set(named)
    for mismatch in compared.mismatches:
        assert mismatch.at_us == 4 * TURN_US - 11
        assert "0.133321 s" in str(mismatch)


def test_a_decision_that_the_vehicle_did_not_make_is_found() -> None:
    compared = again(recorded(), EchoCore(decides_every=2))
    assert compared.mismatches


def test_many_mismatches_are_counted() -> None:
    events = events_of([*recorded(), EndOfLog(True)])
    compared = compare(EchoCore(decides_every=2), events, exact=True, most=3)
    assert len(compared.mismatches) == 4
    assert "more" in str(compared.mismatches[-1])


def test_the_digest_is_of_every_number() -> None:
    kept: list[Any] = []
    drive(EchoCore(), turns=1, details=kept.append)
    record = turn_record(kept[0])
    seen = {digest(record)}

    def each(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in items:
            if isinstance(item, dict | list | tuple):
                yield from each(item, (*place, key))
            elif isinstance(item, float) and (*place, key) != ("elapsed_s",):
                yield (*place, key)

    def listed(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: listed(item) for key, item in value.items()}
        return [listed(item) for item in value] if isinstance(value, list | tuple) else value

    record = listed(record)
    places = list(each(record))
    assert len(places) > 800
    for place in places[::7]:
        changed = copy.deepcopy(record)
        at = changed
        for key in place[:-1]:
            at = at[key]
        at[place[-1]] = -1.25
        seen.add(digest(changed))
    assert len(seen) == 1 + len(places[::7])


def test_lost_entries_are_told_and_their_consequences_found() -> None:
    lines = recorded()
    lines[20:22] = [LoggedFrame.mark(Mark.LOST, 2, at_us=lines[20].at_us)]
    compared = again(lines)
    assert compared.lost == 2
    assert compared.mismatches


def test_a_log_that_breaks_off_replays_up_to_its_last_whole_turn(
    logs: dict[str, Path], tmp_path: Path
) -> None:
    for suffix in (*FORMS, ".mcap"):
        content = logs[suffix].read_bytes()
        cut = tmp_path / f"cut{suffix}"
        most = 0
        for size in range(len(content) // 2, len(content), len(content) // 9):
            cut.write_bytes(content[:size])
            log = open_log(cut)
            assert log.exact
            try:
                compared = compare(EchoCore(), log.events, exact=True)
            except InputError as error:
                assert "HEARTBEAT" in str(error)
                continue
            assert compared.mismatches == ()
            most = max(most, compared.turns)
        # This drive is one block of the others.
        assert most > 3 or suffix in (".blf", ".mcap")
