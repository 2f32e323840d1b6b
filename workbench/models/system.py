"""Ordinary differential equations as CasADi expressions with named signals."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol, final, runtime_checkable

import casadi as ca

from workbench.errors import InputError
from workbench.models.atoms import EVERYTHING, Range
from workbench.models.continuity import Branchless, has_branches, without_branches
from workbench.models.operations import checked_graph
from workbench.models.signals import Ranged, Signal


@final
@dataclass(frozen=True, slots=True, eq=False)
class Ode:
    """x' = field(x, p, w): the one form that every analysis takes. Equal only to itself.

    states, parameters, disturbances: the signals, in the order of the entries of the symbol vectors
    `x` (n x 1), `p` (n_p x 1), `w` (n_w x 1). `field` is the n x 1 SX expression in these symbols.
    `outputs`: named scalar expressions of (x, p, w), such as the commands before their limits.
    `constants`: states whose derivative is 0, with the range that whoever analyses this equation
    keeps them in; only proofs of continuity use it.
    Raises ValueError when sizes, names or symbols do not fit together, and InputError naming an
    operation that is not supported (see `operations`), a constant that is not finite, or an
    if_else in the field whose continuity is not proved (see `continuity`).
    """

    name: str
    states: tuple[Signal, ...]
    parameters: tuple[Ranged, ...]
    disturbances: tuple[Ranged, ...]
    x: ca.SX
    p: ca.SX
    w: ca.SX
    field: ca.SX
    outputs: tuple[tuple[str, ca.SX], ...] = ()
    constants: tuple[Ranged, ...] = ()

    def __post_init__(self) -> None:
        groups: tuple[tuple[str, ca.SX, tuple[Signal | Ranged, ...]], ...] = (
            ("state", self.x, self.states),
            ("parameter", self.p, self.parameters),
            ("disturbance", self.w, self.disturbances),
        )
        for what, symbols, signals in groups:
            if symbols.numel() != len(signals):
                raise ValueError(
                    f"{self.name}: expected one symbol per {what}, "
                    f"got {symbols.numel()} symbols and {len(signals)} names"
                )
        names = [signal.name for _, _, signals in groups for signal in signals]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ValueError(f"{self.name}: expected distinct signal names, got {repeated} twice")
        if self.field.shape != (len(self.states), 1):
            raise ValueError(
                f"{self.name}: expected a field of shape {(len(self.states), 1)}, got "
                f"{self.field.shape}"
            )
        known = {element.__hash__() for element in ca.vertsplit(ca.vertcat(self.x, self.p, self.w))}
        free = [s.name() for s in ca.symvar(self.field) if s.__hash__() not in known]
        if free:
            raise ValueError(
                f"{self.name}: the field uses symbols {free} that are neither state, parameter nor "
                "disturbance; list them as one of these"
            )
        moving = [c.name for c in self.constants if not self._rests(c.name)]
        if moving:
            raise InputError(f"{self.name}: expected constants whose derivative is 0, got {moving}")
        self._check_expressions()

    def _rests(self, name: str) -> bool:
        return name in self.names and bool(self.field[self.names.index(name)].is_zero())

    def _check_expressions(self) -> None:
        arguments = [self.x, self.p, self.w]
        for name, expression in self.outputs:
            function = ca.Function("output", arguments, [expression])
            checked_graph(function, f"{self.name}: the output {name!r}")
        self.branchless_field()

    def branchless_field(self) -> Branchless | None:
        """The field with every if_else replaced by fmin and fmax; None where it has none."""
        where = f"{self.name}: the field"
        graph = checked_graph(self.function(), where)
        if not has_branches(graph):
            return None
        known = {signal.name: signal for signal in (*self.constants, *self.parameters)}
        known.update((signal.name, signal) for signal in self.disturbances)
        ranges = [
            [_range(known.get(signal.name)) for signal in signals]
            for signals in (self.states, self.parameters, self.disturbances)
        ]
        return without_branches(graph, (self.x, self.p, self.w), ranges, where=where)

    @property
    def ode(self) -> Ode:
        """This object: an `Ode` is a `System`."""
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the states, in order."""
        return tuple(state.name for state in self.states)

    def function(self) -> ca.Function:
        """The field as a CasADi Function (x, p, w) -> dx."""
        return ca.Function("field", [self.x, self.p, self.w], [self.field], ["x", "p", "w"], ["dx"])

    def parameter_values(self) -> list[float]:
        """Nominal parameter values, in order."""
        return [parameter.nominal for parameter in self.parameters]


def _range(signal: Ranged | None) -> Range:
    return EVERYTHING if signal is None else (Fraction(signal.lower), Fraction(signal.upper))


@runtime_checkable
class System(Protocol):
    """Anything that reduces to one `Ode`: an `Ode` itself, or a `ClosedLoop`."""

    @property
    def ode(self) -> Ode:
        """The equation to analyse."""


def system_from_casadi(
    states: ca.SX,
    field: ca.SX,
    names: tuple[str, ...],
    *,
    units: tuple[str, ...] | None = None,
    name: str = "system",
) -> Ode:
    """Make a `System` of an SX field (n x 1) over the symbols `states` (n x 1), one name for each.

    Raises as `Ode` does, and InputError on anything but SX (MX graphs are not differentiated here).

    >>> x = ca.SX.sym("x")
    >>> system_from_casadi(x, -x, ("x",)).names
    ('x',)
    """
    if not (isinstance(states, ca.SX) and isinstance(field, ca.SX)):
        raise InputError(
            f"expected SX symbols and an SX field, got {type(states).__name__} and "
            f"{type(field).__name__}; build the model from ca.SX.sym"
        )
    units = units or ("",) * len(names)
    signals = tuple(Signal(n, unit) for n, unit in zip(names, units, strict=True))
    empty = ca.SX(0, 1)
    return Ode(name, signals, (), (), states, empty, empty, field)
