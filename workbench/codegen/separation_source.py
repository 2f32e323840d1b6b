"""C text of the separation from people, and a compiled one that takes rectangles alone."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from typing import final

import casadi as ca
import numpy as np

from workbench.codegen.c_source import FLOOR, c_text, function_text
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.native_calls import load_function
from workbench.errors import InputError
from workbench.reach.person_clearance import BLOCK, Nearest
from workbench.reach.person_gap import separation_functions
from workbench.reach.tube import Array
from workbench.runtime.layout import NO_CLEARANCE_M, KernelCause
from workbench.runtime.person_tubes import (
    FOREVER_S,
    KIND_NUMBERS,
    MOST_PEOPLE,
    MOST_PIECES,
    MOST_TUBES,
    PIECE_LIMITS,
    PIECE_NUMBERS,
    TUBE_NUMBERS,
    TrackedPerson,
    TubeKind,
    packed,
)

NEAREST_NUMBERS = 5
"""Doubles per kind: clearance m, time s, person, tube of the person, cause."""
_DOUBLES = ctypes.POINTER(ctypes.c_double)


def separation_text() -> str:
    """Macros and hand-written C of the separation; `separation_functions` come in front of it."""
    limits = [(0.0, MOST_PIECES), *PIECE_LIMITS.values()]
    macros = {
        "MOST_PEOPLE": MOST_PEOPLE, "PERSON_TUBES": MOST_TUBES, "TUBE_PIECES": MOST_PIECES,
        "MOST_TUBES": MOST_PEOPLE * MOST_TUBES, "KINDS": len(KIND_NUMBERS), "BLOCK": BLOCK,
        "TUBE_NUMBERS": TUBE_NUMBERS, "PIECE_NUMBERS": PIECE_NUMBERS, "NEAREST": NEAREST_NUMBERS,
        "SEPARATION_SCRATCH": 1 + max(function.sz_w() for function in separation_functions()),
    }  # fmt: skip
    lines = [f"#define WB_{name} {value}" for name, value in macros.items()]
    lines += [
        f"#define WB_LONGEST_S {FOREVER_S.hex()}",
        "#ifndef WB_NO_CLEARANCE",
        f"#define WB_NO_CLEARANCE {NO_CLEARANCE_M!r}",
        "#endif",
        _numbers("wb_piece_least", [low for low, _ in limits]),
        _numbers("wb_piece_most", [high for _, high in limits]),
    ]
    return "\n".join([*lines, c_text("separate.c")])


def _numbers(name: str, values: Iterable[float]) -> str:
    texts = ", ".join(float(value).hex() for value in values)
    return f"static const double {name}[] = {{{texts}}};"


def alone_source(segments: int, functions: Sequence[ca.Function]) -> str:
    """Complete C text of `wb_separate` for up to `segments` rectangles."""
    return "\n".join([
        FLOOR, function_text(functions),
        "#include <math.h>\n#include <stddef.h>", f"#define WB_SEGMENTS {segments}",
        separation_text(), c_text("separate_alone.c"),
    ])  # fmt: skip


@final
class CompiledSeparation:
    """`nearest_people` compiled to C, for up to `segments` rectangles: the same bits.

    source: text in place of `alone_source`, to see what a changed one does.
    """

    def __init__(
        self, segments: int, *, source: str | None = None, flags: tuple[str, ...] = FLAGS
    ) -> None:
        self.segments = segments
        self.source = source or alone_source(segments, separation_functions())
        self.shared_object = compile_shared(self.source, flags=flags).shared_object
        self._entry = load_function(self.shared_object, "wb_separate")
        self._work = np.zeros(4 * MOST_PEOPLE * MOST_TUBES)
        self._tubes = 7 + 6 * segments
        self._pieces = self._tubes + TUBE_NUMBERS * MOST_PEOPLE * MOST_TUBES
        self.query_size = self._pieces + PIECE_NUMBERS * MOST_PIECES * MOST_PEOPLE * MOST_TUBES

    def query(
        self,
        people: Sequence[TrackedPerson],
        *,
        times_s: Array,
        rectangles: Array,
        kinds: frozenset[TubeKind],
        skew_s: tuple[float, float],
    ) -> Array:
        """The input vector; more segments than fit raise InputError."""
        count = len(rectangles)
        if count > self.segments:
            raise InputError(
                f"expected at most {self.segments} rectangles, got {count}; build with more"
            )
        crowd, out = packed(people), np.zeros(self.query_size)
        mask = sum(1 << i for i, kind in enumerate(KIND_NUMBERS) if kind in kinds)
        out[:6] = [crowd.count, len(crowd.tubes) // TUBE_NUMBERS, *skew_s, mask, count]
        out[6 : 7 + count] = times_s
        first = 7 + self.segments
        out[first : first + 5 * count] = np.ravel(rectangles)
        out[self._tubes : self._tubes + len(crowd.tubes)] = crowd.tubes
        out[self._pieces : self._pieces + len(crowd.pieces)] = crowd.pieces
        return out

    def call(self, query: Array) -> tuple[int, Array]:
        """What the entry returns, and its result, NEAREST_NUMBERS doubles per kind."""
        result = np.zeros(len(KIND_NUMBERS) * NEAREST_NUMBERS)
        arrays = (query, result, self._work)
        return int(self._entry(*[a.ctypes.data_as(_DOUBLES) for a in arrays])), result

    def nearest(self, query: Array) -> dict[TubeKind, Nearest]:
        """The answer by kind; InputError for a query that was refused."""
        code, result = self.call(query)
        if code:
            raise InputError("the kernel refused its query; expected finite numbers in range")
        rows = result.reshape(len(KIND_NUMBERS), NEAREST_NUMBERS)
        return {
            kind: Nearest(
                float(row[0]), float(row[1]), int(row[2]) if row[2] >= 0 else None,
                int(row[3]) if row[3] >= 0 else None, KernelCause(int(row[4])),
            )
            for kind, row in zip(KIND_NUMBERS, rows, strict=True)
        }  # fmt: skip
