"""Claim: fitted figures come into a vehicle file as its section, all else letter by letter."""

from __future__ import annotations

from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.models.vehicle import gem_e2_path, load_vehicle
from workbench.models.vehicle_sections import Uncertainty
from workbench.simulation.conformance.section import section_text, with_section

FOUND = Uncertainty(
    acceleration_mps2=0.12, steering_rate_radps=0.03, wheelbase_m=0.02,
    provenance='12 runs, "every other" one\\',
)  # fmt: skip


def test_the_written_file_loads_with_the_figures(tmp_path: Path) -> None:
    file = tmp_path / "vehicle.toml"
    text = gem_e2_path().read_text(encoding="utf-8")
    file.write_text(with_section(text, FOUND), encoding="utf-8")
    vehicle, shipped = load_vehicle(file), load_vehicle(gem_e2_path())
    assert vehicle.uncertainty.disturbance() == FOUND.disturbance()
    assert vehicle.uncertainty.wheelbase_m == 0.02
    assert vehicle.uncertainty.provenance.strip() == FOUND.provenance
    assert vehicle.guard == shipped.guard
    assert vehicle.limits == shipped.limits


@pytest.mark.parametrize("place", ["first", "between", "last"])
def test_an_old_section_goes_wherever_it_stands(place: str, tmp_path: Path) -> None:
    text = gem_e2_path().read_text(encoding="utf-8")
    old = section_text(Uncertainty(lateral_m=0.5, provenance="[guard]\nnot a header"))
    whole = {
        "first": old + text,
        "between": text.replace("[guard]", old + "\n[guard]", 1),
        "last": text + "\n" + old,
    }[place]
    once = with_section(whole, FOUND)
    assert once.count("[uncertainty]") == 1
    assert "0.5\n" not in once.partition("[uncertainty]")[2]
    assert with_section(once, FOUND) == once
    file = tmp_path / "vehicle.toml"
    file.write_text(once, encoding="utf-8")
    assert load_vehicle(file).uncertainty.lateral_m == 0.0


def test_what_the_figures_include_is_said() -> None:
    said = section_text(Uncertainty(includes_drive_by_wire=True, provenance="runs"))
    assert "includes_drive_by_wire = true" in said


def test_a_section_that_cannot_be_told_apart_is_refused() -> None:
    text = 'uncertainty = { lateral_m = 0.1, provenance = "x" }\n'
    text += gem_e2_path().read_text(encoding="utf-8")
    with pytest.raises((InputError, ValueError)):
        with_section(text, FOUND)
