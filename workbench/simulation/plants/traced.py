"""The package's multi-body field as CasADi expressions: its own function, run on symbols."""

from __future__ import annotations

import operator
from collections.abc import Callable
from types import FunctionType, SimpleNamespace
from typing import Any, final

import casadi as ca

from workbench.errors import InputError

STATES = 29


@final
class _Term:
    """A symbolic number that answers the comparisons on which the package's code branches.

    creeps, drives: what this trace assumes of |speed| < 0.1 m/s and of acceleration > 0. Below 0 is
    nothing else that is asked about: wheels roll forwards.
    """

    __slots__ = ("creeps", "drives", "value")

    def __init__(self, value: ca.SX, creeps: bool, drives: bool) -> None:
        self.value, self.creeps, self.drives = value, creeps, drives

    def applied(self, function: Callable[..., ca.SX], *others: object) -> _Term:
        return _Term(function(self.value, *map(_plain, others)), self.creeps, self.drives)

    def __add__(self, other: object) -> _Term:
        return self.applied(operator.add, other)

    def __sub__(self, other: object) -> _Term:
        return self.applied(operator.sub, other)

    def __mul__(self, other: object) -> _Term:
        return self.applied(operator.mul, other)

    def __truediv__(self, other: object) -> _Term:
        return self.applied(operator.truediv, other)

    def __pow__(self, other: object) -> _Term:
        return self.applied(operator.pow, other)

    def __radd__(self, other: object) -> _Term:
        return self.applied(lambda own, left: left + own, other)

    def __rsub__(self, other: object) -> _Term:
        return self.applied(lambda own, left: left - own, other)

    def __rmul__(self, other: object) -> _Term:
        return self.applied(lambda own, left: left * own, other)

    def __rtruediv__(self, other: object) -> _Term:
        return self.applied(lambda own, left: left / own, other)

    def __neg__(self) -> _Term:
        return self.applied(operator.neg)

    def __abs__(self) -> _Magnitude:
        return _Magnitude(self.creeps)

    def __lt__(self, other: float) -> bool:
        if other != 0.0:
            raise _other_package(other)
        return False

    def __gt__(self, other: float) -> bool:
        if other != 0:
            raise _other_package(other)
        return self.drives


@final
class _Magnitude:
    """|speed|, which the package only compares with 0.1 m/s."""

    __slots__ = ("creeps",)

    def __init__(self, creeps: bool) -> None:
        self.creeps = creeps

    def __lt__(self, other: float) -> bool:
        if other != 0.1:
            raise _other_package(other)
        return self.creeps


def _other_package(other: float) -> InputError:
    return InputError(
        "expected commonroad-vehicle-models that compares speeds with 0 and 0.1, as release 3.0.2 "
        f"does, got one that compares with {other!r}; install that release"
    )


def _plain(value: object) -> Any:
    return value.value if isinstance(value, _Term) else value


def _symbolic(function: Callable[..., ca.SX]) -> Callable[..., Any]:
    def applied(argument: object) -> object:
        return argument.applied(function) if isinstance(argument, _Term) else function(argument)

    return applied


_MATH = SimpleNamespace(
    fabs=_symbolic(ca.fabs),
    **{name: _symbolic(getattr(ca, name)) for name in ("sin", "cos", "tan", "atan", "sqrt")},
)


def _steering(angle: _Term, rate: _Term, p: Any) -> _Term:
    """`steering_constraints` of the package."""
    d, u = angle.value, _plain(rate)
    beyond = ca.logic_or(ca.logic_and(d <= p.min, u <= 0), ca.logic_and(d >= p.max, u >= 0))
    clipped = ca.if_else(u <= p.v_min, p.v_min, ca.if_else(u >= p.v_max, p.v_max, u))
    return _Term(ca.if_else(beyond, 0.0, clipped), angle.creeps, angle.drives)


def _acceleration(speed: _Term, acceleration: _Term, p: Any) -> _Term:
    """`acceleration_constraints` of the package."""
    v, a = speed.value, _plain(acceleration)
    most = ca.if_else(v > p.v_switch, p.a_max * p.v_switch / v, p.a_max)
    beyond = ca.logic_or(ca.logic_and(v <= p.v_min, a <= 0), ca.logic_and(v >= p.v_max, a >= 0))
    clipped = ca.if_else(a <= -p.a_max, -p.a_max, ca.if_else(a >= most, most, a))
    return _Term(ca.if_else(beyond, 0.0, clipped), speed.creeps, speed.drives)


def _rebound(function: Any, **names: object) -> Any:
    """The same code with other meanings of some global names; the package stays as it is."""
    return FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__)


def multi_body_field(name: str, parameters: Any, *, creeps: bool, drives: bool) -> ca.Function:
    """x' = f(x, u) of `vehicle_dynamics_mb` on one of its branches, u = (steering rate,
    acceleration), for wheels that roll forwards and a car that does not spin.

    Raises ImportError without the package, InputError where another release of it asks what this
    trace does not know.
    """
    import vehiclemodels.utils.tire_model as tyre
    from vehiclemodels.utils.vehicle_dynamics_ks_cog import vehicle_dynamics_ks_cog
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

    formulas = {each: _rebound(getattr(tyre, each), math=_MATH, sign=_symbolic(ca.sign))
                for each in ("formula_longitudinal", "formula_lateral",
                             "formula_longitudinal_comb", "formula_lateral_comb")}  # fmt: skip
    limits = {"steering_constraints": _steering, "acceleration_constraints": _acceleration}
    slow = _rebound(vehicle_dynamics_ks_cog, math=_MATH, **limits)
    run = _rebound(
        vehicle_dynamics_mb, math=_MATH, tireModel=SimpleNamespace(**formulas),
        vehicle_dynamics_ks_cog=slow, **limits,
    )  # fmt: skip
    x, u = ca.SX.sym("x", STATES), ca.SX.sym("u", 2)
    terms = [[_Term(each, creeps, drives) for each in ca.vertsplit(part)] for part in (x, u)]
    rates = [_plain(rate) for rate in run(*terms, parameters)]
    return ca.Function(name, [x, u], ca.cse([ca.vertcat(*rates)]))
