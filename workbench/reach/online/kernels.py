"""The online kernels by name and form: one interface, two ways to prove what is rounded."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.models.system import Ode
from workbench.reach.online.budget import Ranges
from workbench.reach.online.enclosed import enclosed_functions
from workbench.reach.online.functions import OnlineFunctions, online_functions

Derivation = Callable[[Ode, Ranges, tuple[str, ...]], OnlineFunctions]

# Whose initial deviations the quadratic form does not follow: they start at known values.
_INTEGRALS: Final = ("speed_integral", "offset_integral")


class Form(enum.Enum):
    """What of the initial deviations is followed exactly, to this order."""

    LINEAR = "linear"
    QUADRATIC = "quadratic"


def _local(ode: Ode, ranges: Ranges, quadratic: tuple[str, ...]) -> OnlineFunctions:
    return online_functions(ode, ranges, quadratic=quadratic)


def _enclosed(ode: Ode, ranges: Ranges, quadratic: tuple[str, ...]) -> OnlineFunctions:
    return enclosed_functions(ode, ranges, quadratic=quadratic)


KERNELS: Final[Mapping[str, Derivation]] = {"local": _local, "enclosed": _enclosed}
"""The kernels by name: each derives its Functions from an equation, its ranges and the states whose
deviations are followed to second order (none: the linear form)."""


@final
@dataclass(frozen=True, slots=True)
class Method:
    """A kernel by name (of `KERNELS`) in one form. InputError for anything else."""

    kernel: str = "local"
    form: Form = Form.LINEAR

    def __post_init__(self) -> None:
        if self.kernel not in KERNELS:
            raise InputError(
                f"no online kernel {self.kernel!r}; expected one of {', '.join(KERNELS)}"
            )
        if not isinstance(self.form, Form):
            raise InputError(f"expected a Form, Form.LINEAR or Form.QUADRATIC, got {self.form!r}")

    def __str__(self) -> str:
        return f"{self.kernel}, {self.form.value}"

    def functions(self, ode: Ode, ranges: Ranges) -> OnlineFunctions:
        """The Functions of this kernel and form for states and inputs in `ranges`."""
        followed = tuple(name for name in ode.names if name not in _INTEGRALS)
        quadratic = followed if self.form is Form.QUADRATIC else ()
        return KERNELS[self.kernel](ode, ranges, quadratic)


LOCAL_LINEAR: Final = Method()
"""The cheapest: what a bundle decides with unless it is built otherwise."""
