"""Keys are made once, kept private and refused where others can touch them; `sign` signs wholes."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from cli_fixture import invoke
from runtime_fixture import write_bundle
from signed_cases import KEY, SEED, all_bits, fake_files, write_files, write_public_key

from workbench.cli.private_key import read_private_key, write_pair
from workbench.errors import InputError
from workbench.runtime import signature
from workbench.runtime.contents import CHECKED_FILES, CHECKSUM_FILE, MANIFEST_FILE
from workbench.runtime.keys import (
    PRIVATE,
    PUBLIC,
    PublicKey,
    default_private_key,
    default_public_key,
    read_public_key,
)
from workbench.runtime.manifest import checksums_text
from workbench.runtime.signature import SIGNATURE_FILE
from workbench.runtime.signed_bundle import load_signed_bundle


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_bundle(tmp_path / "bundle")


@pytest.fixture
def private(tmp_path: Path) -> Path:
    path = tmp_path / "bundle.key"
    path.write_bytes(PRIVATE.text(SEED))
    path.chmod(0o600)
    return path


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def refusal(*words: object) -> str:
    result = invoke(*words)
    assert (result.status, result.out) == (2, "")
    assert result.err.count("\n") == 1
    return result.err


def test_keygen_sign_and_load_fit_together(tmp_path: Path, bundle: Path) -> None:
    made = invoke("keygen", "--key", tmp_path / "new" / "shuttle.key", "--json").data
    private, public = Path(made["private_key"]), Path(made["public_key"])
    assert (mode(private), mode(public), mode(private.parent)) == (0o600, 0o644, 0o700)
    done = invoke("sign", "--bundle", bundle, "--key", private, "--json").data
    assert done == {
        "key_id": made["key_id"], "name": "fake", "signature": str(bundle / SIGNATURE_FILE),
    }  # fmt: skip
    assert read_public_key(public).key_id == made["key_id"]
    assert load_signed_bundle(bundle, public).manifest.name == "fake"
    assert {path.name for path in bundle.iterdir()} == {
        *CHECKED_FILES, CHECKSUM_FILE, SIGNATURE_FILE,
    }  # fmt: skip
    assert made["key_id"] in invoke("sign", "--bundle", bundle, "--key", private).out


@pytest.mark.parametrize("umask", [0o000, 0o002, 0o077, 0o777])
def test_the_modes_of_new_keys_depend_on_no_umask(tmp_path: Path, umask: int) -> None:
    old = os.umask(umask)
    try:
        public, _ = write_pair(tmp_path / "a.key")
    finally:
        os.umask(old)
    assert (mode(tmp_path / "a.key"), mode(public)) == (0o600, 0o644)


def test_two_keys_differ_and_no_output_holds_the_private_one(tmp_path: Path) -> None:
    outputs = [invoke("keygen", "--key", tmp_path / name) for name in ("a", "b")]
    seeds = [read_private_key(tmp_path / name) for name in ("a", "b")]
    assert seeds[0] != seeds[1]
    for seed, made in zip(seeds, outputs, strict=True):
        secret = PRIVATE.text(seed).decode().split("\n")[1]
        assert secret not in made.out + made.err
        assert seed.hex() not in made.out + made.err


@pytest.mark.parametrize("taken", ["a.key", "a.key.pub"])
def test_keygen_replaces_nothing(tmp_path: Path, taken: str) -> None:
    for make in (lambda path: path.write_text("mine"), lambda path: path.symlink_to("nowhere")):
        make(tmp_path / taken)
        said = refusal("keygen", "--key", tmp_path / "a.key")
        assert f"expected no file {tmp_path / taken}, and there is one" in said
        assert [path.name for path in tmp_path.iterdir()] == [taken]
        (tmp_path / taken).unlink()


@pytest.mark.parametrize("fails", [1, 2])
def test_an_interrupted_keygen_leaves_no_half_of_a_pair(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: int
) -> None:
    calls = iter(range(1, 9))

    def fsync(_descriptor: int) -> None:
        if next(calls) == fails:
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(KeyboardInterrupt):
        write_pair(tmp_path / "a.key")
    assert list(tmp_path.iterdir()) == []


def test_a_public_key_that_appears_meanwhile_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", lambda _: (tmp_path / "a.key.pub").write_text("mine"))
    with pytest.raises(InputError, match=r"expected no file .*a.key.pub, and there is one"):
        write_pair(tmp_path / "a.key")
    assert [path.name for path in tmp_path.iterdir()] == ["a.key.pub"]


def test_a_place_that_takes_no_keys_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    said = refusal("keygen", "--key", tmp_path / "file" / "a.key")
    assert "expected a place where keys can be written" in said


@pytest.mark.parametrize("bits", [0o604, 0o640, 0o644, 0o620, 0o602, 0o601, 0o610, 0o777])
def test_a_private_key_that_others_may_open_signs_nothing(
    bundle: Path, private: Path, bits: int
) -> None:
    private.chmod(bits)
    said = refusal("sign", "--bundle", bundle, "--key", private)
    assert f"got mode {bits:04o}; if nobody can have copied it, chmod 600" in said
    assert not (bundle / SIGNATURE_FILE).exists()


@pytest.mark.parametrize("bits", [0o664, 0o646, 0o622, 0o777])
def test_a_public_key_that_others_may_write_is_none(tmp_path: Path, bits: int) -> None:
    path = write_public_key(tmp_path / "a.pub")
    path.chmod(bits)
    with pytest.raises(InputError, match=rf"only its owner may write, got mode {bits:04o}"):
        read_public_key(path)


@pytest.mark.parametrize("form", [PUBLIC, PRIVATE])
def test_a_key_file_has_one_form(form: object) -> None:
    assert form in (PUBLIC, PRIVATE)
    kind = PUBLIC if form is PUBLIC else PRIVATE
    text = kind.text(SEED)
    assert kind.key(text) == SEED
    for changed in all_bits(text):
        assert kind.key(changed) != SEED
    others = (b"", b"\n", text[:-1], text + b"\n", text.replace(b"\n", b"\r\n"), text.lower())
    for other in (*others, kind.text(SEED[:-1]), kind.text(SEED + b"0")):
        assert kind.key(other) is None


def test_mixed_up_key_files_are_named_without_a_byte_of_them(
    tmp_path: Path, bundle: Path, private: Path
) -> None:
    public = write_public_key(tmp_path / "a.pub")
    private.chmod(0o600)
    with pytest.raises(InputError, match=r"expected an Ed25519 public key .* got a private key"):
        read_public_key(private)
    public.chmod(0o600)
    said = refusal("sign", "--bundle", bundle, "--key", public)
    assert "expected an Ed25519 private key as `workbench keygen` writes it, got a public" in said
    private.write_bytes(b"hunter2")
    private.chmod(0o600)
    said = refusal("sign", "--bundle", bundle, "--key", private)
    assert "got 7 bytes of another form" in said
    assert "hunter2" not in said
    private.unlink()
    private.symlink_to(public)
    assert "got a symbolic link" in refusal("sign", "--bundle", bundle, "--key", private)
    with pytest.raises(InputError, match="expected a public key of 32 bytes, got 31"):
        PublicKey(SEED[:31])


@pytest.mark.parametrize("name", [*CHECKED_FILES, CHECKSUM_FILE])
def test_sign_refuses_a_damaged_bundle_and_keeps_the_old_signature(
    bundle: Path, private: Path, name: str
) -> None:
    (bundle / SIGNATURE_FILE).write_text("an older one")
    content = (bundle / name).read_bytes()
    (bundle / name).write_bytes(content[:-2] + b"?\n")
    assert name in refusal("sign", "--bundle", bundle, "--key", private)
    (bundle / name).unlink()
    assert name in refusal("sign", "--bundle", bundle, "--key", private)
    assert (bundle / SIGNATURE_FILE).read_text() == "an older one"


def test_sign_refuses_what_has_right_hashes_but_no_manifest(bundle: Path, private: Path) -> None:
    (bundle / MANIFEST_FILE).write_text("{}")
    files = {name: (bundle / name).read_bytes() for name in CHECKED_FILES}
    (bundle / CHECKSUM_FILE).write_text(checksums_text(files))
    assert MANIFEST_FILE in refusal("sign", "--bundle", bundle, "--key", private)
    assert "found none" in refusal("sign", "--bundle", bundle / "absent", "--key", private)
    assert not (bundle / SIGNATURE_FILE).exists()


def test_sign_replaces_a_signature_whole_and_the_same_key_makes_the_same(
    bundle: Path, private: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_files(bundle, fake_files())
    expected = fake_files()[SIGNATURE_FILE]
    (bundle / SIGNATURE_FILE).write_text("an older one")
    real, replaced = os.replace, []

    def replace(source: Path, target: Path) -> None:
        replaced.append(Path(target))
        assert (bundle / SIGNATURE_FILE).read_text() == "an older one"
        assert Path(source).read_bytes() == expected
        real(source, target)

    monkeypatch.setattr(os, "replace", replace)
    assert invoke("sign", "--bundle", bundle, "--key", private).status == 0
    assert (bundle / SIGNATURE_FILE).read_bytes() == expected
    assert replaced == [bundle / SIGNATURE_FILE]


def test_sign_writes_nothing_that_a_vehicle_would_refuse(
    bundle: Path, private: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(signature, "ask", lambda _request: signature.Answer(0, b"", b""))
    said = refusal("sign", "--bundle", bundle, "--key", private)
    assert "expected an answer about this signature, got none" in said
    assert not (bundle / SIGNATURE_FILE).exists()


def test_keys_have_a_default_place_in_the_users_configuration(
    tmp_path: Path, bundle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for configured in ("", "relative"):
        monkeypatch.setenv("XDG_CONFIG_HOME", configured)
        assert default_private_key() == tmp_path / "home/.config/workbench/bundle.key"
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    assert invoke("keygen").status == 0
    assert invoke("sign", "--bundle", bundle).status == 0
    assert default_public_key() == tmp_path / "config/workbench/bundle.key.pub"
    assert load_signed_bundle(bundle, default_public_key()).manifest.name == "fake"


def test_openssl_reads_the_keys_and_verifies_the_signature(
    tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    openssl = require_tool("openssl")
    files = fake_files()
    public = write_public_key(tmp_path / "a.pub")
    (tmp_path / "a.key").write_bytes(PRIVATE.text(SEED))
    raw = bytes.fromhex(files[SIGNATURE_FILE].split(b"\n")[2].decode())
    (tmp_path / "raw").write_bytes(raw)
    (tmp_path / "sums").write_bytes(files[CHECKSUM_FILE])
    shown = subprocess.run(
        [openssl, "pkey", "-in", tmp_path / "a.key", "-pubout"], capture_output=True, check=True
    )
    assert shown.stdout == public.read_bytes() == PUBLIC.text(KEY.raw)
    verify = (openssl, "pkeyutl", "-verify", "-rawin", "-pubin", "-inkey", public, "-sigfile")
    for message, status in ((files[CHECKSUM_FILE], 0), (files[CHECKSUM_FILE] + b"\n", 1)):
        (tmp_path / "sums").write_bytes(message)
        done = subprocess.run([*verify, tmp_path / "raw", "-in", tmp_path / "sums"], check=False)
        assert done.returncode == status


def test_without_the_library_signing_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "nacl.signing", None)
    assert "expected PyNaCl, which signs" in refusal("keygen", "--key", tmp_path / "a.key")
    assert list(tmp_path.iterdir()) == []
