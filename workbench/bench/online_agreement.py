"""Whether the compiled C gives CasADi's bits, unoptimised and optimised, on random inputs."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import casadi as ca
import numpy as np

from workbench.bench.online_kernels import cells_of, operating_region
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.native_calls import exported_size, load_function
from workbench.codegen.online_source import OnlineSizes, tube_source
from workbench.models.benchmarks import Benchmark
from workbench.reach.online.functions import OnlineFunctions
from workbench.reach.tube import Array

LEVELS: Final = ("-O0", "-O2")
_CHUNK = 2000
_STEPS = 20
# One run of the whole tube costs as much as some hundred Functions.
_INPUTS_PER_TUBE = 500
_POINTERS = ctypes.POINTER(ctypes.c_double)
# Every other input holds sizes, which are not negative.
_SIGNED: Final = ("columns", "offset")


@final
@dataclass(frozen=True, slots=True)
class Agreement:
    """How often one Function, or the whole tube, came out with other bits.

    inputs: random ones; differing: per level of optimisation, inputs for which any output differs
    from CasADi's evaluation (of the whole tube: from the unoptimised one); undefined: inputs with
    an infinite or undefined output, which counts as equal to any undefined one.
    """

    function: str
    inputs: int
    differing: dict[str, int]
    undefined: int


def agreement(
    benchmark: Benchmark, functions: OnlineFunctions, *, inputs: int, seed: int
) -> tuple[Agreement, ...]:
    """Every generated Function on `inputs` random inputs, and the whole tube on a 500th of them.

    The C is that of the kernel, compiled with its flags and again without optimisation. Points are
    drawn from the operating region, sizes over thirteen powers of ten, with zeros, ends and tiny
    numbers among them.
    """
    source = "\n".join([
        tube_source(
            functions, operating_region(benchmark).reordered(benchmark.system.ode.names),
            OnlineSizes(_STEPS, functions.ranges.step_max_s),
        ),
        *(_loop_over(function) for function in functions.all()),
    ])  # fmt: skip
    objects = {
        level: compile_shared(source, flags=tuple(
            level if flag.startswith("-O") else flag for flag in FLAGS
        )).shared_object
        for level in LEVELS
    }  # fmt: skip
    rng = np.random.default_rng(seed)
    found = [_function(f, functions, objects, inputs, rng) for f in functions.all()]
    return (*found, _tubes(benchmark, functions, objects, max(1, inputs // _INPUTS_PER_TUBE), rng))


def _loop_over(function: ca.Function) -> str:
    """C text of a loop that calls one Function on rows of inputs."""
    name, n_in, n_out = function.name(), function.n_in(), function.n_out()
    moves = [f"    arg[{i}] += {function.nnz_in(i)};" for i in range(n_in)]
    moves += [f"    res[{i}] += {function.nnz_out(i)};" for i in range(n_out)]
    return "\n".join([
        f"int {name}_rows(const double **arg, double **res, long long count) {{",
        "  double scratch[WB_SCRATCH];", "  long long k;",
        "  for (k = 0; k < count; ++k) {",
        f"    const double *a[{n_in}];", f"    double *r[{n_out}];",
        f"    memcpy(a, arg, {n_in} * sizeof *a);", f"    memcpy(r, res, {n_out} * sizeof *r);",
        f"    if ({name}(a, r, 0, scratch, 0)) return 1;", *moves, "  }", "  return 0;", "}",
    ])  # fmt: skip


def _function(
    function: ca.Function, functions: OnlineFunctions, objects: dict[str, bytes], inputs: int,
    rng: np.random.Generator,
) -> Agreement:  # fmt: skip
    loops = {
        level: load_function(shared, f"{function.name()}_rows") for level, shared in objects.items()
    }
    differing, undefined, done = dict.fromkeys(LEVELS, 0), 0, 0
    chunk = min(_CHUNK, inputs)
    mapped = function.map(chunk)
    while done < inputs:
        rows = random_inputs(function, functions, chunk, rng)
        used = min(chunk, inputs - done)
        expected = _evaluated(mapped, function, rows)[:used]
        undefined += int(np.sum(~np.isfinite(expected).all(axis=1)))
        for level, loop in loops.items():
            found = _called(loop, function, rows)[:used]
            differing[level] += int(np.sum(~same_bits(expected, found)))
        done += used
    return Agreement(function.name(), inputs, differing, undefined)


def same_bits(first: Array, second: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Which rows (N, m) hold the same bits; undefined equals undefined, whatever its payload."""
    equal = first.view(np.uint64) == second.view(np.uint64)
    return np.asarray((equal | (np.isnan(first) & np.isnan(second))).all(axis=1))


def random_inputs(
    function: ca.Function, functions: OnlineFunctions, count: int, rng: np.random.Generator
) -> list[Array]:
    """One array (count, size) per input of `function`, chosen by the input's name."""
    ranges = functions.ranges
    box = ranges.states.reordered(functions.model.ode.names)
    known = {
        "x": (np.array(box.lower), np.array(box.upper)),
        "p": ranges.parameters,
        "w_mid": ranges.disturbances,
        "h": (np.zeros(1), np.array([ranges.step_max_s])),
        "slope": (np.zeros(functions.model.n_k), np.ones(functions.model.n_k)),
    }
    found: dict[str, Array] = {}
    for i, name in enumerate(function.name_in()):
        shape = (count, function.nnz_in(i))
        if name in known:
            lower, upper = known[name]
            share = rng.random(shape)
            share = np.where(rng.random(shape) < 0.1, np.round(share), share)
            found[name] = lower + share * (upper - lower)
        elif name in ("lower", "upper"):
            middle = found.setdefault("middle", _between(known["x"], shape, rng))
            side = -1.0 if name == "lower" else 1.0
            found[name] = middle + side * _sizes(shape, rng)
        else:
            signs = rng.choice([-1.0, 1.0], shape) if name in _SIGNED else 1.0
            found[name] = signs * _sizes(shape, rng)
    return [np.ascontiguousarray(found[name]) for name in function.name_in()]


def _between(ends: tuple[Array, Array], shape: tuple[int, int], rng: np.random.Generator) -> Array:
    return np.asarray(ends[0] + rng.random(shape) * (ends[1] - ends[0]))


def _sizes(shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Positive numbers from 1e-12 to 10, one in ten zero, one in a hundred below 1e-300."""
    sizes = 10.0 ** rng.uniform(-12.0, 1.0, shape)
    kind = rng.random(shape)
    return np.asarray(np.where(kind < 0.1, 0.0, np.where(kind < 0.11, sizes * 1e-305, sizes)))


def _evaluated(mapped: ca.Function, function: ca.Function, rows: Sequence[Array]) -> Array:
    """CasADi's evaluation of the rows: the outputs' nonzeros side by side."""
    count = len(rows[0])
    outputs = [np.zeros((count, function.nnz_out(j))) for j in range(function.n_out())]
    buffer, trigger = mapped.buffer()
    for i, values in enumerate(rows):
        buffer.set_arg(i, values.data)
    for j, values in enumerate(outputs):
        buffer.set_res(j, values.data)
    trigger()
    return np.concatenate(outputs, axis=1)


def _called(loop: ctypes._NamedFuncPointer, function: ca.Function, rows: Sequence[Array]) -> Array:
    count = len(rows[0])
    outputs = [np.zeros((count, function.nnz_out(j))) for j in range(function.n_out())]
    arg, res = (
        (_POINTERS * len(arrays))(*(a.ctypes.data_as(_POINTERS) for a in arrays))
        for arrays in (rows, outputs)
    )
    if loop(arg, res, ctypes.c_longlong(count)):
        raise RuntimeError(f"{function.name()} did not run")
    return np.concatenate(outputs, axis=1)


def _tubes(
    benchmark: Benchmark, functions: OnlineFunctions, objects: dict[str, bytes], count: int,
    rng: np.random.Generator,
) -> Agreement:  # fmt: skip
    """Whole tubes from random parts of the initial set, of up to 20 steps of random length."""
    ode = benchmark.system.ode
    box = cells_of(benchmark, 1)[0]
    n = len(ode.states)
    w = ode.disturbances
    results = {level: np.zeros((count, 2 + 2 * (2 * _STEPS + 1) * n)) for level in LEVELS}
    queries = []
    for _ in range(count):
        radius = np.array(box.radius) * rng.random()
        center = np.array(box.center) + (np.array(box.radius) - radius) * rng.uniform(-1, 1, n)
        step_s = rng.uniform(0.01, functions.ranges.step_max_s)
        queries.append(np.concatenate([
            center, radius, ode.parameter_values(), [d.lower for d in w], [d.upper for d in w],
            [step_s * rng.uniform(1.0, _STEPS), step_s],
        ]))  # fmt: skip
    for level, shared in objects.items():
        entry = load_function(shared, "wb_tube")
        work = np.zeros(exported_size(shared, "wb_work_size"))
        for query, row in zip(queries, results[level], strict=True):
            entry(*(a.ctypes.data_as(_POINTERS) for a in (query, row, work)))
    plain = results[LEVELS[0]]
    differing = {level: int(np.sum(~same_bits(plain, results[level]))) for level in LEVELS}
    return Agreement("wb_tube", count, differing, int(np.sum(plain[:, 0] != 0.0)))
