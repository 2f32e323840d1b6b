"""Virtual time in microseconds, and a CAN bus on it with frame times and arbitration."""

from __future__ import annotations

import heapq
import itertools
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from workbench.runtime.onboard.bus import BusFaultError, Heard

BITS_PER_S = 500_000
LAST = 1 << 40
"""Order of what happens after everything else of its instant."""


def frame_us(data: bytes) -> int:
    """Time on the bus of a standard data frame with the worst bit stuffing, and the gap after it.

    34 + 8 n bits are stuffed, at worst with one bit after the first five and every four; 13 are
    not.
    """
    stuffed = 34 + 8 * len(data)
    return (stuffed + (stuffed - 1) // 4 + 13) * 1_000_000 // BITS_PER_S


class Timeline:
    """Events at instants; of the same instant the lowest order first, then the oldest."""

    def __init__(self) -> None:
        self.now_us = 0
        self._events: list[tuple[int, int, int, Callable[[], None]]] = []
        self._count = itertools.count()

    def at(self, at_us: int, call: Callable[[], None], *, order: int = -1) -> None:
        assert at_us >= self.now_us, f"{at_us} us has passed, it is {self.now_us} us"
        heapq.heappush(self._events, (at_us, order, next(self._count), call))

    def every(self, first_us: int, period_us: int, call: Callable[[], None]) -> None:
        def again() -> None:
            self.at(self.now_us + period_us, again)
            call()

        self.at(first_us, again)

    def run(self, until_us: int, *, unless: Callable[[], bool] = lambda: False) -> None:
        """Let events happen up to an instant, or until `unless` holds after one of them."""
        while self._events and self._events[0][0] <= until_us:
            at_us, _, _, call = heapq.heappop(self._events)
            self.now_us = at_us
            call()
            if unless():
                return
        self.now_us = max(self.now_us, until_us)


@dataclass(frozen=True)
class Frame:
    """A frame on its way. by: the injector that made or changed it."""

    sender: str
    identifier: int
    data: bytes
    by: object = None


@dataclass(frozen=True)
class Delivered:
    """A frame that was on the bus, and when its last bit was."""

    at_us: int
    frame: Frame


class VirtualBus:
    """One frame at a time; whose turn it is decides the lowest identifier that waits.

    Every sender has a queue of its own, first in, first out, as a controller with one mailbox: what
    it wants to send next competes, the rest waits behind it. Full queues drop what comes.
    """

    def __init__(self, timeline: Timeline, *, deepest: int = 64) -> None:
        self._timeline, self._deepest = timeline, deepest
        self._waiting: dict[str, deque[Frame]] = {}
        self._busy = False
        self.hears: list[Callable[[Delivered], None]] = []
        self.dropped = 0
        self.busy_us = 0

    def send(self, frame: Frame) -> bool:
        """Whether there was room for it."""
        queue = self._waiting.setdefault(frame.sender, deque())
        if len(queue) >= self._deepest:
            self.dropped += 1
            return False
        queue.append(frame)
        self._timeline.at(self._timeline.now_us, self._arbitrate, order=LAST)
        return True

    def waiting(self, sender: str) -> int:
        return len(self._waiting.get(sender, ()))

    def _arbitrate(self) -> None:
        ready = [queue for queue in self._waiting.values() if queue]
        if self._busy or not ready:
            return
        frame = min(ready, key=lambda queue: queue[0].identifier).popleft()
        self._busy = True
        taken_us = frame_us(frame.data)
        self.busy_us += taken_us
        self._timeline.at(
            self._timeline.now_us + taken_us, lambda: self._end(frame), order=frame.identifier
        )

    def _end(self, frame: Frame) -> None:
        self._busy = False
        self._timeline.at(self._timeline.now_us, self._arbitrate, order=LAST)
        delivered = Delivered(self._timeline.now_us, frame)
        for hear in tuple(self.hears):
            hear(delivered)


class Port:
    """The monitor's end of the bus, as its loop wants it; what injectors do to it shows here.

    failing: what the next calls raise, until it is None again; closed ports hear nothing.
    """

    def __init__(self, timeline: Timeline, bus: VirtualBus, name: str = "monitor") -> None:
        self._timeline, self._bus, self.name = timeline, bus, name
        self.queue: deque[Heard] = deque()
        self.fails_to_receive: BusFaultError | None = None
        self.fails_to_send: BusFaultError | None = None
        self.open = True
        self.handed: list[tuple[int, int, bytes]] = []
        bus.hears.append(self._hear)

    def _hear(self, delivered: Delivered) -> None:
        if self.open and delivered.frame.sender != self.name:
            self.queue.append(Heard(delivered.frame.identifier, delivered.frame.data))

    def receive(self, wait_us: int) -> Heard | None:
        if self.fails_to_receive is not None:
            raise self.fails_to_receive
        if not self.queue and wait_us > 0:
            until_us = self._timeline.now_us + wait_us
            self._timeline.run(until_us, unless=lambda: bool(self.queue))
        return self.queue.popleft() if self.queue else None

    def send(self, identifier: int, data: bytes) -> None:
        if self.fails_to_send is not None:
            raise self.fails_to_send
        self.handed.append((self._timeline.now_us, identifier, data))
        self._bus.send(Frame(self.name, identifier, data))

    def close(self) -> None:
        self.open = False
        self.queue.clear()

    def reopened(self) -> Port:
        """The port again, unless it still fails."""
        if self.fails_to_receive is not None:
            raise self.fails_to_receive
        self.open = True
        return self


class VirtualClock:
    """The loop's clock on a timeline."""

    def __init__(self, timeline: Timeline) -> None:
        self._timeline = timeline

    def now_us(self) -> int:
        return self._timeline.now_us

    def sleep_us(self, duration_us: int) -> None:
        self._timeline.run(self._timeline.now_us + max(duration_us, 0))
