"""The generated C computes what CasADi computes, bit for bit, whatever the optimisation level."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from tube_cases import Array

from workbench.bench.scoreboard import wide_region
from workbench.codegen.c_source import _FLOOR, KernelSizes, function_text, work_macro
from workbench.codegen.compiler import FLAGS, compile_shared
from workbench.codegen.tube_kernel import CompiledTube, load_function
from workbench.models.benchmarks import Benchmark, b1, b2
from workbench.reach.step_functions import StepFunctions, step_functions

COUNT = 10_000
UNOPTIMISED = tuple("-O0" if flag == "-O2" else flag for flag in FLAGS)
_DOUBLES = ctypes.POINTER(ctypes.c_double)

# Calls one Function on every row; the inputs and outputs of a row lie behind one another.
_DRIVER = """
void run(long long count, const double *in, double *out) {
  static const int in_size[] = {%(in_size)s}, out_size[] = {%(out_size)s};
  double scratch[WB_SCRATCH];
  const double *arg[%(n_in)d];
  double *res[%(n_out)d];
  int i;
  while (count-- > 0) {
    for (i = 0; i < %(n_in)d; in += in_size[i++]) arg[i] = in;
    for (i = 0; i < %(n_out)d; out += out_size[i++]) res[i] = out;
    %(name)s(arg, res, 0, scratch, 0);
  }
}
"""


def plain_text(function: ca.Function) -> str:
    """CasADi's own text, without the replacements of the kernel."""
    generator = ca.CodeGenerator("plain", {"with_header": False, "verbose": False})
    generator.add(function)
    return str(generator.dump())


def sizes(function: ca.Function) -> tuple[list[int], list[int]]:
    return (
        [function.nnz_in(i) for i in range(function.n_in())],
        [function.nnz_out(i) for i in range(function.n_out())],
    )


def compiled(function: ca.Function, text: str, flags: tuple[str, ...]) -> Callable[[Array], Array]:
    n_in, n_out = sizes(function)
    driver = _DRIVER % {
        "in_size": ", ".join(map(str, n_in)),
        "out_size": ", ".join(map(str, n_out)),
        "n_in": len(n_in),
        "n_out": len(n_out),
        "name": function.name(),
    }
    source = "\n".join([_FLOOR, text, work_macro([function]), driver])
    entry = load_function(compile_shared(source, flags=flags).shared_object, "run")

    def call(inputs: Array) -> Array:
        out = np.zeros((len(inputs), sum(n_out)))
        pointers = [a.ctypes.data_as(_DOUBLES) for a in (inputs, out)]
        entry(ctypes.c_longlong(len(inputs)), *pointers)
        return out

    return call


def evaluated(function: ca.Function, inputs: Array) -> Array:
    """CasADi's own evaluation, row by row."""
    n_in, n_out = sizes(function)
    buffer, run = function.buffer()
    arguments, results = [np.zeros(n) for n in n_in], [np.zeros(n) for n in n_out]
    for i, argument in enumerate(arguments):
        buffer.set_arg(i, memoryview(argument))
    for i, result in enumerate(results):
        buffer.set_res(i, memoryview(result))
    cuts = np.cumsum([0, *n_in])
    rows = np.zeros((len(inputs), sum(n_out)))
    for k, row in enumerate(inputs):
        for i, argument in enumerate(arguments):
            argument[:] = row[cuts[i] : cuts[i + 1]]
        run()
        rows[k] = np.concatenate(results)
    return rows


def random_inputs(loop: Benchmark, steps: StepFunctions, function: ca.Function) -> Array:
    """States and radii about the initial set, small non-negative radii, everything else about 0."""
    rng = np.random.default_rng(5)
    box = loop.initial_set
    spread = np.array(box.radius) + 0.05
    parameters = np.array(steps.form.parameter_values())
    known: dict[str, Callable[[], Array]] = {
        "x": lambda: np.array(box.center) + 3 * spread * rng.standard_normal((COUNT, 7)),
        "r": lambda: spread * rng.random((COUNT, 7)),
        "r_end": lambda: spread * rng.random((COUNT, 7)),
        "p": lambda: np.tile(parameters, (COUNT, 1)),
        "h": lambda: rng.uniform(0.001, 0.05, (COUNT, 1)),
    }
    columns = []
    for i, name in enumerate(function.name_in()):
        count = function.nnz_in(i)
        if name in known:
            columns.append(known[name]())
        elif name in ("slope", "w_rad", "gap", "sizes", "linear_radius"):
            columns.append(rng.random((COUNT, count)))
        elif name.endswith("_upper"):
            below = columns[function.name_in().index(name.replace("_upper", "_lower"))]
            columns.append(below + rng.random((COUNT, count)))
        else:
            columns.append(0.5 * rng.standard_normal((COUNT, count)))
    return np.ascontiguousarray(np.concatenate(columns, axis=1))


@pytest.fixture(scope="module", params=[b1, b2], ids=["B1", "B2"])
def loop(request: pytest.FixtureRequest) -> tuple[Benchmark, StepFunctions]:
    benchmark = request.param()
    return benchmark, step_functions(benchmark.system.ode)


@pytest.mark.parametrize("name", ["advance", "bounds", "remainder"])
def test_c_has_the_bits_of_casadi(loop: tuple[Benchmark, StepFunctions], name: str) -> None:
    benchmark, steps = loop
    function = getattr(steps, name)
    inputs = random_inputs(benchmark, steps, function)
    wanted = evaluated(function, inputs)
    finite = np.isfinite(wanted).all(axis=1)
    assert finite.mean() > 0.9
    plain = compiled(function, plain_text(function), FLAGS)(inputs)
    shipped = compiled(function, function_text([function]), FLAGS)(inputs)
    slow = compiled(function, function_text([function]), UNOPTIMISED)(inputs)
    assert np.array_equal(plain.view(np.int64)[finite], wanted.view(np.int64)[finite])
    # The kernel's minimum and maximum choose another zero of two with different signs.
    assert np.array_equal(shipped[finite], wanted[finite])
    assert np.array_equal(slow.view(np.int64), shipped.view(np.int64))


@pytest.mark.parametrize("benchmark", [b1, b2])
def test_the_whole_tube_has_the_same_bits_unoptimised(benchmark: Callable[[], Benchmark]) -> None:
    loop = benchmark()
    fast, slow = (
        CompiledTube(
            loop.system, region=wide_region(loop), sizes=KernelSizes(60, 0.05, 2), flags=flags
        )
        for flags in (FLAGS, UNOPTIMISED)
    )
    assert fast.shared_object != slow.shared_object
    for parts in (1, 2):
        cells = loop.initial_set.split({"y": parts, "speed": parts})
        for cell in cells:
            tubes = [k.tube(cell, horizon_s=3.0, step_s=0.05) for k in (fast, slow)]
            for rows in ("times", "lower", "upper", "lower_at", "upper_at"):
                one, other = (getattr(tube, rows) for tube in tubes)
                assert np.array_equal(one.view(np.int64), other.view(np.int64))


def test_another_operation_order_would_be_noticed(loop: tuple[Benchmark, StepFunctions]) -> None:
    benchmark, steps = loop
    inputs = random_inputs(benchmark, steps, steps.advance)
    wanted = evaluated(steps.advance, inputs)
    text = function_text([steps.advance])
    # Only reassociation: the whole of -ffast-math would switch subnormals off for this process.
    reordered = (*FLAGS, "-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math")
    other = compiled(steps.advance, text, reordered)(inputs)
    assert not np.array_equal(other, wanted)
