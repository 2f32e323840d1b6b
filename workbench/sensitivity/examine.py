"""Cross-examination: a learned discrepancy against samples, gradient search and proved bounds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.claims import Rigor, weakest
from workbench.errors import InputError
from workbench.models.system import System
from workbench.sensitivity.ascent import Goals, Pairs, ascend, joined
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.examination import (
    Coverage,
    Examination,
    ExaminationVerdict,
    Examiner,
    ProvedCurve,
    ProvedEnvelope,
)
from workbench.sensitivity.sampling import (
    Flow,
    face_states,
    instants,
    ordered_box,
    parameter_states,
    uniform_states,
    vertex_states,
)
from workbench.sensitivity.vectorised import Array
from workbench.sensitivity.witness import Witness, confirmed
from workbench.sets.box import Box


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
    |e_i(t)| <= learned.radius(half widths, t)_i at the step instants. proved: bounds to compare
    with. The search is by samples and gradients in floats: only REFUTED (replayed with a smaller
    step and its error estimated) and IMPLIED_BY_PROOF (as good as the proof) are conclusions;
    CONSISTENT is none. Raises InputError where names do not fit or the horizon is not a whole
    number of steps.
    """
    box = ordered_box(system.ode, initial_set, "initial set")
    if learned.names != system.ode.names:
        raise InputError(f"expected a bound over {system.ode.names}, got one over {learned.names}")
    times = instants(horizon_s, method.step_s)
    flow = Flow(system, horizon_s, method.step_s)
    bound = np.array([learned.radius(box.radius, t) for t in times.tolist()])
    groups = _groups(system, box, method)
    differences = {name: np.abs(pairs.differences(flow)) for name, pairs in groups.items()}
    coverage = tuple(_coverage(name, d, bound) for name, d in differences.items())
    everything = joined(list(groups.values()))
    distances = np.concatenate(list(differences.values()))
    sampled = np.nanmax(distances, axis=0)
    found = _driven(flow, box, pairs=everything, distances=distances, bound=bound, method=method)
    found_distances = np.abs(found.differences(flow))
    driven = np.fmax(sampled, np.nanmax(found_distances, axis=0))
    pool = joined([everything, found])
    pool_distances = np.concatenate([distances, found_distances])
    ratios = _ratios(pool_distances, bound)
    witness = _witness(flow, pool, ratios=ratios, times=times, claim=learned)
    curves = tuple(
        _curve(p, box, times, learned=bound, reached=driven, method=method) for p in proved
    )
    return Examination(
        _verdict(witness, curves),
        witness,
        learned.names,
        times,
        sampled,
        driven,
        bound,
        curves,
        coverage,
    )


def _verdict(witness: Witness | None, curves: tuple[ProvedCurve, ...]) -> ExaminationVerdict:
    if witness is not None:
        return ExaminationVerdict.REFUTED
    if any(curve.implies_learned and curve.rigor is Rigor.ENCLOSED for curve in curves):
        return ExaminationVerdict.IMPLIED_BY_PROOF
    return ExaminationVerdict.CONSISTENT


def _groups(system: System, box: Box, method: Examiner) -> dict[str, Pairs]:
    rng = np.random.default_rng(method.seed)
    count, center, half = method.samples, np.array(box.center), np.array(box.radius)

    def about_center(states: Array) -> Pairs:
        first = np.tile(center, (len(states), 1))
        return Pairs(first, states, parameter_states(system.ode.parameters, len(states), rng))

    groups = {
        "interior": about_center(uniform_states(box, count, rng)),
        "faces": about_center(face_states(box, count, rng)),
        "vertices": about_center(vertex_states(box, most=count, rng=rng)),
    }
    if method.any_centre:
        first = face_states(box, count, rng)
        shift = np.where(rng.random((count, 1)) < 0.5, 1.0, rng.random((count, len(half))))
        shift = shift * rng.choice([-1.0, 1.0], size=(count, len(half))) * half
        second = np.clip(first + shift, np.array(box.lower), np.array(box.upper))
        parameters = parameter_states(system.ode.parameters, count, rng)
        groups["other centres"] = Pairs(first, second, parameters)
    return groups


def _ratios(distances: Array, bound: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = distances / bound
    ratios = np.where((bound == 0.0) & (distances == 0.0), 0.0, ratios)
    return np.where(np.isfinite(distances), ratios, np.inf)


def _coverage(group: str, distances: Array, bound: Array) -> Coverage:
    ratios = _ratios(distances, bound).max(axis=2)
    # At t = 0 the two sides are the same number up to its last digit.
    inside = ratios <= 1.0 + 1e-12
    return Coverage(
        group,
        len(distances),
        inside.mean(axis=0),
        float(inside.all(axis=1).mean()),
        float(ratios.max()),
    )


def _driven(
    flow: Flow, box: Box, *, pairs: Pairs, distances: Array, bound: Array, method: Examiner
) -> Pairs:
    """Drive each coordinate's distance up at its worst instants and at evenly spaced ones."""
    size = distances.shape[2]
    worst = _ratios(distances, bound).max(axis=0)
    half = (method.goals_per_coordinate + 1) // 2
    spaced = np.linspace(1, len(bound) - 1, method.goals_per_coordinate - half + 1)[1:].astype(int)
    chosen = [
        (i, int(k))
        for i in range(size)
        for k in np.union1d(1 + np.argsort(worst[1:, i], kind="stable")[-half:], spaced)
    ]
    coordinate, instant = (np.array(part) for part in zip(*chosen, strict=True))
    rows = np.array([int(np.nanargmax(distances[:, k, i])) for i, k in chosen])
    start = pairs.take(rows)
    signed = start.differences(flow)[np.arange(len(rows)), instant, coordinate]
    goals = Goals(coordinate, instant, np.where(signed < 0.0, -1.0, 1.0))
    return ascend(
        flow, box, goals=goals, start=start, rounds=method.rounds, move_first=method.any_centre
    )


def _witness(
    flow: Flow, pairs: Pairs, *, ratios: Array, times: Array, claim: Discrepancy
) -> Witness | None:
    """The confirmed witness with the largest distance / bound; one try per coordinate."""
    candidates = []
    for i in range(ratios.shape[2]):
        column = ratios[:, 1:, i]
        row, k = np.unravel_index(int(np.argmax(column)), column.shape)
        if column[row, k] <= 1.0:
            continue
        pair = pairs.take(np.array([row]))
        found = confirmed(flow, pair, coordinate=i, time_s=float(times[k + 1]), claim=claim)
        if found is not None:
            candidates.append(found)
    return max(candidates, key=lambda w: w.distance / max(w.bound, 1e-300), default=None)


def _curve(
    proved: Discrepancy | ProvedEnvelope,
    box: Box,
    times: Array,
    *,
    learned: Array,
    reached: Array,
    method: Examiner,
) -> ProvedCurve:
    rigor = proved.rigor
    if isinstance(proved, Discrepancy):
        name, covers = proved.norm, True
        if proved.region is not None:
            rigor = weakest(rigor, method.stays_in_region)
        rows = [proved.radius(box.radius, t) for t in times.tolist()]
    else:
        name, covers = proved.name, not method.any_centre
        rows = [tuple(proved.half_widths(t)) for t in times.tolist()]
    half_widths = np.array(rows)
    return ProvedCurve(
        name,
        half_widths,
        rigor,
        proved.condition,
        implies_learned=covers and bool(np.all(half_widths <= learned)),
        worst_ratio=float(_ratios(reached, half_widths).max()),
    )
