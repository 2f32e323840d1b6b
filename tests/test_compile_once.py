"""The tests' compiler front end keeps what was compiled, and never gives one text another's."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from compile_once import parts

FRONT = Path(__file__).parent / "compile_once.py"
FLAGS = ("-std=c99", "-O0", "-fPIC", "-shared")
TEXT = "int answer(void) { return 42; }\n"


@pytest.fixture
def compiler(tmp_path: Path) -> Path:
    """A compiler that notes each of its calls, and copies instead of compiling."""
    path = tmp_path / "fake-cc"
    path.write_text(
        '#!/bin/sh\necho called >> "$(dirname "$0")/calls"\n'
        "grep -q refused kernel.c && { echo no >&2; exit 3; }\n"
        "grep -q warned kernel.c && echo careful >&2\n"
        'while [ "$1" != -o ]; do shift; done\ncp kernel.c "$2"\n'
    )
    path.chmod(0o755)
    (tmp_path / "kept").mkdir()
    return path


def compiled(
    compiler: Path, text: str, *flags: str, made: str = "kernel.so"
) -> subprocess.CompletedProcess[str]:
    folder = compiler.parent
    (folder / "kernel.c").write_text(text)
    (folder / made).unlink(missing_ok=True)
    words = [str(compiler), str(folder / "kept"), *(flags or FLAGS), "-o", made, "kernel.c", "-lm"]
    return subprocess.run(
        [sys.executable, "-I", "-S", str(FRONT), *words],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip


def calls(compiler: Path) -> int:
    return len((compiler.parent / "calls").read_text().splitlines())


def test_the_same_is_compiled_once_under_whatever_name(compiler: Path) -> None:
    for made in ("kernel.so", "other.so", "kernel.so"):
        assert compiled(compiler, TEXT, made=made).returncode == 0
        assert (compiler.parent / made).read_text() == TEXT
    assert calls(compiler) == 1


def test_another_text_flag_or_compiler_is_compiled_anew(compiler: Path) -> None:
    compiled(compiler, TEXT)
    other = TEXT.replace("42", "43")
    compiled(compiler, other)
    assert (compiler.parent / "kernel.so").read_text() == other
    assert calls(compiler) == 2
    compiled(compiler, TEXT, *FLAGS, "-ffp-contract=off")
    assert calls(compiler) == 3
    compiler.write_text(compiler.read_text() + "# newer\n")
    compiled(compiler, TEXT)
    assert calls(compiler) == 4


@pytest.mark.parametrize(("word", "status", "said"), [("refused", 3, "no"), ("warned", 0, "caref")])
def test_what_was_refused_or_warned_about_is_so_again(
    compiler: Path, word: str, status: int, said: str
) -> None:
    for count in (1, 2):
        found = compiled(compiler, f"/* {word} */\n{TEXT}")
        assert found.returncode == status
        assert said in found.stderr
        assert calls(compiler) == count


@pytest.mark.parametrize(
    ("text", "flag"),
    [('#include "mine.h"\n', "-O0"), ("#include MINE\n", "-O0"), ("int at = __FILE__;", "-O0"),
     (TEXT, "-I."), (TEXT, "-DANSWER=1"), (TEXT, "-fstack-usage"), (TEXT, "-g")],
)  # fmt: skip
def test_what_depends_on_more_than_its_text_is_never_kept(
    compiler: Path, text: str, flag: str
) -> None:
    for count in (1, 2):
        compiled(compiler, text, *FLAGS, flag)
        assert calls(compiler) == count
    assert not list((compiler.parent / "kept").glob("*"))


@pytest.mark.parametrize(
    "words", [["a.c"], ["-o"], ["-o", "x"], ["-o", "x", "a.c", "b.c"], ["-o", "x", "a.c", "b.o"],
              ["-o", "x", "-", "-lm"], ["--version"], ["-o", "x", "-o", "y", "a.c"]],
)  # fmt: skip
def test_anything_but_one_file_into_one_is_unusual(words: list[str]) -> None:
    assert parts(words) is None
    assert parts(["-O2", "-o", "x", "a.c"]) == ("a.c", "x", ["-O2", "a.c"])


def test_the_run_shares_its_compiler_s_work(require_tool: Callable[..., str]) -> None:
    assert str(Path(require_tool("cc")).parent) == os.environ["TESTS_COMPILED_ONCE"]


def test_who_compiles_anew_finds_the_compiler_itself(
    require_tool: Callable[..., str], compile_anew: None
) -> None:
    assert str(Path(require_tool("cc")).parent) != os.environ["TESTS_COMPILED_ONCE"]
