"""Every row of the fault list is a fault with a rule or said to be beyond us, and in the docs."""

from __future__ import annotations

from onboard_fault_table import DOCUMENT, with_table

from workbench.runtime.onboard.faults import (
    NOT_ON_BOARD,
    Fault,
    Found,
    Latency,
    Reaction,
    Release,
)

ROWS = {
    "stale vehicle speed/steer", "localisation dropped", "frozen value", "NaN/Inf/sentinel",
    "out of range / rate", "wrong unit / wrong parameters", "replay", "duplicate", "out of order",
    "late (delay d)", "clock jump", "bus-off / error passive / RX overflow",
    "counter / CRC error", "pedestrian burst 0..100", "track set incomplete", "deadline overrun",
    "corrupted bundle", "crash / kill -9", "hang (GIL, SIGSTOP)", "disk full / slow disk",
    "wrong mode state", "driver override", "actuator not following", "spoofed command IDs",
    "bus flood / babbling idiot", "wrong protocol (v2/v3)", "memory growth / fd leak",
    "subnormal / FP environment changed",
}  # fmt: skip
"""Of the fault list that the monitor was built to."""
OWN = {
    "wrong vehicle", "gate: upstream controller", "assumption: estimation error",
    "assumption: actuation", "assumption: initial set", "assumption: intent", "exception",
}  # fmt: skip
"""Rows that were added to it."""


def test_every_row_is_answered_or_said_to_be_beyond_us() -> None:
    found = {fault.rule.row for fault in Fault}
    beyond = {row for row, _ in NOT_ON_BOARD}
    assert found | beyond == ROWS | OWN
    # A row that is answered in part says which part is not.
    assert beyond & found == {"replay", "corrupted bundle", "hang (GIL, SIGSTOP)"}


def test_no_two_faults_are_one() -> None:
    assert len(Fault.__members__) == len(list(Fault))
    assert len({fault.rule.condition for fault in Fault}) == len(list(Fault))


def test_each_reaction_is_released_in_its_own_way() -> None:
    release = {
        Reaction.ALERT: {Release.GONE},
        Reaction.PLAN: {Release.STANDSTILL},
        Reaction.BRAKE: {Release.STANDSTILL},
        Reaction.LATCH: {Release.DISARM},
        Reaction.YIELD: {Release.REARM},
        Reaction.REFUSE: {Release.RESTART},
    }
    for fault in Fault:
        assert fault.rule.release in release[fault.reaction]
        if fault.reaction in (Reaction.BRAKE, Reaction.LATCH, Reaction.YIELD):
            assert fault.rule.latency is Latency.TURN
    assert set(release) == set(Reaction)
    assert {fault.reaction for fault in Fault} == set(Reaction)


def test_a_found_fault_says_its_name() -> None:
    assert f"{Found(Fault.SPOOFED, 'BRAKE_CMD', 3)}" == "SPOOFED: BRAKE_CMD"


def test_the_document_holds_the_table() -> None:
    text = DOCUMENT.read_text()
    assert with_table(text) == text, "run `python tests/onboard_fault_table.py`"
