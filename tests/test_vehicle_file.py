"""A vehicle file is read exactly, and every mistake in one is answered with what mends it."""

import dataclasses
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.models import PathFrame, PlaneFrame
from workbench.models.benchmarks import b2, b2_path
from workbench.models.vehicle import Vehicle, gem_e2, gem_e2_path, load_vehicle
from workbench.models.vehicle_sections import Geometry, Uncertainty

SHIPPED = gem_e2_path().read_text(encoding="utf-8")


def edited(folder: Path, old: str, new: str) -> Path:
    assert SHIPPED.count(old) == 1, f"the shipped file has {old!r} {SHIPPED.count(old)} times"
    path = folder / "edited.toml"
    path.write_text(SHIPPED.replace(old, new), encoding="utf-8")
    return path


def test_shipped_vehicle_has_the_documented_numbers() -> None:
    vehicle = gem_e2()
    body = vehicle.geometry
    assert (body.wheelbase_m, body.front_m, body.rear_m) == (1.75, 2.26, 0.47)
    assert body.half_width_m == 0.8825
    assert vehicle.initial_set.names == b2_path().system.ode.names
    assert vehicle.initial_set == b2_path().initial_set
    assert "station" not in vehicle.operation.region.names
    texts = [
        getattr(vehicle, name).provenance
        for name in (
            "geometry",
            "limits",
            "steering_pid",
            "speed_pid",
            "operation",
            "guard",
            "brake",
        )
    ]
    assert all(texts)
    assert vehicle.provenance
    assert vehicle.initial_set_provenance


def test_shipped_vehicle_in_the_plane_is_the_benchmark_b2() -> None:
    vehicle = gem_e2()
    loop = vehicle.closed_loop(vehicle.track(), PlaneFrame()).ode
    assert loop.parameters == b2().system.ode.parameters
    assert str(loop.field) == str(b2().system.ode.field)


def test_path_frame_takes_the_curvature_interval() -> None:
    vehicle = gem_e2()
    (curvature,) = vehicle.closed_loop(vehicle.track(), PathFrame(-0.05, 0.1)).ode.disturbances
    assert (curvature.lower, curvature.upper) == (-0.05, 0.1)
    assert curvature.nominal == pytest.approx(0.025)


def test_another_body_keeps_the_gains() -> None:
    passat = Geometry(2.71, 3.6, 1.15, 0.92, provenance="approximate values of an estate car")
    vehicle = gem_e2().with_geometry(passat, name="Passat")
    parameters = {
        p.name: p.nominal for p in vehicle.closed_loop(vehicle.track(), PlaneFrame()).ode.parameters
    }
    assert parameters["wheelbase"] == 2.71
    assert parameters["steering_gain_proportional"] == 0.6


def test_brake_of_the_file_is_the_mode() -> None:
    mode = gem_e2().brake.mode()
    assert (mode.deceleration_min_mps2, mode.delay_s, mode.build_up_s) == (2.0, 0.1, 0.1)


def test_guard_of_the_file_bounds_people_and_says_that_it_is_assumed() -> None:
    guard = gem_e2().guard
    assert (guard.speed_max_mps, guard.accel_max_mps2) == (2.5, 1.5)
    assert "ssumed" in guard.provenance


@pytest.mark.parametrize(
    ("old", "new", "messages"),
    [
        ("wheelbase_m = 1.75", "wheelbase = 1.75", ("[geometry]", "wheelbase_m")),
        ("wheelbase_m = 1.75", "wheelbase_m = -1.75", ("[geometry] wheelbase_m", "> 0", "-1.75")),
        ("wheelbase_m = 1.75", 'wheelbase_m = "1.75"', ("finite number", "'1.75'")),
        ("wheelbase_m = 1.75", "wheelbase_m = true", ("finite number", "True")),
        ("wheelbase_m = 1.75", "wheelbase_m = nan", ("finite number", "nan")),
        ("wheelbase_m = 1.75\n", "", ("[geometry] lacks the key wheelbase_m",)),
        ("front_m = 2.26", "front_m = 1.0", ("front_m", "at least wheelbase_m")),
        ("steering_rad = 0.6\n", "steering_rad = 35\n", ("[limits] steering_rad", "pi/2")),
        ("accel_min_mps2 = -2.0", "accel_min_mps2 = 2.0", ("accel_min_mps2", "< 0")),
        ("look_ahead_m = 2.0", "look_ahead_m = -2.0", ("[steering_pid] look_ahead_m", ">= 0")),
        ("[speed_pid]", "[speed_pdi]", ("unknown section 'speed_pdi'", "'speed_pid'")),
        (
            "offset_m = [-1.5, 1.5]",
            "offset_m = [1.5, -1.5]",
            ("[operation.region] offset_m", "swap"),
        ),
        ("offset_m = [-1.5, 1.5]", "offset_m = 1.5", ("[lowest, highest]",)),
        (
            "offset_m = [-1.5, 1.5]",
            "offset_m = [-0.1, 0.1]",
            ("offset inside the operating region",),
        ),
        (
            "heading_error_rad = 0.05",
            "heading_error_rad = -0.05",
            ("[initial_set.radius] heading_error_rad", ">= 0"),
        ),
        ("speed_max_mps = 2.5", "speed_max_mps = 0.0", ("[guard] speed_max_mps", "> 0", "0.0")),
        ("speed_max_mps = 2.5", "speed_max = 2.5", ("[guard]", "speed_max_mps")),
        ("accel_max_mps2 = 1.5", "accel_max_mps2 = inf", ("[guard] accel_max_mps2", "finite")),
        ("accel_max_mps2 = 1.5\n", "", ("[guard] lacks the key accel_max_mps2",)),
        ("deceleration_min_mps2 = 2.0", "deceleration_min_mps2 = 9.0", ("[brake]", "<=")),
        ("build_up_s = 0.1", "build_up_s = 0.0", ("[brake]", "build_up_s > 0")),
        (
            "[brake]",
            '[uncertainty]\nspeed_mps = 0.2\nprovenance = "guess"\n[brake]',
            ("[uncertainty] speed_mps", "less than 0.2", "standing car would steer"),
        ),
        (
            "[brake]",
            '[uncertainty]\nacceleration_mps2 = 2.5\nprovenance = "guess"\n[brake]',
            ("[uncertainty] acceleration_mps2", "less than 2.0", "would not stand still"),
        ),
        (
            "[brake]",
            '[uncertainty]\nwheelbase_m = 2\nprovenance = "guess"\n[brake]',
            ("[uncertainty] wheelbase_m", "less than 1.75"),
        ),
        (
            "[brake]",
            '[uncertainty]\nlateral_m = -0.1\nprovenance = "guess"\n[brake]',
            ("[uncertainty]", "lateral_m", ">= 0"),
        ),
        ("[brake]", "[uncertainty]\nlateral_m = 0.1\n[brake]", ("lacks the key provenance",)),
        ("[brake]", "[uncertainties]\n[brake]", ("unknown section", "'uncertainty'")),
        ('name = "GEM e2"', "name = 7", ("[vehicle] name", "text in quotes")),
        ('name = "GEM e2"', 'name = "', ("expected a TOML file", "line")),
    ],
)
def test_mistakes_are_answered(
    tmp_path: Path, old: str, new: str, messages: tuple[str, ...]
) -> None:
    path = edited(tmp_path, old, new)
    with pytest.raises(InputError) as caught:
        load_vehicle(path)
    for message in (str(path), *messages):
        assert message in str(caught.value)


def test_missing_section_and_missing_file(tmp_path: Path) -> None:
    short = tmp_path / "short.toml"
    short.write_text(SHIPPED[: SHIPPED.index("[brake]")], encoding="utf-8")
    with pytest.raises(InputError, match="lacks the section brake"):
        load_vehicle(short)
    with pytest.raises(InputError, match="no such vehicle file") as caught:
        load_vehicle(tmp_path / "nowhere.toml")
    assert str(gem_e2_path()) in str(caught.value)


def test_section_that_is_a_number_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flat.toml"
    path.write_text("brake = 1\n" + SHIPPED[: SHIPPED.index("[brake]")], encoding="utf-8")
    with pytest.raises(InputError, match=r"\[brake\]: expected a section, got 1"):
        load_vehicle(path)


def test_replacing_a_part_is_checked_again() -> None:
    vehicle = gem_e2()
    assert isinstance(dataclasses.replace(vehicle, name="other"), Vehicle)
    with pytest.raises(InputError, match="wheelbase_m"):
        dataclasses.replace(vehicle.geometry, wheelbase_m=0.0)


def test_what_the_file_is_unsure_of_disturbs_the_loop(tmp_path: Path) -> None:
    added = '[uncertainty]\nlateral_m = 0.1\nwheelbase_m = 0.05\nprovenance = "tape"\n[brake]'
    vehicle = load_vehicle(edited(tmp_path, "[brake]", added))
    assert vehicle.uncertainty == Uncertainty(0.1, wheelbase_m=0.05, provenance="tape")
    loop = vehicle.uncertain_loop(vehicle.track(), PathFrame(0.0, 0.0)).ode
    ranges = {q.name: (q.lower, q.upper) for q in (*loop.disturbances, *loop.parameters)}
    assert ranges["position_error_lateral"] == (-0.1, 0.1)
    assert ranges["wheelbase"] == pytest.approx((1.7, 1.8))
    # What other commands analyse is the loop without it, as ever.
    calm = vehicle.closed_loop(vehicle.track(), PathFrame(0.0, 0.0)).ode
    assert [w.name for w in calm.disturbances] == ["curvature"]
    sure = gem_e2()
    assert sure.uncertainty == Uncertainty()
    same = sure.uncertain_loop(sure.track(), PathFrame(0.0, 0.0)).ode
    assert [w.name for w in same.disturbances] == ["curvature"]
