"""A CasADi Function evaluated for many cases at once, on arrays whose first axis counts them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def lanes(function: ca.Function) -> Callable[..., tuple[Array, ...]]:
    """The function for arrays (n, ...), each of whose rows holds one argument column by column.

    Returns one array (n, r) or (n, c, r) per result of r rows and c columns. A matrix comes out
    transposed, which does not matter for symmetric ones. Raises ValueError where sizes differ.
    """
    rows = [(function.size1_out(k), function.size2_out(k)) for k in range(function.n_out())]
    sizes = [function.size1_in(k) * function.size2_in(k) for k in range(function.n_in())]
    dense = all(function.sparsity_in(k).is_dense() for k in range(function.n_in())) and all(
        function.sparsity_out(k).is_dense() for k in range(function.n_out())
    )
    assert dense, f"{function.name()}: buffers are taken to be dense"
    made: dict[int, tuple[Any, Any]] = {}

    def call(*arguments: Array) -> tuple[Array, ...]:
        n = len(arguments[0])
        if n not in made:
            made[n] = function.map(n).buffer()
        buffer, run = made[n]
        given = [np.ascontiguousarray(a, dtype=np.float64) for a in arguments]
        for k, (array, size) in enumerate(zip(given, sizes, strict=True)):
            if array.size != n * size:
                raise ValueError(
                    f"{function.name()}: expected {n} x {size} numbers for argument {k}, got an "
                    f"array of shape {array.shape}"
                )
            buffer.set_arg(k, array.data)
        found = tuple(np.empty((n, r) if c == 1 else (n, c, r)) for r, c in rows)
        for k, array in enumerate(found):
            buffer.set_res(k, array.data)
        run()
        return found

    return call
