"""RANGE frames are what their DBC file says, and a frame that is wrong, old or early is refused."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("cantools", reason="needs the optional package cantools")

import test_can_cantools as laws
from hypothesis import given
from hypothesis import strategies as st
from localiser_cases import CLOCKS

from workbench.cli.main import main
from workbench.codegen.can_tables import FOLDER, made_table
from workbench.codegen.dbc_reader import read_dbc
from workbench.runtime.localiser.range_stream import RangeFault, RangeSeen, RangeStream
from workbench.runtime.protocols import PROTOCOLS, Decoded, Reason, Refusal, decode, load_protocol
from workbench.runtime.protocols.ranges import (
    SentRange,
    range_frame,
    ranges_protocol,
    received_range,
)
from workbench.runtime.protocols.tables import Role, protocol_from_table, table_of

RANGE = ranges_protocol().by_name["RANGE"]
BOUNDS = CLOCKS.stamps(0)
FUTURE = 2**23


def frame_of(sent: SentRange) -> bytes:
    made = range_frame(sent)
    assert not isinstance(made, Refusal), made
    return made[1]


def decoded(sent: SentRange) -> Decoded | Refusal:
    return decode(ranges_protocol(), RANGE.frame_id, frame_of(sent))


def stream() -> RangeStream:
    return RangeStream(BOUNDS, beacons=6)


def sent_at(number: int, stamp: int, beacon: int = 2, range_m: float | None = 7.5) -> SentRange:
    return SentRange(number % 256, beacon, range_m, stamp % 2**24)


def test_the_table_is_up_to_date_and_whole() -> None:
    text = (FOLDER / "ranges.dbc").read_text(encoding="utf-8")
    shipped = (FOLDER / "ranges.json").read_text(encoding="utf-8")
    assert shipped == made_table("ranges"), "run `python -m workbench.codegen.can_tables`"
    made = read_dbc(text, name="ranges")
    assert protocol_from_table(json.loads(json.dumps(table_of(made)))) == made == ranges_protocol()


def test_its_identifier_is_nobody_s() -> None:
    for name in PROTOCOLS:
        assert RANGE.frame_id not in load_protocol(name).by_id
    assert 0x600 <= RANGE.frame_id < min(load_protocol("workbench").by_id)


def test_it_is_full_and_ends_with_its_crc() -> None:
    assert sum(signal.length for signal in RANGE.signals) == 8 * RANGE.length == 64
    assert RANGE.signals[0].role is Role.COUNTER
    assert RANGE.signals[-1].role is Role.CRC
    assert [m.name for m in laws.reference("ranges").messages] == ["RANGE"]


def test_cantools_reads_and_writes_the_same() -> None:
    laws.test_any_bytes_hold_the_same_values(ranges_protocol(), RANGE)
    laws.test_any_values_are_sent_as_the_same_bytes(ranges_protocol(), RANGE)
    for signal in RANGE.signals:
        if signal.role is not Role.CRC:
            assert laws.checks_of_edges(ranges_protocol(), RANGE, signal) >= 1


@given(
    number=st.integers(0, 255), beacon=st.integers(0, 63), range_mm=st.integers(0, 131_071),
    stamp=st.integers(0, 2**24 - 1),
)  # fmt: skip
def test_what_is_sent_is_received(number: int, beacon: int, range_mm: int, stamp: int) -> None:
    sent = SentRange(number, beacon, range_mm / 1000, stamp)
    found = decoded(sent)
    assert isinstance(found, Decoded)
    assert received_range(found) == sent


@pytest.mark.parametrize(
    "wrong",
    [
        SentRange(0, 64, 1.0, 0), SentRange(0, 0, 131.072, 0), SentRange(0, 0, -0.001, 0),
        SentRange(0, 0, float("nan"), 0), SentRange(0, 0, float("inf"), 0),
        SentRange(256, 0, 1.0, 0), SentRange(0, 0, 1.0, 2**24), SentRange(0, 0, 1.0, -1),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_not_sent(wrong: SentRange) -> None:
    assert isinstance(range_frame(wrong), Refusal)


@given(bits=st.sets(st.integers(0, 63), min_size=1, max_size=3))
def test_up_to_three_flipped_bits_are_refused(bits: set[int]) -> None:
    data = int.from_bytes(frame_of(sent_at(9, 77)), "big")
    for bit in bits:
        data ^= 1 << bit
    found = decode(ranges_protocol(), RANGE.frame_id, data.to_bytes(8, "big"))
    assert isinstance(found, Refusal)
    mine = stream()
    assert mine.take(found, 1) is RangeFault.REFUSED
    assert mine.counts[RangeFault.REFUSED] == 1


def test_a_range_that_did_not_come_says_so() -> None:
    found, mine = decoded(sent_at(9, 77, range_m=None)), stream()
    assert isinstance(found, Refusal)
    assert found.reason is Reason.SAID_INVALID
    word = int.from_bytes(frame_of(sent_at(9, 77, range_m=None)), "big")
    assert (RANGE.signal("RANGE").raw_in(word), RANGE.signal("BEACON").raw_in(word)) == (0, 2)
    assert mine.take(found, 1) is RangeFault.NO_RANGE
    # It does not count as one: the next of the same number is used.
    assert isinstance(mine.take(decoded(sent_at(9, 77)), 2), RangeSeen)


def test_instants_follow_the_quickest_frame_across_the_wrap() -> None:
    """The sender's clock is 5 s ahead modulo its wrap; delays are 1 ms, some 4 ms."""
    mine, least_us = stream(), BOUNDS.delay_us[0]
    for k in range(400):
        at_us = 100_000 * k
        stamp = 2**24 - 20_000 + at_us // 100
        delay_us = 4_000 if k % 3 else 1_000
        found = mine.take(decoded(sent_at(k, stamp)), at_us + delay_us)
        assert isinstance(found, RangeSeen)
        # Delays seem smaller by the least one, and the offset may drift while none is quick.
        off_us = found.at_us - (at_us + 1_000 - least_us)
        assert -100 <= off_us <= 150 or k == 0, k
    assert mine.used == 400


def test_numbers_and_stamps_that_do_not_move_on_are_refused_and_change_nothing() -> None:
    mine = stream()
    assert isinstance(mine.take(decoded(sent_at(250, 1_000)), 1_000_000), RangeSeen)
    wrong = [
        (sent_at(250, 1_000), RangeFault.REPEATED),
        (sent_at(250, 1_500), RangeFault.REPEATED),
        (sent_at(249, 1_500), RangeFault.REGRESSED),
        (sent_at(250 + 128, 1_500), RangeFault.REGRESSED),
        (sent_at(251, 999), RangeFault.REGRESSED),
        (sent_at(251, 1_000 + FUTURE), RangeFault.REGRESSED),
        (sent_at(251, 1_500, beacon=6), RangeFault.UNKNOWN_BEACON),
        (sent_at(251, 1_000), RangeFault.LATE),
        (sent_at(251, 3_000), RangeFault.JUMPED),
    ]
    for sent, fault in wrong:
        assert mine.take(decoded(sent), 1_050_000) is fault, sent
    assert isinstance(mine.take(decoded(sent_at(251, 1_500)), 1_050_000), RangeSeen)
    # Two beacons may have been asked at one instant, and frames may be lost.
    assert isinstance(mine.take(decoded(sent_at(255, 1_500, beacon=3)), 1_050_100), RangeSeen)
    assert isinstance(mine.take(decoded(sent_at(257, 1_510)), 1_051_200), RangeSeen)
    assert mine.used == 4
    assert sum(mine.counts.values()) == len(wrong)


@pytest.mark.parametrize("pause_s", [0.6, 2.0, 120.0, 830.0, 850.0, 1700.0, 3600.0])
@pytest.mark.parametrize("silent", [128, 200, 255, 256])
def test_after_a_pause_ranges_are_used_again(pause_s: float, silent: int) -> None:
    """However long, and whatever number of frames without a range came in between."""
    mine, at_us = stream(), round(1e6 * pause_s)
    assert isinstance(mine.take(decoded(sent_at(7, 1_000)), 100_000), RangeSeen)
    none = decoded(sent_at(8, 2_000, range_m=None))
    assert mine.take(none, 150_000) is RangeFault.NO_RANGE
    stamp = 1_000 + at_us // 100
    again = mine.take(decoded(sent_at(7 + silent, stamp)), 100_000 + at_us)
    assert isinstance(again, RangeSeen), again
    after = sent_at(8 + silent, stamp + 100, beacon=1)
    assert isinstance(mine.take(decoded(after), 110_000 + at_us), RangeSeen)
    # What was recorded before the pause is still told.
    old = mine.take(decoded(sent_at(9 + silent, 1_100)), 120_000 + at_us)
    assert old in (RangeFault.REGRESSED, RangeFault.LATE, RangeFault.JUMPED)


def test_a_recorded_frame_whose_counter_and_stamp_fit_is_late() -> None:
    """Held back for exactly 256 frames and with nothing lost: only its delay shows it."""
    mine = stream()
    for k in range(3):
        assert isinstance(mine.take(decoded(sent_at(k, 1_000 * k)), 100_000 * k), RangeSeen)
    held = sent_at(3, 3_000)
    late_us = BOUNDS.delay_us[1] + 1_000
    assert mine.take(decoded(held), 300_000 + late_us) is RangeFault.LATE
    assert isinstance(mine.take(decoded(sent_at(4, 4_000)), 400_000), RangeSeen)


def test_a_log_of_ranges_is_decoded(tmp_path: object, capsys: pytest.CaptureFixture[str]) -> None:
    log = f"{tmp_path}/drive.log"
    with open(log, "w", encoding="utf-8") as file:
        for k in range(3):
            file.write(f"({k}.5) can0 6B8#{frame_of(sent_at(k, 100 * k)).hex().upper()}\n")
    assert main(["can", "decode", "--protocol", "ranges", log]) == 0
    assert "RANGE 7.5 m" in capsys.readouterr().out
