"""Whatever comes, in whatever order, at whatever time: nothing raises and memory stays flat."""

from __future__ import annotations

import gc
import random
import sys

from can_cases import plain_values
from hypothesis import given, settings
from hypothesis import strategies as st
from onboard_intakes import (
    PACMOD3,
    WALKER,
    crowd_frames,
    filled,
    intake,
    observed,
    place_frames,
)
from onboard_sensors import OWN, PACMOD2, pacmod2_reports

from workbench.runtime.observation import Observation
from workbench.runtime.onboard.observing import NotObserved
from workbench.runtime.protocols import (
    encode,
)

KNOWN = st.sampled_from([*PACMOD2.by_id, *OWN.by_id, *PACMOD3.by_id])
FRAMES = st.lists(
    st.tuples(
        st.one_of(KNOWN, KNOWN, st.integers(-2, 2**31)),
        st.one_of(st.binary(min_size=8, max_size=8), st.binary(max_size=64)),
        st.one_of(st.integers(0, 100_000), st.integers(-(10**18), 10**18), st.integers()),
    ),
    max_size=40,
)


@settings(max_examples=150, deadline=None)
@given(FRAMES, st.sampled_from(["pacmod2", "pacmod3", "pacmod3_3_4"]), st.integers(), st.booleans())
def test_nothing_raises_whatever_comes(
    frames: list[tuple[int, bytes, int]], vehicle: str, now_us: int, begun: bool
) -> None:
    found = filled() if begun else intake(vehicle)
    last = found.last_us
    for identifier, data, late_us in frames:
        found.receive(identifier, data, late_us if last is None else last + late_us)
    for at in (now_us, (found.last_us or 0), (found.last_us or 0) + 50_000):
        assert isinstance(observed(found, at), Observation | NotObserved)


def test_valid_frames_in_any_order_with_any_numbers_raise_nothing() -> None:
    """Frames whose checksums fit, with every raw value that there is."""
    dice = random.Random(4)
    messages = [*OWN.by_name.values(), *PACMOD2.by_name.values()]
    found, at_us = filled(), 1_000_000
    for _ in range(3_000):
        message = dice.choice(messages)
        protocol = OWN if message in OWN.by_name.values() else PACMOD2
        values = {}
        for name in plain_values(message):
            signal = message.signal(name)
            ends = (signal.raw_min, signal.raw_max)
            values[name] = signal.value_of(dice.choice((*ends, dice.randint(*ends))))
        data = encode(protocol, message.name, values)
        if isinstance(data, bytes):
            at_us += dice.choice((0, 10, 30_000))
            found.receive(message.frame_id, data, at_us)
            assert isinstance(observed(found, at_us), Observation | NotObserved)


def test_memory_stays_flat_over_a_hundred_thousand_frames() -> None:
    dice = random.Random(2)
    found = filled()
    reports = pacmod2_reports(speed_mps=1.0, wheel_rad=0.1)
    few = (0x10, 0x64, 0x6B, 0x6F, 0x7A, 0x6C8, 0x6CB, 0x6D0)

    def more(begin: int, count: int) -> None:
        for k in range(begin, begin + count):
            at_us = 1_000_000 + 1_000 * k
            match k % 5:
                case 0:
                    found.receive(*reports[0], at_us)
                case 1:
                    found.receive(*reports[1], at_us)
                case 2:
                    found.receive(dice.choice(CROWD[k // 5 % 256])[0], bytes(8), at_us)
                case 3:
                    found.receive(*PLACES[k // 20 % 256][k // 5 % 4], at_us)
                case _:
                    found.receive(dice.choice(few), dice.randbytes(dice.choice((2, 8))), at_us)

    more(0, 20_000)
    gc.collect()
    before = sys.getallocatedblocks()
    more(20_000, 100_000)
    gc.collect()
    grown = sys.getallocatedblocks() - before
    assert grown < 200, grown
    assert found.localisation_counts.whole > 0


PLACES = [place_frames(k, 2.0 + k / 10) for k in range(256)]
CROWD = [crowd_frames(k, 2.0 + k / 10, WALKER) for k in range(256)]
