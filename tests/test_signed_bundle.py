"""A signed bundle loads; every flipped byte of it, a foreign signature or key is refused before."""

from __future__ import annotations

import ctypes
import io
import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from runtime_fixture import write_bundle
from signed_cases import (
    KEY,
    NAMES,
    OTHER_KEY,
    OTHER_SEED,
    all_bits,
    ask_here,
    fake_files,
    flipped,
    one_bit_per_byte,
    signed_again,
    write_files,
    write_public_key,
)

from workbench.errors import InputError
from workbench.runtime import bundle as loading
from workbench.runtime import load_bundle, signature
from workbench.runtime.contents import CHECKED_FILES, CHECKSUM_FILE, LIBRARY_FILE, MANIFEST_FILE
from workbench.runtime.manifest import checksums_text, manifest_to_json
from workbench.runtime.signature import SIGNATURE_FILE
from workbench.runtime.signed_bundle import load_signed_bundle, signed_bundle_of

ROOT = Path(__file__).parent.parent
NOWHERE = Path("bundle")
ALL_BITS = (SIGNATURE_FILE, CHECKSUM_FILE)
# Every bit of these is flipped below; of the others one bit per byte here, all in the campaign.
assert set(ALL_BITS) | set(CHECKED_FILES) == set(NAMES)


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_files(tmp_path / "bundle", fake_files())


@pytest.fixture
def key(tmp_path: Path) -> Path:
    return write_public_key(tmp_path / "keys" / "vehicle.pub")


@pytest.fixture
def no_loading(monkeypatch: pytest.MonkeyPatch) -> None:
    """The library is neither opened nor called, by whatever name."""

    def stand_in(*_arguments: Any, **_named: Any) -> None:
        pytest.fail("the library was loaded")

    fake_files()
    monkeypatch.setattr(ctypes, "CDLL", stand_in)
    monkeypatch.setattr(loading, "NativeKernel", stand_in)


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signature, "ask", ask_here)


def refused(files: dict[str, bytes]) -> str:
    with pytest.raises(InputError) as caught:
        signed_bundle_of(files, key=KEY, folder=NOWHERE)
    return str(caught.value)


def test_the_untouched_bundle_loads_as_without_its_signature(bundle: Path, key: Path) -> None:
    loaded = load_signed_bundle(bundle, key).manifest
    assert manifest_to_json(loaded) == manifest_to_json(load_bundle(bundle).manifest)
    (bundle / "notes.txt").write_text("files that nobody lists are nobody's business")
    assert load_signed_bundle(bundle, key).manifest.name == "fake"


def test_the_stand_ins_see_a_library_that_is_loaded(no_loading: None, in_process: None) -> None:
    with pytest.raises(pytest.fail.Exception, match="the library was loaded"):
        signed_bundle_of(fake_files(), key=KEY, folder=NOWHERE)


@pytest.mark.parametrize("name", ALL_BITS)
def test_every_flipped_bit_of_signature_and_checksums_is_refused(
    name: str, no_loading: None, in_process: None
) -> None:
    for changed in all_bits(fake_files()[name]):
        assert SIGNATURE_FILE in refused(fake_files() | {name: changed})


@pytest.mark.parametrize("name", CHECKED_FILES)
def test_a_flipped_bit_in_every_byte_of_the_other_files_is_refused(
    name: str, no_loading: None, in_process: None
) -> None:
    for changed in one_bit_per_byte(fake_files()[name]):
        assert f"{name} and its line" in refused(fake_files() | {name: changed})


@pytest.mark.parametrize("name", NAMES)
def test_flipped_files_are_refused_from_the_folder_by_the_process_too(
    name: str, bundle: Path, key: Path, no_loading: None
) -> None:
    content = fake_files()[name]
    for place in (0, len(content) // 2, len(content) - 1):
        (bundle / name).write_bytes(flipped(content, place, place % 8))
        with pytest.raises(InputError, match=name):
            load_signed_bundle(bundle, key)


def test_every_flipped_bit_of_the_installed_key_is_refused(
    bundle: Path, key: Path, no_loading: None, in_process: None
) -> None:
    for changed in all_bits(key.read_bytes()):
        key.write_bytes(changed)
        with pytest.raises(InputError, match=r"vehicle.pub|by the installed key"):
            load_signed_bundle(bundle, key)


def test_who_changes_a_file_and_its_hash_is_refused(
    bundle: Path, key: Path, no_loading: None
) -> None:
    files = {name: fake_files()[name] for name in CHECKED_FILES}
    files[LIBRARY_FILE] += b"and more"
    write_files(bundle, files | {CHECKSUM_FILE: checksums_text(files).encode()})
    with pytest.raises(InputError, match="that does not fit; one of the two was changed after"):
        load_signed_bundle(bundle, key)


def test_another_key_and_another_bundles_signature_are_refused(
    bundle: Path, key: Path, tmp_path: Path, no_loading: None
) -> None:
    write_files(bundle, signed_again(fake_files(), OTHER_SEED))
    ours, others = KEY.key_id, OTHER_KEY.key_id
    with pytest.raises(InputError, match=f"installed key {ours}, got one by {others}"):
        load_signed_bundle(bundle, key)
    claimed = fake_files()[SIGNATURE_FILE].split(b"\n")
    forged = (bundle / SIGNATURE_FILE).read_bytes().split(b"\n")
    (bundle / SIGNATURE_FILE).write_bytes(b"\n".join([*claimed[:2], *forged[2:]]))
    with pytest.raises(InputError, match="does not fit"):
        load_signed_bundle(bundle, key)
    write_files(bundle, fake_files())
    with pytest.raises(InputError, match=f"installed key {others}, got one by {ours}"):
        load_signed_bundle(bundle, write_public_key(key, OTHER_KEY))
    older = write_bundle(tmp_path / "older", change=lambda m: replace(m, name="older"))
    files = signed_again({path.name: path.read_bytes() for path in older.iterdir()})
    (bundle / SIGNATURE_FILE).write_bytes(files[SIGNATURE_FILE])
    with pytest.raises(InputError, match="does not fit"):
        load_signed_bundle(bundle, write_public_key(key))


@pytest.mark.parametrize("name", NAMES)
def test_a_cut_lengthened_missing_or_linked_file_is_named(
    name: str, bundle: Path, key: Path, tmp_path: Path, no_loading: None
) -> None:
    path, content = bundle / name, fake_files()[name]
    for changed in (content[:-1], content[1:], b"", content + b"\n", content + content):
        path.write_bytes(changed)
        with pytest.raises(InputError, match=name):
            load_signed_bundle(bundle, key)
    path.unlink()
    with pytest.raises(InputError, match=f"{name}.*(No such file|sign it with)"):
        load_signed_bundle(bundle, key)
    (tmp_path / name).write_bytes(content)
    path.symlink_to(tmp_path / name)
    with pytest.raises(InputError, match=f"{name}: expected a regular file, got a symbolic link"):
        load_signed_bundle(bundle, key)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(InputError, match=f"{name}: expected a regular file, got a folder, pipe"):
        load_signed_bundle(bundle, key)


def test_a_linked_folder_is_followed_and_none_is_said_so(
    bundle: Path, key: Path, tmp_path: Path
) -> None:
    (tmp_path / "current").symlink_to(bundle)
    assert load_signed_bundle(tmp_path / "current", key).manifest.name == "fake"
    for place in (tmp_path / "absent", bundle / MANIFEST_FILE / "deeper"):
        with pytest.raises(InputError, match="expected a bundle folder, found none"):
            load_signed_bundle(place, key)


def test_a_key_inside_the_bundle_is_none(
    bundle: Path, key: Path, tmp_path: Path, no_loading: None
) -> None:
    inside = write_public_key(bundle / "vehicle.pub")
    (tmp_path / "current").symlink_to(bundle)
    (tmp_path / "linked.pub").symlink_to(inside)
    for place in (inside, tmp_path / "current" / "vehicle.pub", tmp_path / "linked.pub"):
        with pytest.raises(InputError, match="expected a public key apart from the bundle"):
            load_signed_bundle(bundle, place)
    (tmp_path / "away.pub").symlink_to(key)
    with pytest.raises(InputError, match="got a symbolic link"):
        load_signed_bundle(bundle, tmp_path / "away.pub")


def test_each_file_is_opened_once_and_a_change_after_that_changes_nothing(
    bundle: Path, key: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A whole other bundle stands there when the signature is checked, nothing when it loads."""
    opened: Counter[str] = Counter()
    seen: list[Counter[str]] = []
    real_ask = signature.ask

    def counted(real: Callable[..., Any]) -> Callable[..., Any]:
        def count(path: Any, *rest: Any, **named: Any) -> Any:
            if str(path).startswith(f"{bundle}/"):
                opened[Path(path).name] += 1
            return real(path, *rest, **named)

        return count

    def ask(request: bytes) -> signature.Answer:
        seen.append(opened.copy())
        other = write_bundle(bundle, change=lambda m: replace(m, name="impostor"))
        assert load_bundle(other).manifest.name == "impostor"
        return real_ask(request)

    monkeypatch.setattr(os, "open", counted(os.open))
    monkeypatch.setattr(io, "open", counted(io.open))
    monkeypatch.setattr(signature, "ask", ask)
    (bundle / MANIFEST_FILE).read_bytes()
    assert opened.pop(MANIFEST_FILE) == 1  # the count counts
    assert load_signed_bundle(bundle, key).manifest.name == "fake"
    assert seen == [Counter(NAMES)]


def test_a_folder_that_vanishes_while_the_library_loads_changes_nothing(
    bundle: Path, key: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = ctypes.CDLL

    def load(*arguments: Any, **named: Any) -> ctypes.CDLL:
        shutil.rmtree(bundle)
        return real(*arguments, **named)

    monkeypatch.setattr(ctypes, "CDLL", load)
    assert load_signed_bundle(bundle, key).manifest.name == "fake"


def test_what_drives_never_holds_the_signature_library(bundle: Path, key: Path) -> None:
    code = (
        "import sys; from pathlib import Path; "
        "from workbench.runtime.signed_bundle import load_signed_bundle; "
        f"load_signed_bundle(Path({str(bundle)!r}), Path({str(key)!r})); "
        "print(sorted({'nacl', 'cffi', '_cffi_backend'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


@pytest.mark.campaign
@pytest.mark.parametrize("name", CHECKED_FILES)
def test_every_flipped_bit_of_every_file_is_refused(
    name: str, no_loading: None, in_process: None
) -> None:
    for changed in all_bits(fake_files()[name]):
        assert f"{name} and its line" in refused(fake_files() | {name: changed})


@pytest.fixture
def shipped() -> dict[str, bytes]:
    """The bundle of the shipped vehicle, signed; building it loads its library."""
    from decision_fixture import real_files

    return signed_again(real_files())


@pytest.mark.campaign
@pytest.mark.parametrize("name", NAMES)
def test_a_flipped_bit_in_every_byte_of_the_shipped_vehicles_bundle_is_refused(
    name: str, shipped: dict[str, bytes], no_loading: None, in_process: None
) -> None:
    for changed in one_bit_per_byte(shipped[name]):
        assert name in refused(shipped | {name: changed})
