"""Entries pass the pipe whole, in order, or are counted as lost; writing never waits."""

from __future__ import annotations

import fcntl
import os
import time
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.runtime.onboard.recorder_pipe import Inbox, Outbox

SIZES = st.one_of(st.integers(0, 60), st.integers(0, 3 * 65536))
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("put"), SIZES),
        st.tuples(st.just("read"), st.integers(1, 200_000)),
        st.tuples(st.just("send"), st.just(0)),
    ),
    max_size=40,
)


@given(STEPS, st.integers(0, 300_000))
@settings(deadline=None)
def test_what_was_accepted_arrives_whole_and_in_order(
    steps: list[tuple[str, int]], most_bytes: int
) -> None:
    reader, writer = os.pipe()
    os.set_blocking(reader, False)
    outbox, inbox = Outbox(writer, most_bytes=most_bytes), Inbox()
    fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, 4096)
    accepted: list[Any] = []
    arrived: list[Any] = []
    refused = 0

    def read(most: int) -> int:
        try:
            received = os.read(reader, most)
        except BlockingIOError:
            return 0
        arrived.extend(inbox.entries(received))
        return len(received)

    for number, (what, size) in enumerate(steps):
        if what == "put":
            entry = (number, bytes(size))
            if outbox.put(entry):
                accepted.append(entry)
            else:
                refused += 1
        elif what == "read":
            read(size)
        else:
            outbox.catch_up()
        # One entry that has begun must go on, however full it is.
        assert outbox.waiting_bytes <= max(most_bytes, 3 * 65536 + 100)
    while read(1 << 20) or outbox.waiting_bytes:
        outbox.catch_up()
    assert arrived == accepted
    assert outbox.lost == refused
    outbox.close()
    os.close(reader)


def test_a_reader_that_is_gone_is_noticed_and_costs_nothing() -> None:
    reader, writer = os.pipe()
    outbox = Outbox(writer, most_bytes=1 << 20)
    assert outbox.put((0, "x"))
    os.close(reader)
    begun = time.perf_counter()
    assert not any(outbox.put((0, k)) for k in range(100))
    assert time.perf_counter() - begun < 0.1
    assert outbox.gone
    assert outbox.lost == 100
    outbox.finish(1.0)


def test_what_is_no_plain_value_is_lost() -> None:
    reader, writer = os.pipe()
    outbox = Outbox(writer, most_bytes=0)
    assert not outbox.put((0, object()))
    assert outbox.lost == 1
    outbox.close()
    os.close(reader)


def test_finishing_waits_no_longer_than_it_may() -> None:
    reader, writer = os.pipe()
    outbox = Outbox(writer, most_bytes=1 << 24)
    while outbox.waiting_bytes < 100_000:
        outbox.put((0, bytes(50_000)))
    begun = time.monotonic()
    outbox.finish(0.2)
    assert 0.1 < time.monotonic() - begun < 2.0
    os.close(reader)
