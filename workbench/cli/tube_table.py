"""A tube as a table with every digit."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workbench.reach import ReachTube


def tube_csv(tube: ReachTube) -> str:
    """Instants and the steps between them in time order, every digit written."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    ends = [f"{name}_{end}" for name in tube.names for end in ("lower", "upper")]
    writer.writerow(["kind", "from_s", "to_s", *ends])

    def row(kind: str, span: tuple[int, int], low: list[float], high: list[float]) -> None:
        times = [float(tube.times[k]) for k in span]
        pairs = zip(low, high, strict=True)
        writer.writerow([kind, *map(repr, [*times, *(end for pair in pairs for end in pair)])])

    for k in range(len(tube.times)):
        row("instant", (k, k), tube.lower_at[k].tolist(), tube.upper_at[k].tolist())
        if k < len(tube.lower):
            row("step", (k, k + 1), tube.lower[k].tolist(), tube.upper[k].tolist())
    return text.getvalue()


def limits_text(tube: ReachTube) -> list[str]:
    """What the tube has proved about limits, as a line; none where its method does not say."""
    if tube.kinks is None or not tube.kinks.linear.size:
        return []
    if tube.kinks.unsaturated:
        return ["limits: none is exceeded at any time (unsaturated throughout)"]
    return [f"limits: may be reached; decided for {tube.kinks.share:.1%} of steps and limits"]


def limits_data(tube: ReachTube) -> dict[str, object]:
    """The same for JSON; null where the method does not say."""
    known = tube.kinks
    return {
        "unsaturated": None if known is None else known.unsaturated,
        "limits_decided_share": None if known is None else known.share,
    }
