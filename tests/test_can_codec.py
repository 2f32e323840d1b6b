"""A frame is used whole or refused with a name; a value is sent exactly or not at all."""

from __future__ import annotations

import math
import subprocess
import sys
from fractions import Fraction
from typing import Any

import can
import pytest
from can_cases import EVERY_MESSAGE, NAMES, plain_frame, plain_values
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.runtime.protocols import (
    PROTOCOLS,
    Decoded,
    Reason,
    Refusal,
    decode,
    decode_received,
    encode,
    load_protocol,
)
from workbench.runtime.protocols.tables import COMPUTED, Message, Protocol

TWO, THREE, EARLY, OWN = (load_protocol(name) for name in PROTOCOLS)


def reason(said: Decoded | bytes | Refusal) -> Reason:
    assert isinstance(said, Refusal), said
    return said.reason


def values(said: Decoded | Refusal) -> dict[str, float]:
    assert isinstance(said, Decoded), said
    return dict(said.values)


def sent(protocol: Protocol, name: str, **changed: float) -> bytes | Refusal:
    return encode(protocol, name, plain_values(protocol.by_name[name], changed))


def test_frames_written_by_hand_hold_what_the_documents_say() -> None:
    speed = bytes.fromhex("0118 01 0000000000")
    assert values(decode(TWO, 0x6F, speed)) == {"VEHICLE_SPEED": 2.8, "VEHICLE_SPEED_VALID": 1}
    kinds = [type(value) for value in values(decode(TWO, 0x6F, speed)).values()]
    assert kinds == [float, int]
    steering = {"POSITION_VALUE": -1.5, "SPEED_LIMIT": 2.0}
    assert encode(TWO, "STEERING_CMD", steering) == bytes.fromhex("FFFFFA24 000007D0")
    brake = {"ENABLE": 1, "IGNORE_OVERRIDES": 0, "CLEAR_OVERRIDE": 0, "BRAKE_CMD": 0.7}
    assert encode(THREE, "BRAKE_CMD", brake) == bytes.fromhex("01 02BC")
    supervisory = encode(THREE, "SUPERVISORY_CTRL", {"ENABLE": 1, "COUNTER": 5})
    assert supervisory == bytes.fromhex("01 A5")
    health = encode(THREE, "USER_PC_HEALTH_RPT_00", {"COUNTER": 0xF0, "APPLICATION_FAULT": 1})
    assert health == bytes.fromhex("F0 15 01")


def test_a_signed_sentinel_is_no_standing_wheel() -> None:
    """cantools reads raw 0xFFFF of a file that lists 65535 as -0.01 rad/s."""
    name = "WHEEL_SPEED_RPT"
    ids = THREE.by_name[name].frame_id
    assert reason(decode(THREE, ids, b"\xff\xff" + bytes(6))) is Reason.NOT_AVAILABLE
    assert reason(decode(THREE, ids, bytes(2) + b"\xff\xfe" + bytes(4))) is Reason.ERROR
    assert values(decode(THREE, ids, bytes(6) + b"\xff\xfd"))["WHEEL_SPD_REAR_RIGHT"] == -0.03
    assert reason(sent(THREE, name, WHEEL_SPD_FRONT_LEFT=-0.01)) is Reason.NOT_AVAILABLE
    assert reason(sent(THREE, name, WHEEL_SPD_FRONT_LEFT=-0.02)) is Reason.ERROR


def test_a_speed_that_is_not_available_is_no_speed() -> None:
    assert reason(decode(THREE, 0x400, b"\x7f\xff")) is Reason.NOT_AVAILABLE
    assert reason(decode(THREE, 0x400, b"\x7f\xfe")) is Reason.ERROR
    assert values(decode(THREE, 0x400, b"\x7f\xfd")) == {"VEHICLE_SPEED": 327.65}
    assert reason(sent(THREE, "VEHICLE_SPEED_RPT", VEHICLE_SPEED=327.67)) is Reason.OUT_OF_RANGE
    assert reason(decode(EARLY, 0x400, bytes(8))) is Reason.SAID_INVALID
    assert values(decode(EARLY, 0x400, b"\x7f\xff\x01" + bytes(5)))["VEHICLE_SPEED"] == 327.67
    said = decode(TWO, 0x6F, b"\x01\x18\xfe" + bytes(5))
    assert reason(said) is Reason.SAID_INVALID
    assert str(said) == "VEHICLE_SPEED_RPT.VEHICLE_SPEED_VALID: the sender calls it invalid"


@pytest.mark.parametrize(("protocol", "message"), EVERY_MESSAGE, ids=NAMES)
def test_every_other_length_is_refused(protocol: Protocol, message: Message) -> None:
    data = plain_frame(protocol, message)
    assert isinstance(decode(protocol, message.frame_id, bytearray(data)), Decoded)
    for length in {*range(9), 12, 64} - {message.length}:
        given_length = (data + bytes(64))[:length]
        said = decode(protocol, message.frame_id, given_length)
        assert reason(said) is Reason.WRONG_LENGTH
        assert str(said) == (
            f"{message.name}: wrong length ({length} bytes, expected {message.length})"
        )


def test_a_command_beyond_its_range_is_not_sent() -> None:
    """cantools sends BRAKE_CMD 1.5 as 0x05DC when it is not strict."""
    for name in ("BRAKE_CMD", "ACCEL_CMD"):
        for protocol in (TWO, THREE, EARLY):
            for wrong in (1.5, 1.0004, math.nextafter(1.0, 2.0), -1e-300, 2**70, -(10**400)):
                assert reason(sent(protocol, name, **{name: wrong})) is Reason.OUT_OF_RANGE
            for wrong in (math.nan, math.inf, -math.inf):
                assert reason(sent(protocol, name, **{name: wrong})) is Reason.NOT_FINITE
            assert isinstance(sent(protocol, name, **{name: 1}), bytes)
    assert str(sent(TWO, "BRAKE_CMD", BRAKE_CMD=1.5)) == (
        "BRAKE_CMD.BRAKE_CMD: out of range (1.5, expected 0 to 1)"
    )
    assert str(sent(TWO, "STEERING_CMD", POSITION_VALUE=-13)) == (
        "STEERING_CMD.POSITION_VALUE: out of range (-13, expected -12 to 12 rad)"
    )


def test_ranges_and_choices_of_received_frames_are_kept() -> None:
    assert reason(decode(TWO, 0x68, b"\x03\xe9" + bytes(6))) is Reason.OUT_OF_RANGE
    assert values(decode(TWO, 0x68, b"\x03\xe8" + bytes(6)))["MANUAL_INPUT"] == 1.0
    assert reason(decode(TWO, 0x66, bytes([0, 5, 0, 0, 0, 0, 0, 0]))) is Reason.NOT_A_CHOICE
    assert reason(sent(TWO, "SHIFT_CMD", SHIFT_CMD=5)) is Reason.OUT_OF_RANGE
    assert reason(decode(THREE, 0x0C0, b"\x00")) is Reason.NOT_A_CHOICE
    assert values(decode(THREE, 0x0C1, b"\x00")) == {"SAFETY_BRAKE_CMD": 0}
    assert reason(decode(EARLY, 0x407, b"\x80" + bytes(7))) is Reason.OUT_OF_RANGE


def test_undefined_bits_are_refused_where_the_protocol_fixes_them() -> None:
    said = decode(THREE, 0x104, bytes.fromhex("11 0000"))
    assert reason(said) is Reason.UNDEFINED_BITS
    assert str(said) == "BRAKE_CMD: undefined bits are not 0 (0x100000)"
    assert values(decode(EARLY, 0x104, b"\x08" + bytes(7)))["CLEAR_FAULTS"] == 1
    assert reason(decode(EARLY, 0x104, b"\x10" + bytes(7))) is Reason.UNDEFINED_BITS
    last = decode(EARLY, 0x104, bytes(7) + b"\x01")
    assert str(last) == "BRAKE_CMD: undefined bits are not 0 (0x0000000000000001)"
    # PACMod 2 says nothing of them.
    assert values(decode(TWO, 0x6B, bytes(7) + b"\x01")) == {"BRAKE_CMD": 0.0}


def test_only_classic_standard_data_frames_count() -> None:
    frame = {"arbitration_id": 0x6B, "data": bytes(8), "is_extended_id": False}
    assert isinstance(decode_received(TWO, can.Message(**frame)), Decoded)  # type: ignore[arg-type]
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"is_extended_id": True}, "extended identifier"),
        ({"is_fd": True}, "CAN FD"),
        ({"is_error_frame": True, "data": b""}, "error frame"),
        ({"is_remote_frame": True, "data": b""}, "remote frame"),
    ]
    for change, word in wrong:
        said = decode_received(TWO, can.Message(**(frame | change)))
        assert reason(said) is Reason.NOT_A_DATA_FRAME
        assert word in str(said)
    said = decode(TWO, 0x7FF, bytes(8))
    assert reason(said) is Reason.UNKNOWN_ID
    assert str(said) == "unknown identifier (0x7FF)"


@pytest.mark.parametrize("name", PROTOCOLS)
@settings(max_examples=400, deadline=None)
@given(frame_id=st.integers(0, 2**29 - 1), data=st.binary(max_size=64))
def test_no_bytes_raise(name: str, frame_id: int, data: bytes) -> None:
    protocol = load_protocol(name)
    known = list(protocol.by_id)
    for each in (frame_id, known[frame_id % len(known)]):
        said = decode(protocol, each, data)
        assert isinstance(said, Decoded | Refusal)
        assert str(said)


@pytest.mark.parametrize(("protocol", "message"), EVERY_MESSAGE, ids=NAMES)
def test_what_is_sent_is_the_nearest_and_what_is_read_is_sent_again(
    protocol: Protocol, message: Message
) -> None:
    fields = [signal for signal in message.signals if signal.role not in COMPUTED]

    @settings(max_examples=25, deadline=None)
    @given(st.data())
    def law(data: st.DataObject) -> None:
        wanted = {
            s.name: data.draw(st.sampled_from(sorted(s.choices)))
            if s.choices
            else data.draw(st.floats(s.value_of(s.raw_min), s.value_of(s.raw_max)))
            for s in fields
        }
        frame = encode(protocol, message.name, wanted)
        if isinstance(frame, Refusal):
            assert frame.reason in (Reason.ERROR, Reason.NOT_AVAILABLE)
            return
        word = int.from_bytes(frame, "big")
        for s in fields:
            exact = (Fraction(wanted[s.name]) * s.divisor - s.offset) / s.factor
            assert s.raw_in(word) == round(exact)
        received = decode(protocol, message.frame_id, frame)
        if isinstance(received, Refusal):
            assert received.reason is Reason.SAID_INVALID
            return
        again = {s.name: received.values[s.name] for s in fields}
        assert encode(protocol, message.name, again) == frame

    law()


def test_ties_go_to_the_even_count() -> None:
    speed = OWN.by_name["PERSON_MOTION"]
    for raw in range(-4, 4):
        between = (2 * raw + 1) / 800  # exact in binary only for multiples of 1 / 32
        frame = encode(OWN, "PERSON_MOTION", plain_values(speed, {"X_SPEED": between}))
        assert isinstance(frame, bytes)
        exact = Fraction(between) * 400
        assert speed.signal("X_SPEED").raw_in(int.from_bytes(frame, "big")) == round(exact)
    half = {"COUNTER": 2.5, "PEOPLE_SET": 3.5}
    frame = encode(OWN, "DECISION", plain_values(OWN.by_name["DECISION"], half))
    assert isinstance(frame, bytes)
    assert (frame[0], frame[6]) == (2, 4)


@pytest.mark.parametrize(
    ("name", "given_values", "said"),
    [
        ("BRAKE", {}, "expected a message of pacmod2, got 'BRAKE'"),
        ("BRAKE_CMD", {}, r"expected values of \['BRAKE_CMD'\], got \[\]"),
        ("BRAKE_CMD", {"BRAKE_CMD": 0, "X": 1}, r"got \['BRAKE_CMD', 'X'\]"),
        ("BRAKE_CMD", {"BRAKE_CMD": "0"}, "BRAKE_CMD.BRAKE_CMD: expected a number, got '0'"),
        ("BRAKE_CMD", {"BRAKE_CMD": None}, "expected a number, got None"),
    ],
)
def test_wrong_use_is_said(name: str, given_values: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        encode(TWO, name, given_values)


def test_what_the_codec_computes_is_not_given() -> None:
    with pytest.raises(InputError, match=r"expected values of \['COUNTER', 'ENABLE'\]"):
        encode(THREE, "SUPERVISORY_CTRL", {"ENABLE": 1, "COUNTER": 5, "COMPLEMENT": 10})


def test_a_number_too_long_to_print_is_cut() -> None:
    said = sent(TWO, "BRAKE_CMD", BRAKE_CMD=10**400)
    assert reason(said) is Reason.OUT_OF_RANGE
    assert len(str(said)) < 120


def test_the_codecs_need_the_standard_library_only() -> None:
    program = (
        "import sys; before = set(sys.modules); import workbench.runtime.protocols as p; "
        "p.load_protocol('workbench'); p.worst_rounding(); "
        "own = {n.partition('.')[0] for n in set(sys.modules) - before}; "
        "print(sorted(own - sys.stdlib_module_names - {'workbench'}))"
    )
    # The package `workbench.runtime` brings its own modules, of which all are blocked elsewhere.
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
