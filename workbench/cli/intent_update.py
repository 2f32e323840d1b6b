"""The quickest update of the intent filter that this machine has."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.estimation.intent_cloud import Update


@contextlib.contextmanager
def quick_update() -> Iterator[Update]:
    """The compiled update, or the one in NumPy on a machine without a compiler."""
    from workbench.codegen.compiler import find_compiler
    from workbench.estimation.intent_cloud import NumpyUpdate

    try:
        find_compiler()
    except InputError:
        yield NumpyUpdate()
        return
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        yield _compiled(Path(folder))


def _compiled(folder: Path) -> Update:
    from workbench.codegen.compiler import compile_shared
    from workbench.estimation.intent_kernel import CompiledUpdate, kernel_source

    library = folder / "intent.so"
    library.write_bytes(compile_shared(kernel_source()).shared_object)
    return CompiledUpdate(library)
