"""Cross-examination: a learned discrepancy against samples, gradient search and proved bounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from workbench.claims import Rigor, weakest
from workbench.errors import InputError
from workbench.models.system import System
from workbench.sensitivity.ascent import Pairs, joined
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.examination import (
    Coverage,
    Examination,
    ExaminationVerdict,
    Examiner,
    ProvedCurve,
    ProvedEnvelope,
)
from workbench.sensitivity.examine_pairs import (
    CLOSER,
    Trial,
    closer_pairs,
    own_distances,
    trial_groups,
)
from workbench.sensitivity.examine_search import pressed, ratios
from workbench.sensitivity.sampling import Flow, instants, ordered_box, parameter_states
from workbench.sensitivity.vectorised import Array
from workbench.sensitivity.witness import AnyWitness, confirmed
from workbench.sets.box import Box

Confirm = Callable[[Pairs, int, float], AnyWitness | None]

# Instants per coordinate at which a pair is run again before the bound is let go.
_TRIES = 5
# Shares of all that breaks the bound, in the order of by how much.
_LESSER = (0.75, 0.5, 0.25)
# Instants at which the bound is evaluated for every closer pair's own distances.
_OWN_INSTANTS = 24
# At t = 0 the two sides are the same number up to its last digit.
_ROUNDING = 1e-12


def cross_examine(
    system: System,
    *,
    initial_set: Box,
    horizon_s: float,
    learned: Discrepancy,
    proved: Sequence[Discrepancy | ProvedEnvelope],
    method: Examiner,
) -> Examination:
    """Try to refute `learned`, and put it beside sampled and proved growth.

    initial_set: box over all states; its half widths are the initial radius of the claim examined:
    |e_i(t)| <= learned.radius(half widths, t)_i at the step instants; closer pairs are held to the
    radius of their own distances. proved: bounds to compare with. The search is by samples,
    gradients and curvature in floats: only REFUTED (run again with a smaller step, its error
    estimated) and IMPLIED_BY_PROOF (from the half widths, as good as the proof) are conclusions;
    CONSISTENT is none. Raises InputError where names do not fit or the horizon is not a whole
    number of steps.
    """
    ode = system.ode
    box = ordered_box(ode, initial_set, "initial set")
    if learned.names != ode.names:
        raise InputError(f"expected a bound over {ode.names}, got one over {learned.names}")
    flow = Flow(system, horizon_s, method.step_s)
    trial = Trial(
        flow,
        box,
        instants(horizon_s, method.step_s),
        lambda count, rng: parameter_states(ode.parameters, count, rng),
        ode.parameters,
    )
    return examined(
        trial,
        learned,
        proved,
        method,
        confirm=lambda pair, i, t: confirmed(flow, pair, coordinate=i, time_s=t, claim=learned),
    )


def examined(
    trial: Trial,
    learned: Discrepancy,
    proved: Sequence[Discrepancy | ProvedEnvelope],
    method: Examiner,
    *,
    confirm: Confirm,
) -> Examination:
    """The examination of a prepared trial; confirm: runs a pair again, None if it fails."""
    times, half_widths = trial.times, trial.box.radius
    bound = np.array([learned.radius(half_widths, t) for t in times.tolist()])
    groups = trial_groups(trial, method)
    pairs = joined(list(groups.values()))
    differences = pairs.differences(trial.flow)
    ends = np.cumsum([len(group.first) for group in groups.values()])
    parts = zip(groups, np.split(ratios(np.abs(differences), bound), ends[:-1]), strict=True)
    coverage = [_coverage(name, found) for name, found in parts]
    sampled = np.fmax.reduce(np.abs(differences), axis=0)
    found, its = pressed(trial, pairs=pairs, differences=differences, bound=bound, method=method)
    pool, distances = joined([pairs, found]), np.abs(np.concatenate([differences, its]))
    witness = _witness(pool, _shown(distances, ratios(distances, bound)), times, confirm)
    if method.closer:
        closer = closer_pairs(trial, method)
        rows, apart, own = _own_ratios(closer, trial, learned)
        coverage.append(_coverage(CLOSER, own))
        witness = witness or _witness(closer, _shown(apart, own), times[rows], confirm)
    reached = np.fmax.reduce(distances, axis=0)
    curves = tuple(_curve(p, trial, learned=bound, reached=reached, method=method) for p in proved)
    return Examination(
        _verdict(witness, curves),
        witness,
        learned.names,
        times,
        sampled,
        reached,
        bound,
        curves,
        tuple(coverage),
        tightness(bound, reached),
    )


def tightness(half_widths: Array, reached: Array) -> Array:
    """Mean over the instants after the first of half width / reached (n,); NaN where none moved."""
    moved = reached[1:] > 0.0
    ratio = np.where(moved, half_widths[1:] / np.where(moved, reached[1:], 1.0), 0.0)
    count = moved.sum(axis=0)
    return np.where(count > 0, ratio.sum(axis=0) / np.maximum(count, 1), np.nan)


def _verdict(witness: AnyWitness | None, curves: tuple[ProvedCurve, ...]) -> ExaminationVerdict:
    if witness is not None:
        return ExaminationVerdict.REFUTED
    if any(curve.implies_learned and curve.rigor is Rigor.ENCLOSED for curve in curves):
        return ExaminationVerdict.IMPLIED_BY_PROOF
    return ExaminationVerdict.CONSISTENT


def _shown(distances: Array, found: Array) -> Array:
    """The ratios that a witness can show: 0 where a run left the finite numbers."""
    return np.where(np.isfinite(distances), found, 0.0)


def _own_ratios(pairs: Pairs, trial: Trial, learned: Discrepancy) -> tuple[Array, Array, Array]:
    """Instants' numbers (M,), distances and distance / bound of the own initial distances, both (N,
    M, n)."""
    last = len(trial.times) - 1
    rows = np.unique(np.linspace(0, last, min(_OWN_INSTANTS, last + 1)).astype(int))
    distances = np.abs(pairs.differences(trial.flow))[:, rows]
    gaps = own_distances(pairs).tolist()
    bound = np.array([[learned.radius(gap, t) for t in trial.times[rows].tolist()] for gap in gaps])
    return rows, distances, ratios(distances, bound)


def _coverage(group: str, found: Array) -> Coverage:
    worst = found.max(axis=2)
    inside = worst <= 1.0 + _ROUNDING
    return Coverage(
        group,
        len(worst),
        inside.mean(axis=0),
        float(inside.all(axis=1).mean()),
        float(worst.max()),
    )


def _witness(pairs: Pairs, found: Array, times: Array, confirm: Confirm) -> AnyWitness | None:
    """The confirmed witness with the largest distance / bound among a few tries per coordinate."""
    candidates = []
    for i in range(found.shape[2]):
        for row, k in _tries(found[:, :, i]):
            witness = confirm(pairs.take(np.array([row])), i, float(times[k]))
            if witness is not None:
                candidates.append(witness)
                break
    return max(candidates, key=lambda w: w.distance / max(w.bound, 1e-300), default=None)


def _tries(column: Array) -> list[tuple[int, int]]:
    """Pairs and instants that break the bound: the worst pair of the worst instants; then some that
    break it by less, as the worst may be runs on their way out of all numbers."""
    worst = np.argsort(-column.max(axis=0), kind="stable")[:_TRIES]
    rows = column[:, worst].argmax(axis=0)
    tries = [(int(row), int(k)) for row, k in zip(rows, worst, strict=True) if column[row, k] > 1.0]
    breaking = np.flatnonzero(column > 1.0)
    ordered = breaking[np.argsort(column.ravel()[breaking], kind="stable")]
    for share in _LESSER if len(ordered) else ():
        row, k = np.unravel_index(ordered[int(share * (len(ordered) - 1))], column.shape)
        tries.append((int(row), int(k)))
    return tries


def _curve(
    proved: Discrepancy | ProvedEnvelope,
    trial: Trial,
    *,
    learned: Array,
    reached: Array,
    method: Examiner,
) -> ProvedCurve:
    rigor, times = proved.rigor, trial.times.tolist()
    if isinstance(proved, Discrepancy):
        name, covers = proved.norm, True
        if proved.region is not None:
            rigor = weakest(rigor, method.stays_in_region)
        rows = [proved.radius(trial.box.radius, t) for t in times]
    else:
        name, covers = proved.name, not method.any_centre
        rows = [tuple(proved.half_widths(t)) for t in times]
    half_widths = np.array(rows)
    return ProvedCurve(
        name,
        half_widths,
        rigor,
        proved.condition,
        implies_learned=covers and bool(np.all(half_widths <= learned)),
        worst_ratio=float(ratios(reached, half_widths).max()),
        tightness=tightness(half_widths, reached),
    )
