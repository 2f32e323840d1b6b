"""A recording is read exactly as written, and whatever cannot be used is refused by its place."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.simulation.recording import load_recording

VEHICLES = """recording,agent,kind,t,x,y,heading,v,v_lat,a,yaw_rate
one,ego,car,0.0,1.0,2.0,0.1,3.0,0.01,0.2,0.05
one,ego,car,0.1,1.3,2.0,0.1,3.0,0.01,0.2,0.05
two,a,cart,0.0,0,0,0,1,0,0,0
two,b,cart,0.0,5,5,0,1,0,0,0
"""
PEDS = """recording,agent,kind,t,x,y,occluded
one,p1,ped,0.0,5.0,1.0,0
one,p2,cyclist,0.1,6.0,1.0,0
one,p1,ped,0.1,5.1,1.0,0
crowd,q,ped,0.0,1,1,0
"""
SHAPES = """recording,agent,front,rear,half_width,wheelbase
one,ego,3.5,1.3,0.91,2.71
two,b,1.2,1.2,0.6,1.56
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("vehicles", VEHICLES), ("peds", PEDS)):
        (tmp_path / f"{name}.csv.gz").write_bytes(gzip.compress(text.encode()))
    (tmp_path / "shapes.csv").write_text(SHAPES)
    (tmp_path / "recordings.csv").write_text("recording\none\ntwo\ncrowd\n")
    return tmp_path


def refused(folder: Path, name: str = "one", agent: str | None = None) -> str:
    with pytest.raises(InputError) as caught:
        load_recording(folder, name, agent=agent)
    return str(caught.value)


def rewrite(folder: Path, table: str, text: str) -> None:
    (folder / f"{table}.csv.gz").unlink(missing_ok=True)
    (folder / f"{table}.csv").write_text(text)


def test_reads_vehicle_people_and_shape(folder: Path) -> None:
    recording = load_recording(folder, "one")
    assert (recording.agent, recording.kind, len(recording.vehicle)) == ("ego", "car", 2)
    first = recording.vehicle[0]
    assert (first.t_s, first.x_m, first.y_m, first.heading_rad, first.speed_mps) == (
        0.0,
        1.0,
        2.0,
        0.1,
        3.0,
    )
    assert (first.lateral_speed_mps, first.acceleration_mps2, first.yaw_rate_radps) == (
        0.01,
        0.2,
        0.05,
    )
    assert [(t.name, t.kind, len(t.samples)) for t in recording.people] == [
        ("p1", "ped", 2),
        ("p2", "cyclist", 1),
    ]
    assert (recording.shape.front_m, recording.shape.wheelbase_m) == (3.5, 2.71)


def test_plain_files_and_missing_optional_columns_are_fine(folder: Path) -> None:
    rewrite(folder, "vehicles", "recording,agent,kind,t,x,y,heading,v\none,ego,car,0,1,2,0.1,3\n")
    (folder / "recordings.csv").unlink()
    sample = load_recording(folder, "one").vehicle[0]
    assert (sample.lateral_speed_mps, sample.yaw_rate_radps) == (None, None)


def test_a_recording_without_people_is_a_recording(folder: Path) -> None:
    rewrite(folder, "peds", "recording,agent,kind,t,x,y\n")
    assert load_recording(folder, "one").people == ()


@pytest.mark.parametrize("bad", ["nan", "inf", "-inf", "fast", "", "1,5"])
def test_bad_numbers_are_named_by_file_line_and_column(folder: Path, bad: str) -> None:
    rewrite(folder, "vehicles", VEHICLES.replace("1.3,2.0,0.1", f'"{bad}",2.0,0.1'))
    message = refused(folder)
    for part in ("vehicles.csv", "line 3", "'x'", repr(bad), "correct the entry"):
        assert part in message


def test_bad_number_of_a_person_is_named_too(folder: Path) -> None:
    rewrite(folder, "peds", PEDS.replace("5.1,1.0", "5.1,nan"))
    message = refused(folder)
    assert "peds.csv" in message
    assert "line 4, column 'y'" in message


def test_a_bad_number_in_another_recording_does_not_matter(folder: Path) -> None:
    rewrite(folder, "peds", PEDS.replace("crowd,q,ped,0.0,1", "crowd,q,ped,0.0,nan"))
    assert len(load_recording(folder, "one").people) == 2


def test_missing_columns_say_what_was_expected_and_what_came(folder: Path) -> None:
    rewrite(folder, "vehicles", "recording,agent,kind,t,x,y,psi,speed\none,e,car,0,1,2,0,3\n")
    message = refused(folder)
    assert "missing columns heading, v;" in message
    assert "got recording, agent, kind, t, x, y, psi, speed" in message


@pytest.mark.parametrize(
    ("table", "text", "part"),
    [
        ("vehicles", "", "is empty; expected a header row"),
        ("peds", "", "is empty; expected a header row"),
        ("vehicles", VEHICLES.split("\n")[0] + "\n", "has no vehicle"),
        ("vehicles", VEHICLES.replace(",0.01,0.2,0.05\n", "\n"), "line 2: expected 11 entries"),
        ("vehicles", VEHICLES.replace("car,0.1,", "car,0.0,"), "expected a time after 0.0"),
        ("peds", PEDS.replace("ped,0.1,", "ped,-1,"), "expected a time after 0.0"),
        ("shapes", SHAPES.replace("one,ego", "one,else"), "no row for recording 'one'"),
        ("shapes", SHAPES.replace("2.71", "-2.71"), "expected metres above zero, got -2.71"),
        ("shapes", SHAPES.replace("0.91", "0"), "expected metres above zero, got 0"),
        ("shapes", SHAPES.replace("3.5,1.3", "1,-1"), "expected front + rear above zero"),
    ],
)
def test_unusable_tables_are_refused(folder: Path, table: str, text: str, part: str) -> None:
    rewrite(folder, table, text)
    assert part in refused(folder)


def test_unknown_name_lists_the_nearest_first(folder: Path) -> None:
    assert "it has, nearest first: two, " in refused(folder, "tow")


def test_no_vehicle_and_several_vehicles_say_what_there_is(folder: Path) -> None:
    assert "has no vehicle; replay needs one. Recordings here with a vehicle: one, two" in refused(
        folder, "crowd"
    )
    assert "has 2 vehicles (a, b); say which" in refused(folder, "two")
    assert "no vehicle 'c'; it has a, b" in refused(folder, "two", "c")
    assert load_recording(folder, "two", agent="b").vehicle[0].x_m == 5.0


def test_missing_folder_and_missing_table(folder: Path) -> None:
    assert "found nothing" in refused(folder / "nowhere")
    assert "found a file" in refused(folder / "shapes.csv")
    (folder / "peds.csv.gz").unlink()
    assert "expected peds.csv.gz or peds.csv, the folder holds recordings.csv" in refused(folder)


def test_damaged_files_are_refused(folder: Path) -> None:
    path = folder / "vehicles.csv.gz"
    path.write_bytes(path.read_bytes()[:-20])
    assert "cannot be read" in refused(folder)
    path.unlink()
    (folder / "vehicles.csv").write_bytes(b"recording\xff\n")
    assert "not UTF-8" in refused(folder)
