"""What the core did on the vehicle, whatever happened to it, it does again from a log, bit for bit;
and `workbench replay` says so, or what differs."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import random
from pathlib import Path
from typing import Any

import pytest
from cli_fixture import invoke
from log_cases import Kept
from onboard_core_bench import Bench, person
from onboard_core_cases import DRIVE_BY_WIRE, PATH, SETTINGS, bundle
from onboard_main_cases import installed

from workbench.errors import InputError
from workbench.runtime.contents import MANIFEST_FILE
from workbench.runtime.onboard.core import Core, Mode, Request
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.playback import Compared, compare
from workbench.runtime.onboard.playback_logs import EndOfLog, events_of
from workbench.runtime.onboard.playback_settings import (
    core_again,
    log_header,
    plain_settings,
    settings_again,
)
from workbench.runtime.onboard.recorder import RecordedCore, Recorder, RecorderSettings
from workbench.runtime.onboard.recorder_header import LogHeader

TOLD = dataclasses.replace(
    SETTINGS,
    sensors=dataclasses.replace(SETTINGS.sensors, road_wheel=DRIVE_BY_WIRE.steering.road_wheel.at),
)


def header(mode: Mode, digest: str = "0" * 64) -> LogHeader:
    made = log_header(
        bundle(),
        PATH,
        TOLD,
        mode=mode,
        manifest_sha256=digest,
        started_unix_us=1_700_000_000 * 10**6,
    )
    return LogHeader.from_json(made.to_json(), source="x")


def trouble(b: Bench, chance: random.Random) -> None:
    """Something happens, or nothing."""
    kind = chance.randrange(12)
    at_us = b.at_us - 2_000
    if kind == 0:
        b.people = [person(1, b.x_m + chance.uniform(2.0, 30.0), chance.uniform(-3.0, 3.0))]
    elif kind == 1:
        b.people = []
    elif kind == 2:
        b.core.bus_error(chance.choice(list(BusError)), at_us)
    elif kind == 3:
        b.request(chance.choice(list(Request)))
    elif kind == 4:
        b.silent = {chance.choice(["VEHICLE_SPEED_RPT", "LOC_STAMP", "PEOPLE", "STEERING_RPT"])}
    elif kind == 5:
        b.silent = set()
    elif kind == 6:
        b.core.receive(chance.randrange(2**32), chance.randbytes(8), at_us)
    elif kind == 7:
        b.core.receive(chance.randrange(0x7FF), chance.randbytes(chance.randrange(9)), at_us)
    elif kind == 8:
        b.core.receive_upstream(chance.randrange(0x7FF), chance.randbytes(8), at_us)
    elif kind == 9:
        b.takes_us = chance.choice([0, 1, 7_777, 80_000])


def driven(core: Any, *, turns: int, seed: int, details: Any) -> None:
    chance = random.Random(seed)
    b = Bench(core)
    for turn in range(turns):
        if turn == 12:
            b.request(Request.ARM)
        if turn > 45:
            trouble(b, chance)
        details(b.step())


def again(lines: list[Any], mode: Mode) -> Compared:
    return compare(
        core_again(bundle(), header(mode)), events_of([*lines, EndOfLog(True)]), exact=True
    )


@pytest.mark.parametrize("mode", Mode)
@pytest.mark.parametrize("seed", range(2))
def test_a_drive_with_whatever_happens_is_replayed_bit_for_bit(mode: Mode, seed: int) -> None:
    kept = Kept()
    core = RecordedCore(Core(bundle(), PATH, TOLD, mode=mode), kept)  # type: ignore[arg-type]
    driven(core, turns=160, seed=seed, details=kept.details)
    compared = again(kept.lines, mode)
    assert compared.mismatches == ()
    assert compared.turns == 160
    assert compared.compared == compared.decisions > 5


def test_another_setting_or_mode_is_noticed() -> None:
    kept = Kept()
    core = RecordedCore(Core(bundle(), PATH, TOLD, mode=Mode.DRIVE), kept)  # type: ignore[arg-type]
    driven(core, turns=60, seed=0, details=kept.details)
    assert again(kept.lines, Mode.SHADOW).mismatches
    other = dataclasses.replace(TOLD, reference_speed_mps=2.7)
    events = events_of([*kept.lines, EndOfLog(True)])
    replayed = Core(bundle(), PATH, other, mode=Mode.DRIVE)
    assert compare(replayed, events, exact=True).mismatches


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a bundle and, in `log`, what the recorder wrote of a drive with it."""
    folder = tmp_path_factory.mktemp("drive")
    installed(folder)
    digest = hashlib.sha256((folder / "bundle" / MANIFEST_FILE).read_bytes()).hexdigest()
    recorder = Recorder.start(
        header(Mode.DRIVE, digest), RecorderSettings(folder / "log", can_suffix=".blf")
    )
    core = RecordedCore(Core(bundle(), PATH, TOLD, mode=Mode.DRIVE), recorder)
    driven(core, turns=100, seed=7, details=recorder.details)
    assert recorder.close().in_order
    return folder


def test_the_command_replays_a_log(drive: Path) -> None:
    result = invoke(
        "replay", drive / "log" / "monitor.mcap", "--bundle", drive / "bundle", "--json"
    )
    assert result.status == 0, result.err
    assert result.data["exact"]
    assert result.data["turns"] == 100
    assert result.data["compared"] == result.data["decisions"] > 5
    result = invoke("replay", drive / "log" / "can.blf", "--bundle", drive / "bundle")
    assert result.status == 0, result.err
    assert "they are those of the log" in result.out
    assert "0 decisions were held against every bit" in result.out


def test_the_command_names_what_differs_and_ends_with_1(drive: Path, tmp_path: Path) -> None:
    text = (drive / "log" / "run.json").read_text()
    changed = json.loads(text)
    changed["settings"]["reference_speed_mps"] = 2.7
    (tmp_path / "run.json").write_text(json.dumps(changed))
    words = ["--bundle", drive / "bundle", "--run", tmp_path / "run.json"]
    result = invoke("replay", drive / "log" / "monitor.mcap", *words)
    assert result.status == 1
    assert "the log says" in result.out
    assert "they differ from the log" in result.out


def test_the_command_refuses_what_it_cannot_replay(drive: Path, tmp_path: Path) -> None:
    log = drive / "log" / "monitor.mcap"
    raw = drive / "log" / "can.blf"
    bundle_words = ["--bundle", drive / "bundle"]
    (tmp_path / "can.blf").write_bytes(raw.read_bytes())
    installed(tmp_path, driving=False)
    for words, why in [
        ([log], "--bundle: expected"),
        ([log, *bundle_words, "--recording", "x"], "--recording: expected beside a folder"),
        ([log, *bundle_words, "--out", "x", "--step", "1"], "--step, --out: expected beside"),
        ([tmp_path / "can.blf", *bundle_words], "name it by --run"),
        ([tmp_path / "none.mcap", *bundle_words], "expected an MCAP file"),
        ([log, "--bundle", tmp_path / "bundle"], "expected the bundle whose manifest"),
        ([drive], "--recording: expected the name"),
        ([drive, "--recording", "x", "--run", "y"], "--run: expected beside a log"),
        ([drive / "bundle" / MANIFEST_FILE, *bundle_words], "one of these endings"),
    ]:
        result = invoke("replay", *words)
        assert (result.status, why in result.err) == (2, True), result.err


def test_every_number_of_the_settings_comes_back() -> None:
    content = json.loads(json.dumps(plain_settings(TOLD)))
    again = settings_again(content)
    assert plain_settings(again) == plain_settings(TOLD)
    named = dataclasses.replace(again.sensors, road_wheel=TOLD.sensors.road_wheel)
    assert dataclasses.replace(again, sensors=named) == TOLD
    for angle in (-3.0, 0.1, 7.7):
        assert again.sensors.road_wheel(angle) == TOLD.sensors.road_wheel(angle)


def test_settings_that_cannot_be_told_are_refused() -> None:
    with pytest.raises(InputError, match="road_wheel"):
        plain_settings(SETTINGS)
    content = json.loads(json.dumps(plain_settings(TOLD)))
    wrong: list[dict[str, Any]] = [
        {**content, "bundle_tag": 300}, {**content, "more": 1}, {"timing": content["timing"]},
        {**content, "timing": None}, {**content, "gate": {"x": 1.0}},
    ]  # fmt: skip
    for each in wrong:
        with pytest.raises(InputError):
            settings_again(each)
    unknown = dataclasses.replace(header(Mode.DRIVE), mode="FLY")
    with pytest.raises(InputError, match="a mode out of"):
        core_again(bundle(), unknown)
    assert isinstance(settings_again(content), OnboardSettings)
