"""What a turn results in, and how it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.runtime.decision import Decision
from workbench.runtime.observation import Observation
from workbench.runtime.onboard.commands import Frame
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.states import State
from workbench.runtime.onboard.times import SEND_US
from workbench.runtime.policies import Timing


@final
@dataclass(frozen=True, slots=True)
class TurnResult:
    """One turn. frames: to send, the vehicle's first (SHADOW: for the log alone); decision,
    observation: of a turn that decided; decided_us: when the decision had ended; faults: all that
    are there, each once; events: sentences for whoever watches."""

    at_us: int
    frames: tuple[Frame, ...]
    state: State
    decision: Decision | None
    decided_us: int | None
    observation: Observation | None
    faults: tuple[Found, ...]
    events: tuple[str, ...]


def news(
    known: frozenset[Fault], found: Sequence[Found], *, before: State, after: State
) -> tuple[str, ...]:
    """Sentences for what has changed: faults that came, faults that went, another state."""
    now = {each.fault for each in found}
    came = (f"{each}" for each in found if each.fault not in known)
    went = (f"{fault.name} is over" for fault in Fault if fault in known and fault not in now)
    moved = () if after is before else (f"{before.name} -> {after.name}",)
    return (*came, *went, *moved)


def internal(where: str, error: Exception, at_us: int) -> Found:
    """An exception as a fault, whatever the exception holds."""
    try:
        said = f"{type(error).__name__}: {error}"
    except Exception:
        said = type(error).__name__
    return Found(Fault.INTERNAL, f"{where}: {said}", at_us)


def untimely(before_us: int | None, at_us: int, timing: Timing) -> tuple[Found, ...]:
    """What the instant of a turn says: CLOCK_BACKWARDS, or LATE_TURN after a hang.

    before_us: begin of the turn before, None for the first. Frames that are made at at_us may be on
    the bus SEND_US later, and the longest time between two sets of them counts.
    """
    gap_us = 0 if before_us is None else at_us - before_us
    if gap_us < 0:
        return (Found(Fault.CLOCK_BACKWARDS, f"{gap_us} us after the last turn", at_us),)
    most_us = round(timing.send_gap_s * 1e6) - SEND_US
    if gap_us <= most_us:
        return ()
    detail = f"{gap_us} us after the last turn, {most_us} us are allowed"
    return (Found(Fault.LATE_TURN, detail, at_us - gap_us + most_us),)


def overrun(at_us: int, ended_us: int | None, timing: Timing) -> tuple[Found, ...]:
    """OVERRUN where a decision ended more than the latency after its turn's begin."""
    most_us = round(timing.latency_s * 1e6)
    if ended_us is None or ended_us - at_us <= most_us:
        return ()
    detail = f"the decision took {ended_us - at_us} us, {most_us} us are allowed"
    return (Found(Fault.OVERRUN, detail, at_us + most_us),)
