"""The library as a table of Markdown, for docs/scenarios.md."""

from __future__ import annotations

from workbench.simulation.scenarios.scenario_file import POLICIES
from workbench.simulation.scenarios.shipped import library, named


def library_table() -> str:
    """One row per shipped scenario: name, what happens, what is expected of each policy."""
    rows = [
        f"| scenario | what happens | {' | '.join(POLICIES)} |",
        "|" + " --- |" * (2 + len(POLICIES)),
    ]
    for name in library():
        scenario = named(name)
        expected = " | ".join(scenario.expected[policy].value for policy in POLICIES)
        rows.append(f"| `{name}` | {scenario.title} | {expected} |")
    return "\n".join(rows) + "\n"
