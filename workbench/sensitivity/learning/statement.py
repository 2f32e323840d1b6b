"""What the runs behind a learned bound say about further ones, in numbers and in words."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final, final

NOTHING_BETWEEN: Final = "nothing is claimed between the instants"


class Argument(enum.Enum):
    """Why the probability of a violation is bounded.

    A_PRIORI: by the number of fitted parameters, known before the runs. WAIT_AND_JUDGE: by the
    number of pairs that carry the fitted bound. HOLD_OUT: by violations counted on fresh pairs.
    NONE: it is not, because the runs used are not independent pairs.
    """

    A_PRIORI = "a priori"
    WAIT_AND_JUDGE = "wait and judge"
    HOLD_OUT = "hold-out"
    NONE = "none"


_COUNTED: Final = {
    Argument.A_PRIORI: "a priori, by the {} fitted parameters",
    Argument.WAIT_AND_JUDGE: "wait and judge, by the {} pairs that carry the fit",
    Argument.HOLD_OUT: "by {} violations among fresh pairs that the fit has not seen",
}


@final
@dataclass(frozen=True, slots=True)
class Statement:
    """With confidence 1 - delta, a further pair leaves the bound with probability <= epsilon.

    epsilon: for leaving it at any of the instants, in any state. epsilon_at_an_instant: for leaving
    it, in any state, at one instant chosen beforehand. pairs: independent pairs it rests on.
    counted: fitted parameters, pairs that carry the fit, or violations seen, as `argument` says.
    distribution: what a further pair is drawn from. between: what is claimed between the instants.
    """

    argument: Argument
    epsilon: float
    epsilon_at_an_instant: float
    delta: float
    pairs: int
    counted: int
    distribution: str
    between: str = NOTHING_BETWEEN

    def __str__(self) -> str:
        if self.argument is Argument.NONE:
            return (
                f"no probability is claimed for further runs: {self.distribution}; {self.between}"
            )
        reason = _COUNTED[self.argument].format(self.counted)
        return (
            f"with confidence 1 - {self.delta:g}, a further pair drawn as the {self.pairs} were "
            f"({self.distribution}) leaves the bound at some step instant with probability at most "
            f"{self.epsilon:.3g}, and at one given instant with at most "
            f"{self.epsilon_at_an_instant:.3g} ({reason}); {self.between}, nor for other "
            "distributions, such as vertices"
        )
