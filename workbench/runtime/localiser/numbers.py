"""What localiser.json holds: site, vehicle, clocks and sets that a localiser is built for."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
from dataclasses import dataclass
from typing import Any, Final, TypeVar, final

from workbench.errors import InputError
from workbench.runtime.contents import MANIFEST_FILE, Golden
from workbench.runtime.json_reader import JsonReader, no_constant
from workbench.runtime.localiser.native_steps import REBUILD
from workbench.runtime.localiser.site import (
    Antenna,
    Beacon,
    Limits,
    Motion,
    Ranges,
    Reports,
    Site,
)
from workbench.runtime.localiser.steps import FOUND, GIVEN, NAMES
from workbench.runtime.onboard.curve import Curve
from workbench.runtime.onboard.stamps import StampBounds
from workbench.runtime.runs import packed_runs, unpacked_runs

NUMBERS_FILE: Final = "localiser.json"
FORMAT: Final = 1
MOST_BEACONS: Final = 64
"""What a RANGE frame can count."""
_SECTIONS: Final = {
    "antenna": Antenna, "ranges": Ranges, "reports": Reports, "motion": Motion, "limits": Limits
}  # fmt: skip
_Part = TypeVar("_Part")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """What the vehicle's reports mean.

    protocol: of its bus; road_wheel: steering-wheel angle (rad) -> road-wheel angle (rad);
    speed_scale, steering_zero_rad: what `commission` found; the reports are corrected by them.
    """

    name: str
    protocol: str
    wheelbase_m: float
    road_wheel: Curve
    speed_scale: float
    steering_zero_rad: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.wheelbase_m) and self.wheelbase_m > 0.0):
            raise InputError(f"wheelbase_m: expected a number > 0, got {self.wheelbase_m!r}")
        if not (abs(self.speed_scale) < 0.5 and abs(self.steering_zero_rad) < 0.5):
            raise InputError(
                "speed_scale, steering_zero_rad: expected corrections within 0.5, got "
                f"{self.speed_scale!r} and {self.steering_zero_rad!r}; commission the vehicle"
            )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Clocks:
    """How late things arrive, from the instant they are about, in us.

    report_delay_us: a report, usually. range_delay_us: (least, most) a range; one that came later
    is refused. drift_ppm: how much faster or slower than ours the clock of the ranges runs at most.
    """

    report_delay_us: int
    range_delay_us: tuple[int, int]
    drift_ppm: int

    def __post_init__(self) -> None:
        if not 0 <= self.report_delay_us <= 1_000_000:
            raise InputError(
                f"report_delay_us: expected 0 to 1000000, got {self.report_delay_us!r}"
            )
        if not self.range_delay_us[1] <= 1_000_000:
            raise InputError(
                f"range_delay_us: expected at most 1000000, got {self.range_delay_us!r}"
            )
        self.stamps(0)

    def stamps(self, read_us: int) -> StampBounds:
        """The same for whoever reads a frame up to read_us after it arrived."""
        least_us, most_us = self.range_delay_us
        return StampBounds(
            delay_us=(least_us, most_us + read_us), drift_ppm=self.drift_ppm, window_us=_WINDOW_US
        )


_WINDOW_US: Final = 20_000_000


@final
@dataclass(frozen=True, slots=True)
class SetLevel:
    """A joint confidence, and half of its box's width in deviations of each state."""

    level: float
    deviations: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Numbers:
    """Everything beside the shared object; raises InputError where the parts do not fit.

    levels: what sets may be asked for, rising; level: the one that is sent; shape: its name, how
    levels became deviations. golden: one call of each function of `NAMES`, bit for bit.
    """

    created_by: str
    machine: str
    compiler: str
    flags: tuple[str, ...]
    site: Site
    vehicle: Vehicle
    clocks: Clocks
    shape: str
    levels: tuple[SetLevel, ...]
    level: float
    golden: tuple[Golden, ...]

    def __post_init__(self) -> None:
        if len(self.site.beacons) > MOST_BEACONS:
            raise InputError(
                f"beacon: expected at most {MOST_BEACONS}, which a RANGE frame can count, got "
                f"{len(self.site.beacons)}"
            )
        columns = [(each.level, each.deviations) for each in self.levels]
        rising = all(a < c and b < d for (a, b), (c, d) in itertools.pairwise(columns))
        if (
            not columns
            or not rising
            or not all(0.0 < a < 1.0 and 0.0 < b < 99.0 for a, b in columns)
        ):
            raise InputError(f"levels: expected rising confidences in (0, 1), got {columns!r}")
        self.deviations(self.level)
        sizes = tuple((len(each.query), len(each.result)) for each in self.golden)
        wanted = tuple((sum(g), sum(f)) for g, f in zip(GIVEN, FOUND, strict=True))
        if sizes != wanted:
            raise InputError(f"golden: expected one call of each of {NAMES}, got sizes {sizes}")

    def deviations(self, level: float) -> float:
        """Of one of the levels; InputError for any other."""
        for each in self.levels:
            if each.level == level:
                return each.deviations
        known = ", ".join(f"{each.level:g}" for each in self.levels)
        raise InputError(f"level: expected one of {known}, got {level!r}")


def numbers_to_json(numbers: Numbers) -> str:
    """The text of localiser.json, one line per top-level key; floats are written exactly."""
    content = {"format": FORMAT} | dataclasses.asdict(numbers)
    content["golden"] = [
        {"given": packed_runs(each.query), "found": packed_runs(each.result)}
        for each in numbers.golden
    ]
    lines = (f"{json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in content.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def numbers_from_json(text: bytes) -> Numbers:
    """What `numbers_to_json` wrote; raises InputError that names the key at fault."""
    try:
        return _numbers(JsonReader(json.loads(text, parse_constant=no_constant), ""))
    except InputError as error:
        said = str(error).partition("; rebuild the bundle")[0].removeprefix(f"{MANIFEST_FILE}: ")
        raise InputError(f"{NUMBERS_FILE}: {said}; {REBUILD}") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{NUMBERS_FILE}: expected JSON ({error}); {REBUILD}") from None


def _numbers(top: JsonReader) -> Numbers:
    number = top.integer("format")
    if number != FORMAT:
        raise InputError(f"format: expected {FORMAT}, got {number}")
    clocks = top.part("clocks")
    least_us, most_us = (int(end) for end in clocks.interval("range_delay_us"))
    return top.done(Numbers(
        created_by=top.text("created_by"), machine=top.text("machine"),
        compiler=top.text("compiler"), flags=tuple(map(str, top.items("flags"))),
        site=_site(top.part("site")), vehicle=_vehicle(top.part("vehicle")),
        clocks=clocks.done(Clocks(
            report_delay_us=clocks.integer("report_delay_us"), range_delay_us=(least_us, most_us),
            drift_ppm=clocks.integer("drift_ppm"),
        )),
        shape=top.text("shape"), level=top.number("level"),
        levels=tuple(_filled(SetLevel, part) for part in top.parts("levels")),
        golden=tuple(_golden(part) for part in top.parts("golden")),
    ))  # fmt: skip


def _site(part: JsonReader) -> Site:
    beacons = tuple(_filled(Beacon, each) for each in part.parts("beacons"))
    sections: dict[str, Any] = {
        name: _filled(kind, part.part(name)) for name, kind in _SECTIONS.items()
    }
    return part.done(Site(beacons=beacons, **sections))


def _vehicle(part: JsonReader) -> Vehicle:
    curve = part.part("road_wheel")
    columns = (curve.numbers(name) for name in ("command", "lowest", "highest"))
    return part.done(Vehicle(
        name=part.text("name"), protocol=part.text("protocol"),
        wheelbase_m=part.number("wheelbase_m"), road_wheel=curve.done(Curve(*columns)),
        speed_scale=part.number("speed_scale"),
        steering_zero_rad=part.number("steering_zero_rad"),
    ))  # fmt: skip


def _filled(kind: type[_Part], part: JsonReader) -> _Part:
    """The value of that kind, all of whose fields are numbers and texts."""
    values = {
        field.name: part.text(field.name) if field.type == "str" else part.number(field.name)
        for field in dataclasses.fields(kind)  # type: ignore[arg-type]
    }
    return part.done(kind(**values))


def _golden(part: JsonReader) -> Golden:
    given, found = (
        unpacked_runs(part.items(key), most=_MOST_NUMBERS) for key in ("given", "found")
    )
    return part.done(Golden(given, found))


_MOST_NUMBERS: Final = 10_000
