"""A user's Python function as a black box: an initial state and instants in, states out."""

from __future__ import annotations

import functools
import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Final, final

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.learning.draws import Words
from workbench.sensitivity.vectorised import Array

_MODULE: Final = "workbench_black_box"
_USE: Final = "write `def {name}(state, times, seed): ...` that returns one row of states per time"
# What a run may report as its own start, relative to the size of the numbers.
_SAME: Final = 1e-9


@final
@dataclass(frozen=True, slots=True, eq=False)
class FunctionSimulator:
    """`function(state, times, seed)` of a Python file: rows of states (K+1, n), the first `state`.

    state (n,), times (K+1,) in s, both read-only; seed: a whole number that both runs of a pair are
    given, from which the function draws whatever is random in it. The same arguments must give the
    same answer. Raises InputError where file or function are missing, and for an answer that is no
    run from that state, that is not the same again, or that never comes because the function fails.
    """

    file: Path
    function: str
    names: tuple[str, ...]
    times: Array

    @property
    def what(self) -> str:
        """Whose runs they are."""
        return f"runs of {self.function} in {self.file.name}"

    def runs(self, initial_states: Array, seeds: Words) -> Array:
        """As `Simulator` says; the first run is asked for twice."""
        call = _loaded(str(self.file.resolve()), self.function)
        found = np.empty((len(initial_states), len(self.times), len(self.names)))
        for row, (state, seed) in enumerate(zip(initial_states, seeds.tolist(), strict=True)):
            found[row] = self._run(call, state, seed)
        again = self._run(call, initial_states[0], int(seeds[0]))
        if not np.array_equal(found[0], again):
            apart = np.abs(found[0] - again).max()
            raise self._refused(
                f"expected the same answer to the same arguments, got states up to {apart:.3g} "
                "apart; draw what is random from the seed, and keep nothing between calls"
            )
        return found

    def _run(self, call: Callable[..., object], state: Array, seed: int) -> Array:
        given, times = state.copy(), self.times.copy()
        given.setflags(write=False)
        times.setflags(write=False)
        try:
            answer = call(given, times, seed)
        except (Exception, SystemExit) as error:
            mend = "make it answer for every state of the initial set"
            if isinstance(error, TypeError) and "argument" in str(error):
                mend = _USE.format(name=self.function)
            if isinstance(error, ValueError) and "read-only" in str(error):
                mend = "its arguments are not its own, so work on a copy: state = state.copy()"
            raise self._refused(
                f"expected states, got {type(error).__name__}: {error} (from the state "
                f"{self._said(state)}); {mend}"
            ) from error
        return self._checked(answer, state)

    def _checked(self, answer: object, state: Array) -> Array:
        wanted = (len(self.times), len(self.names))
        try:
            run = np.array(answer, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise self._refused(
                f"expected numbers of shape {wanted}, got {type(answer).__name__} ({error}); "
                "return an array, one row per time"
            ) from error
        if run.shape != wanted:
            raise self._refused(
                f"expected shape {wanted}, one row per time and one column for each of "
                f"{', '.join(self.names)}, got {run.shape}"
            )
        bad = np.argwhere(~np.isfinite(run))
        if len(bad):
            k, i = bad[0]
            raise self._refused(
                f"expected finite numbers, got {run[k, i]} in {self.names[i]} at "
                f"{self.times[k]:g} s from the state {self._said(state)}; shorten --horizon or "
                "shrink the initial set"
            )
        off = np.abs(run[0] - state) > _SAME * np.maximum(1.0, np.abs(state))
        if off.any():
            i = int(np.argmax(off))
            raise self._refused(
                f"expected the first row to be the state it was given, got {run[0, i]:.9g} in "
                f"{self.names[i]} for {state[i]:.9g}"
            )
        run[0] = state
        return run

    def _said(self, state: Array) -> str:
        return ", ".join(f"{n} = {x:.6g}" for n, x in zip(self.names, state, strict=True))

    def _refused(self, why: str) -> InputError:
        return InputError(f"{self.file}:{self.function}: {why}")


@functools.cache
def _loaded(file: str, name: str) -> Callable[..., object]:
    """The function, its file executed once in this process."""
    module = _executed(file)
    found: Any = getattr(module, name, None)
    if not callable(found):
        others = sorted(
            key
            for key, value in vars(module).items()
            if callable(value) and getattr(value, "__module__", "") == _MODULE
        )
        raise InputError(
            f"{file}: expected a function {name!r}, found "
            f"{', '.join(others) if others else 'no function'}; {_USE.format(name=name)}"
        )
    return found  # type: ignore[no-any-return]


def _executed(file: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(_MODULE, file)
    if spec is None or spec.loader is None or not Path(file).is_file():
        raise InputError(f"{file}: expected a Python file (.py), found none; check the path")
    module = importlib.util.module_from_spec(spec)
    folder = str(Path(file).parent)
    if folder not in sys.path:
        sys.path.append(folder)
    # Where Python's own tools look up a class's module, such as `dataclasses`.
    sys.modules[_MODULE] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise InputError(
            f"{file}: expected a Python file that can be executed, got {type(error).__name__}: "
            f"{error}"
        ) from error
    return module
