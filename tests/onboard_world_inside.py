"""What goes wrong in the car, the sensors, the bus driver and the monitor's own process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from onboard_world import World
from onboard_world_bus import Delivered, Frame
from onboard_world_injectors import LOCALISATION, PEOPLE, Passed
from onboard_world_sensors import Localiser, Tracker, Walker

from workbench.runtime.onboard.bus import BusFaultError, Heard
from workbench.runtime.onboard.intake import BusError


@dataclass
class Happening:
    """Something happens once, at the start; `shows` (identifiers): it is true for the monitor with
    the next frame of these that was made after it, lag_us before it is sent; nothing: at once."""

    start_us: int
    does: Callable[[World], object]
    shows: tuple[int, ...] = ()
    lag_us: int = 0
    condition_us: int | None = field(default=None, init=False)
    _happened_us: int | None = field(default=None, init=False)

    def begin(self, world: World) -> None:
        def happen() -> None:
            self.does(world)
            self._happened_us = world.timeline.now_us
            if not self.shows:
                self.condition_us = world.timeline.now_us

        world.timeline.at(self.start_us, happen)

    def passing(self, frame: Frame, at_us: int) -> Passed:
        # Only frames that are made from now on can show it: those before may still wait.
        if self._happened_us is None or at_us < self._happened_us + self.lag_us:
            return None
        if frame.identifier in self.shows:
            return [(0, Frame(frame.sender, frame.identifier, frame.data, self))]
        return None

    def delivered(self, delivered: Delivered) -> None:
        if delivered.frame.by is self and self.condition_us is None:
            self.condition_us = delivered.at_us


GLOBAL, ACCEL, BRAKE, STEERING, SHIFT = 0x6A, 0x68, 0x6C, 0x6E, 0x66


def brake_pedal(start_us: int, *, ratio: float = 0.3) -> Happening:
    """The driver brakes: by hand, and with it the override bit."""
    return Happening(
        start_us, lambda world: setattr(world.plant.driver, "brake", ratio), (GLOBAL, BRAKE)
    )


def steering_override(start_us: int) -> Happening:
    """The driver turns the wheel: only the override bit shows it."""
    return Happening(
        start_us, lambda world: setattr(world.plant.driver, "turns_wheel", True), (GLOBAL,)
    )


def wrong_gear(start_us: int, *, gear: int = 2) -> Happening:
    """The gear lever is moved; 2: neutral."""
    return Happening(start_us, lambda world: setattr(world.plant, "gear", gear), (SHIFT,))


def emergency_stop(start_us: int) -> Happening:
    """By-wire control is switched off beside the bus; PACMod 2 only shows that it is disabled."""

    def switch(world: World) -> None:
        world.plant.enabled, world.plant.told_disable = False, False

    return Happening(start_us, switch, (GLOBAL,))


def weak_brake(start_us: int, *, share: float = 0.2) -> Happening:
    """The brake holds less; there is nothing to see before somebody brakes."""
    return Happening(start_us, lambda world: setattr(world.plant, "brake_share", share))


def stuck_wheel(start_us: int) -> Happening:
    """The steering motor stands still."""
    return Happening(start_us, lambda world: setattr(world.plant, "stuck_wheel", True))


def wrong_echo(start_us: int, *, more: float = 0.2) -> Happening:
    """The vehicle reports another accelerator command than it was given."""
    return Happening(start_us, lambda world: setattr(world.plant, "echo", more), (ACCEL,))


def crowd(start_us: int, count: int) -> Happening:
    """So many people, from the next set on."""

    def gather(world: World) -> None:
        world.tracker.walkers = [
            Walker(k, 30.0 + 0.5 * (k % 16), 8.0 + 0.5 * (k // 16)) for k in range(count)
        ]

    return Happening(start_us, gather, PEOPLE[:1], Tracker.delay_us)


def clock_jump(start_us: int, *, by_us: int, of: str = "localiser") -> Happening:
    """A sensor's clock is set."""

    def jump(world: World) -> None:
        getattr(world, of).clock.offset_us += by_us

    sender = Localiser if of == "localiser" else Tracker
    header = LOCALISATION[0] if of == "localiser" else PEOPLE[0]
    return Happening(start_us, jump, (header,), sender.delay_us)


def error_frame(start_us: int, kind: BusError = BusError.ERROR_FRAME) -> Happening:
    """The controller reports an error."""
    return Happening(start_us, lambda world: world.port.queue.append(Heard(0, b"", kind)))


def bus_down(start_us: int, *, for_us: int, sending: bool = True) -> Happening:
    """The driver fails, and cannot be opened again for a while; sending: only to send, and the bus
    stays open."""

    def fail(world: World) -> None:
        kind = BusError.SEND if sending else BusError.RECEIVE
        fault = BusFaultError(kind, "injected", broken=not sending)
        if sending:
            world.port.fails_to_send = fault
        else:
            world.port.fails_to_receive = fault
        world.timeline.at(world.timeline.now_us + for_us, lambda: mend(world))

    def mend(world: World) -> None:
        world.port.fails_to_send = world.port.fails_to_receive = None

    return Happening(start_us, fail)


def silent_bus(start_us: int) -> Happening:
    """Nothing is heard any more, and nothing reports it."""

    def cut(world: World) -> None:
        world.port.open = False

    return Happening(start_us, cut)


@dataclass
class Slow:
    """The monitor's own process is held up once: a decision that takes so long, or (hangs) a pause
    after a turn. True when it is over: before that nothing of the monitor can answer."""

    start_us: int
    for_us: int
    hangs: bool = False
    _world: World | None = field(default=None, init=False)

    def begin(self, world: World) -> None:
        self._world = world
        world.timeline.at(self.start_us, lambda: world.core.hold_up(self.for_us, self.hangs))

    @property
    def condition_us(self) -> int | None:
        return None if self._world is None else self._world.core.held_until_us

    def passing(self, frame: Frame, at_us: int) -> Passed:
        return None

    def delivered(self, delivered: Delivered) -> None:
        return
