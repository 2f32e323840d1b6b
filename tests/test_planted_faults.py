"""Claim: each planted fault of the validated integrator is noticed by a named check."""

from __future__ import annotations

import pytest

faults = pytest.importorskip("validated_faults", reason="python-flint is not installed")


@pytest.mark.parametrize("name", faults.FAULTS)
def test_a_planted_fault_is_caught(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    fault = faults.FAULTS[name]
    fault.plant(monkeypatch)
    assert fault.catch() > 0


@pytest.mark.parametrize("name", faults.FAULTS)
def test_the_check_is_silent_without_the_fault(name: str) -> None:
    assert faults.FAULTS[name].catch() == 0
