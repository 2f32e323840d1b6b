"""The compiled update of the particles: the same function of the same random numbers, in C."""

from __future__ import annotations

import ctypes
from importlib.resources import files
from pathlib import Path
from typing import Final, final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.intent_cloud import Cloud, Draws, FilterSettings, Measured, Values


def kernel_source() -> str:
    """The C99 source, to be compiled into a shared object (with -lm, without -ffast-math)."""
    return (files("workbench.estimation") / "intent_kernel.c").read_text(encoding="utf-8")


@final
class _Sizes(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_long) for name in ("intents", "particles", "replaced", "steps")),
        *((name, ctypes.c_double) for name in ("kick", "free_kick", "relax_s", "deviation_m",
                                               "floor", "duration_s")),
    )  # fmt: skip


def _copy(values: Values) -> Values:
    return np.array(values, dtype=np.float64, order="C")


def _read(values: Values) -> Values:
    return np.ascontiguousarray(values, dtype=np.float64)


def _at(values: Values) -> int:
    return values.ctypes.data


@final
class CompiledUpdate:
    """The update in C; agrees with `NumpyUpdate` to rounding.

    library: shared object compiled from `kernel_source()` on this machine. Raises InputError when
    it cannot be loaded or lacks the function.
    """

    def __init__(self, library: Path) -> None:
        try:
            self._call = ctypes.CDLL(str(library)).intent_update
        except (OSError, AttributeError) as fault:
            raise InputError(
                f"expected the compiled filter at {library}, got: {fault}; compile it on this "
                "machine"
            ) from fault
        self._call.argtypes = (ctypes.POINTER(_Sizes), *(19 * (ctypes.c_void_p,)))
        self._call.restype = None

    def __call__(
        self, cloud: Cloud, draws: Draws, measured: Measured, settings: FilterSettings
    ) -> tuple[Cloud, Values]:
        """See `Update`."""
        counts, numbers, arrays = kernel_arguments(cloud, draws, measured, settings)
        sizes = _Sizes(*counts, *numbers)
        self._call(ctypes.byref(sizes), *map(_at, arrays))
        return Cloud(*arrays[_NEW]), arrays[_WEIGHTS]


_WEIGHTS: Final = 11
_NEW: Final = slice(14, 18)


def kernel_arguments(
    cloud: Cloud, draws: Draws, measured: Measured, settings: FilterSettings
) -> tuple[tuple[int, ...], tuple[float, ...], list[Values]]:
    """What the C function is called with: counts and numbers of its sizes, and its 19 arrays.

    Weights and new particles are in the arrays when it has returned.
    """
    intents, n = cloud.speed.shape
    counts = (intents, n, len(draws.sources), len(draws.kicks))
    numbers = (
        settings.kick, settings.free_kick, settings.relax_s, settings.deviation_m, settings.floor,
        measured.duration_s,
    )  # fmt: skip
    # Place, velocity and speed are overwritten; everything else is only read.
    scratch = [_copy(cloud.place), _copy(cloud.velocity), _read(cloud.aim), _copy(cloud.speed)]
    given = [_read(each) for each in (
        draws.kicks, draws.speeds, draws.aims, draws.comb, draws.sources, draws.members,
        measured.place,
    )]  # fmt: skip
    around = [_copy(measured.weights), _read(measured.goals), _read(measured.spreads)]
    new = [np.empty_like(each) for each in scratch]
    return counts, numbers, [*scratch, *given, *around, *new, np.empty((intents, n))]
