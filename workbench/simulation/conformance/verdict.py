"""Fit on some recordings, judge on the others: everything that a report of conformance says."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.simulation.conformance.counting import (
    Containment,
    Statement,
    containment,
    statement,
)
from workbench.simulation.conformance.discs import Disc, Prediction, containing, of_area
from workbench.simulation.conformance.enclosing import Enclosed, enclose
from workbench.simulation.conformance.fit import Advance, Fit
from workbench.simulation.conformance.traces import Traces, traces
from workbench.simulation.conformance.windows import Measured, MotionModel, Split

STAGES: Final = 5
"""Of a fit and of what is judged of it, for who waits; without `Verdict.tested_on`."""
_DELTA: Final = 0.05


@final
@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """One fit and how it fares.

    training, held_out: containment by real tubes; held_out_tubes: the tubes behind it; stated: what
    the training recordings support for a further one, None where the tubes do not contain all
    windows that were not left out; pointwise: the stronger alternative, with the share of held-out
    steps within it and the tubes that it makes of the held-out windows; elsewhere: containment of
    all recordings of other sources, by the source's name.
    """

    model: MotionModel
    fit: Fit
    split: Split
    training: Containment
    held_out: Containment
    held_out_tubes: Enclosed
    stated: Statement | None
    pointwise: Traces
    pointwise_share: float | None
    pointwise_tubes: Containment
    elsewhere: tuple[tuple[str, Containment], ...] = ()

    def tested_on(
        self, elsewhere: Sequence[tuple[str, Measured]], *, advance: Advance
    ) -> Verdict:  # fmt: skip
        """The same with the containment of all windows of other sources, each by its name."""
        found = []
        for name, measured in elsewhere:
            tubes = enclose(self.model, self.fit.uncertainty, measured)
            found.append((name, containment(tubes)))
            advance(1)
        return dataclasses.replace(self, elsewhere=tuple(found))

    def reached(self, share: float) -> bool:
        """Are all training windows contained, and this share of the held-out steps and of those of
        each other source?"""
        return self.fit.contained and all(found.steps.value >= share for _, found in self.tested)

    @property
    def tested(self) -> tuple[tuple[str, Containment], ...]:
        """Everything that was not fitted to, with what it is called."""
        elsewhere = ((f"all of {name}", found) for name, found in self.elsewhere)
        return (("other recordings", self.held_out), *elsewhere)

    @property
    def said(self) -> str:
        """The statement, or why there is none."""
        whole = self.training.recordings
        return str(self.stated or (
            "nothing is stated of further recordings: that takes tubes that contain all windows "
            f"fitted to, and {whole.of - whole.inside} of {whole.of} recordings leave theirs"
        ))  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class DiscResult:
    """A disc and how often it contains the held-out positions."""

    kind: str
    disc: Disc
    mean_area_m2: float
    held_out: Containment


def judge(
    model: MotionModel,
    measured: Measured,
    split: Split,
    found: Fit,
    *,
    candidates: int,
    advance: Advance,
) -> Verdict:
    """Test what was found with `split.training` on `split.held_out`.

    candidates: models among which the tightest is chosen by the same training windows; the
    statement's delta is shared among them. advance: told of the two stages after those of `fit`.
    """
    training, held_out = measured.of(split.training), measured.of(split.held_out)
    tubes = enclose(model, found.uncertainty, held_out)
    advance(1)
    points = traces(training.without(found.linear.left_out))
    pointwise = containment(enclose(model, points.uncertainty(), held_out))
    advance(1)
    return Verdict(
        model,
        found,
        split,
        containment(found.enclosed),
        containment(tubes),
        tubes,
        _stated(model, training, found, delta=_DELTA / candidates),
        points,
        points.kept(held_out),
        pointwise,
    )


def _stated(
    model: MotionModel, training: Measured, found: Fit, *, delta: float
) -> Statement | None:
    """Wait and judge needs every recording that it does not count as deciding to be contained."""
    if not found.contained:
        return None
    owners = [window.recording for window in training.windows]
    first = training.recordings[0]
    deciding = {owners[place] for place in (*found.linear.deciding, *found.linear.left_out)}
    if found.deciding is not None:
        deciding.add(found.deciding)
    return statement(
        recordings=len(training.recordings) - 1,
        parameters=len(model.fitted),
        discards=found.linear.outliers > 0,
        supporting=len(deciding - {first}),
        delta=delta,
    )


def discs(
    measured: Measured, verdict: Verdict, *, error_m: float
) -> tuple[tuple[DiscResult, ...], str]:
    """Discs as large as the tubes of the held-out windows, and such that contain the training
    windows that were not left out; and why there is none of the former (empty: there is)."""
    training = measured.of(verdict.split.training).without(verdict.fit.linear.left_out)
    held_out = measured.of(verdict.split.held_out)
    area, least = verdict.held_out.mean_area_m2, math.pi * error_m**2
    results = []
    for prediction in Prediction:
        found = {}
        if area > least:
            found["of the tubes' mean area"] = of_area(
                prediction, held_out, error_m=error_m, mean_area_m2=area
            )
        found["that contains the windows fitted to"] = containing(
            prediction, training, error_m=error_m
        )
        for kind, disc in found.items():
            counts = containment(disc.enclosed(held_out))
            results.append(DiscResult(kind, disc, disc.area_m2(held_out.times_s), counts))
    lacking = "" if area > least else (
        f"no disc has the tubes' mean area: they take {area:.3g} m^2, and a disc {least:.3g} m^2 "
        f"at the beginning already, where the position is known to {error_m:.3g} m"
    )  # fmt: skip
    return tuple(results), lacking
