"""The faults of docs/on-the-vehicle.md, made of `Fault`; run it to write the table anew."""

from __future__ import annotations

from pathlib import Path

from workbench.runtime.onboard.faults import NOT_ON_BOARD, Fault, Latency, Reaction, Release

DOCUMENT = Path(__file__).parent.parent / "docs" / "on-the-vehicle.md"
BEGIN, END = "<!-- faults -->\n", "<!-- end of faults -->\n"


def table() -> str:
    """Meanings of the words, then a line for each fault, then what nobody on board can answer."""
    lines = ["| reaction | what is done |", "| --- | --- |"]
    lines += [f"| {reaction.name} | {reaction.value} |" for reaction in Reaction]
    lines += ["", "| released by | when |", "| --- | --- |"]
    lines += [f"| {release.name} | {release.value} |" for release in Release]
    lines += ["", "| answered within | on the bus |", "| --- | --- |"]
    lines += [f"| {latency.name} | {latency.value} |" for latency in Latency]
    lines += [
        "",
        "| fault | row of the fault list | it is there when | reaction | within | released by |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for fault in Fault:
        rule = fault.rule
        cells = (
            f"`{fault.name}`", rule.row, rule.condition, rule.reaction.name, rule.latency.name,
            rule.release.name,
        )  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", "| row | what happens, since no code on board can answer |", "| --- | --- |"]
    lines += [f"| {row} | {outcome} |" for row, outcome in NOT_ON_BOARD]
    return "\n".join(lines) + "\n"


def with_table(text: str) -> str:
    """The document with the table between its marks."""
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    return before + BEGIN + table() + END + after


if __name__ == "__main__":
    DOCUMENT.write_text(with_table(DOCUMENT.read_text()))
