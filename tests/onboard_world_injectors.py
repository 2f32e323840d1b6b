"""What goes wrong on the bus: frames that stop, freeze, change, repeat, swap or wait."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field

from onboard_world import World
from onboard_world_bus import Delivered, Frame
from onboard_world_plant import rewritten

from workbench.runtime.protocols import load_protocol

PACMOD2, OWN = load_protocol("pacmod2"), load_protocol("workbench")
MPH = 2.237
LOCALISATION = tuple(OWN.by_name[n].frame_id for n in
                     ("LOC_STAMP", "LOC_POSITION", "LOC_MOTION", "LOC_RADII"))  # fmt: skip
PEOPLE = tuple(OWN.by_name[n].frame_id for n in
               ("PEOPLE", "PERSON_POSITION", "PERSON_MOTION", "PERSON_TRACK"))  # fmt: skip
REPORTS = tuple(m.frame_id for m in PACMOD2.by_name.values() if m.sender == "PACMOD")
Passed = Sequence[tuple[int, Frame]] | None


def identifiers(*names: str) -> tuple[int, ...]:
    """Of messages of the vehicle or of our own."""
    both = {**PACMOD2.by_name, **OWN.by_name}
    return tuple(both[name].frame_id for name in names)


@dataclass
class Counted:
    """An injector whose condition is true once `needed` frames of its making were on the bus."""

    start_us: int
    needed: int = field(default=1, kw_only=True)
    seen_us: list[int] = field(default_factory=list, init=False)

    @property
    def condition_us(self) -> int | None:
        return self.seen_us[self.needed - 1] if len(self.seen_us) >= self.needed else None

    def begin(self, world: World) -> None:
        return

    def passing(self, frame: Frame, at_us: int) -> Passed:
        return None

    def delivered(self, delivered: Delivered) -> None:
        if delivered.frame.by is self:
            self.seen_us.append(delivered.at_us)

    def made(self, frame: Frame, data: bytes) -> Frame:
        return Frame(frame.sender, frame.identifier, data, self)


@dataclass
class Stopped(Counted):
    """Frames of some identifiers stop; the condition is true budget_us after the last one.

    for_us: how long they stay away; only: every how many-th is lost instead, by header.
    """

    stops: Collection[int] = field(kw_only=True)
    budget_us: int = field(default=100_000, kw_only=True)
    for_us: int = field(default=10**12, kw_only=True)
    last_us: int | None = field(default=None, init=False)
    lost: bool = field(default=False, init=False)

    @property
    def condition_us(self) -> int | None:
        if not self.lost:
            return None
        return (0 if self.last_us is None else self.last_us) + self.budget_us

    def passing(self, frame: Frame, at_us: int) -> Passed:
        if frame.identifier in self.stops and at_us < self.start_us + self.for_us:
            self.lost = True
            return []
        return None

    def delivered(self, delivered: Delivered) -> None:
        if delivered.frame.identifier in self.stops and not self.lost:
            self.last_us = delivered.at_us


@dataclass
class Frozen(Counted):
    """Reports keep their last payload; true once what they hold is off by more than `off`.

    off: what the car's true value must differ by, in the report's own signal.
    """

    name: str = field(kw_only=True)
    signal: str = field(kw_only=True)
    off: float = field(default=0.0, kw_only=True)
    kept: dict[int, bytes] = field(default_factory=dict, init=False)
    frozen_value: float | None = field(default=None, init=False)
    world: World | None = field(default=None, init=False)

    def begin(self, world: World) -> None:
        self.world = world

    def passing(self, frame: Frame, at_us: int) -> Passed:
        assert self.world is not None
        if frame.identifier != PACMOD2.by_name[self.name].frame_id:
            return None
        if self.frozen_value is None:
            self.frozen_value = float(self.world.plant.reports()[self.name][self.signal])
        return [(0, self.made(frame, self.kept.setdefault(frame.identifier, frame.data)))]

    def delivered(self, delivered: Delivered) -> None:
        if delivered.frame.by is self and self.frozen_value is not None:
            assert self.world is not None
            true = float(self.world.plant.reports()[self.name][self.signal])
            if abs(true - self.frozen_value) > self.off:
                self.seen_us.append(delivered.at_us)


@dataclass
class Changed(Counted):
    """Payloads are changed: NaN patterns, sentinels, range edges, lengths, flipped bits, units."""

    of: Collection[int] = field(kw_only=True)
    change: Callable[[bytes], bytes] = field(kw_only=True)
    most: int = field(default=10**9, kw_only=True)
    done: int = field(default=0, init=False)

    def passing(self, frame: Frame, at_us: int) -> Passed:
        if frame.identifier not in self.of or self.done >= self.most:
            return None
        self.done += 1
        return [(0, self.made(frame, self.change(frame.data)))]


def raw_field(first_byte: int, raw: int, *, size: int = 2) -> Callable[[bytes], bytes]:
    """A change that writes a raw big-endian number into a frame: 0x7FFF, 0xFFFF, 1001, ..."""
    return lambda data: (
        data[:first_byte] + raw.to_bytes(size, "big") + data[first_byte + size :]
    )  # fmt: skip


def flipped(*bits: int) -> Callable[[bytes], bytes]:
    """A change that flips bits, counted from the first of the frame."""

    def change(data: bytes) -> bytes:
        word = int.from_bytes(data, "big")
        for bit in bits:
            word ^= 1 << (8 * len(data) - 1 - bit)
        return word.to_bytes(len(data), "big")

    return change


def wrong_unit(start_us: int, *, factor: float = MPH) -> Changed:
    """The speed report in another unit; true from its first frame: the core needs motion for it."""

    def change(data: bytes) -> bytes:
        return rewritten(
            "VEHICLE_SPEED_RPT", data,
            lambda v: v.update(VEHICLE_SPEED=v["VEHICLE_SPEED"] * factor),
        )  # fmt: skip

    return Changed(start_us, of=identifiers("VEHICLE_SPEED_RPT"), change=change)


@dataclass
class Replayed(Counted):
    """What was on the bus in the window_us before the start takes the place of what is true now.

    of: identifiers; instead: whether the true frames stay away.
    """

    of: Collection[int] = field(kw_only=True)
    window_us: int = field(default=2_000_000, kw_only=True)
    instead: bool = field(default=True, kw_only=True)
    kept: list[tuple[int, Frame]] = field(default_factory=list, init=False)

    def begin(self, world: World) -> None:
        def play() -> None:
            for at_us, frame in tuple(self.kept):
                later_us = world.timeline.now_us + at_us - (self.start_us - self.window_us)
                again = self.made(frame, frame.data)
                world.timeline.at(
                    later_us,
                    lambda again=again: world.send(  # type: ignore[misc]
                        again.sender, again.identifier, again.data, by=self
                    ),
                )
            world.timeline.at(world.timeline.now_us + self.window_us, play)

        world.timeline.at(self.start_us, play)

    def passing(self, frame: Frame, at_us: int) -> Passed:
        return [] if self.instead and frame.identifier in self.of else None

    def delivered(self, delivered: Delivered) -> None:
        super().delivered(delivered)
        at_us = delivered.at_us
        recent = self.start_us - self.window_us <= at_us < self.start_us
        if recent and delivered.frame.identifier in self.of:
            self.kept.append((at_us, delivered.frame))


@dataclass
class Doubled(Counted):
    """Frames come twice in a row."""

    of: Collection[int] = field(kw_only=True)

    def passing(self, frame: Frame, at_us: int) -> Passed:
        if frame.identifier not in self.of:
            return None
        return [(0, frame), (0, self.made(frame, frame.data))]


@dataclass
class Swapped(Counted):
    """Of every two frames of these identifiers, the first waits for the second."""

    of: Collection[int] = field(kw_only=True)
    held: deque[Frame] = field(default_factory=deque, init=False)

    def passing(self, frame: Frame, at_us: int) -> Passed:
        if frame.identifier not in self.of:
            return None
        if not self.held:
            self.held.append(frame)
            return []
        earlier = self.held.popleft()
        return [(0, self.made(frame, frame.data)), (0, self.made(earlier, earlier.data))]


@dataclass
class Delayed(Counted):
    """Frames wait before they are sent, in their order."""

    of: Collection[int] = field(kw_only=True)
    delay_us: int = field(kw_only=True)

    def passing(self, frame: Frame, at_us: int) -> Passed:
        if frame.identifier not in self.of:
            return None
        return [(self.delay_us, self.made(frame, frame.data))]


@dataclass
class Incomplete(Counted):
    """One frame of each set is lost, the `part`-th of its identifier; true with the next header,
    which shows it at the latest."""

    lost: int = field(kw_only=True)
    header: int = field(kw_only=True)
    most: int = field(default=10**9, kw_only=True)
    dropped: int = field(default=0, init=False)
    seen_headers: int = field(default=0, init=False)

    def passing(self, frame: Frame, at_us: int) -> Passed:
        if frame.identifier != self.lost or self.dropped >= self.most:
            return None
        self.dropped += 1
        return []

    def delivered(self, delivered: Delivered) -> None:
        if delivered.frame.identifier == self.header and self.dropped > len(self.seen_us):
            self.seen_us.append(delivered.at_us)
