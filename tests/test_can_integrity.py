"""Every change of up to three bits of our frames is seen; counters show what is not new."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest
from can_cases import EVERY_MESSAGE, plain_frame
from hypothesis import given
from hypothesis import strategies as st

from workbench.runtime.protocols import (
    PROTOCOLS,
    Decoded,
    Reason,
    Refusal,
    counter_step,
    decode,
    frame_crc,
    load_protocol,
    worst_rounding,
)
from workbench.runtime.protocols.integrity import CRC_POLYNOMIAL, crc8
from workbench.runtime.protocols.own_frames import rounding_of
from workbench.runtime.protocols.tables import Message, Protocol

OWN = load_protocol("workbench")
OURS = [(protocol, message) for protocol, message in EVERY_MESSAGE if protocol is OWN]
THREE = load_protocol("pacmod3")
ROOT = Path(__file__).parent.parent


def slow_crc(data: bytes) -> int:
    """The remainder by long division, bit by bit, with the first eight bits inverted."""
    bits = int.from_bytes(bytes([data[0] ^ 0xFF]) + data[1:] + b"\0", "big")
    for place in range(8 * len(data) - 1, -1, -1):
        if bits >> (place + 8) & 1:
            bits ^= (0x100 | CRC_POLYNOMIAL) << place
    return bits ^ 0xFF


@given(st.binary(min_size=1, max_size=16))
def test_the_table_divides_like_long_division(data: bytes) -> None:
    assert crc8(data) == slow_crc(data)


def test_published_check_values() -> None:
    assert crc8(b"123456789") == 0xDF
    assert crc8(bytes(4)) == 0x12
    assert crc8(bytes.fromhex("F20183")) == 0xC2
    assert frame_crc(0x6C0, b"") == crc8(b"\x06\xc0")


@pytest.mark.parametrize(("protocol", "message"), OURS, ids=[m.name for _, m in OURS])
def test_one_and_two_flipped_bits_of_a_frame_are_seen(protocol: Protocol, message: Message) -> None:
    data = plain_frame(protocol, message)
    assert isinstance(decode(protocol, message.frame_id, data), Decoded)
    word = int.from_bytes(data, "big")
    for many in (1, 2):
        for places in combinations(range(64), many):
            flipped = word ^ sum(1 << place for place in places)
            said = decode(protocol, message.frame_id, flipped.to_bytes(8, "big"))
            assert isinstance(said, Refusal)
            assert said.reason is Reason.WRONG_CHECKSUM


def test_three_flipped_bits_and_short_bursts_are_seen() -> None:
    """A change is seen or not whatever the frame holds: the CRC is linear in it."""
    blank = frame_crc(0x6C0, bytes(7))
    alone = []
    for place in range(56):
        payload = (1 << place).to_bytes(7, "big")
        alone.append(frame_crc(0x6C0, payload) ^ blank)
    syndromes = [1 << place for place in range(8)] + alone
    assert len(set(syndromes)) == 64
    pairs = {a ^ b for a, b in combinations(syndromes, 2)}
    assert 0 not in pairs
    assert not pairs & set(syndromes)
    for start in range(57):
        for pattern in range(1, 256):
            burst = 0
            for offset in range(8):
                burst ^= syndromes[start + offset] if pattern >> offset & 1 else 0
            assert burst != 0


def test_a_frame_under_another_identifier_is_seen() -> None:
    for protocol, message in OURS:
        data = plain_frame(protocol, message)
        for other in OWN.by_id:
            if other != message.frame_id:
                said = decode(OWN, other, data)
                assert isinstance(said, Refusal)
                assert said.reason is Reason.WRONG_CHECKSUM


@pytest.mark.parametrize("name", ["GLOBAL_CMD", "SUPERVISORY_CTRL", "COMPONENT_RPT_00"])
def test_a_counter_must_match_its_complement(name: str) -> None:
    message = THREE.by_name[name]
    counter, complement = message.signal("COUNTER"), message.signal("COMPLEMENT")
    for count in range(16):
        for inverse in range(16):
            word = counter.placed(count) | complement.placed(inverse)
            said = decode(THREE, message.frame_id, word.to_bytes(message.length, "big"))
            assert isinstance(said, Decoded) == (count + inverse == 15)
            if isinstance(said, Refusal):
                assert said.reason is Reason.WRONG_COMPLEMENT


@pytest.mark.parametrize("number", [0, 1])
def test_a_health_report_carries_its_sum(number: int) -> None:
    frame_id = 0x025 + number
    for count in range(256):
        for step in (0, 1, 255):
            data = bytes([count, (frame_id + count + step) % 256, 0])
            said = decode(THREE, frame_id, data)
            assert isinstance(said, Decoded) == (step == 0)
            if isinstance(said, Refusal):
                assert said.reason is Reason.WRONG_CHECKSUM


@given(st.integers(0, 255), st.integers(-128, 127), st.sampled_from([4, 8]))
def test_a_counter_moves_as_far_as_it_was_moved(start: int, moved: int, bits: int) -> None:
    size = 1 << bits
    start, moved = start % size, (moved + size // 2) % size - size // 2
    assert counter_step(start, (start + moved) % size, bits=bits) == moved


def test_half_a_round_is_a_step_backwards() -> None:
    assert counter_step(0, 128, bits=8) == -128
    assert counter_step(0, 127, bits=8) == 127
    assert counter_step(9, 9, bits=4) == 0


def test_rounding_is_bounded_for_every_scaled_signal() -> None:
    table = worst_rounding()
    for _, message in OURS:
        for signal in message.signals:
            half = signal.factor / signal.divisor / 2
            if signal.divisor == 1:
                assert (message.name, signal.name) not in table
                assert rounding_of(signal) == 0.0
            else:
                assert half < table[message.name, signal.name] < half * 1.001
    assert table["LOC_POSITION", "X"] == pytest.approx(0.0005, rel=1e-5)


def test_the_rounding_table_of_the_documents_is_this_one() -> None:
    text = (ROOT / "docs" / "can-protocols.md").read_text(encoding="utf-8")
    for (message, signal), bound in worst_rounding().items():
        assert f"| {message} | {signal} | {bound:.3g} |" in text


@pytest.mark.parametrize("name", PROTOCOLS[:-1])
def test_vehicles_frames_carry_no_crc(name: str) -> None:
    """What pacmod2 cannot show stands among the limits; this keeps the sentence true."""
    roles = {s.role.value for m in load_protocol(name).by_id.values() for s in m.signals}
    assert "crc" not in roles
    assert (name == "pacmod3") == bool(roles & {"sum", "complement"})
