"""More of what goes wrong: values that lie, poses that freeze, chips and code that misbehave."""

from __future__ import annotations

import ctypes
import dataclasses
import random
from collections.abc import Callable
from typing import Any

from onboard_campaign_world import Phased
from onboard_world import World
from onboard_world_injectors import LOCALISATION, Changed, identifiers
from onboard_world_inside import Happening, error_frame
from onboard_world_plant import PACMOD2, framed, rewritten
from onboard_world_sensors import Walker

from workbench.runtime.onboard.bus import BusFaultError
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.protocols import Localised

UPWARD = 0x800
"""FE_UPWARD of x86-64."""


def says(
    start_us: int, message: str, change: Callable[[dict[str, float]], object], *, needed: int = 1
) -> Changed:
    """A report's values are others, from the first frame on."""
    return Changed(
        start_us, of=identifiers(message), needed=needed,
        change=lambda data: rewritten(message, data, change),
    )  # fmt: skip


def growing(start_us: int, message: str, signal: str, *, per_frame: float) -> Changed:
    """A report's value is multiplied by more and more."""
    factors = [1.0]

    def change(values: dict[str, float]) -> None:
        factors.append(min(factors[-1] + per_frame, 2.237))
        values[signal] *= factors[-1]

    return says(start_us, message, change)


def localised(start_us: int, change: Callable[[World, Localised], Localised]) -> Happening:
    """Localisation tells something else; it shows with its last frame."""

    def begin(world: World) -> None:
        measured = world.localiser.measured

        def other(*now: Any) -> Localised | None:
            seen = measured(*now)
            return None if seen is None else change(world, seen)

        world.localiser.measured = other  # type: ignore[assignment, method-assign]

    return Happening(start_us, begin, LOCALISATION[3:], 60_000)


def frozen_pose(start_us: int) -> Happening:
    """The same pose again and again, with counter, stamp and speed alive."""
    kept: list[Localised] = []

    def same(world: World, seen: Localised) -> Localised:
        kept.append(seen)
        place = kept[0]
        return dataclasses.replace(
            seen, x_m=place.x_m, y_m=place.y_m, heading_rad=place.heading_rad
        )

    return localised(start_us, same)


def moved(start_us: int, **by: float) -> Happening:
    """Every pose is off by so much."""

    def off(world: World, seen: Localised) -> Localised:
        return dataclasses.replace(
            seen, **{name: getattr(seen, name) + more for name, more in by.items()}
        )

    return localised(start_us, off)


def parameter(start_us: int, **values: float) -> Happening:
    """The car is another one than the bundle's; localisation shows it."""

    def change(world: World) -> None:
        for name, value in values.items():
            setattr(world.plant.truth, name, value)

    return Happening(start_us, change, LOCALISATION[3:], 60_000)


def late_people(start_us: int) -> Happening:
    """People's sets take longer from now on."""
    return Happening(start_us, lambda world: setattr(world.tracker, "delay_us", 250_000))


def driver(start_us: int, shows: tuple[str, ...], **values: Any) -> Happening:
    """The driver does something."""

    def change(world: World) -> None:
        for name, value in values.items():
            setattr(world.plant.driver, name, value)

    return Happening(start_us, change, identifiers(*shows), 1_000)


def in_core(start_us: int, does: Callable[[Any], object]) -> Happening:
    """Something inside the real core."""
    return Happening(start_us, lambda world: does(world.core._core))


def raising(owner: Callable[[Any], Any], name: str) -> Callable[[Any], object]:
    """A method of something inside raises once, and works again."""

    def plant_it(core: Any) -> None:
        held, usual = owner(core), getattr(owner(core), name)

        def broken(*args: object, **named: object) -> None:
            setattr(held, name, usual)
            raise ZeroDivisionError("planted")

        setattr(held, name, broken)

    return plant_it


def rounding_upward(start_us: int) -> Happening:
    """The processor rounds upward from now on: some library set it and did not set it back."""
    return Happening(start_us, lambda world: ctypes.CDLL(None).fesetround(UPWARD))


def earlier_frame(start_us: int) -> Happening:
    """The instants of frames go backwards."""
    gear = {"MANUAL_INPUT": 3.0, "COMMANDED_VALUE": 3.0, "OUTPUT_VALUE": 3.0}

    def receive(world: World) -> None:
        number = PACMOD2.by_name["SHIFT_RPT"].frame_id
        world.core.receive(number, framed("SHIFT_RPT", gear), world.timeline.now_us - 200_000)

    return Happening(start_us, receive)


def fails_once(start_us: int, kind: BusError, *, broken: bool) -> Happening:
    """A call of the bus's driver fails, once; broken: the bus has to be opened again."""

    def fail(world: World) -> None:
        port, name = world.port, "send" if kind is BusError.SEND else "receive"
        usual = getattr(port, name)

        def once(*args: Any) -> Any:
            setattr(port, name, usual)
            happening.condition_us = world.timeline.now_us
            raise BusFaultError(kind, "injected", broken=broken)

        setattr(port, name, once)

    happening = Happening(start_us, fail, (-1,))
    return happening


def bus_says(start_us: int, dice: random.Random) -> Happening:
    """The controller reports one of its errors."""
    kinds = (BusError.BUS_OFF, BusError.ERROR_PASSIVE, BusError.OVERFLOW, BusError.CLOSED)
    return error_frame(start_us, dice.choice(kinds))


def upstream(start_us: int, change: Callable[[Phased], object]) -> Happening:
    """The upstream controller does something else from its next frames on."""

    def begin(world: World) -> None:
        assert isinstance(world, Phased)
        change(world)

    return Happening(start_us, begin)


def braking_badly(start_us: int, *, share: float) -> Happening:
    """Somebody steps in front of the car, whose brake holds less."""

    def step(world: World) -> None:
        world.plant.brake_share = share
        car = world.plant.car
        world.tracker.walkers = [*world.tracker.walkers, Walker(9, car.x_m + 4.0, car.y_m + 0.5)]

    return Happening(start_us, step)


def slower_pedals(core: Any) -> None:
    """The vehicle's file says that pedals may move less than the law wants."""
    commander, law = core._helm._driver
    dbw = commander._dbw
    pedals = dataclasses.replace(dbw.pedals, slew_mps3=0.5, withheld_mps2=0.02)
    commander._dbw = dataclasses.replace(dbw, pedals=pedals)
    core._helm._driver = commander, law
