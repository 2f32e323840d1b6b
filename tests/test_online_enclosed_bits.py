"""The enclosed kernel's C has the bits of CasADi's evaluation, optimised or not."""

from __future__ import annotations

import ctypes

import casadi as ca
import numpy as np
from enclosed_cases import Array, built, called, points

from workbench.codegen.c_source import FLOOR, PRELUDE, function_text
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.native_calls import load_function


def test_c_has_the_bits_of_casadi_at_every_optimisation() -> None:
    unoptimised = tuple("-O0" if flag == "-O2" else flag for flag in FLAGS)
    for name, quadratic in (("B1", True), ("brake", False)):
        functions = built(name, quadratic=quadratic)
        text = "\n".join([FLOOR, function_text(functions.all()), PRELUDE])
        objects = [compile_shared(text, flags=f).shared_object for f in (FLAGS, unoptimised)]
        rng = np.random.default_rng(2)
        for function in functions.all():
            entries = [load_function(o, function.name()) for o in objects]
            for point in points(functions.model, 10):
                arguments = _arguments(function, point, rng)
                expected = list(called(function, arguments).values())
                for entry in entries:
                    for own, other in zip(expected, _run(entry, function, arguments), strict=True):
                        assert own.tobytes() == other.tobytes()


def _arguments(
    function: ca.Function, point: list[Array], rng: np.random.Generator
) -> list[Array | float]:
    named = dict(zip(("x", "p", "w_mid", "slope", "offset"), point, strict=True))
    named |= {"below": 0.1 - point[0], "above": point[0] + 0.1}
    sizes = {function.name_in(k): function.numel_in(k) for k in range(function.n_in())}
    return [named.get(name, rng.uniform(0.0, 0.1, size)) for name, size in sizes.items()]


def _run(
    entry: ctypes._NamedFuncPointer, function: ca.Function, arguments: list[Array | float]
) -> list[Array]:
    kind = ctypes.POINTER(ctypes.c_double)
    blocks = [np.ascontiguousarray(np.atleast_1d(a), float) for a in arguments]
    results = [np.zeros(function.nnz_out(k)) for k in range(function.n_out())]
    work = np.zeros(function.sz_w() + 1)
    pointers = [[b.ctypes.data_as(kind) for b in group] for group in (blocks, results)]
    given, taken = (
        (kind * size)(*group)
        for size, group in zip((function.sz_arg(), function.sz_res()), pointers, strict=True)
    )
    entry.argtypes = [
        ctypes.POINTER(kind),
        ctypes.POINTER(kind),
        ctypes.c_void_p,
        kind,
        ctypes.c_int,
    ]
    assert entry(given, taken, None, work.ctypes.data_as(kind), 0) == 0
    return results
