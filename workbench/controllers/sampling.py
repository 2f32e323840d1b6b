"""When a digital controller reads, and when its commands act."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from fractions import Fraction
from typing import final

from workbench.errors import InputError

# A time interval in s, exact.
Window = tuple[Fraction, Fraction]


class Jitter(enum.Enum):
    """What the uncertainty of a sample's instant refers to.

    CLOCK: sample k comes within +- jitter of k periods, however many there were; the samples sit on
    a clock. DRIFT: each sample comes one period +- jitter after the one before, so that errors add
    up over time.
    """

    CLOCK = "samples sit on a clock"
    DRIFT = "samples drift"


class IntegralStep(enum.Enum):
    """The time by which the controller multiplies the rate of an integral at a sample.

    NOMINAL: the period. MEASURED: the time since the sample before, as it really was.
    """

    NOMINAL = "nominal period"
    MEASURED = "measured time since the last sample"


@final
@dataclass(frozen=True, slots=True)
class SentCommand:
    """A command sent before t = 0: steering rate (rad/s) and acceleration (m/s^2), as (low, high).

    The values are unknown in the intervals, one for the whole time the command is in force.
    """

    steering_rate_radps: tuple[float, float]
    acceleration_mps2: tuple[float, float]

    def __post_init__(self) -> None:
        for name, (low, high) in (
            ("steering_rate_radps", self.steering_rate_radps),
            ("acceleration_mps2", self.acceleration_mps2),
        ):
            if not (math.isfinite(low) and math.isfinite(high) and low <= high):
                raise InputError(f"SentCommand.{name}: expected (low, high), got {(low, high)!r}")

    @classmethod
    def exactly(cls, steering_rate_radps: float, acceleration_mps2: float) -> SentCommand:
        """A known command."""
        return cls(
            (steering_rate_radps, steering_rate_radps), (acceleration_mps2, acceleration_mps2)
        )


@final
@dataclass(frozen=True, slots=True)
class Sampling:
    """Zero-order hold: the controller works at samples, its last command that has acted holds.

    Sample k is due at k period_s + const and comes with `jitter_s` (see `Jitter`). The state that
    it reads was measured a time in `measurement_delay_s` before; its command acts a time in
    `actuation_delay_s` after, on steering rate and acceleration each at its own instant. All delays
    are any values (low, high) in s, each time anew. t = 0 is the earliest instant of the first
    measurement; where samples drift, the first sample comes the longest measurement delay later. A
    sample computes its command with the integrals as they are, then adds `integral_step` times
    their rates (back-calculation included). Instants are rounded to multiples of 2^-44 s. Raises
    InputError on a period <= 0, on intervals out of order, where two measurements, or two commands,
    could come out of order, and where the commands sent before t = 0 drift too far apart.
    """

    period_s: float
    jitter_s: float
    jitter: Jitter
    measurement_delay_s: tuple[float, float]
    actuation_delay_s: tuple[float, float]
    integral_step: IntegralStep

    def __post_init__(self) -> None:
        if not (math.isfinite(self.period_s) and self.period_s > 0.0):
            raise InputError(f"Sampling.period_s: expected a time > 0 in s, got {self.period_s!r}")
        if not 0.0 <= self.jitter_s < self.period_s / 2.0:
            raise InputError(
                f"Sampling.jitter_s: expected a time in s from 0 to less than half the period, got "
                f"{self.jitter_s!r}"
            )
        for name in ("measurement_delay_s", "actuation_delay_s"):
            low, high = getattr(self, name)
            if not (0.0 <= low <= high and math.isfinite(high)):
                raise InputError(
                    f"Sampling.{name}: expected 0 <= low <= high in s, got {(low, high)!r}"
                )
        for what, (low, high) in (("measurements", self.read), ("commands", self.act)):
            # A margin, since instants are rounded.
            if high - low > Fraction(self.period_s) - Fraction(1, 10**9):
                raise InputError(
                    f"Sampling: two {what} could come out of order, because delays and jitter "
                    f"leave {float(high - low):.4g} s open and the period is {self.period_s!r} s; "
                    "narrow the delays or lengthen the period"
                )
        self._check_sent()

    def _check_sent(self) -> None:
        """Commands sent before t = 0 must begin to act one after the other in sample time too.

        The earlier a command was sent, the more it drifts: the two sent first decide.
        """
        before, period = self.commands_sent - 2, Fraction(self.period_s)
        if before < 1:
            return
        opens = max(Fraction(0), self.act[0] - self.ahead(before) - before * period)
        if self.act[1] - (before + 1) * period > opens - Fraction(1, 10**9):
            raise InputError(
                f"Sampling: the instants of the {self.commands_sent} commands sent before t = 0 "
                f"drift so far apart that they overlap, at jitter_s={self.jitter_s!r}; lessen the "
                "jitter or the delays"
            )

    @property
    def stretch(self) -> Fraction:
        """Largest relative error of the time between samples that adds up; 0 on a clock."""
        if self.jitter is Jitter.CLOCK:
            return Fraction(0)
        return Fraction(self.jitter_s) / Fraction(self.period_s)

    @property
    def read(self) -> Window:
        """When sample k measures, from k periods on; where samples drift, in sample time.

        Sample time runs by one period from sample to sample, so that it is 1 / (1 +- stretch) of
        the time.
        """
        return Fraction(0), 2 * self._shake() + self._longest_delay() - self._shortest(
            self.measurement_delay_s[0]
        )

    @property
    def act(self) -> Window:
        """When the command of sample k begins to act, from k periods on; as `read`."""
        low, high = self.actuation_delay_s
        start = self._longest_delay()
        return start + self._shortest(low), start + 2 * self._shake() + self._longest(high)

    def ahead(self, before: int) -> Fraction:
        """How much earlier than `act` says the command of sample -`before` may begin to act.

        The first sample comes at the longest measurement delay m, at the sample time m / (1 -
        stretch). Back from there to a command sent before, the time may have run at the fastest
        pace; the sample time in between then is what the slowest pace gives.
        """
        stretch = self.stretch
        back = before * Fraction(self.period_s) * (1 + stretch) - Fraction(
            self.actuation_delay_s[0]
        )
        return max(back, Fraction(0)) * 2 * stretch / (1 - stretch**2)

    @property
    def commands_sent(self) -> int:
        """How many commands were sent before t = 0 and act then or later: one holds, the others are
        under way."""
        # What acts less than the rounding of instants after t = 0 holds then.
        late = self.act[1] - Fraction(1, 2**45)
        return max(1, math.ceil(late / Fraction(self.period_s)))

    def _shake(self) -> Fraction:
        return Fraction(self.jitter_s if self.jitter is Jitter.CLOCK else 0.0)

    def _longest_delay(self) -> Fraction:
        return self._longest(self.measurement_delay_s[1])

    def _longest(self, delay_s: float) -> Fraction:
        return Fraction(delay_s) / (1 - self.stretch)

    def _shortest(self, delay_s: float) -> Fraction:
        return Fraction(delay_s) / (1 + self.stretch)

    @property
    def integral_steps_s(self) -> Window:
        """What an integral's rate is multiplied with."""
        period, jitter = Fraction(self.period_s), Fraction(self.jitter_s)
        if self.integral_step is IntegralStep.NOMINAL:
            return period, period
        open_s = jitter if self.jitter is Jitter.DRIFT else 2 * jitter
        return period - open_s, period + open_s
