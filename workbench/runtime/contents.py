"""What a bundle says about itself: the values that manifest.json holds, checked at construction."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.claims import Assumption, Rigor
from workbench.errors import InputError
from workbench.runtime.monitor_settings import MonitorSettings
from workbench.runtime.onboard.drive_by_wire import DriveByWire
from workbench.runtime.path import PathTable
from workbench.runtime.policies.deciding import Deciding
from workbench.runtime.policies.horizon import BrakeBounds
from workbench.sets import Box

FORMAT = 2
MANIFEST_FILE = "manifest.json"
LIBRARY_FILE = "kernel.so"
SOURCE_FILE = "kernel.c"
HEADER_FILE = "kernel.h"
CHECKSUM_FILE = "SHA256SUMS"
CHECKED_FILES = (LIBRARY_FILE, SOURCE_FILE, HEADER_FILE, MANIFEST_FILE)


def _refuse(what: str) -> InputError:
    return InputError(f"{MANIFEST_FILE}: {what}; rebuild the bundle with `workbench build`")


@final
@dataclass(frozen=True, slots=True)
class Field:
    """A named run of `count` doubles from `offset` on; `default` fills a query field left out."""

    name: str
    offset: int
    count: int
    default: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if not self.name or self.offset < 0 or self.count < 1:
            raise _refuse(
                f"field {self.name!r}: expected a name, an offset >= 0 and a count >= 1, "
                f"got offset {self.offset}, count {self.count}"
            )
        if self.default is None:
            return
        if len(self.default) != self.count or not all(map(math.isfinite, self.default)):
            raise _refuse(
                f"field {self.name!r}: expected {self.count} finite default values, "
                f"got {len(self.default)}: {self.default[:4]!r}"
            )

    @property
    def span(self) -> slice:
        """The field's place in the buffer."""
        return slice(self.offset, self.offset + self.count)


@final
@dataclass(frozen=True, slots=True)
class Kernel:
    """The library's entry point and the sizes of its three buffers, in doubles."""

    entry: str
    query_size: int
    result_size: int
    work_size: int

    def __post_init__(self) -> None:
        if not self.entry.isidentifier():
            raise _refuse(f"expected the entry point to be a C name, got {self.entry!r}")
        if self.query_size < 1 or self.result_size < 1 or self.work_size < 0:
            raise _refuse(
                "expected query_size >= 1, result_size >= 1 and work_size >= 0, "
                f"got {self.query_size}, {self.result_size} and {self.work_size}"
            )


@final
@dataclass(frozen=True, slots=True)
class StateSignal:
    """Name and SI unit of one state of the kernel, in the order of its tube's columns."""

    name: str
    unit: str


@final
@dataclass(frozen=True, slots=True)
class Parameter:
    """A run-time parameter and the range over which the proof holds."""

    name: str
    unit: str
    nominal: float
    lower: float
    upper: float

    def __post_init__(self) -> None:
        numbers = (self.lower, self.nominal, self.upper)
        if not all(map(math.isfinite, numbers)) or not self.lower <= self.nominal <= self.upper:
            raise _refuse(
                f"parameter {self.name!r}: expected finite lower <= nominal <= upper, "
                f"got {numbers!r}"
            )


@final
@dataclass(frozen=True, slots=True)
class VehicleBody:
    """The vehicle's shape about the middle of its rear axle; `further`: other figures by name."""

    name: str
    wheelbase_m: float
    front_m: float
    rear_m: float
    half_width_m: float
    further: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        lengths = (self.wheelbase_m, self.front_m, self.half_width_m)
        numbers = (*lengths, self.rear_m, *(value for _, value in self.further))
        if not all(map(math.isfinite, numbers)) or min(lengths) <= 0.0 or self.rear_m < 0.0:
            raise _refuse(
                f"vehicle {self.name!r}: expected finite figures, wheelbase_m, front_m and "
                f"half_width_m > 0 and rear_m >= 0, got {numbers!r}"
            )


@final
@dataclass(frozen=True, slots=True)
class NestedLevel:
    """One of the nested sets: the observation about its centre, its radii times `share`."""

    name: str
    share: float

    def __post_init__(self) -> None:
        if not self.name or not 0.0 < self.share <= 1.0:
            raise _refuse(
                f"level {self.name!r}: expected a name and a share > 0, at most 1, "
                f"got {self.share!r}"
            )


@final
@dataclass(frozen=True, slots=True)
class Golden:
    """One recorded call: query, result bit for bit, and what the entry point returned."""

    query: tuple[float, ...]
    result: tuple[float, ...]
    returns: int = 0


@final
@dataclass(frozen=True, slots=True)
class Manifest:
    """Everything a bundle claims; raises InputError when its parts do not fit together.

    query, result: fields that tile their buffers exactly, in order. region: box of the states
    (those it names) in which the proof holds, or None. levels: nested sets, the largest first, its
    share 1; deciding_level: the one whose SAFE counts; deciding: whose TRACK counts, a value of
    `Deciding`. brake: what BRAKE does at least. guard_speed_max_mps, guard_accel_max_mps2: what
    nobody exceeds, those who are not seen included. budget: most attempted steps of integration in
    one call. tubes: kernel and form that compute them, such as "local, linear". golden: at least
    one recorded call. drive_by_wire, path, monitor, sensors (what sensors, clocks and people keep
    to, as TOML): what driving needs besides, None where the bundle is not for driving.
    """

    name: str
    created_by: str
    machine: str
    compiler: str
    flags: tuple[str, ...]
    kernel: Kernel
    query: tuple[Field, ...]
    result: tuple[Field, ...]
    states: tuple[StateSignal, ...]
    parameters: tuple[Parameter, ...]
    vehicle: VehicleBody
    steps: int
    step_s: float
    horizon_s: float
    region: Box | None
    levels: tuple[NestedLevel, ...]
    deciding_level: str
    deciding: str
    brake: BrakeBounds
    guard_speed_max_mps: float
    guard_accel_max_mps2: float
    budget: int
    tubes: str
    rigor: Rigor
    assumptions: tuple[Assumption, ...]
    golden: tuple[Golden, ...]
    drive_by_wire: DriveByWire | None = None
    path: PathTable | None = None
    monitor: MonitorSettings | None = None
    sensors: str | None = None

    def __post_init__(self) -> None:
        _check_tiling("query", self.query, self.kernel.query_size)
        _check_tiling("result", self.result, self.kernel.result_size)
        _check_names("state", [state.name for state in self.states])
        _check_names("parameter", [parameter.name for parameter in self.parameters])
        if not self.states:
            raise _refuse("expected at least one state, got none")
        grid = self.steps >= 1 and 0.0 < self.step_s < math.inf
        if not (grid and abs(self.steps * self.step_s - self.horizon_s) <= 1e-9 * self.steps):
            raise _refuse(
                "expected steps >= 1, step_s > 0 and horizon_s = steps * step_s, "
                f"got {self.steps}, {self.step_s!r} and {self.horizon_s!r}"
            )
        known = {state.name for state in self.states}
        if self.region is not None and not known.issuperset(self.region.names):
            raise _refuse(f"the region names {self.region.names}, the states are {sorted(known)}")
        self._check_deciding()
        self._check_driving()
        self._check_golden()

    def _check_driving(self) -> None:
        wire = self.drive_by_wire
        if wire is None:
            return
        proved = {parameter.name: parameter.nominal for parameter in self.parameters}
        for name, driven in (
            ("steering_max", wire.steering.angle_limit_rad),
            ("steering_rate_max", wire.steering.rate_limit_radps),
            ("acceleration_min", wire.pedals.accel_min_mps2),
            ("acceleration_max", wire.pedals.accel_max_mps2),
        ):
            if proved.get(name, driven) != driven:
                raise _refuse(
                    f"drive_by_wire: expected the proof's {name} = {proved[name]!r}, got {driven!r}"
                )
        gap_s = 0.0 if self.monitor is None else self.monitor.timing.send_gap_s
        if gap_s > wire.turn_s:
            raise _refuse(
                f"monitor: expected a send_gap_s within the drive-by-wire's {wire.turn_s!r} s, "
                f"which its disturbance covers, got {gap_s!r}"
            )

    def _check_deciding(self) -> None:
        names = [level.name for level in self.levels]
        _check_names("level", names)
        shares = [level.share for level in self.levels]
        falling = all(a > b for a, b in itertools.pairwise(shares))
        if not shares or shares[0] != 1.0 or not falling:
            raise _refuse(f"expected shares that fall from 1 on, level by level, got {shares!r}")
        if self.deciding_level not in names:
            raise _refuse(f"deciding_level: expected one of {names!r}, got {self.deciding_level!r}")
        policies = [deciding.value for deciding in Deciding]
        if self.deciding not in policies:
            raise _refuse(f"deciding: expected one of {policies!r}, got {self.deciding!r}")
        limits = (self.guard_speed_max_mps, self.guard_accel_max_mps2)
        if not all(0.0 < limit < math.inf for limit in limits):
            raise _refuse(f"guard: expected finite limits > 0, got {limits!r}")
        if self.budget < 1:
            raise _refuse(f"budget: expected at least 1 step, got {self.budget}")
        if not self.tubes:
            raise _refuse("tubes: expected kernel and form, such as 'local, linear', got ''")

    def _check_golden(self) -> None:
        if not self.golden:
            raise _refuse("expected at least one golden vector, got none")
        sizes = (self.kernel.query_size, self.kernel.result_size)
        for index, golden in enumerate(self.golden):
            if (len(golden.query), len(golden.result)) != sizes:
                raise _refuse(
                    f"golden vector {index}: expected {sizes[0]} query and {sizes[1]} result "
                    f"numbers, got {len(golden.query)} and {len(golden.result)}"
                )


def _check_names(what: str, names: Sequence[str]) -> None:
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated or "" in names:
        raise _refuse(f"expected distinct, non-empty {what} names, got {list(names)!r}")


def _check_tiling(buffer: str, fields: Sequence[Field], size: int) -> None:
    _check_names(f"{buffer} field", [field.name for field in fields])
    end = 0
    for field in fields:
        if field.offset != end:
            raise _refuse(
                f"the {buffer} fields must tile the buffer: expected {field.name!r} at offset "
                f"{end}, got {field.offset}"
            )
        end += field.count
    if end != size:
        raise _refuse(
            f"the {buffer} fields must tile the buffer: they end at {end}, "
            f"its size is {size} (kernel.{buffer}_size)"
        )
