"""A signed bundle for the car of the virtual world on disk, and all else that the command needs."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import onboard_core_cases
from onboard_core_cases import DRIVE_BY_WIRE, PATH, SETTINGS, bundle
from onboard_world import World
from onboard_world_fake_core import FakeCore
from runtime_fixture import FLAGS, compiled
from signed_cases import KEY, signed_again, write_files, write_public_key

from workbench.runtime.contents import Manifest
from workbench.runtime.manifest import (
    CHECKSUM_FILE,
    HEADER_FILE,
    LIBRARY_FILE,
    MANIFEST_FILE,
    SOURCE_FILE,
    checksums_text,
    manifest_to_json,
)
from workbench.runtime.monitor_settings import MonitorSettings

SENSORS = """
[clocks]
delay_us = [1000, 60000]
drift_ppm = 200
window_us = 5000000
localisation_age_us = 900000
people_age_us = 600000
[reports]
delay_us = [0, 20000]
age_us = 100000
speed_gain = [1.0, 1.0]
speed_range_mps = [-1.0, 8.0]
acceleration_mps2 = [-6.0, 3.0]
steering_limit_rad = 0.6
steering_rate_radps = 0.4
wheelbase_m = [1.74, 1.76]
[people]
unseen_speed_mps = 2.5
[people.on_foot]
speed_mps = 2.5
acceleration_mps2 = 2.0
intent_mps2 = 0.1
[people.on_wheels]
speed_mps = 7.0
acceleration_mps2 = 3.0
intent_mps2 = 0.2
[reading]
offset_m = 1.0
heading_rad = 0.5
speed_mps = 1.0
[gate]
acceleration_mps2 = 0.1
steering_rate_radps = 0.01
[vehicle]
maker = "52C"
"""


def manifest(sensors: str = SENSORS) -> Manifest:
    """Of the fake kernel with all that driving needs."""
    monitor = MonitorSettings(1, 0.5, SETTINGS.timing)
    return replace(
        bundle().manifest, drive_by_wire=DRIVE_BY_WIRE, path=PATH, monitor=monitor, sensors=sensors
    )


@functools.cache
def _files(sensors: str | None) -> dict[str, bytes]:
    found = bundle().manifest if sensors is None else manifest(sensors)
    source = onboard_core_cases._source(found.query, found.kernel.query_size)
    files = {
        MANIFEST_FILE: manifest_to_json(found).encode(),
        LIBRARY_FILE: compiled(source, FLAGS),
        SOURCE_FILE: source.encode(),
        HEADER_FILE: b"/* as the manifest says */\n",
    }
    return files | {CHECKSUM_FILE: checksums_text(files).encode()}


def installed(
    folder: Path, *, driving: bool = True, sensors: Callable[[str], str] = lambda text: text
) -> list[str]:
    """Arguments of the command for a bundle, key and control folder written here."""
    files = _files(sensors(SENSORS) if driving else None)
    write_files(folder / "bundle", signed_again(files))
    write_public_key(folder / "keys" / "key.pub", KEY)
    (folder / "control").mkdir(mode=0o700)
    return [f"--bundle={folder / 'bundle'}", f"--public-key={folder / 'keys' / 'key.pub'}"]


@functools.cache
def usual_frames() -> tuple[tuple[int, int, bytes], ...]:
    """(us, identifier, bytes) of ten seconds on the bus of a car that stands."""
    world = World(FakeCore(frames=()), sends=False, seed=8).run(10_000_000)
    return tuple((e.at_us, e.frame.identifier, e.frame.data) for e in world.trace)
