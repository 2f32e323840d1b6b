"""The bundle of the shipped vehicle loads and decides at once, and refuses every kind of damage."""

from __future__ import annotations

import json
import math
import platform
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from decision_fixture import HORIZON_S, STEP_S, real_files, real_manifest, write_real_bundle

from workbench.claims import Rigor, Verdict
from workbench.codegen import MonitorSpec, build_bundle
from workbench.errors import InputError
from workbench.models.vehicle import gem_e2
from workbench.runtime import load_bundle
from workbench.runtime.layout import KERNEL_VERDICTS, TUBES
from workbench.runtime.manifest import CHECKSUM_FILE, LIBRARY_FILE, MANIFEST_FILE, checksums_text

ROOT = Path(__file__).parent.parent
_FOREIGN = "aarch64" if platform.machine() != "aarch64" else "x86_64"

_START = """
import sys, time
started = time.perf_counter()
import workbench.runtime
from workbench.runtime import (
    Deciding, Disc, Guard, Monitor, MotionLimits, Observation, ObservedPerson, PathTable, Person,
    Timing, Watched, load_bundle,
)
n = 400
path = PathTable(-10.0, 0.25, tuple(0.25 * j - 10.0 for j in range(n)), (0.0,) * n, (0.0,) * n,
                 (0.0,) * (n - 1), (0.0,) * (n - 1))
bundle = load_bundle(sys.argv[1])
timing = Timing(period_s=0.1, latency_s=9.0, send_gap_s=0.04)
monitor = Monitor(bundle, path, release_steps=1, clearance_required_m=0.2, timing=timing,
                  deciding=Deciding.LOOK_AHEAD)
aside = Person("aside", 5.0, 6.0, 0.5, 0.0, 0.3, 0.1, 0.1)
limits = MotionLimits(bundle.manifest.guard_speed_max_mps, bundle.manifest.guard_accel_max_mps2)
guard = Guard(0.0, Disc(5.0, 6.0, 0.3), Disc(0.5, 0.0, 0.1), limits)
seen = Observation((-0.05, 0.05), (-0.05, 0.05), (-0.01, 0.01), (-0.005, 0.005), (2.7, 2.8),
                   (0, 0), (0, 0), 2.8, people=(ObservedPerson("aside", (aside.intent,), guard),),
                   stamp_s=time.monotonic(), watched=Watched(0.0, 0.0, 50.0))
first = monitor.step(seen)
cold_s = time.perf_counter() - started
import json
# getrusage would count what the parent process held before this one replaced it.
peak_kb = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(json.dumps({"verdict": first.verdict.name, "reason": first.reason, "cold_s": cold_s,
                  "peak_mb": int(peak_kb) / 1024}))
"""


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_real_bundle(tmp_path / "bundle")


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs the optional file /proc")
def test_a_process_decides_soon_after_it_starts(
    bundle: Path, record_property: Callable[[str, object], None]
) -> None:
    command = [sys.executable, "-c", _START, str(bundle)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    measured = json.loads(done.stdout)
    record_property("cold_start_s", measured["cold_s"])
    record_property("peak_mb", measured["peak_mb"])
    assert measured["verdict"] == "SAFE", measured["reason"]
    # Half a second and 80 MB on an idle machine; this one may be busy.
    assert measured["cold_s"] < 5.0
    assert measured["peak_mb"] < 80.0


def test_the_golden_vectors_tell_the_verdicts_apart() -> None:
    manifest = real_manifest()
    for tube in TUBES:
        span = next(f.span for f in manifest.result if f.name == f"{tube}_verdicts")
        numbers = {number for golden in manifest.golden for number in golden.result[span]}
        verdicts = {KERNEL_VERDICTS[int(number)] for number in numbers}
        assert verdicts == {Verdict.SAFE, Verdict.UNPROVED, Verdict.INVALID}, tube
    assert any(math.isnan(number) for golden in manifest.golden for number in golden.query)


def test_the_manifest_says_what_was_built() -> None:
    manifest, vehicle = real_manifest(), gem_e2()
    assert manifest.rigor is Rigor.ENCLOSED
    assert (manifest.horizon_s, manifest.step_s, manifest.steps) == (HORIZON_S, STEP_S, 60)
    body, built = vehicle.geometry, manifest.vehicle
    for name in ("wheelbase_m", "front_m", "rear_m", "half_width_m"):
        assert getattr(built, name) == getattr(body, name)
    assert manifest.region is not None
    region = vehicle.operation.region
    for name in region.names:
        assert manifest.region.interval(name) == region.interval(name)
    assert [level.share for level in manifest.levels] == [1.0, 2 / 3, 1 / 3]
    assert (manifest.deciding_level, manifest.deciding) == ("whole", "both")
    assert manifest.brake.deceleration_min_mps2 == vehicle.brake.deceleration_min_mps2
    assert manifest.brake.delay_s == vehicle.brake.delay_s
    assert manifest.brake.build_up_s == vehicle.brake.build_up_s
    assert manifest.guard_speed_max_mps == vehicle.guard.speed_max_mps
    assert manifest.guard_accel_max_mps2 == vehicle.guard.accel_max_mps2
    assert {"model", "initial set", "people", "sight"} <= {a.name for a in manifest.assumptions}


@pytest.mark.parametrize("name", sorted([*real_files()]))
def test_a_flipped_bit_in_any_file_is_refused_by_name(bundle: Path, name: str) -> None:
    content = real_files()[name]
    for place in (0, len(content) // 3, len(content) // 2, len(content) - 1):
        flipped = bytearray(content)
        flipped[place] ^= 1
        (bundle / name).write_bytes(flipped)
        with pytest.raises(InputError, match=name):
            load_bundle(bundle)
    (bundle / name).write_bytes(content)
    load_bundle(bundle)


def _rewritten(bundle: Path, name: str, change: Callable[[bytes], bytes]) -> Path:
    """The bundle with one file changed and its checksum made right again."""
    files = {n: c for n, c in real_files().items() if n != CHECKSUM_FILE}
    files[name] = change(files[name])
    (bundle / name).write_bytes(files[name])
    (bundle / CHECKSUM_FILE).write_text(checksums_text(files))
    return bundle


def test_another_machines_bundle_is_refused_though_its_hashes_are_right(bundle: Path) -> None:
    here = f'"machine": "{platform.machine()}"'.encode()
    there = f'"machine": "{_FOREIGN}"'.encode()
    with pytest.raises(InputError, match=f"built for {_FOREIGN}, this machine is"):
        load_bundle(_rewritten(bundle, MANIFEST_FILE, lambda text: text.replace(here, there)))


def test_a_library_of_another_machine_is_refused_though_its_hashes_are_right(bundle: Path) -> None:
    def patched(library: bytes) -> bytes:
        return library[:18] + (8).to_bytes(2, "little") + library[20:]

    with pytest.raises(InputError, match=r"ELF header of kernel\.so says machine 8"):
        load_bundle(_rewritten(bundle, LIBRARY_FILE, patched))


def test_a_kernel_with_another_constant_fails_its_golden_vectors(bundle: Path) -> None:
    """An end of the operating region, found in the library's tables and moved."""
    old, new = struct.pack("<d", 0.6), struct.pack("<d", 0.35)
    assert old in real_files()[LIBRARY_FILE]
    with pytest.raises(InputError, match="golden vector"):
        load_bundle(_rewritten(bundle, LIBRARY_FILE, lambda code: code.replace(old, new)))


def test_building_twice_gives_the_same_bytes_and_replaces_only_bundles(
    tmp_path: Path, compile_anew: None
) -> None:
    spec = MonitorSpec(gem_e2(), HORIZON_S, STEP_S)
    folder = build_bundle(spec, tmp_path / "deep" / "bundle")
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == real_files()
    (folder / LIBRARY_FILE).write_bytes(b"damaged")
    build_bundle(spec, folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == real_files()
    assert [path.name for path in folder.parent.iterdir()] == ["bundle"]
    other = tmp_path / "papers"
    other.mkdir()
    (other / "thesis.txt").write_text("years of work")
    # A manifest.json makes no bundle of somebody's folder.
    (other / MANIFEST_FILE).write_text("{}")
    for refused in (other, other / "thesis.txt"):
        with pytest.raises(InputError, match="exists and is not a bundle"):
            build_bundle(spec, refused)
    assert sorted(path.name for path in other.iterdir()) == [MANIFEST_FILE, "thesis.txt"]


@pytest.mark.parametrize(
    ("horizon_s", "step_s"),
    [
        (3.0, 0.0),
        (3.0, -0.1),
        (0.0, 0.1),
        (3.0, 0.07),
        (math.inf, 0.1),
        (math.nan, 0.1),
        (3.0, math.nan),
    ],
)
def test_impossible_grids_are_refused(horizon_s: float, step_s: float) -> None:
    with pytest.raises(InputError, match="expected"):
        MonitorSpec(gem_e2(), horizon_s, step_s)
