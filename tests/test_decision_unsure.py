"""No car whose readings err, that is pushed or whose wheelbase is unknown leaves its tubes."""

from __future__ import annotations

import ctypes
import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from decision_answers import Answer, Array, TubeAnswer
from decision_fixture import (
    BAD_INPUT,
    COMPLETE,
    INVALID,
    LEFT_REGION,
    STARTS,
    STEP_S,
    DecisionKernel,
    Start,
    Text,
    compiled,
    query,
    with_faults,
)
from decision_paths import paths
from numpy.typing import NDArray

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.codegen.bundle import operating_region
from workbench.codegen.decision_source import DecisionSizes, decision_layout, decision_source
from workbench.models.bicycle import PathFrame
from workbench.models.signals import Ranged
from workbench.models.system import Ode
from workbench.models.vehicle import Vehicle, gem_e2
from workbench.models.vehicle_sections import Uncertainty
from workbench.reach.ranged_parameters import with_ranged_parameters_as_disturbances

SPEED, STEERING, SPEED_INTEGRAL, CLOCK = 3, 2, 5, 7
_FINE_S = 0.005
_RUNS = 48
# A step in which the car comes to a standstill is wrong by about its square.
_TOLERANCE = 1e-5
_AT_ONCE = (0.0, 0.0)
_ALL = {"all": Uncertainty(0.04, 0.015, 0.15, 0.3, 0.02, 0.1)}


# So much that every sign of it shows.
_TELLING = {"telling": Uncertainty(0.0, 0.0, 0.5, 0.2, 0.02)}


def _vehicle(name: str) -> Vehicle:
    vehicle = gem_e2()
    brake = dataclasses.replace(vehicle.brake, stop_speed_mps=0.6 if name in _TELLING else 0.2)
    return dataclasses.replace(vehicle, brake=brake, uncertainty=(_ALL | _TELLING)[name])


@functools.cache
def _loop(name: str, *, braking: bool) -> Ode:
    vehicle = _vehicle(name)
    mode = vehicle.brake.mode() if braking else vehicle.track()
    loop = vehicle.uncertain_loop(mode, PathFrame(-0.5, 0.5))
    return with_ranged_parameters_as_disturbances(loop.ode)


@functools.cache
def _text(name: str) -> Text:
    track, brake = _loop(name, braking=False), _vehicle(name).brake.mode()
    sizes = DecisionSizes(60, STEP_S, 3, 0, 3000)
    layout = decision_layout(track, brake, sizes)
    return Text(decision_source(track, brake, operating_region(_vehicle(name)), sizes), *layout)


_RESTING = Start((0.0,) * 7, (0.0,) * 7, 1.0)


def _kernel(name: str) -> DecisionKernel:
    return compiled(_text(name))


@dataclass(frozen=True, slots=True)
class Case:
    """A start on a path, and when what is commanded; side: the disturbances' half that acts (1
    their upper one, -1 their lower one, 0 both)."""

    name: str
    where: str
    start: Start
    switch_s: tuple[float, float] = (0.15, 0.1834)
    start_s: tuple[float, float] = (0.0, 0.0)
    side: int = 0

    @property
    def brake_s(self) -> tuple[float, float]:
        """When the tube `brake` brakes: a car that waits for its start does so at once."""
        return self.switch_s if self.start_s == _AT_ONCE else _AT_ONCE

    def __str__(self) -> str:
        return f"{self.name}-{self.where}-{self.start.center[1:4]}-{self.switch_s}-{self.side}"

    def signals(self, *, braking: bool) -> list[Ranged]:
        """The disturbances of this case."""
        return [
            w if w.name in ("curvature", "wheelbase", "brake_deceleration")
            else Ranged(
                w.name, w.unit, 0.0, w.lower if self.side < 1 else 0.0,
                w.upper if self.side > -1 else 0.0,
            )
            for w in _loop(self.name, braking=braking).disturbances
        ]  # fmt: skip

    def answer(
        self, kernel: DecisionKernel | None = None, /, **changed: tuple[float, ...]
    ) -> Answer:
        """What the kernel answers; `changed` replaces fields of the query."""
        track, start, text = _loop(self.name, braking=False), self.start, _text(self.name)
        parameters = [
            start.reference_mps if p.name == "reference_speed" else p.nominal
            for p in track.parameters
        ]
        felt = self.signals(braking=False)
        ends = [
            (*(getattr(w, side) for w in felt), *(field.default or ())[len(felt) :])
            for side in ("lower", "upper")
            for field in text.query
            if field.name == f"disturbance_{side}"
        ]
        asked: dict[str, Sequence[float]] = {
            "parameters": parameters, "disturbance_lower": ends[0], "disturbance_upper": ends[1],
            "switch_s": self.switch_s, "brake_s": self.brake_s, "start_s": self.start_s,
        }  # fmt: skip
        numbers = query(paths()[self.where].table, start, (), text.query, **(asked | changed))
        return (kernel or _kernel(self.name))(numbers)


def _stepper(ode: Ode, columns: int, reference_mps: float) -> Callable[[Array, Array], Array]:
    """One step of RK4: states (n, columns) under disturbances (n_w, columns)."""
    rate = ode.function().map(columns)
    numbers = [reference_mps if p.name == "reference_speed" else p.nominal for p in ode.parameters]
    p = np.tile(np.array(numbers)[:, None], columns)

    def step(x: Array, w: Array) -> Array:
        k1 = np.asarray(rate(x, p, w))
        k2 = np.asarray(rate(x + _FINE_S / 2 * k1, p, w))
        k3 = np.asarray(rate(x + _FINE_S / 2 * k2, p, w))
        k4 = np.asarray(rate(x + _FINE_S * k3, p, w))
        return np.asarray(x + _FINE_S / 6 * (k1 + 2 * k2 + 2 * k3 + k4))

    return step


class _Chosen:
    """What acts on each run: one end of every range, ends or anything between in turn; the
    wheelbase never changes during a run."""

    def __init__(self, case: Case, columns: int, *, braking: bool) -> None:
        self._signals, self._path = case.signals(braking=braking), paths()[case.where]
        self._chance = np.random.default_rng(5)
        size = (len(self._signals), columns)
        self._way = self._chance.integers(0, 4, size)
        self._constant = self._chance.integers(0, 3, columns) / 2.0

    def at(self, station: Array) -> Array:
        columns = len(station)
        rows = []
        for way, signal in zip(self._way, self._signals, strict=True):
            ends = [np.zeros(columns), np.ones(columns)]
            turns = [self._chance.integers(0, 2, columns) * 1.0, self._chance.uniform(size=columns)]
            share = np.choose(way, [*ends, *turns])
            share = self._constant if signal.name == "wheelbase" else share
            low, high = signal.lower, signal.upper
            if signal.name == "curvature":
                low, high = self._path.bins(station)
            rows.append(low + share * (high - low))
        return np.array(rows)

    def turning(self, station: Array) -> Array:
        """What acts on the steering's rate, also of a car at rest."""
        names = [signal.name for signal in self._signals]
        name = "steering_rate_disturbance"
        rows = self.at(station)
        return rows[names.index(name)] if name in names else 0.0 * station


def _sampled(
    window: tuple[float, float], columns: int, chance: np.random.Generator
) -> NDArray[np.int64]:
    """Instants of a window in steps of _FINE_S; a third at either end."""
    first, last = math.ceil(window[0] / _FINE_S - 1e-9), math.floor(window[1] / _FINE_S + 1e-9)
    instants: NDArray[np.int64] = chance.integers(first, last + 1, columns)
    third = columns // 3
    instants[:third], instants[third : 2 * third] = first, last
    return chance.permutation(instants)


@functools.cache
def _runs(case: Case, *, seconds: float, tube: str) -> Array:
    """States (instants, 7, runs) every _FINE_S: at rest until the start (tubes `track`, `stop`),
    TRACK, and BRAKE from an instant of the switch on (tubes `stop`, `brake`)."""
    chance = np.random.default_rng(3)
    x = chance.permutation(case.start.states(_RUNS, chance), axis=1)[:, :_RUNS]
    columns = x.shape[1]
    held = tube != "brake" and case.start_s != _AT_ONCE
    switch_s = case.switch_s if tube == "stop" else case.brake_s
    switch_s = (9.0, 9.0) if tube == "track" else switch_s
    begins = _sampled(case.start_s if held else _AT_ONCE, columns, chance)
    commanded = np.maximum(_sampled(switch_s, columns, chance), begins)
    steps = {
        mode: _stepper(_loop(case.name, braking=mode), columns, case.start.reference_mps)
        for mode in (False, True)
    }
    acts = {mode: _Chosen(case, columns, braking=mode) for mode in (False, True)}
    x = np.vstack([x, np.zeros(columns)])
    seen = []
    for k in range(round(seconds / _FINE_S) + 1):
        reset = (commanded == k) | (held & (begins == k))
        x[SPEED_INTEGRAL] = np.where(reset, 0.0, x[SPEED_INTEGRAL])
        brakes, rests = commanded <= k, begins > k
        shown = x[:CLOCK].copy()
        shown[SPEED] = np.where(brakes, np.maximum(x[SPEED], 0.0), x[SPEED])
        seen.append(shown)
        resting = x.copy()
        resting[STEERING] += _FINE_S * acts[True].turning(x[0])
        moved, acting = x, acts[True].at(x[0])
        # Who brakes goes on braking: in most steps all runs are in one mode.
        if not brakes.all():
            tracked = steps[False](x[:CLOCK], acts[False].at(x[0]))
            moved = np.vstack([tracked, x[CLOCK:]])
        if brakes.any():
            moved = np.where(brakes, steps[True](x, acting), moved)
        x = np.where(rests, resting, moved)
    return np.array(seen)


def _excess(tube: TubeAnswer, seen: Array) -> Array:
    """Largest distance outside of the rows, per state; a tube that stands goes on standing."""
    lower, upper = tube.rows("lower", 7), tube.rows("upper", 7)
    stands = upper[-1, SPEED] <= 0.0
    per_row = round(STEP_S / _FINE_S)
    worst = np.full(7, -np.inf)
    for k in range(len(seen) // per_row):
        if k >= tube.steps and not stands:
            break
        row = min(k, tube.steps - 1)
        part = seen[k * per_row : (k + 1) * per_row + 1]
        outside = np.maximum(lower[row][:, None] - part, part - upper[row][:, None])
        worst = np.maximum(worst, outside.max(axis=(0, 2)))
    return worst


_HELD = {"switch_s": (0.25, 0.285), "start_s": (0.05, 0.085)}
_CASES = [
    *(
        Case("all", *scene, switch_s=switch_s)
        for switch_s in ((0.15, 0.185), (0.0, 0.3))
        for scene in (
            ("straight", STARTS["initial set"]), ("S", STARTS["accelerating"].scaled(0.3)),
            ("right", STARTS["point"]),
        )
    ),
    *(Case("all", "left", STARTS["standing"], side=side, **_HELD) for side in (-1, 0, 1)),
    *(Case("all", "straight", STARTS["point"], side=side) for side in (-1, 1)),
    Case("all", "straight", _RESTING, (0.7, 0.75), (0.5, 0.55)),
]  # fmt: skip


@pytest.mark.parametrize("case", _CASES, ids=str)
def test_no_run_leaves_its_rows_nor_goes_on_when_it_stands(case: Case) -> None:
    answer = case.answer()
    seen = _runs(case, seconds=2.5, tube="stop")
    assert _excess(answer.stop, seen).max() < _TOLERANCE
    seen = seen if case.brake_s == case.switch_s else _runs(case, seconds=2.5, tube="brake")
    assert _excess(answer.brake, seen).max() < _TOLERANCE
    seconds = answer.track.steps * STEP_S
    assert _excess(answer.track, _runs(case, seconds=seconds, tube="track")).max() < _TOLERANCE


def test_most_of_these_tubes_are_complete() -> None:
    """What is refused would be inside of anything."""
    answers = [case.answer() for case in _CASES]
    assert sum(answer.stop.status == COMPLETE for answer in answers) >= 2 * len(_CASES) // 3
    assert sum(answer.track.steps >= 20 for answer in answers) >= 2 * len(_CASES) // 3


# What the kernel's text says of a loop that is disturbed, and what stands there instead.
FAULTS = {
    "nothing slows the car but its orders": ("wb_min(d->push[0], 0.0)", "0.0"),
    "nothing speeds the car up but its orders": ("wb_max(d->push[1], 0.0)", "0.0"),
    "a push is as a pull": ("wb_max(d->push[1], 0.0)", "wb_max(-d->push[0], 0.0)"),
    "a pull is as a push": ("wb_min(d->push[0], 0.0)", "wb_min(-d->push[1], 0.0)"),
    "the push ends with the command": ("(d->push[1] > 0.0 ? held : 0.0)", "0.0"),
    "the speed is never read as less": ("d->low + d->misread[0]", "d->low"),
    "the speed is never read as more": ("d->high + d->misread[1]", "d->high"),
    "what is read as less is as what is read as more": (
        "d->low + d->misread[0]", "d->low - d->misread[1]",
    ),
    "what is read as more is as what is read as less": (
        "d->high + d->misread[1]", "d->high - d->misread[0]",
    ),
    "standing wheels do not turn right": ("wb_min(d->turn[0], 0.0)", "0.0"),
    "standing wheels do not turn left": ("wb_max(d->turn[1], 0.0)", "0.0"),
    "waiting wheels do not turn": ("wb_max(-turn[0], turn[1]) * wait", "0.0"),
}  # fmt: skip
_SATURATED = (
    Start((0.0, 1.4, 0.0, 1.1, 0.0, 0.0, 0.0), (0.0,) * 7, 1.1),
    Start((0.0, -1.4, 0.0, 1.1, 0.0, 0.0, 0.0), (0.0,) * 7, 1.1),
)
_CATCHERS = [
    *(Case("telling", "straight", STARTS["point"], _AT_ONCE, side=side) for side in (-1, 0, 1)),
    *(
        Case("telling", "straight", start, _AT_ONCE, side=side)
        for start in _SATURATED for side in (-1, 0, 1)
    ),
    Case("telling", "straight", Start((0.0,) * 7, (0.0,) * 7, 0.7), _AT_ONCE),
    Case("telling", "straight", _RESTING, (0.7, 0.75), (0.5, 0.55)),
]  # fmt: skip


@functools.cache
def _faulty() -> DecisionKernel:
    return with_faults(_text("telling"), tuple(FAULTS.values()))


@functools.cache
def _caught(number: int) -> float:
    kernel = _faulty()
    ctypes.c_int.in_dll(kernel.handle, "wb_fault").value = number
    return max(
        float(_excess(case.answer(kernel).stop, _runs(case, seconds=2.5, tube="stop")).max())
        for case in _CATCHERS
    )


@pytest.mark.parametrize("name", FAULTS)
def test_some_run_leaves_the_rows_of_a_faulty_kernel(name: str) -> None:
    assert _caught(0) < _TOLERANCE
    assert _caught(list(FAULTS).index(name) + 1) > 2 * _TOLERANCE


def test_a_query_may_narrow_what_disturbs_and_widening_is_invalid() -> None:
    case, text = Case("telling", "straight", STARTS["point"]), _text("telling")
    upper = next(f for f in text.query if f.name == "disturbance_upper").default or ()
    lower = next(f for f in text.query if f.name == "disturbance_lower").default or ()
    whole = case.answer().stop
    calm = case.answer(
        disturbance_lower=(0.0,) * len(lower), disturbance_upper=(0.0,) * len(upper)
    ).stop
    assert whole.status == calm.status == COMPLETE
    gap = [t.rows("upper", 7)[-1] - t.rows("lower", 7)[-1] for t in (whole, calm)]
    assert (gap[1][:5] < 0.9 * gap[0][:5])[[0, 2]].all()
    for k in range(len(upper)):
        wider = [2.0 * w if i == k else w for i, w in enumerate(upper)]
        status = case.answer(disturbance_upper=tuple(wider)).stop.status
        # The kernel sets the curvature and what stands for braking itself.
        felt = k < len(_loop("telling", braking=False).disturbances)
        named = felt and _loop("telling", braking=False).disturbances[k].name != "curvature"
        assert (status in (LEFT_REGION, BAD_INPUT)) == named


def test_what_would_move_a_standing_car_is_invalid() -> None:
    """Kernels for more than the brake can hold, or than the stop speed, are never asked so."""
    case = Case("telling", "straight", STARTS["point"])
    brake = next(f for f in _text("telling").query if f.name == "brake").default or ()
    assert case.answer(brake=tuple(brake)).stop.status == COMPLETE
    weak, early = (0.19, *brake[1:]), (*brake[:4], 0.49)
    for changed in (weak, early):
        assert case.answer(brake=changed).stop.verdict == INVALID
