"""Every refusal at start-up is one sentence and a status of its own, and comes before any frame."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import can
import pytest
from onboard_main_cases import SENSORS, installed, manifest, usual_frames

from workbench.errors import InputError
from workbench.runtime.onboard import listening
from workbench.runtime.onboard import main as command
from workbench.runtime.onboard.loop import LONGEST_WAIT_US
from workbench.runtime.onboard.main import Exit, main
from workbench.runtime.onboard.sensors_file import settings_from


@contextlib.contextmanager
def vehicle(
    channel: str, frames: Sequence[tuple[int, int, bytes]], *, seen: list[int] | None = None
) -> Iterator[None]:
    """A car on python-can's virtual bus that sends these frames at their instants."""
    bus = can.Bus(channel=channel, interface="virtual")
    over = threading.Event()

    def send() -> None:
        begun = time.monotonic()
        for at_us, identifier, data in frames:
            while (left := begun + at_us / 1e6 - time.monotonic()) > 0.0:
                if over.wait(min(left, 0.05)):
                    return
            bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

    sender = threading.Thread(target=send)
    sender.start()
    try:
        yield
    finally:
        over.set()
        sender.join()
        while seen is not None and (message := bus.recv(0)) is not None:
            seen.append(message.arbitration_id)
        bus.shutdown()


def refused(capfd: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    """The status and the sentence."""
    status = main(arguments)
    lines = [line for line in capfd.readouterr().err.splitlines() if "warning" not in line]
    assert len(lines) == 1, lines
    assert lines[0].startswith("workbench-monitor: refused: ")
    return status, lines[0]


def on(channel: str, mode: str = "shadow", *more: str) -> list[str]:
    return ["--interface=virtual", f"--channel={channel}", f"--mode={mode}", "--wait=0", *more]


@pytest.mark.parametrize(
    "arguments",
    [
        ["--mode=drive"],
        ["--mode=gate", "--control=c"],
        ["--mode=shadow", "--upstream-channel=can1"],
        ["--mode=gate", "--control=c", "--upstream-channel=can0"],
        ["--mode=drive", "--control=c", "--upstream-channel=can1"],
        ["--wait=-1"],
        ["--mode=fly"],
    ],
)
def test_wrong_use_is_status_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    usual = ["--bundle=b", "--interface=virtual", "--channel=can0"]
    with pytest.raises(SystemExit) as ended:
        main([*usual, *arguments])
    assert ended.value.code == Exit.MISUSE
    assert capsys.readouterr().err


def test_shadow_is_the_default() -> None:
    args = command.parser().parse_args(["--bundle=b", "--interface=i", "--channel=c"])
    assert args.mode == "shadow"


def test_a_bundle_that_is_not_whole_is_status_10(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    arguments = installed(tmp_path)
    kernel = tmp_path / "bundle" / "kernel.so"
    changed = bytearray(kernel.read_bytes())
    changed[len(changed) // 2] ^= 1
    kernel.write_bytes(changed)
    status, text = refused(capfd, *arguments, *on("x"))
    assert status == Exit.BUNDLE
    assert "kernel.so" in text


def test_nothing_unsigned_drives_status_11(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    arguments = [each for each in installed(tmp_path) if "public-key" not in each]
    control = f"--control={tmp_path / 'control'}"
    status, text = refused(capfd, *arguments, *on("x", "drive", control))
    assert status == Exit.UNSIGNED
    assert "workbench sign" in text


def test_a_wrong_processor_mode_is_status_12(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "float_mode_fault", lambda: "rounding is not to nearest")
    assert refused(capfd, *installed(tmp_path), *on("x"))[0] == Exit.FLOAT_MODE


def test_a_bundle_that_is_not_for_a_car_is_status_13(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    status, text = refused(capfd, *installed(tmp_path, driving=False), *on("x"))
    assert status == Exit.NOT_FOR_DRIVING
    assert "drive_by_wire" in text


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("drift_ppm = 200", "", "drift_ppm"),
        ("drift_ppm = 200", "drift_ppm = 2.5", "drift_ppm"),
        ("drift_ppm = 200", "drift_ppm = true", "drift_ppm"),
        ("maker =", "owner = 1\nmaker =", "owner"),
        ('maker = "52C"', 'maker = "52"', "maker"),
        ("offset_m = 1.0", "offset_m = -1.0", "offset_m"),
        ("offset_m = 1.0", 'offset_m = "wide"', "offset_m"),
        ("[0, 20000]", "[20000, 0]", "lower <= upper"),
        ("[0, 20000]", "20000", "delay_us"),
        ("[gate]", "[gates]", "gate"),
        ("[gate]", "gate", "TOML"),
    ],
)
def test_what_sensors_keep_to_must_be_said_status_14(
    old: str, new: str, said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    arguments = installed(tmp_path, sensors=lambda text: text.replace(old, new))
    status, text = refused(capfd, *arguments, *on("x"))
    assert status == Exit.SENSORS
    assert said in text


def test_the_time_until_a_frame_is_read_widens_every_delay() -> None:
    settings = settings_from(manifest(), signed=True, tag=7)
    assert settings.sensors.report_delay_us == (0, 20_000 + LONGEST_WAIT_US)
    assert settings.sensors.stamps.delay_us == (1_000, 60_000 + LONGEST_WAIT_US)
    assert settings.maker == 0x353243
    assert (settings.signed, settings.bundle_tag) == (True, 7)
    assert "any" not in SENSORS


def test_commands_are_sent_within_the_shorter_of_both_proofs_times() -> None:
    """Found by the board on the vehicle: 50.26 ms, where the plan had 50 and turn_s 55."""
    given = manifest()
    wire, monitor = given.drive_by_wire, given.monitor
    assert wire is not None
    assert monitor is not None
    most_s = wire.turn_s
    for gap_s, expected_s in ((most_s - 0.005, most_s - 0.005), (most_s, most_s)):
        timing = replace(monitor.timing, send_gap_s=gap_s)
        settings = settings_from(
            replace(given, monitor=replace(monitor, timing=timing)), signed=True, tag=7
        )
        assert settings.timing.send_gap_s == gap_s
        assert settings.drive_by_wire.turn_s == expected_s
    with pytest.raises(InputError, match=r"at most timing\.send_gap_s"):
        replace(settings, timing=replace(timing, send_gap_s=most_s - 0.001))


def test_a_control_folder_that_is_not_private_is_status_15(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    arguments = installed(tmp_path)
    os.chmod(tmp_path / "control", 0o755)
    control = f"--control={tmp_path / 'control'}"
    assert refused(capfd, *arguments, *on("x", "drive", control))[0] == Exit.CONTROL


def test_a_bus_that_cannot_be_opened_is_status_17(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    arguments = [*installed(tmp_path), "--interface=slcan", "--channel=/dev/none", "--wait=0"]
    assert refused(capfd, *arguments)[0] == Exit.BUS


def test_a_silent_bus_and_another_protocol_are_status_18(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listening, "LISTENED_US", 300_000)
    arguments = installed(tmp_path)
    status, text = refused(capfd, *arguments, *on("silent"))
    assert status == Exit.PROTOCOL
    assert "VEHICLE_SPEED_RPT" in text
    three = [(20_000 * k, 0x200, bytes(8)) for k in range(100)]
    seen: list[int] = []
    control = f"--control={tmp_path / 'control'}"
    with vehicle("both", sorted([*usual_frames(), *three]), seen=seen):
        status, text = refused(capfd, *arguments, *on("both", "drive", control))
    assert status == Exit.PROTOCOL
    assert "pacmod3" in text
    assert seen == [], "a refusal comes before any frame"


def test_another_makers_vehicle_is_status_19(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    other = installed(tmp_path, sensors=lambda text: text.replace("52C", "1FT"))
    with vehicle("other", usual_frames()):
        status, text = refused(capfd, *other, *on("other"))
    assert status == Exit.VEHICLE
    assert "0x353243" in text


def test_a_log_that_exists_is_status_16(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listening, "LISTENED_US", 300_000)
    arguments = installed(tmp_path)
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / "run.json").write_text("{}")
    with vehicle("log", usual_frames()):
        status, _ = refused(capfd, *arguments, *on("log", "shadow", f"--log={tmp_path / 'log'}"))
    assert status == Exit.LOG
