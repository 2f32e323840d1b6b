"""The safety argument names every fault, hypothesis and assumption that the code has, no others."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from actuation_cases import drive_vehicle

from workbench.codegen import MonitorSpec
from workbench.codegen.assumptions import assumptions
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.policies.cycle import Hypothesis
from workbench.runtime.protocols import PROTOCOLS, load_protocol

PAGE = (Path(__file__).parents[1] / "docs" / "safety-argument.md").read_text(encoding="utf-8")
FAULTS, HYPOTHESES = set(Fault.__members__), set(Hypothesis.__members__)
MESSAGES = {name for protocol in PROTOCOLS for name in load_protocol(protocol).by_name}


def _names(text: str) -> set[str]:
    return set(re.findall(r"`([A-Z][A-Z_0-9]+)`", text))


def _rows(heading: str) -> list[list[str]]:
    section = PAGE.split(f"## {heading}\n", 1)[1].split("\n## ", 1)[0]
    rows = [line for line in section.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[2:]]


def test_every_name_is_one_of_the_code() -> None:
    known = FAULTS | HYPOTHESES | MESSAGES | {"ENCLOSED"}
    assert _names(PAGE) - known == set()


def test_every_fault_and_hypothesis_stands_against_a_hazard() -> None:
    checked = _names(" ".join(row[-1] for row in _rows("From hazards to checks")))
    # Hypotheses of the plan itself that the rows of the induction name are in its first row.
    assert checked >= FAULTS
    assert checked >= HYPOTHESES


def test_every_assumption_of_a_safe_is_looked_at_or_is_a_limit() -> None:
    made = {each.name for each in assumptions(MonitorSpec(drive_vehicle(), 2.0, 0.05))}
    rows = {row[0]: row for row in _rows("Assumptions of a SAFE")}
    assert set(rows) == made
    for name, (_, check, limit) in rows.items():
        assert _names(check) or limit not in ("", "–") or name == "rounding"


def test_every_hazard_has_claim_evidence_and_what_it_rests_on() -> None:
    for hazard, claim, evidence, rests_on, check in _rows("From hazards to checks"):
        assert hazard
        assert claim
        assert {evidence, rests_on, check} != {"–"}
