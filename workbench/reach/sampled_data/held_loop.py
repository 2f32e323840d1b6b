"""A closed loop taken apart: the plant under held commands, and the law at a sample."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import casadi as ca

from workbench.controllers import ReferenceZeroBrake, Track
from workbench.controllers.sampling import Sampling
from workbench.errors import InputError
from workbench.models.closed_loop import ClosedLoop
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode, System
from workbench.reach.ranged_parameters import with_ranged_parameters_as_states

# What the two commands drive, what is added to them, and the integrals of their controllers.
_DRIVEN = ("steering", "speed")
_FELT = ("steering_rate_disturbance", "acceleration_disturbance")
_INTEGRALS = ("offset_integral", "speed_integral")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Law:
    """What a sample does: image (n x 1) of the rows and of the symbols v = (noise, shift).

    noise: known ranges, new at every sample; shift: by how much the loop's `pose_rows` have moved
    when they are measured, one symbol each, none where a sample measures at a known instant.
    """

    ode: Ode
    noise: tuple[Ranged, ...]


@final
@dataclass(frozen=True, slots=True, eq=False)
class HeldLoop:
    """Rows and symbols of a sampled loop.

    loop: the closed loop with ranged parameters as states. Rows of a set: the loop's states, then
    pairs (steering rate, acceleration): what holds, each waiting command, and, where it is unknown
    when a command begins to act, the jump from what holds to it; where samples drift, last the
    time that has really passed. sampling: its timing.
    """

    loop: Ode
    sampling: Sampling
    slots: int
    x: ca.SX

    @classmethod
    def of(cls, system: System, sampling: Sampling, slots: int) -> HeldLoop:
        """Raises InputError for anything but a closed loop under its two PIDs."""
        if not (
            isinstance(system, ClosedLoop) and isinstance(system.mode, Track | ReferenceZeroBrake)
        ):
            raise InputError(
                "expected a ClosedLoop in the mode Track or ReferenceZeroBrake, whose commands a "
                f"sampled controller computes, got {getattr(system, 'mode', system)!r}"
            )
        loop = with_ranged_parameters_as_states(system.ode)
        rows = len(loop.states) + 2 * (slots + 2) + bool(sampling.stretch)
        return cls(loop, sampling, slots, ca.SX.sym("row", rows))

    def pair(self, index: int) -> tuple[int, int]:
        """Rows of pair `index`: 0 what holds, 1 .. slots what waits, slots + 1 the jump."""
        first = len(self.loop.states) + 2 * index
        return first, first + 1

    @property
    def signals(self) -> tuple[Signal, ...]:
        """One per row."""
        names = ["held", *(f"waiting {k}" for k in range(self.slots)), "jump"]
        units = (("steering rate", "rad/s"), ("acceleration", "m/s^2"))
        clock = (Signal("time passed", "s"),) if self.sampling.stretch else ()
        return (
            *self.loop.states,
            *(Signal(f"{name} {what}", unit) for name in names for what, unit in units),
            *clock,
        )

    def row(self, name: str) -> int:
        """Row of a state of the loop."""
        return self.loop.names.index(name)

    @property
    def pose_rows(self) -> list[int]:
        """Rows that a measurement reads: the loop's states but for the controllers' integrals."""
        kept = range(len(self.loop.states))
        return [i for i in kept if self.loop.names[i] not in _INTEGRALS]

    def plant_rates(self, commands: list[ca.SX]) -> ca.SX:
        """Rates of the loop's states under (steering rate, acceleration); integrals rest."""
        rates = ca.vertsplit(self.loop.field)
        for driven, felt, command in zip(_DRIVEN, _FELT, commands, strict=True):
            rates[self.row(driven)] = command + self._disturbance(felt)
        for integral in _INTEGRALS:
            rates[self.row(integral)] = ca.SX(0)
        own = self.x[: len(self.loop.states)]
        return ca.substitute(ca.vertcat(*rates), self.loop.x, own)

    def _disturbance(self, name: str) -> ca.SX:
        names = [d.name for d in self.loop.disturbances]
        return self.loop.w[names.index(name)] if name in names else ca.SX(0)

    def flow(self, *, opening: bool) -> Ode:
        """Between events, in sample time; while `opening`, each command has jumped or not."""
        commands = [self.x[row] for row in self.pair(0)]
        begun = ca.SX.sym("begun", 2 if opening else 0)
        if opening:
            jump = self.pair(self.slots + 1)
            commands = [c + begun[i] * self.x[jump[i]] for i, c in enumerate(commands)]
        rates = self.plant_rates(commands)
        known = [
            Ranged(f"{what} has begun", "1", 0.5, 0.0, 1.0)
            for what in ("steering rate", "acceleration")[: begun.numel()]
        ]
        return self._timed(rates, known, begun)

    def _timed(self, rates: ca.SX, ranged: list[Ranged], symbols: ca.SX) -> Ode:
        """The plant's rates (rows of the loop) as an Ode in sample time."""
        used = [i for i in range(self.loop.w.numel()) if ca.depends_on(rates, self.loop.w[i])]
        ranged = [*(self.loop.disturbances[i] for i in used), *ranged]
        w = [*(self.loop.w[i] for i in used), symbols]
        stretch, own = self.sampling.stretch, rates.numel()
        rates = ca.vertcat(rates, ca.SX.zeros(self.x.numel() - own))
        if stretch:
            pace = ca.SX.sym("pace")
            ends = outward(1 - stretch, 1 + stretch)
            # Kept in front, so that others can find it.
            ranged.insert(0, Ranged("time per sample time", "1", 1.0, *ends))
            w.insert(0, pace)
            rates = pace * ca.vertcat(rates[:-1], 1)
        return Ode(
            name=f"{self.loop.name} under held commands",
            states=self.signals,
            parameters=self.loop.parameters,
            disturbances=tuple(ranged),
            x=self.x,
            p=self.loop.p,
            w=ca.vertcat(*w) if ranged else ca.SX(0, 1),
            field=rates,
        )

    def free(self) -> Ode:
        """The flow with the commands as its last two disturbances, whose ranges are left open."""
        commands = ca.SX.sym("command", 2)
        unknown = [Ranged.exactly(f"command {k}", "", 0.0) for k in range(2)]
        return self._timed(self.plant_rates(ca.vertsplit(commands)), unknown, commands)

    def law(self, slot: int) -> Law:
        """What a sample does: a command to the slot, and the integrals' steps."""
        image = ca.vertsplit(self.x)
        outputs, noise, symbols = self._outputs()
        for row, command in zip(self.pair(1 + slot), outputs[:2], strict=True):
            image[row] = command
        low, high = outward(*self.sampling.integral_steps_s)
        noise.append(Ranged("integral step", "s", self.sampling.period_s, low, high))
        symbols.append(ca.SX.sym("integral_step"))
        for integral, rate in zip(_INTEGRALS, outputs[2:], strict=True):
            image[self.row(integral)] += symbols[-1] * rate
        pose = self.pose_rows if self.sampling.read[1] else []
        shift = ca.SX.sym("shift", len(pose))
        shifted = ca.vertcat(*(self.x[row] + shift[i] for i, row in enumerate(pose)))
        read = ca.vertcat(*(self.x[row] for row in pose))
        if pose:
            for row in (*self.pair(1 + slot), *(self.row(name) for name in _INTEGRALS)):
                image[row] = ca.substitute(image[row], read, shifted)
        v = ca.vertcat(*symbols, shift)
        names = [*(each.name for each in noise), *(f"shift {row}" for row in pose)]
        ode = Ode(
            name=f"{self.loop.name} at a sample",
            states=(*self.signals, *(Signal(f"noise: {name}", "") for name in names)),
            parameters=self.loop.parameters,
            disturbances=(),
            x=ca.vertcat(self.x, v),
            p=self.loop.p,
            w=ca.SX(0, 1),
            field=ca.vertcat(*image, ca.SX.zeros(v.numel())),
        )
        return Law(ode, tuple(noise))

    def _outputs(self) -> tuple[list[ca.SX], list[Ranged], list[ca.SX]]:
        """Both commands, both integrals' rates, and the disturbances they read, as symbols."""
        rates = ca.vertsplit(self.loop.field)
        outputs = [rates[self.row(name)] for name in (*_DRIVEN, *_INTEGRALS)]
        names = [d.name for d in self.loop.disturbances]
        felt = [self.loop.w[names.index(name)] for name in _FELT if name in names]
        found = ca.vertcat(*outputs)
        if felt:
            found = ca.substitute(found, ca.vertcat(*felt), ca.SX.zeros(len(felt)))
        own = self.x[: len(self.loop.states)]
        found = ca.substitute(found, self.loop.x, own)
        used = [i for i in range(len(names)) if ca.depends_on(found, self.loop.w[i])]
        ranged = [self.loop.disturbances[i] for i in used]
        return ca.vertsplit(found), ranged, [self.loop.w[i] for i in used]


def outward(low: Fraction, high: Fraction) -> tuple[float, float]:
    """Doubles around an interval of exact numbers; exact ends stay."""
    ends = float(low), float(high)
    below = ends[0] if Fraction(ends[0]) == low else math.nextafter(ends[0], -math.inf)
    above = ends[1] if Fraction(ends[1]) == high else math.nextafter(ends[1], math.inf)
    return below, above
