"""A car with PACMod 2: pedals and steering wheel, enable and override, reports; a plain bicycle."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from workbench.runtime.protocols import Decoded, Refusal, decode, encode, load_protocol

PACMOD2 = load_protocol("pacmod2")
STEP_US = 1_000
REPORT_US = 33_333
TIMEOUT_US = 100_000
OVERRIDE_PEDAL = 0.05
FORWARD, NEUTRAL, PARK = 3, 2, 0
VIN = {"MFG_CODE": 0x353243, "MODEL_YEAR_CODE": ord("H")}


@dataclass
class Truth:
    """What this car really does. Pedals: ratios below the dead band do nothing, the rest acts in
    proportion; what is commanded acts after its delay and comes up linearly within its build-up.
    sag: what slows a car that coasts. wheel_rate: the steering motor's; ratio: of wheel angles."""

    wheelbase_m: float = 1.75
    accel_per_ratio: float = 6.0
    accel_dead: float = 0.30
    brake_per_ratio: float = 8.0
    brake_dead: float = 0.05
    pedal_delay_us: int = 60_000
    pedal_build_up_us: int = 150_000
    steering_ratio: float = 20.0
    steering_dead_rad: float = 0.01
    steering_delay_us: int = 40_000
    wheel_rate_radps: float = 4.0
    sag_mps2: float = 0.08


@dataclass
class Car:
    """The true state, about the middle of the rear axle; wheel: the steering wheel's angle."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading: float = 0.0
    speed_mps: float = 0.0
    wheel_rad: float = 0.0
    accel: float = 0.0
    brake: float = 0.0


@dataclass
class Driver:
    """Who sits in the car."""

    accel: float = 0.0
    brake: float = 0.0
    turns_wheel: bool = False


@dataclass
class Orders:
    """What PACMod was last told."""

    accel: float = 0.0
    brake: float = 0.0
    wheel_rad: float = 0.0
    wheel_rate_radps: float = 0.0
    heard_us: int = -TIMEOUT_US


@dataclass
class Plant:
    """PACMod 2 and the car behind it; `hear` takes commands, `step` moves it on by a millisecond.

    Enabling needs ENABLE 0 heard since the last time it was enabled, and a frame without
    CLEAR_OVERRIDE; an override latches until CLEAR_OVERRIDE comes with ENABLE 0. broken: rules of
    the protocol that were broken, in words. brake_share, stuck_wheel, said_speed, echo: what
    injectors change.
    """

    truth: Truth = field(default_factory=Truth)
    car: Car = field(default_factory=Car)
    driver: Driver = field(default_factory=Driver)
    orders: Orders = field(default_factory=Orders)
    enabled: bool = False
    override: bool = False
    timed_out: bool = True
    gear: int = FORWARD
    told_disable: bool = False
    brake_share: float = 1.0
    stuck_wheel: bool = False
    echo: float = 0.0
    broken: list[str] = field(default_factory=list)
    _late: deque[tuple[int, Orders]] = field(default_factory=deque)
    _pedals_told: set[str] = field(default_factory=set)

    def hear(self, identifier: int, data: bytes, at_us: int) -> None:
        """A frame of whoever sends commands."""
        message = PACMOD2.by_id.get(identifier)
        if message is None or message.sender != "WORKBENCH":
            return
        said = decode(PACMOD2, identifier, data)
        if isinstance(said, Refusal):
            self.broken.append(f"{at_us} us: {said}")
            return
        if said.message == "GLOBAL_CMD":
            self._switch(said, at_us)
        else:
            self._order(said)

    def _switch(self, said: Decoded, at_us: int) -> None:
        enable, clear, ignore = (
            bool(said.values[name])
            for name in ("PACMOD_ENABLE", "CLEAR_OVERRIDE", "IGNORE_OVERRIDE")
        )
        self.orders.heard_us, self.timed_out = at_us, False
        if ignore:
            self.broken.append(f"{at_us} us: IGNORE_OVERRIDE")
        if clear and enable:
            self.broken.append(f"{at_us} us: CLEAR_OVERRIDE with ENABLE")
        if not enable:
            self.enabled, self.told_disable = False, True
            self.override = self.override and not clear
            self._pedals_told.clear()
        elif self.told_disable and not self.override and not clear and not self.enabled:
            self.enabled, self.told_disable = True, False

    def _order(self, said: Decoded) -> None:
        orders, values = self.orders, said.values
        if said.message == "ACCEL_CMD":
            orders.accel = values["ACCEL_CMD"]
        elif said.message == "BRAKE_CMD":
            orders.brake = values["BRAKE_CMD"]
        elif said.message == "STEERING_CMD":
            orders.wheel_rad = values["POSITION_VALUE"]
            orders.wheel_rate_radps = values["SPEED_LIMIT"]
        self._pedals_told.add(said.message)
        if orders.accel > 0.0 and orders.brake > 0.0:
            self.broken.append("accelerator and brake together")

    def step(self, now_us: int) -> None:
        """One millisecond on."""
        self._watch(now_us)
        self._late.append((now_us, Orders(**vars(self.orders))))
        dt = STEP_US / 1e6
        pedals = self._before(now_us, self.truth.pedal_delay_us)
        wheel = self._before(now_us, self.truth.steering_delay_us)
        keep_us = now_us - max(self.truth.pedal_delay_us, self.truth.steering_delay_us)
        while len(self._late) > 1 and self._late[1][0] <= keep_us:
            self._late.popleft()
        self._press(pedals, dt)
        self._turn_wheel(wheel, dt)
        self._move(dt)

    def _watch(self, now_us: int) -> None:
        if max(self.driver.accel, self.driver.brake) > OVERRIDE_PEDAL or self.driver.turns_wheel:
            self.override, self.enabled = self.override or self.enabled, False
        if now_us - self.orders.heard_us > TIMEOUT_US and not self.timed_out:
            self.timed_out, self.enabled, self.told_disable = True, False, False
        if self.enabled and not {"ACCEL_CMD", "BRAKE_CMD"} <= self._pedals_told:
            waited = now_us - self.orders.heard_us
            if waited > REPORT_US // 2:
                self.broken.append(f"{now_us} us: enabled without both pedals commanded")

    def _before(self, now_us: int, delay_us: int) -> Orders:
        found = self._late[0][1]
        for at_us, orders in self._late:
            if at_us > now_us - delay_us:
                break
            found = orders
        return found

    def _press(self, orders: Orders, dt: float) -> None:
        most = dt * 1e6 / self.truth.pedal_build_up_us
        wanted = (orders.accel, orders.brake) if self.enabled else (0.0, 0.0)
        wanted = (max(wanted[0], self.driver.accel), max(wanted[1], self.driver.brake))
        car = self.car
        car.accel += min(max(wanted[0] - car.accel, -most), most)
        car.brake += min(max(wanted[1] - car.brake, -most), most)

    def _turn_wheel(self, orders: Orders, dt: float) -> None:
        if not self.enabled or self.stuck_wheel:
            return
        short = orders.wheel_rad - self.car.wheel_rad
        if abs(short) > self.truth.steering_dead_rad:
            most = min(orders.wheel_rate_radps, self.truth.wheel_rate_radps) * dt
            self.car.wheel_rad += min(max(short, -most), most)

    def _move(self, dt: float) -> None:
        car, truth = self.car, self.truth
        push = truth.accel_per_ratio * max(car.accel - truth.accel_dead, 0.0)
        push *= self.gear == FORWARD
        hold = truth.brake_per_ratio * max(car.brake - truth.brake_dead, 0.0) * self.brake_share
        hold += truth.sag_mps2 + 9.0 * (self.gear == PARK)
        speed = max(car.speed_mps + (push - hold) * dt, 0.0)
        way = 0.5 * (speed + car.speed_mps) * dt
        turn = way * math.tan(self.road_wheel_rad) / truth.wheelbase_m
        car.x_m += way * math.cos(car.heading + 0.5 * turn)
        car.y_m += way * math.sin(car.heading + 0.5 * turn)
        car.heading += turn
        car.speed_mps = speed

    @property
    def road_wheel_rad(self) -> float:
        return self.car.wheel_rad / self.truth.steering_ratio

    def reports(self) -> Mapping[str, Mapping[str, float]]:
        """Signals of every report by message."""
        car, orders, driver = self.car, self.orders, self.driver
        told = orders if self.enabled else Orders(wheel_rad=car.wheel_rad)
        return {
            "GLOBAL_RPT": {
                "PACMOD_STATUS": self.enabled, "OVERRIDE_STATUS": self.override,
                "VEH_CAN_TIMEOUT": 0, "STR_CAN_TIMEOUT": 0, "BRK_CAN_TIMEOUT": 0,
                "USR_CAN_TIMEOUT": self.timed_out, "USR_CAN_READ_ERRORS": 0,
            },
            "ACCEL_RPT": _pedal(driver.accel, told.accel + self.echo, car.accel),
            "BRAKE_RPT": _pedal(driver.brake, told.brake, car.brake)
            | {"BRAKE_ON_OFF": car.brake > 0.0},
            "STEERING_RPT_1": {
                "MANUAL_INPUT": 0.0, "COMMANDED_VALUE": told.wheel_rad,
                "OUTPUT_VALUE": car.wheel_rad,
            },
            "SHIFT_RPT": {
                "MANUAL_INPUT": self.gear, "COMMANDED_VALUE": self.gear, "OUTPUT_VALUE": self.gear
            },
            "VEHICLE_SPEED_RPT": {"VEHICLE_SPEED": car.speed_mps, "VEHICLE_SPEED_VALID": 1},
        }  # fmt: skip

    def report_frames(self) -> list[tuple[int, bytes]]:
        """The reports as frames, in the order in which PACMod sends them."""
        return [(PACMOD2.by_name[name].frame_id, framed(name, v)) for name, v in
                self.reports().items()]  # fmt: skip


def _pedal(manual: float, commanded: float, output: float) -> dict[str, float]:
    values = {"MANUAL_INPUT": manual, "COMMANDED_VALUE": commanded, "OUTPUT_VALUE": output}
    return {name: min(max(value, 0.0), 1.0) for name, value in values.items()}


def framed(name: str, values: Mapping[str, float]) -> bytes:
    data = encode(PACMOD2, name, values)
    assert isinstance(data, bytes), data
    return data


def rewritten(name: str, data: bytes, change: Callable[[dict[str, float]], object]) -> bytes:
    """The same report with other values."""
    said = decode(PACMOD2, PACMOD2.by_name[name].frame_id, data)
    assert isinstance(said, Decoded), said
    values = dict(said.values)
    change(values)
    return framed(name, values)
