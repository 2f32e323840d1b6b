"""The kernel's C text stands alone: no warning, no heap, no state, and a header that fits it."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from decision_fixture import real_files, real_manifest

from workbench.codegen.compiler import FLAGS, find_compiler
from workbench.runtime.manifest import HEADER_FILE, SOURCE_FILE

_STRICT = ["-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-pedantic", "-Werror"]
_USER = """\
#include <stdio.h>
#include <stdlib.h>
#include "kernel.h"
int main(void) {
  double *query = calloc(WB_QUERY_SIZE, sizeof *query);
  double *result = calloc(WB_RESULT_SIZE, sizeof *result);
  double *work = calloc((size_t)wb_work_size(), sizeof *work);
  if (!query || !result || !work) return 1;
  if (wb_query_size() != WB_QUERY_SIZE || wb_result_size() != WB_RESULT_SIZE) return 2;
  if (wb_decide(query, result, work) != 0) return 3;
  printf("%g %g", result[WB_R_STATUS], result[WB_R_STOP_VERDICTS]);
  return 0;
}
"""


def _folder(tmp_path: Path) -> Path:
    for name in (SOURCE_FILE, HEADER_FILE):
        (tmp_path / name).write_bytes(real_files()[name])
    return tmp_path


def test_what_surrounds_the_generated_functions_compiles_without_a_warning(tmp_path: Path) -> None:
    # CasADi's own functions leave a parameter unused.
    command = [find_compiler(), "-std=c99", "-O2", *_STRICT, "-Wno-unused-parameter",
               "-c", SOURCE_FILE, "-o", "kernel.o"]  # fmt: skip
    done = subprocess.run(command, cwd=_folder(tmp_path), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_program_in_c_uses_the_header(tmp_path: Path) -> None:
    """An empty query is refused: status BAD_INPUT, verdict INVALID."""
    folder = _folder(tmp_path)
    (folder / "user.c").write_text(_USER)
    flags = [flag for flag in FLAGS if flag not in ("-shared", "-fPIC")]
    command = [find_compiler(), *flags, *_STRICT, "-Wno-unused-parameter",
               "user.c", SOURCE_FILE, "-o", "user", "-lm"]  # fmt: skip
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    answer = subprocess.run([folder / "user"], capture_output=True, text=True)
    assert (answer.returncode, answer.stdout) == (0, "4 2")


def test_the_header_says_where_every_field_is() -> None:
    header, manifest = real_files()[HEADER_FILE].decode(), real_manifest()
    macros = dict(re.findall(r"#define (WB_[QR]_\w+) (\d+)", header))
    told = {f"WB_Q_{f.name.upper()}": f.offset for f in manifest.query}
    told |= {f"WB_R_{f.name.upper()}": f.offset for f in manifest.result}
    assert {name: int(value) for name, value in macros.items()} == told
    assert header in real_files()[SOURCE_FILE].decode()


@pytest.mark.parametrize("word", ["malloc", "calloc", "realloc", "alloca", "printf", "goto"])
def test_there_is_no_heap_and_no_output(word: str) -> None:
    assert not re.search(rf"\b{word}\b", real_files()[SOURCE_FILE].decode())


def test_nothing_is_kept_between_calls() -> None:
    """Every object at file scope is constant."""
    text = real_files()[SOURCE_FILE].decode()
    objects = re.findall(r"^static [^(){};=]*\w+(?:\[[^\]]*\])*\s*=", text, re.M)
    assert len(objects) > 10
    assert not [each for each in objects if not each.startswith("static const ")]
