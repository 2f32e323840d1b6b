"""The localiser's steps on the desk: CasADi Functions behind the buffers that the vehicle uses."""

from __future__ import annotations

import casadi as ca

from workbench.estimation.localisation_filter import FilterFunctions
from workbench.runtime.localiser.states import HYPOTHESES
from workbench.runtime.localiser.steps import FOUND, GIVEN, NAMES, Step, Steps, doubles


def casadi_steps(functions: FilterFunctions) -> Steps:
    """Every step, evaluated by CasADi: of its own graphs, or of what a compiler made of them."""
    made = {}
    for name, function, given, found in zip(NAMES, functions.all(), GIVEN, FOUND, strict=True):
        made[name] = _step(function, given, found)
        if name in NAMES[:4]:
            each = function.map(HYPOTHESES)
            many = (tuple(HYPOTHESES * size for size in sizes) for sizes in (given, found))
            made[f"each_{name}"] = _step(each, *many)
    return Steps(**made)


def _step(function: ca.Function, given: tuple[int, ...], found: tuple[int, ...]) -> Step:
    taken = tuple(function.numel_in(k) for k in range(function.n_in()))
    made = tuple(function.numel_out(k) for k in range(function.n_out()))
    dense = all(function.sparsity_in(k).is_dense() for k in range(len(taken))) and all(
        function.sparsity_out(k).is_dense() for k in range(len(made))
    )
    assert (taken, made) == (given, found), f"{function.name()}: {(taken, made)}"
    assert dense, f"{function.name()}: buffers are taken to be dense"
    buffer, run = function.buffer()
    arguments, results = (tuple(map(doubles, sizes)) for sizes in (given, found))
    for k, numbers in enumerate(arguments):
        buffer.set_arg(k, numbers)
    for k, numbers in enumerate(results):
        buffer.set_res(k, numbers)

    def call(_keep: object = (buffer, function)) -> None:
        # The buffer must outlive what is bound to it.
        run()

    return Step(arguments, results, call)
