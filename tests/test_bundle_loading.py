"""Code that is not what the manifest promises is found at loading, and never decides anything."""

from __future__ import annotations

import ctypes
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from runtime_fixture import (
    FLAGS,
    QUERY,
    STEPS,
    compiled,
    fake_manifest,
    fake_source,
    write_bundle,
)

from workbench.errors import InputError
from workbench.runtime import Bundle, load_bundle
from workbench.runtime.bundle import first_difference
from workbench.runtime.floats import float_mode_fault
from workbench.runtime.manifest import Manifest

_ROUNDING = {"x86_64": (0x400, 0x800, 0xC00), "aarch64": (0x800000, 0x400000, 0xC00000)}


def _values() -> dict[str, list[float]]:
    values = {field.name: [0.0] * field.count for field in QUERY if field.default is None}
    values["path_spacing_m"] = [0.5]
    values["path_count"] = [128.0]
    values["initial_center"] = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0] * 3
    return values


@pytest.fixture
def bundle(tmp_path: Path) -> Bundle:
    return load_bundle(write_bundle(tmp_path))


def test_a_call_fills_defaults_and_reads_fields_back(bundle: Bundle) -> None:
    result = bundle.call(_values())
    assert result.code == 0
    assert result.scalar("track_verdicts") == 0.0
    rows = result.rows("track_upper", width=7, count=STEPS)
    assert len(rows) == STEPS
    assert rows[-1][0] == pytest.approx(6.0)
    assert rows[59] == rows[-1]
    assert rows[:2] == (rows[0], rows[1])
    assert len(list(rows)) == STEPS
    with pytest.raises(IndexError):
        rows[STEPS]


def test_a_result_outlives_the_next_call(bundle: Bundle) -> None:
    first = bundle.call(_values())
    values = _values()
    values["initial_center"] = [0.0] * 21
    bundle.call(values)
    assert first.rows("track_upper", width=7, count=STEPS)[-1][0] == pytest.approx(6.0)


def test_a_default_left_out_after_use_is_the_default_again(bundle: Bundle) -> None:
    changed = bundle.call(_values() | {"acceleration_bound": [math.nan]})
    assert changed.scalar("status") == 4.0
    assert bundle.call(_values()).scalar("status") == 0.0


def test_queries_of_a_wrong_shape_are_refused(bundle: Bundle) -> None:
    values = _values()
    with pytest.raises(InputError, match="has no field 'speed'"):
        bundle.call(values | {"speed": [1.0]})
    with pytest.raises(InputError, match="'initial_radius': expected 21 numbers, got 6"):
        bundle.call(values | {"initial_radius": [0.0] * 6})
    with pytest.raises(InputError, match="'people_tubes': expected 640 numbers, got 641"):
        bundle.call(values | {"people_tubes": [0.0] * 641})
    del values["people_count"]
    with pytest.raises(InputError, match=r"lacks \['people_count'\]"):
        bundle.call(values)


def test_what_is_left_out_of_the_crowd_is_zero_also_after_a_longer_one(bundle: Bundle) -> None:
    somebody = _values() | {"people_count": [1.0], "tubes_count": [1.0]}
    full = bundle.call(somebody | {"people_pieces": [math.nan] * 9216})
    assert full.scalar("status") == 4.0
    short = bundle.call(somebody | {"people_tubes": [0.0, 0.0, 9.0, 0.0, 1.0], "people_pieces": ()})
    assert short.scalar("status") == 0.0
    assert short.scalar("track_intent") < 0.0


def test_two_bundles_in_one_process_keep_their_own_code(tmp_path: Path) -> None:
    slower = fake_source().replace("slow = c[3]", "slow = 0.5 * c[3]")
    first = load_bundle(write_bundle(tmp_path / "a"))
    other = load_bundle(
        write_bundle(
            tmp_path / "b", library=compiled(slower.replace("fast = c[3]", "fast = 0.5 * c[3]")),
            change=lambda m: replace(m, golden=m.golden[1:]),
        )
    )  # fmt: skip
    assert first.call(_values()).rows("track_upper", width=7, count=STEPS)[-1][0] > 5.9
    assert other.call(_values()).rows("track_upper", width=7, count=STEPS)[-1][0] < 3.1


def test_the_loaded_bytes_are_the_hashed_ones_even_if_the_file_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_bundle(tmp_path)
    load = ctypes.CDLL

    def swap(path: str, mode: int) -> ctypes.CDLL:
        (folder / "kernel.so").write_bytes(b"changed after the check")
        assert mode == os.RTLD_NOW | os.RTLD_LOCAL
        assert str(folder) not in path
        return load(path, mode=mode)

    monkeypatch.setattr(ctypes, "CDLL", swap)
    assert load_bundle(folder).call(_values()).code == 0


def test_without_memfd_a_private_file_serves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(os, "memfd_create", raising=False)
    seen = []
    load = ctypes.CDLL

    def look(path: str, mode: int) -> ctypes.CDLL:
        seen.append((Path(path).stat().st_mode & 0o777, Path(path).parent.stat().st_mode & 0o777))
        return load(path, mode=mode)

    monkeypatch.setattr(ctypes, "CDLL", look)
    assert load_bundle(write_bundle(tmp_path)).call(_values()).code == 0
    assert seen == [(0o500, 0o700)]


@pytest.mark.parametrize(
    ("was", "becomes", "message"),
    [
        ("wb_work_size", "wb_work_sizes", "does not export wb_work_size"),
        ("int wb_decide", "int wb_decided", "does not export wb_decide"),
        ("return QUERY_SIZE;", "return QUERY_SIZE - 1;", r"wb_query_size\(\) of kernel.so says"),
        ("return RESULT_SIZE;", "return 1;", r"wb_result_size\(\) of kernel.so says 1, the man"),
        ("return 4;", "return 5;", r"wb_work_size\(\) of kernel.so says 5, the manifest says 4"),
        ("d[1];", "d[1] + 1e-9;", "golden vector 0: track_occupancy"),
        ("result[R_status] = 4.0; r", "result[R_status] = 3.0; r", "golden vector 1: status"),
        ("result[i] = 0.0;", "result[i] = -0.0;", "golden vector 0: status"),
        ("#include <math.h>", "#include <math.h>\nextern int absent(void);\n#define hypot(a, b) "
         "(hypot(a, b) + absent())", "cannot be loaded"),
        ("if (kind == 1) return 7;", "return 3;", "expected the kernel to return 0, got 3"),
        ("work[0] = r[T_intent];", "fesetround(FE_UPWARD);", "rounding is not to nearest"),
    ],
)  # fmt: skip
def test_a_library_that_differs_from_its_manifest_is_refused(
    tmp_path: Path, was: str, becomes: str, message: str
) -> None:
    source = fake_source()
    assert was in source
    folder = write_bundle(tmp_path, library=compiled(source.replace(was, becomes)))
    try:
        with pytest.raises(InputError, match=message):
            load_bundle(folder)
    finally:
        ctypes.CDLL(None).fesetround(0)


def test_a_golden_vector_that_is_off_by_one_bit_is_refused(tmp_path: Path) -> None:
    def change(manifest: Manifest) -> Manifest:
        golden = manifest.golden[0]
        place = next(f.offset for f in manifest.result if f.name == "track_upper")
        nudged = list(golden.result)
        nudged[place] = math.nextafter(nudged[place], math.inf)
        return replace(manifest, golden=(replace(golden, result=tuple(nudged)),))

    with pytest.raises(InputError, match=r"golden vector 0: track_upper\[0\] is 0x.*promised 0x"):
        load_bundle(write_bundle(tmp_path, change=change))


def test_bit_comparison_counts_nans_as_one_and_signs_of_zero_as_two() -> None:
    assert first_difference((1.0, math.nan, 0.0), (1.0, -math.nan, 0.0)) is None
    assert first_difference((1.0, 0.0), (1.0, -0.0)) == 1
    assert first_difference((math.nan,), (1.0,)) == 0
    assert first_difference((math.inf,), (-math.inf,)) == 0


def test_the_rounding_mode_is_noticed() -> None:
    modes = _ROUNDING.get(fake_manifest().machine)
    if modes is None:
        pytest.skip("rounding modes of this machine are not known here")
    library = ctypes.CDLL(None)
    try:
        for mode in modes:
            assert library.fesetround(mode) == 0
            assert float_mode_fault() == "rounding is not to nearest"
    finally:
        library.fesetround(0)
    assert float_mode_fault() is None


def test_a_library_that_flushes_subnormals_to_zero_is_refused(tmp_path: Path) -> None:
    # As old compilers' -ffast-math does; the process keeps that mode, hence one apart.
    if fake_manifest().machine != "x86_64":
        pytest.skip("needs the control register of x86_64")
    source = fake_source() + (
        "\n#include <xmmintrin.h>\n__attribute__((constructor)) static void fast(void)"
        "{ _mm_setcsr(_mm_getcsr() | 0x8040); }\n"
    )
    folder = write_bundle(tmp_path, library=compiled(source, FLAGS))
    code = f"from workbench.runtime import load_bundle; load_bundle({str(folder)!r})"
    outcome = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert outcome.returncode == 1
    assert "InputError" in outcome.stderr
    assert "(FTZ or DAZ is set) after kernel.so was loaded" in outcome.stderr
