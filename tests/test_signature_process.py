"""Only a process that verified this very signature counts as one: no crash, no silence, no echo."""

from __future__ import annotations

import ast
import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest
from ed25519_reference import ORDER, verifies
from hypothesis import given
from hypothesis import strategies as st
from signed_cases import KEY, OTHER_KEY, OTHER_SEED, SEED, all_bits

from workbench.cli.private_key import signed
from workbench.errors import InputError
from workbench.runtime import signature
from workbench.runtime.signature import Answer, Signature, check_signature, signature_from
from workbench.runtime.signature_process import (
    NO_LIBRARY,
    REFUSED,
    VERIFIED,
    answer_line,
    status_of,
)

ROOT = Path(__file__).parent.parent
PROGRAM = ROOT / "workbench" / "runtime" / "signature_process.py"
PATH = Path("bundle/SHA256SUMS.sig")
MESSAGE = b"what SHA256SUMS may hold\n"
SIGNATURE = signed(MESSAGE, SEED)[0]
REQUEST = KEY.raw + SIGNATURE.raw + MESSAGE
WRONG = KEY.raw + SIGNATURE.raw + b"something else\n"
YES = answer_line(VERIFIED, REQUEST)
NO = answer_line(REFUSED, REQUEST)

# RFC 8032, 7.1, tests 1 to 3: secret key, public key, message, signature.
VECTORS = [
    (
        "9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60",
        "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a",
        "",
        "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555fb8821590a33bacc61e39701"
        "cf9b46bd25bf5f0595bbe24655141438e7a100b",
    ),
    (
        "4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb",
        "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c",
        "72",
        "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da085ac1e43e15996e458f3613d"
        "0f11d8c387b2eaeb4302aeeb00d291612bb0c00",
    ),
    (
        "c5aa8df43f9f837bedb7442f31dcb7b166d38535076f094b85ce3a2e0b4458f7",
        "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025",
        "af82",
        "6291d657deec24024827e69c3abe01a30ce548a284743a445e3680d7db5ac3ac18ff9b538d16f290ae67f7609"
        "84dc6594a7c15e9716ed28dc027beceea1ec40a",
    ),
]


def process(request: bytes, *options: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-I", *options, PROGRAM], input=request, capture_output=True, check=False
    )


@pytest.mark.parametrize(("secret", "public", "message", "expected"), VECTORS)
def test_signatures_are_those_of_the_standard(
    secret: str, public: str, message: str, expected: str
) -> None:
    made, key = signed(bytes.fromhex(message), bytes.fromhex(secret))
    assert (made.raw.hex(), key.raw.hex()) == (expected, public)
    assert status_of(key.raw + made.raw + bytes.fromhex(message)) == VERIFIED


def test_a_plain_implementation_of_the_standard_agrees() -> None:
    cases = [(KEY.raw, SIGNATURE.raw, MESSAGE), (OTHER_KEY.raw, SIGNATURE.raw, MESSAGE)]
    cases += [(KEY.raw, signed(MESSAGE, OTHER_SEED)[0].raw, MESSAGE)]
    cases += [(KEY.raw, raw, MESSAGE) for raw in list(all_bits(SIGNATURE.raw))[::61]]
    for key, raw, message in cases:
        assert verifies(key, message, raw) == (status_of(key + raw + message) == VERIFIED)
    assert verifies(KEY.raw, MESSAGE, SIGNATURE.raw)


def test_a_signature_has_one_form_only() -> None:
    """S + order fits the equation as well, and must not pass as another signature."""
    scalar = int.from_bytes(SIGNATURE.raw[32:], "little") + ORDER
    other = SIGNATURE.raw[:32] + scalar.to_bytes(32, "little")
    assert status_of(KEY.raw + other + MESSAGE) == REFUSED


def test_a_key_that_anybody_can_sign_for_verifies_nothing() -> None:
    """Of the group's neutral point, R neutral and S = 0 fit every message."""
    neutral = (1).to_bytes(32, "little")
    assert verifies(neutral, MESSAGE, neutral + bytes(32))
    assert status_of(neutral + neutral + bytes(32) + MESSAGE) == REFUSED


def test_the_process_answers_with_status_and_line_of_this_request() -> None:
    right, wrong = process(REQUEST), process(WRONG)
    assert (right.returncode, right.stdout, right.stderr) == (VERIFIED, YES, b"")
    assert (wrong.returncode, wrong.stdout) == (REFUSED, answer_line(REFUSED, WRONG))
    assert b"verified %b\n" % hashlib.sha256(REQUEST).hexdigest().encode() == YES
    for short in (b"", REQUEST[:32], REQUEST[:95]):
        assert process(short).returncode == REFUSED


def test_without_the_library_the_process_says_so() -> None:
    done = process(REQUEST, "-S")
    assert (done.returncode, done.stdout) == (NO_LIBRARY, b"")
    assert done.stderr == b"No module named 'nacl'\n"


def test_the_right_answer_is_accepted_and_the_wrong_refused() -> None:
    check_signature(MESSAGE, SIGNATURE, key=KEY, path=PATH)
    with pytest.raises(InputError, match=r"SHA256SUMS.sig: expected the signature .* does not fit"):
        check_signature(b"something else\n", SIGNATURE, key=KEY, path=PATH)


def refuses(answer: Answer, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(signature, "ask", lambda _request: answer)
    with pytest.raises(InputError) as caught:
        check_signature(MESSAGE, SIGNATURE, key=KEY, path=PATH)
    return str(caught.value)


@pytest.mark.parametrize(
    ("status", "out"),
    [
        (VERIFIED, b""),
        (VERIFIED, YES[:-1]),
        (VERIFIED, YES + b"\n"),
        (VERIFIED, YES + YES),
        (VERIFIED, b"a warning\n" + YES),
        (VERIFIED, YES.upper()),
        (VERIFIED, YES.split(b" ")[0] + b"\n"),
        (VERIFIED, answer_line(VERIFIED, WRONG)),
        (VERIFIED, NO),
        (VERIFIED, NO + YES),
        (VERIFIED, REQUEST),
        (REFUSED, YES),
        (REFUSED, b""),
        (1, YES),
        (2, YES),
        (NO_LIBRARY, YES),
        (-11, YES),
        (256, YES),
    ],
)
def test_any_other_answer_is_none(status: int, out: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    said = refuses(Answer(status, out, b"Traceback\nSomeError: why\n"), monkeypatch)
    assert said.startswith(
        "bundle/SHA256SUMS.sig: expected an answer about this signature, got none "
        f"(exit status {status}, SomeError: why); install"
    )


@given(st.integers(-64, 300), st.binary(max_size=80) | st.sampled_from([YES, NO, YES[:-1]]))
def test_no_pair_of_status_and_output_but_one_is_accepted(status: int, out: bytes) -> None:
    with pytest.MonkeyPatch.context() as monkeypatch:
        answer = Answer(status, out, b"")
        if (status, out) == (VERIFIED, YES):
            monkeypatch.setattr(signature, "ask", lambda _request: answer)
            check_signature(MESSAGE, SIGNATURE, key=KEY, path=PATH)
        else:
            refuses(answer, monkeypatch)


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("import os; os.kill(os.getpid(), 9)", r"got none \(exit status -9\)"),
        ("import os; os._exit(0)", r"got none \(exit status 0\)"),
        ("", r"got none \(exit status 0\)"),
        ("import nacl.absent", r"exit status 1, ModuleNotFoundError: No module named 'nacl.absent"),
        ("syntax error", "exit status 1, SyntaxError"),
        ("import sys; sys.stdout.buffer.write(sys.stdin.buffer.read())", "exit status 0"),
        ("import sys; sys.stdin.close(); print('verified')", "exit status 0"),
        ("import time; time.sleep(60)", "within 0.5 s, got none; try again on a machine"),
    ],
)
def test_a_process_that_fails_in_whatever_way_verifies_nothing(
    program: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "program.py").write_text(program)
    monkeypatch.setattr(signature, "_PROGRAM", tmp_path / "program.py")
    monkeypatch.setattr(signature, "_PATIENCE_S", 0.5 if "sleep" in program else 20.0)
    with pytest.raises(InputError, match=said):
        check_signature(MESSAGE, SIGNATURE, key=KEY, path=PATH)


@pytest.mark.parametrize(
    ("python", "said"),
    [
        ("/absent/python", "expected to start /absent/python .*No such file"),
        (os.devnull, "Permission denied"),
        ("", "got no sys.executable"),
    ],
)
def test_a_process_that_cannot_start_verifies_nothing(
    python: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", python)
    with pytest.raises(InputError, match=said):
        check_signature(MESSAGE, SIGNATURE, key=KEY, path=PATH)


def test_neither_environment_nor_working_folder_changes_what_the_process_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    yes = "import sys, hashlib; print('verified', hashlib.sha256(sys.stdin.buffer.read())"
    for name in ("nacl", "hashlib", "sitecustomize"):
        (tmp_path / f"{name}.py").write_text(f"{yes}.hexdigest()); sys.exit(0)\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("PYTHONSTARTUP", str(tmp_path / "nacl.py"))
    check_signature(MESSAGE, SIGNATURE, key=KEY, path=PATH)
    with pytest.raises(InputError, match="does not fit"):
        check_signature(b"something else\n", SIGNATURE, key=KEY, path=PATH)


def test_a_signature_file_has_one_form() -> None:
    text = SIGNATURE.text()
    assert signature_from(text, PATH) == SIGNATURE
    others = [text[:-1], text + b"\n", text.upper(), text.replace(b"\n", b"\r\n"), b" " + text]
    for other in [*others, b"", text.replace(b"key", b"\nkey"), text.replace(b" 1 ", b" 2 ")]:
        with pytest.raises(InputError, match="expected three lines as `workbench sign` writes"):
            signature_from(other, PATH)


def test_the_name_of_another_key_is_refused_without_a_question(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(signature, "ask", lambda _request: pytest.fail("asked"))
    with pytest.raises(InputError, match=f"got one by {OTHER_KEY.key_id}"):
        check_signature(MESSAGE, Signature(OTHER_KEY.key_id, SIGNATURE.raw), key=KEY, path=PATH)


def test_the_library_is_imported_by_the_process_and_the_signing_commands_alone() -> None:
    found = set()
    for path in (ROOT / "workbench").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [each.name for each in node.names] if isinstance(node, ast.Import) else []
            if any(name.partition(".")[0] == "nacl" for name in names):
                found.add(str(path.relative_to(ROOT / "workbench")))
    assert found == {"cli/private_key.py", "runtime/signature_process.py"}
