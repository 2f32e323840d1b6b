"""Learn a discrepancy from pairs of runs, wherever they come from."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.sensitivity.discrepancy import Discrepancy
from workbench.sensitivity.learning.evidence import Evidence
from workbench.sensitivity.learning.form import Fit, Form, Progress
from workbench.sensitivity.learning.pairs import PairSource
from workbench.sensitivity.learning.statement import Statement
from workbench.sets.box import Box


def learn_from_pairs(
    pairs: PairSource,
    *,
    count: int,
    form: Form,
    evidence: Sequence[Evidence],
    region: Box | None,
    progress: Progress | None = None,
) -> Discrepancy:
    """Fit `form` to pairs number 0 .. count - 1, and state what they support. Rigor SAMPLED.

    evidence: chosen before the runs are seen; each gives one statement, at its own confidence.
    region: the set both ends were drawn from, where there is one. Raises InputError where a run is
    not finite, the form cannot contain the pairs, or the source has too few.
    """
    if not evidence:
        raise InputError(
            "expected at least one statement about the pairs; pass evidence=[APriori(delta=1e-6)]"
        )
    fit = form.fit(pairs, count, progress=progress)
    statements = tuple(each.state(fit, pairs, count) for each in evidence)
    return discrepancy_of(fit, pairs, region=region, statements=statements)


def discrepancy_of(
    fit: Fit, pairs: PairSource, *, region: Box | None, statements: tuple[Statement, ...]
) -> Discrepancy:
    """The fitted bound with its statements in words."""
    said = "; ".join(map(str, statements))
    return Discrepancy(
        names=tuple(pairs.names),
        region=region,
        horizon_s=float(pairs.times[-1]),
        rigor=Rigor.SAMPLED,
        growth=fit.growth,
        norm=fit.norm,
        condition=f"pairs of runs drawn as stated: {said}",
        statements=statements,
    )
