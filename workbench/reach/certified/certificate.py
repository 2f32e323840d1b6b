"""Certificates: all that is needed to re-check a proved bound without this package's methods.

docs/certificates.md describes the format; `workbench check` verifies it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from workbench.errors import InputError
from workbench.models.system import Ode, System
from workbench.reach.certified.cell_tree import splits_of
from workbench.reach.certified.frame_step import widened
from workbench.reach.certified.frame_tube import FrameProof
from workbench.reach.certified.graph import CertifiedModel, certified_model
from workbench.sensitivity.blockwise import BlockwiseGrowth
from workbench.sensitivity.discrepancy import Discrepancy, Growth
from workbench.sensitivity.growth_matrix import MetzlerGrowth
from workbench.sensitivity.inputs import Inputs
from workbench.sensitivity.interval_arrays import Interval
from workbench.sensitivity.kink_ranges import decimal_hull
from workbench.sensitivity.weighted_norm import ExponentialGrowth, Norm
from workbench.sets.box import Box

FORMAT = "workbench certificate 1"
SPREAD = (
    "Let x, y solve the model with measurable inputs u, v in `ranges`, |u_j - v_j| <= "
    "differences_j, and stay in `region` (null: unrestricted) for 0 <= t <= horizon_s. Then N(t) "
    "<= exp(C t) N(0) + integral of exp(C s) M over [0, t], where C has the rows `comparison`, N_k "
    "is max P_ii |e_i| (max), sum P_ii |e_i| (sum) or sqrt(e' P e) (quadratic), P = `metric`, for "
    "e = x - y in block k, and M_k is the largest N_k of any e with |e_i| <= mismatch_i. So "
    "|e_i(0)| <= initial_i gives |e_i| <= widths_i at `instants`."
)
TUBE = (
    "Each solution of the model from `initial` at times_s[0], with any measurable inputs in "
    "`ranges`, exists up to the last of `times_s`, lies in instants[k] at times_s[k] and in "
    "rows[k] for times_s[k] <= t <= times_s[k+1]."
)


def certificate_text(document: Mapping[str, object]) -> str:
    """The file's text: JSON on one line per field of the document, the same for the same bound."""
    parts = [f'"{key}": {json.dumps(value, allow_nan=False)}' for key, value in document.items()]
    return "{\n" + ",\n".join(parts) + "\n}\n"


def spread_certificate(
    system: System,
    discrepancy: Discrepancy,
    *,
    initial_radius: Mapping[str, float],
    instants_s: Sequence[float],
    slack: float,
) -> dict[str, object]:
    """The certificate of a proved discrepancy of `system`, as a JSON document.

    It claims |e_i(t)| <= widths_i at each of `instants_s` (s, within the horizon) for initial
    distances up to `initial_radius` (state -> its unit; missing means 0). slack: rates, couplings
    and mismatch are raised by this share (and by as much of one unit) before they are written,
    because the checker encloses the Jacobian by its own expressions; any larger number is also
    true. Rigor of what is written: the discrepancy's; of what `workbench check` accepts: proved.
    Raises InputError for a discrepancy without a proof, and as `certified_model`.
    """
    proof = discrepancy.proof
    if proof is None or discrepancy.region is None:
        raise InputError(
            f"expected a discrepancy that was proved over a region, got {discrepancy.norm!r}; "
            "derive it with one of the methods of workbench.sensitivity"
        )
    model, growth = certified_model(system), _raised(discrepancy.growth, slack)
    initial = [float(initial_radius.get(name, 0.0)) for name in discrepancy.names]
    claim = {
        "region": _region(discrepancy.region, discrepancy.names),
        "ranges": [list(pair) for pair in model.ranges],
        "differences": _differences(system.ode, model, proof.inputs),
        "horizon_s": discrepancy.horizon_s,
        **_norms(growth),
        "mismatch": list(growth.mismatch),
        "initial": initial,
        "instants": [_instant(growth, initial, t) for t in instants_s],
    }
    splits = splits_of(proof.cells, discrepancy.region, discrepancy.names)
    return document("spread", SPREAD, model, claim, {"splits": splits})


def _instant(growth: Growth, initial: list[float], t_s: float) -> dict[str, object]:
    # A little more than the bound, so that a checker with other roundings agrees.
    widths = [v * (1.0 + 1e-9) + 1e-12 for v in growth.half_widths(tuple(initial), t_s)]
    return {"time_s": t_s, "widths": widths}


def _region(region: Box, names: tuple[str, ...]) -> list[list[float] | None]:
    return [list(region.interval(name)) if name in region.names else None for name in names]


def document(
    kind: str, statement: str, model: CertifiedModel, claim: object, proof: object
) -> dict[str, object]:
    """The outer form that all kinds share."""
    return {
        "format": FORMAT,
        "kind": kind,
        "statement": statement,
        "model": model.document(),
        "claim": claim,
        "proof": proof,
    }


Proved = BlockwiseGrowth | MetzlerGrowth | ExponentialGrowth


def _raised(growth: Growth, slack: float) -> Proved:
    """A weaker bound of the same kind."""

    def matrix(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        return tuple(
            tuple(v + slack * (1.0 + abs(v) if k == j else v + 1e-3) for j, v in enumerate(row))
            for k, row in enumerate(rows)
        )

    if not isinstance(growth, BlockwiseGrowth | MetzlerGrowth | ExponentialGrowth):
        raise InputError(
            f"certificates have no form of {type(growth).__name__}; use GrowthMatrix, "
            "WeightedNorm, EuclideanNorm, OptimalMetric or BlockGrowth"
        )
    felt = tuple(value * (1.0 + slack) for value in growth.mismatch)
    if isinstance(growth, BlockwiseGrowth):
        return replace(growth, comparison=matrix(growth.comparison), mismatch=felt)
    if isinstance(growth, MetzlerGrowth):
        return replace(growth, matrix=matrix(growth.matrix), mismatch=felt)
    return replace(growth, rate_per_s=matrix(((growth.rate_per_s,),))[0][0], mismatch=felt)


def _norms(growth: Proved) -> dict[str, object]:
    if isinstance(growth, BlockwiseGrowth):
        parts = zip(growth.blocks, growth.metrics, growth.comparison, strict=True)
        return {"norm": "quadratic", "blocks": [_block(*part) for part in parts]}
    if isinstance(growth, MetzlerGrowth):
        singles = [_block((i,), ((1.0,),), row) for i, row in enumerate(growth.matrix)]
        return {"norm": "max", "blocks": singles}
    size = range(len(growth.weights))
    metric = tuple(tuple(w if i == j else 0.0 for j in size) for i, w in enumerate(growth.weights))
    norm = "max" if growth.norm is Norm.MAX else "sum"
    return {"norm": norm, "blocks": [_block(tuple(size), metric, (growth.rate_per_s,))]}


def _block(
    states: tuple[int, ...], metric: tuple[tuple[float, ...], ...], comparison: tuple[float, ...]
) -> dict[str, object]:
    return {
        "states": list(states),
        "metric": [list(row) for row in metric],
        "comparison": list(comparison),
    }


def _differences(ode: Ode, model: CertifiedModel, inputs: Inputs) -> list[float]:
    """How far an input's two values can be apart; constants of the graph are the same for both."""
    signals = [*ode.parameters, *ode.disturbances]
    gaps = [0.0] * len(model.inputs)
    for k, (signal, (low, high)) in enumerate(zip(signals, model.ranges, strict=False)):
        shared = inputs is Inputs.SAME_PARAMETERS and k < len(ode.parameters)
        if inputs is Inputs.SHARED or shared or signal.lower == signal.upper:
            continue
        gap = high - low
        if inputs is Inputs.AGAINST_NOMINAL:
            ends = decimal_hull(signal.nominal)
            gap = max(high - ends[0], ends[1] - low)
        gaps[k] = math.nextafter(gap, math.inf)
    return gaps


def tube_certificate(proof: FrameProof) -> dict[str, object]:
    """The certificate of a moving-frame tube up to where its proof ends, as a JSON document."""
    frames = [
        {
            "center": frame.center.tolist(),
            "frame": frame.matrix.tolist(),
            "inverse": frame.inverse.tolist(),
            "radius": frame.radius.tolist(),
        }
        for frame in proof.frames
    ]
    steps = [
        {"box": _pairs(step.box), "cores": [_pairs(core) for core in step.cores]}
        for step in proof.steps
    ]
    claim = {
        "initial": _pairs(proof.initial),
        "ranges": [list(pair) for pair in proof.model.ranges],
        "times_s": list(proof.times),
        "instants": [_pairs(widened(frame.states)) for frame in proof.frames],
        "rows": [_pairs(widened(step.row)) for step in proof.steps],
    }
    return document("tube", TUBE, proof.model, claim, {"frames": frames, "steps": steps})


def _pairs(box: Interval) -> list[list[float]]:
    return np.stack(box, axis=1).tolist()  # type: ignore[no-any-return]
