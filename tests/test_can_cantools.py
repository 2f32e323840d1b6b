"""Our codecs and cantools agree on every message and signal, at the edges of ranges and inside."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest
from can_cases import EVERY_MESSAGE, EVERY_SIGNAL, NAMES, plain_frame, plain_values, with_raw
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("cantools", reason="needs the optional package cantools")

import cantools

import workbench.runtime.protocols
from workbench.runtime.protocols import PROTOCOLS, Decoded, decode, encode
from workbench.runtime.protocols.tables import COMPUTED, Message, Protocol, Role, Signal

FOLDER = Path(workbench.runtime.protocols.__file__).parent


@cache
def reference(name: str) -> Any:
    """What cantools reads from a DBC file, strictly."""
    return cantools.database.load_file(FOLDER / f"{name}.dbc", strict=True)


def theirs_of(protocol: Protocol, message: Message) -> Any:
    return reference(protocol.name).get_message_by_name(message.name)


def acceptable(theirs: Any, raw: int) -> bool:
    """Whether a DBC file lets a signal have a raw value, in the terms of cantools."""
    named = theirs.conversion.choices or {}
    words = {str(text) for text in named.values()}
    if words & {"ERROR", "NOT_AVAILABLE"}:
        if raw in named:
            return False
    elif named and raw not in named:
        return False
    value = raw * theirs.conversion.scale + theirs.conversion.offset
    margin = theirs.conversion.scale / 4
    return bool(theirs.minimum - margin <= value <= theirs.maximum + margin)


def raws_to_try(signal: Signal) -> list[int]:
    """Edges of the stated range and of the field, one count beside them, the middle, sentinels."""
    least = -(1 << signal.length - 1) if signal.signed else 0
    most = least + (1 << signal.length) - 1
    edges = {signal.raw_min, signal.raw_max, least, most, 0, *signal.sentinels, *signal.choices}
    near = {edge + step for edge in edges for step in (-1, 0, 1)}
    return sorted(raw for raw in near if least <= raw <= most)


def test_the_same_messages_stand_in_both() -> None:
    for name in PROTOCOLS:
        ours = [(p, m) for p, m in EVERY_MESSAGE if p.name == name]
        theirs = {message.name: message for message in reference(name).messages}
        assert {m.name for _, m in ours} == set(theirs)
        for protocol, message in ours:
            their = theirs[message.name]
            assert (their.frame_id, their.length) == (message.frame_id, message.length)
            assert {s.name for s in their.signals} == {s.name for s in message.signals}
            assert their.cycle_time == (message.cycle_ms or None)
            for signal in message.signals:
                their_signal = theirs_of(protocol, message).get_signal_by_name(signal.name)
                assert (their_signal.unit or "") == signal.unit
                assert their_signal.byte_order == "big_endian"
                assert (their_signal.comment or "") == signal.note


@pytest.mark.parametrize(("protocol", "message"), EVERY_MESSAGE, ids=NAMES)
def test_any_bytes_hold_the_same_values(protocol: Protocol, message: Message) -> None:
    theirs = theirs_of(protocol, message)

    @settings(max_examples=40, deadline=None)
    @given(st.binary(min_size=message.length, max_size=message.length))
    def law(data: bytes) -> None:
        raws = theirs.decode(data, scaling=False, decode_choices=False)
        values = theirs.decode(data, decode_choices=False)
        word = int.from_bytes(data, "big")
        for signal in message.signals:
            raw = signal.raw_in(word)
            assert raw == raws[signal.name]
            assert signal.value_of(raw) == pytest.approx(values[signal.name], rel=1e-12, abs=1e-12)
        decoded = decode(protocol, message.frame_id, data)
        if isinstance(decoded, Decoded):
            assert decoded.values == pytest.approx(values, rel=1e-12, abs=1e-12)
            assert all(acceptable(s, raws[s.name]) for s in theirs.signals)
        elif not any(signal.role in COMPUTED for signal in message.signals):
            judged = [s for s in message.signals if s.role is Role.VALIDITY]
            assert (
                not all(acceptable(s, raws[s.name]) for s in theirs.signals)
                or any(raws[signal.name] != 1 for signal in judged)
                or word & message.zero_mask
            )

    law()


def checks_of_edges(protocol: Protocol, message: Message, signal: Signal) -> int:
    """Decode and encode every raw value to try, as cantools does; how many were accepted."""
    theirs = theirs_of(protocol, message)
    their_signal = theirs.get_signal_by_name(signal.name)
    data = plain_frame(protocol, message)
    accepted = 0
    for raw in raws_to_try(signal):
        fits = acceptable(their_signal, raw)
        value = signal.value_of(raw)
        sent = encode(protocol, message.name, plain_values(message, {signal.name: value}))
        assert isinstance(sent, bytes) == fits, (signal.name, raw)
        if isinstance(sent, bytes):
            accepted += 1
            raws = theirs.decode(sent, scaling=False, decode_choices=False)
            assert raws[signal.name] == raw
            assert theirs.encode(raws, scaling=False, strict=False, padding=False) == sent
            received = decode(protocol, message.frame_id, sent)
            usable = signal.role is not Role.VALIDITY or raw == 1
            assert isinstance(received, Decoded) == usable
        if not any(each.role in COMPUTED for each in message.signals):
            changed = decode(protocol, message.frame_id, with_raw(message, signal, data, raw))
            usable = signal.role is not Role.VALIDITY or raw == 1
            assert isinstance(changed, Decoded) == (fits and usable)
    return accepted


@pytest.mark.parametrize(("protocol", "message"), EVERY_MESSAGE, ids=NAMES)
def test_edges_of_every_range_are_those_of_cantools(protocol: Protocol, message: Message) -> None:
    for signal in message.signals:
        if signal.role not in COMPUTED:
            assert checks_of_edges(protocol, message, signal) >= 1


@pytest.mark.parametrize(("protocol", "message"), EVERY_MESSAGE, ids=NAMES)
def test_any_values_are_sent_as_the_same_bytes(protocol: Protocol, message: Message) -> None:
    theirs = theirs_of(protocol, message)
    given_signals = [signal for signal in message.signals if signal.role not in COMPUTED]

    def raw_of(signal: Signal) -> st.SearchStrategy[int]:
        if signal.choices:
            return st.sampled_from(sorted(signal.choices))
        inside = st.integers(signal.raw_min, signal.raw_max)
        return inside.filter(lambda raw: raw not in signal.sentinels)

    @settings(max_examples=25, deadline=None)
    @given(st.tuples(*map(raw_of, given_signals)), st.floats(-0.4, 0.4))
    def law(raws: tuple[int, ...], beside: float) -> None:
        values = {}
        for signal, raw in zip(given_signals, raws, strict=True):
            low, high = signal.value_of(signal.raw_min), signal.value_of(signal.raw_max)
            between = signal.value_of(raw) + beside * signal.factor / signal.divisor
            values[signal.name] = min(max(between, low), high)
        sent = encode(protocol, message.name, values)
        assert isinstance(sent, bytes), sent
        read = theirs.decode(sent, scaling=False, decode_choices=False)
        assert [read[signal.name] for signal in given_signals] == list(raws)
        computed = {s.name: read[s.name] for s in message.signals if s.role in COMPUTED}
        assert theirs.encode(values | computed, strict=True, padding=False) == sent

    law()


def test_every_signal_was_tried() -> None:
    assert {id(signal) for _, _, signal in EVERY_SIGNAL} == {
        id(signal) for _, message in EVERY_MESSAGE for signal in message.signals
    }
