"""One state space for two systems, so that a set can pass from one to the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.errors import InputError
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode
from workbench.reach.ranged_parameters import initial_box, with_ranged_parameters_as_states
from workbench.sets import Box


@final
@dataclass(frozen=True, slots=True, eq=False)
class SharedStates:
    """States of `first`, then those that only `then` has, then all unknown constants.

    constants: parameters with a range, one and the same for both systems where they agree in name
    and range; last the time before the switch, in s, with the range [0, longest_s].
    """

    first: Ode
    then: Ode
    signals: tuple[Signal, ...]
    constants: tuple[Ranged, ...]
    x: ca.SX

    @classmethod
    def of(cls, first: Ode, then: Ode, *, longest_s: float) -> SharedStates:
        """Raises InputError where states of one name have different units, where a name is a
        state's and another signal's, and where there is no common state."""
        units = {signal.name: signal.unit for signal in first.states}
        for signal in then.states:
            if units.get(signal.name, signal.unit) != signal.unit:
                raise InputError(
                    f"expected the state {signal.name!r} in one unit, got "
                    f"{units[signal.name]!r} before the switch and {signal.unit!r} after it"
                )
        if not units.keys() & set(then.names):
            raise InputError(
                f"expected systems with a state in common, got {first.names} and {then.names}"
            )
        signals = (*first.states, *(s for s in then.states if s.name not in units))
        _check_names(signals, first, then)
        every = (*first.parameters, *then.parameters)
        constants = [
            *dict.fromkeys(_constant(q) for q in every if q.lower < q.upper),
            Ranged("time before the switch", "s", 0.0, 0.0, longest_s),
        ]
        x = ca.SX.sym("shared", len(signals) + len(constants))
        return cls(first, then, signals, tuple(constants), x)

    @property
    def elapsed(self) -> ca.SX:
        """The symbol of the time before the switch."""
        return self.x[-1]

    def embedded(self, ode: Ode, factor: ca.SX | None = None) -> Ode:
        """`ode` (one of the two) over the shared states, all rates times `factor`.

        States that `ode` lacks and the constants rest. Disturbances stay arbitrary in time.
        """
        ranged = [i for i, q in enumerate(ode.parameters) if q.lower < q.upper]
        fixed = [i for i in range(len(ode.parameters)) if i not in ranged]
        old = ca.vertcat(ode.x, *(ode.p[i] for i in ranged))
        own = [self.index(signal.name) for signal in ode.states]
        constants = [self._constant_index(ode.parameters[i]) for i in ranged]
        new = ca.vertcat(*(self.x[i] for i in (*own, *constants)))
        rates = ca.substitute(ode.field, old, new)
        field = [ca.SX(0)] * self.x.numel()
        for row, index in enumerate(own):
            field[index] = rates[row] if factor is None else factor * rates[row]
        return Ode(
            name=ode.name,
            states=(*self.signals, *(Signal(c.name, c.unit) for c in self.constants)),
            parameters=tuple(ode.parameters[i] for i in fixed),
            disturbances=ode.disturbances,
            x=self.x,
            p=ca.vertcat(*(ode.p[i] for i in fixed)) if fixed else ca.SX(0, 1),
            w=ode.w,
            field=ca.vertcat(*field),
            constants=self.constants,
        )

    def index(self, name: str) -> int:
        """Row of the state `name`."""
        return [signal.name for signal in self.signals].index(name)

    def _constant_index(self, parameter: Ranged) -> int:
        return len(self.signals) + self.constants.index(_constant(parameter))

    def initial_intervals(self, initial_set: Box) -> list[tuple[float, float]]:
        """Ranges of all rows at the start; states that only `then` has are 0 until the switch."""
        given = initial_box(self.first, with_ranged_parameters_as_states(self.first), initial_set)
        intervals = [
            given.interval(s.name) if s.name in self.first.names else (0.0, 0.0)
            for s in self.signals
        ]
        narrowed = {
            _constant(q): given.interval(q.name) for q in self.first.parameters if q.lower < q.upper
        }
        return intervals + [narrowed.get(c, (c.lower, c.upper)) for c in self.constants]

    def resets(
        self, reset: Mapping[str, float | tuple[float, float]]
    ) -> dict[int, tuple[float, float]]:
        """Row -> range after the switch. Raises InputError where a value lacks or is too much."""
        unknown = sorted(set(reset) - set(self.then.names))
        if unknown:
            raise InputError(f"reset: {unknown} are no states of {self.then.name}; leave them out")
        new = [s.name for s in self.then.states if s.name not in self.first.names]
        missing = sorted(set(new) - set(reset))
        if missing:
            raise InputError(
                f"reset: expected a value at the switch for {missing}, which {self.first.name} "
                f"does not have; for example {{{missing[0]!r}: 0.0}}"
            )
        return {self.index(name): _interval(name, value) for name, value in reset.items()}


def _check_names(signals: tuple[Signal, ...], first: Ode, then: Ode) -> None:
    states = {signal.name for signal in signals}
    others = (*first.parameters, *then.parameters, *first.disturbances, *then.disturbances)
    twice = sorted({other.name for other in others} & states)
    if twice:
        raise InputError(
            f"expected names that mean the same before and after the switch, got {twice} both as "
            "state and as parameter or disturbance; rename one of them"
        )


def _constant(parameter: Ranged) -> Ranged:
    """The constant a parameter stands for; its name is no state's, and tells ranges apart."""
    low, high = parameter.lower, parameter.upper
    return Ranged(f"{parameter.name} in [{low!r}, {high!r}]", parameter.unit, low, low, high)


def _interval(name: str, value: float | tuple[float, float]) -> tuple[float, float]:
    low, high = value if isinstance(value, tuple) else (value, value)
    if not float("-inf") < low <= high < float("inf"):
        raise InputError(f"reset: expected {name!r} as a number or (low, high), got {value!r}")
    return float(low), float(high)
