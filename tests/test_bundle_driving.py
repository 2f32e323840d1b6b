"""What driving needs is in a bundle whole or not at all, and no malformed entry is believed."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from actuation_cases import drive_vehicle, granted_text, shipped
from runtime_fixture import fake_manifest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.cli.main import main
from workbench.cli.path_file import path_from_csv
from workbench.codegen.assumptions import assumptions
from workbench.codegen.bundle import MonitorSpec, _track_loop, brake_bounds
from workbench.errors import InputError
from workbench.models.vehicle import Vehicle, gem_e2, gem_e2_drive_path, gem_e2_path, load_vehicle
from workbench.models.vehicle_sections import Uncertainty
from workbench.runtime import Timing
from workbench.runtime.contents import Parameter
from workbench.runtime.manifest import Manifest, manifest_from_json, manifest_to_json
from workbench.runtime.monitor_settings import MonitorSettings
from workbench.runtime.path import PathTable
from workbench.runtime.signed_bundle import load_signed_bundle

_PATH = PathTable(0.0, 0.5, (0.0, 0.5, 1.0), (0.0,) * 3, (0.0,) * 3, (0.0,) * 2, (0.0,) * 2)
_MONITOR = MonitorSettings(5, 0.2, Timing(period_s=0.12, latency_s=0.1, send_gap_s=0.055))


def _manifest() -> Manifest:
    return dataclasses.replace(
        fake_manifest(), golden=fake_manifest().golden[:1], drive_by_wire=shipped(), path=_PATH,
        monitor=_MONITOR,
    )  # fmt: skip


@pytest.mark.parametrize(
    "left_out", [(), ("path",), ("drive_by_wire", "monitor"), ("path", "monitor")]
)
def test_the_entries_come_back(left_out: tuple[str, ...]) -> None:
    manifest = dataclasses.replace(_manifest(), **dict.fromkeys(left_out))  # type: ignore[arg-type]
    text = manifest_to_json(manifest)
    assert manifest_from_json(text) == manifest
    assert not set(left_out) & json.loads(text).keys()


def _edit(*path: str | int, to: Any) -> Callable[[dict[str, Any]], None]:
    def apply(content: dict[str, Any]) -> None:
        place: Any = content
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = to

    return apply


def _drop(*path: str) -> Callable[[dict[str, Any]], None]:
    def apply(content: dict[str, Any]) -> None:
        place: Any = content
        for key in path[:-1]:
            place = place[key]
        del place[path[-1]]

    return apply


_WIRE, _STEERING = "drive_by_wire", ("drive_by_wire", "steering")


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (_edit(_WIRE, to=None), "drive_by_wire: expected an object"),
        (_edit(_WIRE, "protocol", to=2), "drive_by_wire.protocol: expected a text"),
        (_edit(_WIRE, "turn_s", to="0.04"), "drive_by_wire.turn_s: expected a finite number"),
        (_edit(_WIRE, "turn_s", to=0.0), "drive_by_wire: turn_s: expected a number > 0"),
        (_edit(_WIRE, "colour", to=1), "drive_by_wire: unknown keys"),
        (_drop(_WIRE, "pedals"), "drive_by_wire.pedals: expected this key"),
        (_drop(*_STEERING, "lead_s"), "steering.lead_s: expected this key"),
        (_edit(*_STEERING, "lead", to=1.0), r"drive_by_wire.steering: unknown keys \['lead'\]"),
        (_edit(*_STEERING, "delay_s", to=[0.0]), r"delay_s: expected \[lower, upper\]"),
        (_edit(*_STEERING, "delay_s", to=0.1), "delay_s: expected a list"),
        (_edit(*_STEERING, "delay_s", to=[0.2, 0.1]), "delay_s: expected .lowest"),
        (_edit(*_STEERING, "wheel_limit_rad", to=12.0), "wheel_limit_rad: expected an angle"),
        (_edit(*_STEERING, "road_wheel", "lowest", 3, to=9.0), "road_wheel: curve: expected"),
        (_edit(*_STEERING, "road_wheel", "lowest", 3, to="9"), "road_wheel.lowest: expected a f"),
        (_edit(_WIRE, "pedals", "brake_limit", to=2.0), "pedals: brake_limit: expected"),
        (_edit("path", "x", 1, to=5.0), "path: path table, bin 0"),
        (_edit("path", "x", to=[0.0]), "path: path table: expected n >= 2"),
        (_drop("path", "spacing_m"), "path.spacing_m: expected this key"),
        (_edit("monitor", "release_steps", to=0), "monitor: expected release_steps >= 1"),
        (_edit("monitor", "release_steps", to=1.5), "monitor.release_steps: expected an integer"),
        (_edit("monitor", "release_steps", to=True), "monitor.release_steps: expected an integer"),
        (_edit("monitor", "clearance_required_m", to=-1), "clearance_required_m >= 0"),
        (_edit("monitor", "timing", "period_s", to=-1), "monitor.timing: period_s"),
        (_edit("monitor", "timing", "send_gap_s", to=0.06), "send_gap_s within the drive-by-wire"),
    ],
)
def test_a_malformed_entry_names_the_key(
    edit: Callable[[dict[str, Any]], None], message: str
) -> None:
    content = json.loads(manifest_to_json(_manifest()))
    edit(content)
    with pytest.raises(InputError, match=message) as caught:
        manifest_from_json(json.dumps(content))
    assert "workbench build" in str(caught.value)
    assert str(caught.value).count("manifest.json") == 1


def test_a_drive_by_wire_of_another_proof_is_refused() -> None:
    limit = Parameter("steering_rate_max", "rad/s", 0.1, 0.1, 0.1)
    with pytest.raises(InputError, match=r"steering_rate_max = 0\.1, got 0\.2"):
        dataclasses.replace(_manifest(), parameters=(limit,))


def test_the_settings_of_a_monitor_must_make_sense() -> None:
    for steps, clearance in ((0, 0.2), (1, -0.1), (1, math.nan), (1, math.inf)):
        with pytest.raises(InputError, match="release_steps >= 1"):
            MonitorSettings(steps, clearance, _MONITOR.timing)


def test_the_driving_vehicle_is_the_shipped_one_and_its_drive_by_wire() -> None:
    plain = gem_e2_path().read_text(encoding="utf-8").rstrip()
    text = gem_e2_drive_path().read_text(encoding="utf-8")
    assert text.startswith(plain)
    assert "\n[drive_by_wire]\n" in text[len(plain) :]
    assert gem_e2().unsure() == gem_e2().uncertainty
    assert dataclasses.replace(drive_vehicle(), drive_by_wire=None) == gem_e2()


def test_what_commands_bring_about_reaches_the_brake_and_the_premises() -> None:
    spec = MonitorSpec(drive_vehicle(), 2.0, 0.05)
    bounds = brake_bounds(drive_vehicle())
    assert bounds.deceleration_min_mps2 < 2.0 - 0.4
    said = {each.name: each for each in assumptions(spec)}
    assert "within 0.409 m/s^2" in said["estimation"].statement
    assert "within the last 0.205 s (pedals), 0.105 s (steering)" in said["actuation"].statement
    assert "actuation" not in {each.name for each in assumptions(MonitorSpec(gem_e2(), 2.0, 0.05))}


def test_a_path_may_bend_as_much_as_the_file_says_and_no_more(tmp_path: Path) -> None:
    file = tmp_path / "vehicle.toml"
    text = gem_e2_path().read_text(encoding="utf-8")
    told = text.replace("[operation]\n", "[operation]\ncurvature_per_m = 0.125\n", 1)
    file.write_text(told, encoding="utf-8")
    assert load_vehicle(file).operation.curvature_per_m == 0.125
    assert gem_e2().operation.curvature_per_m == 0.5
    curvature = _curvature_of(load_vehicle(file))
    assert curvature == (-0.125, 0.125)
    assert _curvature_of(gem_e2()) == (-0.5, 0.5)
    file.write_text(told.replace("= 0.125", "= 0.0"), encoding="utf-8")
    with pytest.raises(InputError, match=r"\[operation\] curvature_per_m: expected a number > 0"):
        load_vehicle(file)


def _curvature_of(vehicle: Vehicle) -> tuple[float, float]:
    loop = _track_loop(vehicle)
    found = next(each for each in loop.disturbances if each.name == "curvature")
    return found.lower, found.upper


def test_a_disturbance_found_in_drives_stands_in_place_of_the_computed_one(tmp_path: Path) -> None:
    found = (
        "[uncertainty]\nacceleration_mps2 = 0.15\n"
        "includes_drive_by_wire = true\nprovenance = 'drives'\n\n[drive_by_wire]\n"
    )
    file = tmp_path / "vehicle.toml"
    text = gem_e2_drive_path().read_text(encoding="utf-8")
    file.write_text(text.replace("[drive_by_wire]\n", found, 1), encoding="utf-8")
    vehicle = load_vehicle(file)
    unsure = vehicle.unsure()
    assert unsure.acceleration_mps2 == 0.15
    assert unsure.steering_rate_radps == 0.0
    assert unsure.speed_mps == drive_vehicle().unsure().speed_mps
    said = {each.name: each.statement for each in assumptions(MonitorSpec(vehicle, 2.0, 0.05))}
    assert "not from its maps" in said["actuation"]
    with pytest.raises(InputError, match="includes_drive_by_wire: expected false where upstream"):
        dataclasses.replace(vehicle.uncertainty, upstream_acceleration_mps2=0.05)
    file.write_text(file.read_text(encoding="utf-8").replace("= true", "= 1"), encoding="utf-8")
    with pytest.raises(InputError, match="includes_drive_by_wire: expected true or false, got 1"):
        load_vehicle(file)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('protocol = "pacmod2"', "protocol = 2", "text in quotes"),
        ("turn_s = 0.055\n", "", r"\[drive_by_wire\] lacks the key turn_s"),
        ("lead_s = 1.2", "lead_s = 0.1", "lead_s: expected more than"),
        ("lead_s = 1.2", "lead_m = 1.2", "unknown key 'lead_m'.*nearest known one is 'lead_s'"),
        ("lead_s = 1.2", "angle_limit_rad = 1.2", "unknown key 'angle_limit_rad'"),
        ("delay_s = [0.0, 0.03]", "delay_s = 0.03", "delay_s: expected .lowest, highest"),
        ("delay_s = [0.0, 0.03]", "delay_s = [0.03, 0.0]", "swap them"),
        ("delay_s = [0.0, 0.05]", "delay_s = [0.0, 0.15]", r"delay and build-up of \[brake\]"),
        ("brake_profile = 0.3125", "brake_profile = 0.25", "brake_profile: expected a ratio"),
        ("ratio = [0.32, 0.48]", "ratio = [0.32, 0.48, 0.5]", "lists of equal length"),
        ("ratio = [0.32, 0.48]", "ratio = 0.32", "ratio: expected a list of numbers"),
        ("ratio = [0.32, 0.48]", "ratio = [0.48, 0.32]", "command goes from"),
        ("[0.15, 0.15]", "[0.15, -0.15]", "errors >= 0"),
        ("steering_wheel_rad = [\n    0.0,", "steering_wheel_rad = [\n    0.1,", "straight ahead"),
        ("withheld_mps2 = 0.05", "withheld_mps2 = 2.0", "acceleration_mps2: expected less than"),
        ("speed_error_mps = 0.05", "speed_error_mps = 0.3", "with .drive_by_wire. speed_mps"),
        # 0.3125 brakes with 2.350 at least; as the count that is sent, it may be 2.346.
        ("deceleration_min_mps2 = 2.0", "deceleration_min_mps2 = 2.3499", "brake_profile"),
        ("wheel_rate_limit_radps = 5.0", "wheel_rate_limit_radps = true", "finite number"),
        ("[drive_by_wire.brake]", "[drive_by_wire.breaks]", "unknown key 'breaks'"),
    ],
)
def test_mistakes_in_the_section_are_answered(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    text = gem_e2_drive_path().read_text(encoding="utf-8")
    assert text.count(old) == 1
    path = tmp_path / "edited.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        load_vehicle(path)


def test_the_steering_map_of_a_wrong_inverse_is_refused(tmp_path: Path) -> None:
    """A published inverse lacks a pair of brackets: 100 degrees of wheel give -117.5."""
    text = gem_e2_drive_path().read_text(encoding="utf-8")
    begin, end = text.index("road_wheel_rad = ["), text.index("road_wheel_error_rad")
    wheel_deg = [math.degrees(each) for each in shipped().steering.road_wheel.command[14:]]
    wrong = [-21.775 + (21.775**2 - 4 * 0.1084 * w) ** 0.5 / (-2 * 0.1084) for w in wheel_deg]
    assert pytest.approx(-117.5, abs=0.1) == -21.775 + (21.775**2 - 4 * 0.1084 * 100) ** 0.5 / (
        -2 * 0.1084
    )
    listed = ", ".join(repr(math.radians(each)) for each in wrong)
    path = tmp_path / "wrong.toml"
    path.write_text(f"{text[:begin]}road_wheel_rad = [{listed}]\n{text[end:]}", encoding="utf-8")
    with pytest.raises(InputError, match="straight ahead"):
        load_vehicle(path)


def _csv(folder: Path, text: str) -> Path:
    path = folder / "path.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_path_goes_through_its_points(tmp_path: Path) -> None:
    points = [(10.0 * math.sin(0.2 * k), 10.0 - 10.0 * math.cos(0.2 * k)) for k in range(8)]
    lines = "".join(f"{x!r},{y!r}\n" for x, y in points)
    table = path_from_csv(_csv(tmp_path, f"x_m, y_m\n{lines}\n"))
    for x, y in points:
        assert min(math.dist((x, y), node) for node in zip(table.x, table.y, strict=True)) < 0.13
    middle = len(table.curvature_lower) // 3
    assert table.curvature_lower[middle] == pytest.approx(0.1, abs=0.01)
    assert table.start_m == -10.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected the first line x_m,y_m, got ''"),
        ("x,y\n1,2\n", "expected the first line x_m,y_m, got 'x,y'"),
        ("x_m,y_m\n0,0\n1,0\n", "at least 3 points, got 2"),
        ("x_m,y_m\n0,0\n1,zero\n2,0\n", "two finite numbers in line 3, got '1,zero'"),
        ("x_m,y_m\n0,0\n1,nan\n2,0\n", "line 3"),
        ("x_m,y_m\n0,0\n1\n2,0\n", "line 3"),
        ("x_m,y_m\n0,0\n1,0\n1,0\n2,0\n", "distinct neighbours"),
    ],
)
def test_a_path_that_is_none_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        path_from_csv(_csv(tmp_path, text))


def test_a_missing_path_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="CSV file of points that can be read"):
        path_from_csv(tmp_path / "none.csv")


def test_settings_need_a_clearance(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["build", "--release-steps", "3", "--out", str(out)]) == 2
    assert "add --clearance M" in capsys.readouterr().err
    assert not out.exists()


def test_build_puts_all_of_it_into_a_bundle_and_signs_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = _csv(tmp_path, "x_m,y_m\n0,0\n10,0\n20,0.5\n30,1\n")
    vehicle = tmp_path / "granted.toml"
    vehicle.write_text(granted_text(), encoding="utf-8")
    words = ["--vehicle", str(vehicle), "--path", str(path), "--clearance", "0.3",
             "--horizon", "0.1", "--step", "0.05", "--out", str(tmp_path / "out")]  # fmt: skip
    assert main(["build", *words]) == 0
    assert "not for driving, it lacks sensors" in capsys.readouterr().out
    assert main(["new", "sensors", "kept", "--out", str(tmp_path)]) == 0
    assert main(["keygen", "--key", str(tmp_path / "my.key")]) == 0
    more = ["--sensors", str(tmp_path / "kept.toml"), "--key", str(tmp_path / "my.key")]
    assert main(["build", *words, *more]) == 0
    assert "; for driving\n" in capsys.readouterr().out
    manifest = load_signed_bundle(tmp_path / "out", tmp_path / "my.key.pub").manifest
    assert manifest.sensors == (tmp_path / "kept.toml").read_text()
    assert manifest.drive_by_wire == dataclasses.replace(shipped(), stop_speed_mps=0.5)
    assert manifest.path == path_from_csv(path)
    timing = Timing(period_s=0.12, latency_s=0.1, send_gap_s=0.055)
    assert manifest.monitor == MonitorSettings(5, 0.3, timing)


def test_sensors_that_do_not_say_all_are_refused_before_anything_is_written(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = _csv(tmp_path, "x_m,y_m\n0,0\n10,0\n20,0.5\n30,1\n")
    kept = tmp_path / "kept.toml"
    kept.write_text("[clocks]\n")
    words = ["--path", str(path), "--clearance", "0.3", "--horizon", "0.1", "--step", "0.05",
             "--sensors", str(kept), "--out", str(tmp_path / "out")]  # fmt: skip
    assert main(["build", "--vehicle", str(gem_e2_drive_path()), *words]) == 2
    assert "sensors" in capsys.readouterr().err
    assert main(["build", *words]) == 2
    assert "[drive_by_wire]" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "granted"),
    [
        ("offset_m = 0.2", "offset_m = 0.21", "0.2"),
        ("heading_rad = 0.05", "heading_rad = 0.051", "0.05"),
        ("speed_mps = 0.48", "speed_mps = 0.49", "0.48"),
        ("acceleration_mps2 = 0.0 ", "acceleration_mps2 = 0.06 ", "0.05"),
        ("steering_rate_radps = 0.0\n", "steering_rate_radps = 0.011\n", "0.01"),
    ],
)
def test_sensors_that_the_proof_does_not_grant_are_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, old: str, new: str, granted: str
) -> None:
    """Readings and upstream margins up to the vehicle file's [uncertainty], and no more."""
    vehicle, kept = tmp_path / "granted.toml", tmp_path / "kept.toml"
    upstream = "\nupstream_acceleration_mps2 = 0.05\nupstream_steering_rate_radps = 0.01\n"
    vehicle.write_text(granted_text().rstrip() + upstream, encoding="utf-8")
    text = gem_e2_drive_path().with_name("gem_e2_sensors.toml").read_text(encoding="utf-8")
    assert text.count(old) == 1
    kept.write_text(text.replace(old, new), encoding="utf-8")
    path = _csv(tmp_path, "x_m,y_m\n0,0\n10,0\n20,0.5\n30,1\n")
    words = ["--path", str(path), "--clearance", "0.3", "--horizon", "0.1", "--step", "0.05",
             "--sensors", str(kept), "--out", str(tmp_path / "out")]  # fmt: skip
    assert main(["build", "--vehicle", str(vehicle), *words]) == 2
    assert f"within the {granted} that the vehicle file's" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_acts_on_the_car_adds_to_what_its_drive_by_wire_brings_about() -> None:
    bound = drive_vehicle().unsure()
    more = dataclasses.replace(
        drive_vehicle(),
        uncertainty=Uncertainty(
            acceleration_mps2=0.1, steering_rate_radps=0.01,
            upstream_acceleration_mps2=0.2, upstream_steering_rate_radps=0.02,
        ),
    ).unsure()  # fmt: skip
    assert more.acceleration_mps2 == pytest.approx(bound.acceleration_mps2 + 0.3, rel=1e-14)
    assert more.steering_rate_radps == pytest.approx(bound.steering_rate_radps + 0.03, rel=1e-14)
    assert more.acceleration_mps2 >= bound.acceleration_mps2 + 0.3
    assert (more.lateral_m, more.speed_mps) == (bound.lateral_m, bound.speed_mps)
