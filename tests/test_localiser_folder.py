"""A localiser's folder is written whole or not at all, and loaded unchanged or refused."""

from __future__ import annotations

import dataclasses
import functools
import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from localiser_cases import files, spec
from signed_cases import KEY, signed_again, write_files, write_public_key

from workbench.cli.main import main
from workbench.cli.private_key import write_pair
from workbench.codegen import localiser as codegen_localiser
from workbench.codegen import whole_folder
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.localiser import write_localiser
from workbench.errors import InputError
from workbench.estimation.localisation_site import hall_path, load_site
from workbench.models.vehicle import gem_e2_path
from workbench.runtime.contents import CHECKSUM_FILE
from workbench.runtime.localiser.folder import FILES, LIBRARY_FILE, SOURCE_FILE, load_localiser
from workbench.runtime.localiser.numbers import (
    NUMBERS_FILE,
    Clocks,
    Numbers,
    numbers_from_json,
    numbers_to_json,
)
from workbench.runtime.manifest import checksums_text
from workbench.runtime.signature import SIGNATURE_FILE

finite = st.floats(1e-300, 1e300)


def numbers() -> Numbers:
    return numbers_from_json(files()[NUMBERS_FILE])


def summed(content: dict[str, bytes]) -> dict[str, bytes]:
    """The same files with checksums that fit."""
    listed = {name: content[name] for name in FILES}
    return content | {CHECKSUM_FILE: checksums_text(listed).encode()}


def with_numbers(change: Callable[[dict[str, object]], object]) -> dict[str, bytes]:
    said = json.loads(files()[NUMBERS_FILE])
    change(said)
    return summed(files() | {NUMBERS_FILE: json.dumps(said).encode()})


def test_what_was_built_is_loaded(tmp_path: Path) -> None:
    built = load_localiser(write_localiser(files(), tmp_path / "new", replaces=False),
                           public_key=None)  # fmt: skip
    assert built.numbers.site == spec().site
    assert built.numbers.vehicle == spec().vehicle
    assert built.numbers.clocks == spec().clocks


@given(numbers_of=st.lists(finite, min_size=9, max_size=9), x=st.floats(-1e300, 1e300))
def test_numbers_survive_the_file_to_the_last_bit(numbers_of: list[float], x: float) -> None:
    site, n = spec().site, numbers_of
    beacons = (dataclasses.replace(site.beacons[0], x_m=site.beacons[0].x_m + n[0] % 1.0),
               *site.beacons[1:])  # fmt: skip
    site = dataclasses.replace(
        site, beacons=beacons,
        antenna=dataclasses.replace(site.antenna, forward_m=x),
        ranges=dataclasses.replace(site.ranges, deviation_m=n[1], stray_m=n[2]),
        reports=dataclasses.replace(site.reports, speed_mps=n[3], speed_scale=n[4]),
        motion=dataclasses.replace(site.motion, heading_slip=n[5], zero_walk_rad=n[6]),
        limits=dataclasses.replace(site.limits, heading_rad=n[7], still_m=n[8]),
    )  # fmt: skip
    wanted = dataclasses.replace(numbers(), site=site)
    assert numbers_from_json(numbers_to_json(wanted).encode()) == wanted


@pytest.mark.parametrize("name", [*FILES, CHECKSUM_FILE])
def test_a_changed_or_missing_file_is_refused(tmp_path: Path, name: str) -> None:
    content = bytearray(files()[name])
    content[len(content) // 2] ^= 1
    place = write_files(tmp_path / "changed", files() | {name: bytes(content)})
    blamed = rf"{name}: expected the file whose hash SHA256SUMS lists"
    with pytest.raises(InputError, match="SHA256SUMS" if name == CHECKSUM_FILE else blamed):
        load_localiser(place, public_key=None)
    (place / name).unlink()
    with pytest.raises(InputError, match="it lacks"):
        load_localiser(place, public_key=None)


def test_other_lines_of_hashes_are_refused(tmp_path: Path) -> None:
    sums = files()[CHECKSUM_FILE]
    for text in (sums + sums, sums + b"\n", b"\n" + sums, b"".join(sums.splitlines(True)[::-1])):
        place = write_files(tmp_path / "sums", files() | {CHECKSUM_FILE: text})
        with pytest.raises(InputError, match="expected a line for each"):
            load_localiser(place, public_key=None)
    with pytest.raises(InputError, match="expected a folder of a localiser"):
        load_localiser(tmp_path / "none", public_key=None)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda said: said.update(machine="armv7l"), "built for armv7l"),
        (lambda said: said.update(format=9), "format: expected 1"),
        (lambda said: said.update(more=1), "unknown keys"),
        (lambda said: said.pop("vehicle"), "vehicle: expected this key"),
        (lambda said: said.update(level=0.5), "level: expected one of 0.9, 0.99, 0.999"),
        (lambda said: said["levels"].reverse(), "rising confidences"),
        (lambda said: said["golden"].pop(), "golden: expected one call of each"),
        (lambda said: said["golden"][3]["found"].__setitem__(0, "0x1p+3"), "recorded call of"),
        (lambda said: said["golden"][3]["found"].__setitem__(0, "x"), "float.hex"),
        (lambda said: said["site"]["limits"].update(heading_rad=-1.0), "heading_rad: expected"),
        (lambda said: said["site"]["beacons"].__delitem__(slice(2, None)), "at least 3"),
        (lambda said: said["site"]["beacons"].extend(
            {"name": f"b{k}", "x_m": 30 * (k % 2), "y_m": k, "height_m": 1} for k in range(60)),
         "expected at most 64"),
        (lambda said: said["vehicle"].update(wheelbase_m=0.0), "wheelbase_m"),
        (lambda said: said["vehicle"].update(speed_scale=0.9), "speed_scale"),
        (lambda said: said["vehicle"]["road_wheel"].update(command=[0.0, 0.0]), "curve"),
        (lambda said: said["clocks"].update(range_delay_us=[5, 3]), "delay_us"),
        (lambda said: said["clocks"].update(drift_ppm=-1), "drift_ppm"),
    ],
)  # fmt: skip
def test_numbers_that_cannot_be_are_refused(
    tmp_path: Path, change: Callable[[dict[str, object]], object], message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        load_localiser(write_files(tmp_path / "wrong", with_numbers(change)), public_key=None)
    assert "build-localiser" in str(caught.value) or "built for" in str(caught.value)
    assert "manifest.json" not in str(caught.value)


def test_text_that_is_no_json_is_refused() -> None:
    for text in (b"{", b'{"format": NaN}', b"\xff", b"[]"):
        with pytest.raises(InputError, match=r"localiser\.json"):
            numbers_from_json(text)


@pytest.mark.parametrize("late", [-1, 2_000_000])
def test_delays_that_cannot_be_are_refused(late: int) -> None:
    with pytest.raises(InputError, match="report_delay_us"):
        Clocks(report_delay_us=late, range_delay_us=(0, 1), drift_ppm=1)
    with pytest.raises(InputError, match="delay_us"):
        Clocks(report_delay_us=0, range_delay_us=(late, late), drift_ppm=1)


def test_only_the_installed_key_s_signature_loads(tmp_path: Path) -> None:
    key = write_public_key(tmp_path / "keys" / "key.pub", KEY)
    unsigned = write_files(tmp_path / "unsigned", files())
    with pytest.raises(InputError, match="expected a signed localiser"):
        load_localiser(unsigned, public_key=key)
    signed = write_files(tmp_path / "signed", signed_again(files()))
    assert load_localiser(signed, public_key=key).numbers == numbers()
    (signed / "key.pub").write_bytes(key.read_bytes())
    with pytest.raises(InputError, match="apart from the bundle"):
        load_localiser(signed, public_key=signed / "key.pub")
    other = write_files(tmp_path / "other", signed_again(files(), bytes(32)))
    with pytest.raises(InputError, match="expected a signature by the installed key"):
        load_localiser(other, public_key=key)
    changed = signed_again(files()) | {SOURCE_FILE: b"/* other */"}
    with pytest.raises(InputError, match="does not fit"):
        load_localiser(write_files(tmp_path / "c", summed(changed)), public_key=key)


def test_the_command_writes_once_and_replaces_only_a_localiser(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    quick = tuple("-O0" if flag == "-O2" else flag for flag in FLAGS)
    compiling = functools.partial(compile_shared, flags=quick)
    monkeypatch.setattr(codegen_localiser, "compile_shared", compiling)
    pair = tmp_path / "keys" / "car.key"
    pair.parent.mkdir()
    public, _ = write_pair(pair)
    out, words = tmp_path / "made" / "out", ["build-localiser", str(hall_path()), "--out"]
    assert main([*words, str(out), "--level", "0.99", "--key", str(pair), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["level"], said["signed"], len(said["beacons"])) == (0.99, True, 6)
    built = load_localiser(out, public_key=public).numbers
    hall = load_site(hall_path())
    # What a program that hears no commands must allow for.
    assert (built.site.motion.acceleration, built.site.motion.steering_rate) == (1.0, 0.2)
    assert dataclasses.replace(built.site, motion=hall.motion) == hall
    assert main([*words, str(out)]) == 2
    assert "exists" in capsys.readouterr().err
    assert load_localiser(out, public_key=public).numbers == built
    assert main([*words, str(out), "--force", "--shape", "union"]) == 0
    assert load_localiser(out, public_key=None).numbers.shape == "UnionBound"
    assert not (out / SIGNATURE_FILE).exists()
    (out / "notes.txt").write_text("mine")
    assert main([*words, str(out), "--force"]) == 2
    assert (out / "notes.txt").read_text() == "mine"
    assert os.listdir(out.parent) == ["out"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--range-delay", "0.03", "0.02"], "least <= most"),
        (["--range-delay", "-1", "0.02"], "--range-delay: expected 0 to 1 s"),
        (["--report-delay", "7"], "--report-delay"),
        (["--unheard", "nan", "1"], "--unheard"),
        (["--speed-scale", "0.7"], "speed_scale"),
        (["--key", "/none"], "/none"),
        (["--vehicle", "/none"], "no such vehicle file"),
        (["--vehicle", str(gem_e2_path())], "a vehicle file with [drive_by_wire]"),
    ],
)  # fmt: skip
def test_wrong_options_leave_nothing_behind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    out = tmp_path / "a" / "out"
    assert main(["build-localiser", str(hall_path()), "--out", str(out), *words]) == 2
    assert message in capsys.readouterr().err
    assert not out.parent.exists()


def test_a_write_that_fails_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = write_localiser(files(), tmp_path / "out", replaces=False)
    broken = dict(files()) | {"no/such": b""}
    with pytest.raises(OSError, match="no/such"):
        write_localiser(broken, out, replaces=True)
    assert os.listdir(tmp_path) == ["out"]
    assert load_localiser(out, public_key=None).numbers == numbers()
    monkeypatch.setattr(whole_folder.tempfile, "mkdtemp", _refused)
    with pytest.raises(InputError, match="cannot write a localiser"):
        write_localiser(files(), tmp_path / "new", replaces=False)


def _refused(**_: object) -> str:
    raise PermissionError(13, "Permission denied")


def test_the_library_is_compiled_from_the_source_beside_it() -> None:
    source = files()[SOURCE_FILE].decode()
    assert "wb_loc_collapse" in source
    assert not any(call in source for call in ("malloc", "calloc", "alloca", "printf"))
    assert files()[LIBRARY_FILE][:4] == b"\x7fELF"
