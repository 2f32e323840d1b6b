"""The tables that drive are what the DBC files say, and these say what was published."""

from __future__ import annotations

import json
import shutil
from itertools import pairwise
from pathlib import Path

import pytest
from can_cases import EVERY_MESSAGE, EVERY_SIGNAL, start_of

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.codegen.can_tables import FOLDER, made_table, write_tables
from workbench.codegen.dbc_reader import read_dbc
from workbench.errors import InputError
from workbench.runtime.protocols import PROTOCOLS, load_protocol
from workbench.runtime.protocols.tables import Role, protocol_from_table, protocol_of, table_of

# protocol, identifier, bytes, message, signal, start, length, signed, counts per unit
FACTS = """
pacmod2 0x63 8 TURN_CMD TURN_SIGNAL_CMD 7 8 u 1
pacmod2 0x65 8 SHIFT_CMD SHIFT_CMD 7 8 u 1
pacmod2 0x66 8 SHIFT_RPT OUTPUT_VALUE 23 8 u 1
pacmod2 0x67 8 ACCEL_CMD ACCEL_CMD 7 16 u 1000
pacmod2 0x68 8 ACCEL_RPT COMMANDED_VALUE 23 16 u 1000
pacmod2 0x69 8 GLOBAL_CMD CLEAR_OVERRIDE 1 1 u 1
pacmod2 0x6A 8 GLOBAL_RPT USR_CAN_TIMEOUT 5 1 u 1
pacmod2 0x6A 8 GLOBAL_RPT USR_CAN_READ_ERRORS 55 16 u 1
pacmod2 0x6B 8 BRAKE_CMD BRAKE_CMD 7 16 u 1000
pacmod2 0x6C 8 BRAKE_RPT OUTPUT_VALUE 39 16 u 1000
pacmod2 0x6C 8 BRAKE_RPT BRAKE_ON_OFF 48 1 u 1
pacmod2 0x6D 8 STEERING_CMD POSITION_VALUE 7 32 s 1000
pacmod2 0x6D 8 STEERING_CMD SPEED_LIMIT 39 32 u 1000
pacmod2 0x6E 8 STEERING_RPT_1 OUTPUT_VALUE 39 16 s 1000
pacmod2 0x6F 8 VEHICLE_SPEED_RPT VEHICLE_SPEED 7 16 s 100
pacmod2 0x6F 8 VEHICLE_SPEED_RPT VEHICLE_SPEED_VALID 16 1 u 1
pacmod2 0x70 8 BRAKE_MOTOR_RPT_1 MOTOR_CURRENT 7 32 s 1000
pacmod2 0x75 8 STEERING_MOTOR_RPT_3 TORQUE_INPUT 39 32 s 1000
pacmod2 0x7A 8 WHEEL_SPEED_RPT WHEEL_SPD_REAR_RIGHT 55 16 s 1
pacmod2 0x80 8 PARKING_BRAKE_STATUS_RPT PARKING_BRAKE_ENABLED 0 1 u 1
pacmod2 0x81 8 YAW_RATE_RPT YAW_RATE 7 16 s 100
pacmod2 0x82 8 LAT_LON_HEADING_RPT HEADING 55 16 s 100
pacmod2 0xFF 8 VIN_RPT MFG_CODE 7 24 u 1
pacmod3 0x010 8 GLOBAL_RPT CONFIG_FAULT 15 1 u 1
pacmod3 0x010 8 GLOBAL_RPT SUPERVISORY_ENABLE_REQUIRED 14 1 u 1
pacmod3 0x011 2 GLOBAL_RPT_2 ENABLE_METHOD 7 2 u 1
pacmod3 0x011 2 GLOBAL_RPT_2 DEV_ALLOWED 10 1 u 1
pacmod3 0x020 5 COMPONENT_RPT_00 COUNTER 27 4 u 1
pacmod3 0x020 5 COMPONENT_RPT_00 DBW_WARNING_LEVEL 34 3 u 1
pacmod3 0x025 3 USER_PC_HEALTH_RPT_00 CHECKSUM 15 8 u 1
pacmod3 0x080 2 GLOBAL_CMD COUNTER 11 4 u 1
pacmod3 0x080 2 GLOBAL_CMD COMPLEMENT 15 4 u 1
pacmod3 0x081 2 SUPERVISORY_CTRL ENABLE 0 1 u 1
pacmod3 0x0C0 1 SAFETY_FUNC_CMD COMMAND 3 4 u 1
pacmod3 0x0C1 1 SAFETY_BRAKE_CMD SAFETY_BRAKE_CMD 0 1 u 1
pacmod3 0x100 3 ACCEL_CMD ACCEL_CMD 15 16 u 1000
pacmod3 0x104 3 BRAKE_CMD BRAKE_CMD 15 16 u 1000
pacmod3 0x128 2 SHIFT_CMD SHIFT_CMD 15 8 u 1
pacmod3 0x12C 5 STEERING_CMD POSITION 15 16 s 1000
pacmod3 0x12C 5 STEERING_CMD ROTATION_RATE 31 16 u 1000
pacmod3 0x13C 4 BRAKE_DECEL_CMD BRAKE_DECEL_CMD 15 16 u 1000
pacmod3 0x200 8 ACCEL_RPT OUTPUT_VALUE 47 16 u 1000
pacmod3 0x204 8 BRAKE_RPT COMMAND_TIMEOUT 7 1 u 1
pacmod3 0x22C 8 STEERING_RPT MANUAL_INPUT 15 16 s 1000
pacmod3 0x22C 8 STEERING_RPT PERFORMANCE_STATUS 61 3 u 1
pacmod3 0x228 5 SHIFT_RPT OUTPUT_VALUE 31 8 u 1
pacmod3 0x400 2 VEHICLE_SPEED_RPT VEHICLE_SPEED 7 16 s 100
pacmod3 0x407 8 WHEEL_SPEED_RPT WHEEL_SPD_FRONT_LEFT 7 16 s 100
pacmod3 0x40E 8 LAT_LON_HEADING_RPT HEADING 55 16 s 100
pacmod3 0x419 7 LINEAR_ACCEL_RPT LONGITUDINAL_ACCEL 31 16 s 100
pacmod3 0x41A 7 ANG_VEL_RPT YAW_VEL 47 16 s 1000
pacmod3 0x41C 1 ESTOP_RPT ESTOP_FAULT 1 1 u 1
pacmod3_3_4 0x100 8 ACCEL_CMD CLEAR_FAULTS 3 1 u 1
pacmod3_3_4 0x104 8 BRAKE_CMD BRAKE_CMD 15 16 u 1000
pacmod3_3_4 0x12C 8 STEERING_CMD ROTATION_RATE 31 16 u 1000
pacmod3_3_4 0x32C 8 STEERING_AUX_RPT ROTATION_RATE 39 16 u 1000
pacmod3_3_4 0x32C 8 STEERING_AUX_RPT USER_INTERACTION_IS_VALID 59 1 u 1
pacmod3_3_4 0x400 8 VEHICLE_SPEED_RPT VEHICLE_SPEED_VALID 16 1 u 1
pacmod3_3_4 0x407 8 WHEEL_SPEED_RPT WHEEL_SPD_FRONT_LEFT 7 16 u 100
pacmod3_3_4 0x407 8 WHEEL_SPEED_RPT WHEEL_SPD_FRONT_RIGHT 23 16 s 100
pacmod3_3_4 0x40D 8 YAW_RATE_RPT YAW_RATE 7 16 s 100
"""


@pytest.mark.parametrize("fact", FACTS.split("\n")[1:-1])
def test_what_was_published_is_in_the_tables(fact: str) -> None:
    name, frame_id, length, kind, field, *place = fact.split()
    message = load_protocol(name).by_id[int(frame_id, 16)]
    signal = message.signal(field)
    assert (message.name, message.length) == (kind, int(length))
    assert [start_of(message, signal), signal.length] == [int(number) for number in place[:2]]
    assert signal.signed == (place[2] == "s")
    assert (signal.factor, signal.divisor) == (1, int(place[3]))


def test_stated_ranges_and_choices_are_kept() -> None:
    brake = load_protocol("pacmod2").by_name["BRAKE_CMD"].signal("BRAKE_CMD")
    steering = load_protocol("pacmod2").by_name["STEERING_CMD"].signal("POSITION_VALUE")
    gear = load_protocol("pacmod2").by_name["SHIFT_CMD"].signal("SHIFT_CMD")
    apply = load_protocol("pacmod3").by_name["SAFETY_BRAKE_CMD"].signal("SAFETY_BRAKE_CMD")
    assert (brake.raw_min, brake.raw_max) == (0, 1000)
    assert (steering.raw_min, steering.raw_max) == (-12000, 12000)
    assert gear.choices == {0: "PARK", 1: "REVERSE", 2: "NEUTRAL", 3: "FORWARD", 4: "LOW"}
    assert apply.choices[0] == "APPLY_BRAKE"


def test_lengths_and_periods_are_those_of_each_version() -> None:
    new, early = load_protocol("pacmod3"), load_protocol("pacmod3_3_4")
    assert {message.length for message in early.by_id.values()} == {8}
    assert {message.cycle_ms for message in new.by_id.values()} == {33}
    assert {message.length for message in load_protocol("pacmod2").by_id.values()} == {8}
    assert not {0x080, 0x081, 0x0C1} & set(early.by_id)
    assert 0x40D not in new.by_id
    shared = new.by_id.keys() & early.by_id.keys()
    assert all(new.by_id[each].name == early.by_id[each].name for each in shared)


def test_our_frames_share_no_identifier_with_a_vehicle() -> None:
    own = set(load_protocol("workbench").by_id)
    for name in PROTOCOLS[:-1]:
        assert not own & set(load_protocol(name).by_id)
    # Beyond what PACMod 3 uses and below the range of diagnosis.
    assert all(0x600 <= frame_id < 0x700 for frame_id in own)


def test_our_frames_are_full_length_and_end_with_their_crc() -> None:
    for message in load_protocol("workbench").by_id.values():
        last = message.signals[-1]
        assert (message.length, last.role, last.shift, last.length) == (8, Role.CRC, 0, 8)
        assert message.signals[0].role is Role.COUNTER
        used = sum(signal.mask for signal in message.signals)
        assert used | message.zero_mask == 2**64 - 1
        assert used & message.zero_mask == 0


def test_a_command_of_pacmod_3_has_no_free_bits() -> None:
    for name in ("pacmod3", "pacmod3_3_4"):
        for message in load_protocol(name).by_id.values():
            used = sum(signal.mask for signal in message.signals)
            everything = (1 << 8 * message.length) - 1
            sent = message.sender == "WORKBENCH"
            assert message.zero_mask == (everything & ~used if sent else 0)


@pytest.mark.parametrize("name", PROTOCOLS)
def test_the_shipped_tables_are_up_to_date(name: str, tmp_path: Path) -> None:
    shipped = (FOLDER / f"{name}.json").read_text(encoding="utf-8")
    assert shipped == made_table(name), "run `python -m workbench.codegen.can_tables`"
    for each in PROTOCOLS:
        shutil.copy(FOLDER / f"{each}.dbc", tmp_path)
    write_tables(tmp_path)
    assert (tmp_path / f"{name}.json").read_text(encoding="utf-8") == shipped


@pytest.mark.parametrize("name", PROTOCOLS)
def test_a_table_holds_the_whole_protocol(name: str) -> None:
    text = (FOLDER / f"{name}.dbc").read_text(encoding="utf-8")
    made = read_dbc(text, name=name)
    assert protocol_from_table(json.loads(json.dumps(table_of(made)))) == made
    assert load_protocol(name) == made


def test_signals_are_listed_with_distinct_names_and_places() -> None:
    assert len(EVERY_SIGNAL) > 350
    for _, message in EVERY_MESSAGE:
        fields = sorted(message.signals, key=lambda signal: signal.shift)
        assert all(a.shift + a.length <= b.shift for a, b in pairwise(fields))
        with pytest.raises(KeyError):
            message.signal("NOTHING")


GOOD = """VERSION "one"
NS_ :
BS_:
BU_: A B
BO_ 10 MESSAGE: 2 A
 SG_ FIRST : 7|8@0- (0.5,1) [-1|2] "m" B
 SG_ COUNTER : 15|8@0+ (1,0) [0|255] "" B
CM_ BO_ 10 "said";
VAL_ 10 FIRST 0 "ZERO" 1 "ONE" ;
"""


def test_a_signal_of_a_file_is_read_exactly() -> None:
    message = read_dbc(GOOD, name="good").by_id[10]
    first, counter = message.signals
    assert (first.factor, first.offset, first.divisor) == (1, 2, 2)
    assert (first.raw_min, first.raw_max, first.shift) == (-4, 2, 8)
    assert (counter.shift, message.note, first.choices) == (0, "said", {0: "ZERO", 1: "ONE"})
    assert message.zero_mask == 0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("NS_ :", "NS_ : more", "line 2: expected a DBC statement"),
        ('VERSION "one"', "", "expected a VERSION with a title"),
        (GOOD.split("\n", 1)[1], "", "at least one message"),
        ("BO_ 10 MESSAGE: 2 A\n", "", "expected a message before the signal FIRST"),
        ("CM_ BO_ 10", "BO_ 10 AGAIN: 1 A\nCM_ BO_ 10", "expected different identifiers"),
        ("CM_ BO_ 10", "BO_ 11 MESSAGE: 1 A\n SG_ X : 7|8@0+ (1,0) [0|255] \"\" B\nCM_ BO_ 10",
         "differ in identifier and in name"),
        ("CM_ BO_ 10", "CM_ BO_ 11", "something that exists, got message_note"),
        ("VAL_ 10 FIRST", "VAL_ 10 SECOND", "something that exists, got choices"),
        ("BO_ 10 MESSAGE: 2 A", "BO_ 10 MESSAGE: 9 A", "1 to 8 bytes"),
        (" 10 ", " 2048 ", "a standard identifier"),
        ("15|8@0+", "14|8@0+", "expected a field within 2 bytes, got 14|8"),
        ("15|8@0+", "15|0@0+", "expected a field within 2 bytes, got 15|0"),
        ("15|8@0+", "7|8@0+", "signals that do not overlap"),
        ("15|8@0+", "15|8@1+", "expected a DBC statement"),
        ("COUNTER", "FIRST", "names that differ"),
        ("(0.5,1)", "(-0.5,1)", "expected a scale > 0"),
        ("[-1|2]", "[-1|2.1]", "a range of whole counts"),
        ("[-1|2]", "[2|-1]", "a range of whole counts"),
        ("[0|255]", "[0|256]", "within 8 bits, got [0|256]"),
        ("[0|255]", "[-1|255]", "within 8 bits, got [-1|255]"),
        ('1 "ONE"', '200 "ONE"', "expected named values within 8 bits"),
        ("VAL_", 'BA_ "Role" SG_ 10 COUNTER 6;\nVAL_', "expected a role from 0 to 5, got 6"),
        ("VAL_", 'BA_ "Role" SG_ 10 FIRST 5;\nVAL_', "expected a CRC in the last byte"),
        ("VAL_", 'BA_ "Role" SG_ 10 FIRST 4;\nVAL_', "a counter of the same length"),
        ("VAL_", 'BA_ "Role" SG_ 10 FIRST 4;\nBA_ "Role" SG_ 10 COUNTER 5;\nVAL_',
         "at most one computed signal"),
    ],
)  # fmt: skip
def test_a_file_that_is_not_ours_is_refused(old: str, new: str, said: str) -> None:
    assert old in GOOD
    with pytest.raises(InputError, match="expected") as refusal:
        read_dbc(GOOD.replace(old, new), name="bad")
    assert said in str(refusal.value)


def test_a_message_without_signals_is_refused() -> None:
    with pytest.raises(InputError, match="expected at least one signal"):
        read_dbc(GOOD + "BO_ 11 EMPTY: 1 A\n", name="bad")


def test_an_unknown_protocol_and_another_format_are_refused() -> None:
    with pytest.raises(InputError, match="expected a protocol out of pacmod2, "):
        load_protocol("pacmod4")
    table = table_of(load_protocol("pacmod2")) | {"format": 2}
    with pytest.raises(InputError, match="make it again"):
        protocol_from_table(table)
    message = load_protocol("pacmod2").by_name["TURN_CMD"]
    with pytest.raises(InputError, match="differ in identifier"):
        protocol_of("twice", "", "", [message, message])
