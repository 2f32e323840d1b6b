"""Frames that must be accepted, and how a DBC file counts bits."""

from __future__ import annotations

from collections.abc import Mapping

from hypothesis import strategies as st

from workbench.runtime.protocols import (
    PROTOCOLS,
    LocalisationSet,
    Localised,
    NoSet,
    PersonKind,
    PersonSet,
    SentPerson,
    SetFault,
    encode,
    load_protocol,
)
from workbench.runtime.protocols.tables import COMPUTED, Message, Protocol, Role, Signal

EVERY_MESSAGE = [
    (load_protocol(name), message)
    for name in PROTOCOLS
    for message in load_protocol(name).by_name.values()
]
EVERY_SIGNAL = [
    (protocol, message, signal) for protocol, message in EVERY_MESSAGE for signal in message.signals
]
Frame = tuple[int, bytes]
PLACE = Localised(
    number=4,
    stamp_s=12.5,
    x_m=-3.25,
    y_m=80.125,
    heading_rad=-1.5,
    speed_mps=2.75,
    x_radius_m=0.2,
    y_radius_m=0.3,
    heading_radius_rad=0.05,
    speed_radius_mps=0.1,
)
NAMES = [f"{protocol.name}.{message.name}" for protocol, message in EVERY_MESSAGE]


def start_of(message: Message, signal: Signal) -> int:
    """The start bit that a DBC file gives a signal in Motorola order: its first bit."""
    first = 8 * message.length - signal.shift - signal.length
    return 8 * (first // 8) + 7 - first % 8


def accepted_raw(signal: Signal) -> int:
    """A raw value that may be sent: 1, or what is nearest to it."""
    if signal.choices:
        return next(iter(signal.choices))
    return min(max(1, signal.raw_min), signal.raw_max)


def plain_values(message: Message, changed: Mapping[str, float] | None = None) -> dict[str, float]:
    """Values of a frame that is accepted, some of them changed."""
    given = [signal for signal in message.signals if signal.role not in COMPUTED]
    values = {signal.name: signal.value_of(accepted_raw(signal)) for signal in given}
    assert all(values[s.name] == 1 for s in given if s.role is Role.VALIDITY)
    return values | dict(changed or {})


def plain_frame(protocol: Protocol, message: Message) -> bytes:
    """A frame that is accepted."""
    data = encode(protocol, message.name, plain_values(message))
    assert isinstance(data, bytes), data
    return data


def with_raw(message: Message, signal: Signal, data: bytes, raw: int) -> bytes:
    """The frame with one signal's bits replaced, and nothing computed again."""
    word = int.from_bytes(data, "big") & ~signal.mask | signal.placed(raw)
    return word.to_bytes(message.length, "big")


def counts(low: int, high: int, step: float) -> st.SearchStrategy[float]:
    """Multiples of a step, as a decoder gives them."""
    return st.integers(low, high).map(lambda raw: raw / round(1 / step))


def sent_people(most: int = 5) -> st.SearchStrategy[tuple[SentPerson, ...]]:
    """People whose numbers are exactly those of frames, with different tracks."""
    person = st.builds(
        SentPerson,
        track=st.integers(0, 0xFFFF),
        kind=st.sampled_from(PersonKind),
        x_m=counts(-(2**20), 2**20 - 1, 0.01),
        y_m=counts(-(2**20), 2**20 - 1, 0.01),
        position_radius_m=counts(0, 4095, 0.005),
        x_speed_mps=counts(-8192, 8191, 0.0025),
        y_speed_mps=counts(-8192, 8191, 0.0025),
        velocity_radius_mps=counts(0, 8191, 0.0025),
        age_s=counts(0, 4095, 0.001),
    )
    people = st.lists(person, max_size=most, unique_by=lambda each: each.track)
    return people.map(tuple)


def fault(state: PersonSet | LocalisationSet) -> SetFault:
    outcome = state.outcome
    assert isinstance(outcome, NoSet), outcome
    assert str(outcome).startswith(outcome.fault.value)
    return outcome.fault
