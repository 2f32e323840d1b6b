"""The real-time loop: one thread that reads the bus until the next turn is due, then sends what the
core says. Nothing sends in the background, so that a dead or hanging monitor is silent."""

from __future__ import annotations

import enum
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol, final

from workbench.runtime.onboard.bus import Bus, BusFaultError, Heard
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.states import Request, State
from workbench.runtime.onboard.times import SEND_US, TURN_US

if TYPE_CHECKING:
    from workbench.runtime.onboard.commands import Frame
    from workbench.runtime.onboard.core import TurnResult

GAP_US: Final = 500
"""Least time between two frames that we send: PACMod may drop what comes closer."""
LONGEST_WAIT_US: Final = TURN_US
"""A frame that may have waited for longer than this before it was read is not handed on: its age is
not known. So every age that counts from the reading is too small by at most this."""
_DRAIN_US: Final = 2_000
# Short waits: what comes late in a long one would seem to have waited all the time.
_WAIT_US: Final = 8_000
_RETRY_US: Final = (TURN_US, 1_000_000)


class Core(Protocol):
    """What the loop drives: `workbench.runtime.onboard.core.Core`."""

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        """One frame that came."""
        ...

    def bus_error(self, kind: BusError, at_us: int) -> None:
        """The bus failed."""
        ...

    def request(self, request: Request, at_us: int) -> None:
        """The operator asks."""
        ...

    def turn(self, at_us: int, clock: Callable[[], int]) -> TurnResult:
        """One turn."""
        ...


class Clock(Protocol):
    """The receiver's monotonic clock, in microseconds since the core's start."""

    def now_us(self) -> int:
        """The time."""
        ...

    def sleep_us(self, duration_us: int) -> None:
        """Let so much time pass."""
        ...


class Surroundings(Protocol):
    """What else the loop talks to once per turn; nothing of it may wait or raise."""

    def before(self) -> Iterable[Request]:
        """A turn is about to begin: what the operator asked since the last one.

        What has come for the core on other ways is handed to it now.
        """
        ...

    def turned(self, result: TurnResult, counts: Counts) -> None:
        """A turn is over, and its frames are on their way."""
        ...


@final
@dataclass(slots=True)
class Counts:
    """What the loop has done.

    late: deadlines missed, turns whose last frame came after the next one was due; jitter_us:
    longest that a turn began after it was due; unsent: frames that were made and not sent; stale:
    frames dropped because they may have waited too long; reopened: tries to open the bus again.
    """

    turns: int = 0
    late: int = 0
    jitter_us: int = 0
    received: int = 0
    sent: int = 0
    unsent: int = 0
    stale: int = 0
    bus_errors: int = 0
    reopened: int = 0


@final
class End(enum.Enum):
    """How the loop ended. ORDERLY: the core had let go of the vehicle, or sends nothing; AT_ONCE:
    it was asked twice, and the vehicle may be moving with nobody driving."""

    ORDERLY = 0
    AT_ONCE = 30


@final
class MonotonicClock:
    """`Clock` on the system's monotonic clock, from 0 at construction."""

    __slots__ = ("_start_ns",)

    def __init__(self) -> None:
        self._start_ns = time.monotonic_ns()

    def now_us(self) -> int:
        """As `Clock.now_us`."""
        # Rounded up: what has arrived must not be stamped before it did.
        return -((self._start_ns - time.monotonic_ns()) // 1000)

    def sleep_us(self, duration_us: int) -> None:
        """As `Clock.sleep_us`."""
        time.sleep(max(duration_us, 0) / 1e6)


@final
class Loop:
    """Drives a core over a bus until it is told to stop.

    bus: open; open_bus: opens it again after a failure. sends: False in SHADOW, where nothing goes
    out, whatever the core makes. A core that raises ends the loop: what it would have said is not
    known, and silence is seen by everybody on the bus.
    """

    def __init__(
        self,
        core: Core,
        bus: Bus,
        *,
        open_bus: Callable[[], Bus],
        sends: bool,
        clock: Clock,
        surroundings: Surroundings,
    ) -> None:
        self._core, self._clock, self._around = core, clock, surroundings
        self._bus: Bus | None = bus
        self._open_bus, self._sends = open_bus, sends
        self._retry_us, self._back_off_us = 0, _RETRY_US[0]
        self._stops, self._told = 0, 0
        self._due_us = self._made_us = clock.now_us()
        # Until it was found empty once, nobody knows since when its queue has been filling.
        self._empty_us, self._sent_us = self._due_us - LONGEST_WAIT_US - 1, self._due_us - GAP_US
        self.counts = Counts()

    def stop(self) -> None:
        """Asks for an end; safe in a signal handler.

        Each time the core is asked to disarm: the first time it brakes a car that moves, and the
        loop goes on until it stands; the second time it lets go of the car at once.
        """
        self._stops += 1

    def run(self) -> End:
        """Turns until `stop`, then until the core has let go of the vehicle."""
        while (end := self.once()) is None:
            pass
        return end

    def once(self) -> End | None:
        """Listens until the next turn is due, and takes it; how the loop ended, None: it has not.

        A turn that ends after the next one was due is followed by it without a pause.
        """
        self._listen(self._due_us, drain_us=_DRAIN_US)
        begun_us = self._clock.now_us()
        result = self._turn(begun_us)
        ended_us = self._clock.now_us()
        self.counts.jitter_us = max(self.counts.jitter_us, begun_us - self._due_us)
        self.counts.late += ended_us - self._due_us > TURN_US
        self._due_us = max(self._due_us + TURN_US, ended_us)
        if not self._told or (self._sends and result.state not in _LET_GO):
            return None
        if self._bus is not None:
            self._bus.close()
        return End.AT_ONCE if self._sends and self._told > 1 else End.ORDERLY

    def _turn(self, at_us: int) -> TurnResult:
        for request in self._around.before():
            # Who has asked for the end does not arm on the way to it.
            if not self._stops:
                self._core.request(request, at_us)
        while self._told < min(self._stops, 2):
            self._told += 1
            self._core.request(Request.DISARM, at_us)
        self._made_us = at_us
        result = self._core.turn(at_us, self._decided)
        self.counts.turns += 1
        # Without a bus there is nothing to send on: opening it may be what the answer waits for.
        self._reopen()
        if self._sends:
            self._send(result.frames)
        self._around.turned(result, self.counts)
        self._reopen()
        return result

    def _decided(self) -> int:
        """The clock that the core reads when a decision ends, before it makes its frames."""
        self._made_us = self._clock.now_us()
        return self._made_us

    def _send(self, frames: Sequence[Frame]) -> None:
        """In order, with gaps; what would be late stays, and the core hears of what was late."""
        for place, frame in enumerate(frames):
            self._listen(self._sent_us + GAP_US, drain_us=0)
            now_us = self._clock.now_us()
            if self._bus is None:
                self.counts.unsent += 1
                continue
            if now_us - self._made_us > SEND_US:
                self.counts.unsent += len(frames) - place
                self._core.bus_error(BusError.LATE, now_us)
                return
            try:
                self._bus.send(frame.identifier, frame.data)
            except BusFaultError as fault:
                self.counts.unsent += 1
                self._failed(fault)
                continue
            self._sent_us = self._clock.now_us()
            self.counts.sent += 1
        if self._sent_us - self._made_us > SEND_US:
            self._core.bus_error(BusError.LATE, self._sent_us)

    def _listen(self, until_us: int, *, drain_us: int) -> None:
        """Hand on what comes until then, and for drain_us more what still lies ready."""
        drained = False
        while True:
            now_us = self._clock.now_us()
            over = now_us >= until_us
            if (over and drained) or now_us > until_us + drain_us:
                return
            if self._bus is None:
                self._clock.sleep_us(until_us - now_us)
                self._empty_us, drained = self._clock.now_us(), True
                continue
            try:
                wait_us = min(until_us - now_us, _WAIT_US)
                heard = self._bus.receive(0 if over or not drained else wait_us)
            except BusFaultError as fault:
                self._failed(fault)
                continue
            if heard is not None:
                self._hand_on(heard)
                drained = False
            elif over or not drained:
                # Nothing lay ready: whatever is read from now on came after this.
                self._empty_us, drained = now_us, True
            else:
                drained = False

    def _hand_on(self, heard: Heard) -> None:
        at_us = self._clock.now_us()
        if heard.error is not None:
            self.counts.bus_errors += 1
            self._core.bus_error(heard.error, at_us)
        elif at_us - self._empty_us > LONGEST_WAIT_US:
            self.counts.stale += 1
        else:
            self.counts.received += 1
            self._core.receive(heard.identifier, heard.data, at_us)

    def _failed(self, fault: BusFaultError) -> None:
        now_us = self._clock.now_us()
        self.counts.bus_errors += 1
        self._core.bus_error(fault.kind, now_us)
        if fault.broken and self._bus is not None:
            self._bus.close()
            self._bus = None
            self._retry_us = now_us

    def _reopen(self) -> None:
        """Try again, less often each time, but not while listening: opening may take its time."""
        now_us = self._clock.now_us()
        if self._bus is not None or now_us < self._retry_us:
            return
        self.counts.reopened += 1
        try:
            self._bus = self._open_bus()
        except BusFaultError:
            self._back_off_us = min(2 * self._back_off_us, _RETRY_US[1])
            self._retry_us = self._clock.now_us() + self._back_off_us
        else:
            self._back_off_us = _RETRY_US[0]


_LET_GO: Final = frozenset({State.DISARMED, State.YIELDED})
