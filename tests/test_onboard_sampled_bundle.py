"""A bundle whose tubes are only SAMPLED is refused by gate and drive, before any bus is opened, and
taken by shadow."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from onboard_main_cases import SENSORS, _files, installed, manifest
from signed_cases import signed_again, write_files

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.runtime.manifest import CHECKSUM_FILE, MANIFEST_FILE, checksums_text
from workbench.runtime.manifest import manifest_to_json as to_json
from workbench.runtime.onboard import main as command
from workbench.runtime.onboard.main import Exit, main
from workbench.runtime.onboard.proved import check_proved
from workbench.runtime.onboard.states import Mode


@pytest.mark.parametrize("mode", Mode)
@pytest.mark.parametrize("rigor", Rigor)
def test_only_sampled_bundles_are_refused_and_only_where_a_car_is_moved(
    mode: Mode, rigor: Rigor
) -> None:
    graded = replace(manifest(), rigor=rigor, tubes="TRACK learned, others local, linear")
    if mode is Mode.SHADOW or rigor is not Rigor.SAMPLED:
        check_proved(graded, mode)
        return
    with pytest.raises(InputError) as refused:
        check_proved(graded, mode)
    assert str(refused.value) == (
        f"expected a bundle whose tubes are proved for mode {mode.name.lower()}, got rigor SAMPLED "
        "(tubes: TRACK learned, others local, linear): what was learned from runs is no proof; use "
        "--mode shadow, or build the bundle without --learned"
    )


def sampled(folder: Path) -> list[str]:
    """As `installed`, of rigor SAMPLED."""
    arguments = installed(folder)
    files = {name: content for name, content in _files(SENSORS).items() if name != CHECKSUM_FILE}
    files[MANIFEST_FILE] = to_json(replace(manifest(), rigor=Rigor.SAMPLED)).encode()
    for name in (folder / "bundle").iterdir():
        name.unlink()
    (folder / "bundle").rmdir()
    whole = files | {CHECKSUM_FILE: checksums_text(files).encode()}
    write_files(folder / "bundle", signed_again(whole))
    return arguments


@pytest.mark.parametrize("mode", ["gate", "drive"])
def test_gate_and_drive_refuse_it_with_status_13(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    def opened(*_: object) -> None:
        raise AssertionError("no bus is opened")

    monkeypatch.setattr(command, "_opened", opened)
    more = [f"--control={tmp_path / 'control'}"]
    more += ["--upstream-channel=up"] if mode == "gate" else []
    arguments = [*sampled(tmp_path), "--interface=virtual", "--channel=x", f"--mode={mode}"]
    assert main([*arguments, *more]) == Exit.NOT_FOR_DRIVING == 13
    said = capfd.readouterr().err
    assert said.startswith("workbench-monitor: refused: expected a bundle whose tubes are proved")
    assert f"for mode {mode}, got rigor SAMPLED" in said


def test_shadow_takes_it_and_goes_on_to_the_bus(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Where nobody reports, so that the next refusal is about that."""
    arguments = [*sampled(tmp_path), "--interface=virtual", "--channel=nobody", "--wait=0"]
    assert main([*arguments, "--mode=shadow"]) == Exit.PROTOCOL
    assert "missing reports" in capfd.readouterr().err
