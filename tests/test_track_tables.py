"""The tables of `workbench track` say what looking said, to the last digit, and other commands read
them; the summary counts, and names who has no place."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from cli_fixture import Result, invoke
from perception_models import constant_network
from track_fixture import SECONDS, Row, at, base, holds, rows, seen, short, told, tracked
from track_scenes import RED, RED_WALKER, Thing, images_of, times

from workbench.estimation.camera import load_camera
from workbench.estimation.people_data import load_tracks
from workbench.estimation.ranging import sight_of
from workbench.perception.images import frames
from workbench.perception.network import load_network
from workbench.perception.people import Looking, look
from workbench.perception.poses import STANDING
from workbench.perception.tracks import TrackLimits
from workbench.perception.unseen import View
from workbench.runtime.person_guard import MotionLimits
from workbench.simulation.recording import load_recording

__all__ = ["base", "seen", "short", "told"]


def numbers(row: Row, *names: str) -> list[float]:
    return [float(row[name]) for name in names]


def test_the_tables_say_what_looking_says(base: Path, short: Path, tmp_path: Path) -> None:
    """Disc by disc and box by box, to the last digit."""
    assert tracked(base, short, "--out", tmp_path / "out").status == 0
    people = rows(tmp_path / "out" / "tracks.csv")
    boxes = rows(tmp_path / "out" / "detections.csv")
    limits = TrackLimits(MotionLimits(2.5, 2.0), MotionLimits(7.0, 3.0), 1.0, 1.0)
    around = look(
        load_network(base / "net.onnx"), frames(short), sight_of(load_camera(base / "camera.toml")),
        pose_at=lambda _: STANDING,
        looking=Looking(0.25, 0.5, View(4.0, 25.0, 30.0, 3, assumed=True), limits),
    )  # fmt: skip
    for each in around:
        own = at(people, each.t_s, "born", "seen")
        for row, track in zip(own, each.tracks.people, strict=True):
            place, velocity = track.guard.position, track.guard.velocity
            assert numbers(row, "x", "y", "radius") == [place.x, place.y, place.radius]
            assert numbers(row, "vx", "vy", "v_radius") == [
                velocity.x, velocity.y, velocity.radius,
            ]  # fmt: skip
            assert int(row["seen"]) == track.seen
        assumed = at(people, each.t_s, "assumed")
        for row, disc in zip(assumed, each.placed.hidden, strict=True):
            assert numbers(row, "x", "y", "radius") == [disc.x, disc.y, disc.radius]
        found = [row for row in boxes if float(row["t"]) == each.t_s]
        for row, one, answer in zip(found, each.placed.seen, each.placed.answers, strict=True):
            edges = (one.box.left_px, one.box.top_px, one.box.right_px, one.box.bottom_px)
            assert tuple(numbers(row, "left", "top", "right", "bottom")) == edges
            assert (answer is None) == (row["status"] == "")
            if answer is not None:
                assert tuple(numbers(row, "ahead_low", "ahead_high")) == answer.ahead_m
                assert tuple(numbers(row, "beside_low", "beside_high")) == answer.beside_m


def test_vague_places_are_left_out_of_the_people(base: Path, seen: list[Row]) -> None:
    kept = {(row["t"], row["agent"]) for row in rows(base / "out" / "peds.csv")}
    every = [row for row in seen if row["state"] in ("born", "seen")]
    assert kept == {(r["t"], r["agent"]) for r in every if float(r["radius"]) <= 3.0}
    assert len(kept) < len(every)


def test_the_folder_is_read_by_other_commands(base: Path, seen: list[Row], tmp_path: Path) -> None:
    folder = base / "out"
    people = {track.agent: track for track in load_tracks(folder)}
    assert set(people) == {"1", "2", "3"}
    red = people["1"]
    assert np.hypot(*(red.xy_m - [RED_WALKER.at(t) for t in red.t_s]).T).max() < 1.0
    recording = load_recording(folder, "images")
    assert len(recording.people) == 3
    assert {sample.speed_mps for sample in recording.vehicle} == {0.0}
    queries = tmp_path / "queries.csv"
    queries.write_text("recording,agent,t0,h\nimages,1,2.0,1.0\nimages,3,7.0,2.0\n")
    answers = tmp_path / "answers.csv"
    result = invoke("intent", folder, "--answers", queries, "--out", answers)
    assert result.status == 0, result.err
    assert [row["agent"] for row in rows(answers)] == ["1", "3"]
    # They walk to the right, and that is what is foretold.
    assert float(rows(answers)[0]["y"]) < RED_WALKER.at(2.0)[1] - 0.3


def test_the_summary_counts(base: Path, told: Result) -> None:
    summary = told.data["summary"]
    boxes = rows(base / "out" / "detections.csv")
    assert summary["images"] == len(times(SECONDS))
    assert summary["boxes"] == len(boxes)
    assert summary["boxes_of_people"] == sum(row["kind"] == "ped" for row in boxes)
    assert (summary["begun"], summary["given_up"], summary["confirmed"]) == (3, 1, 3)
    assert summary["unplaced"] == []
    assert any("stands at the origin" in limit for limit in summary["limits"])
    assert [Path(name).name for name in told.data["wrote"]] == [
        "peds.csv", "tracks.csv", "detections.csv", "vehicles.csv", "shapes.csv", "page.html",
    ]  # fmt: skip
    assert "looking: 100%" in told.err


def test_who_has_no_place_is_told_with_the_reason(base: Path, tmp_path: Path) -> None:
    """A board of three metres' width far away: by its width it is near, by its feet far."""
    wide = Thing(RED, lambda t: (11.0, 0.0), width=3.0)
    images = images_of(tmp_path / "wide", (wide,), 0.4)
    result = tracked(base, images, "--out", tmp_path / "out")
    assert result.status == 0
    assert re.search(r"0\.20 s, box 0, person, CONTRADICTION: by the width they are", result.out)
    found = rows(tmp_path / "out" / "tracks.csv")
    assert {row["state"] for row in found} == {"assumed"}
    assert any(holds(row, (11.0, 0.0)) for row in at(found, 0.2, "assumed"))


def test_more_people_than_the_monitor_takes_is_a_limit(
    base: Path, short: Path, tmp_path: Path
) -> None:
    result = tracked(base, short, "--out", tmp_path / "out", "--slices", 12)
    assert "the monitor takes 32 people, and up to" in result.out


def test_classes_can_be_named(base: Path, short: Path, tmp_path: Path) -> None:
    """A network that does not say what its classes are; the first is a rider here."""
    output = np.zeros((1, 4 + 2, 1), dtype=np.float32)
    output[0, :, 0] = [320.0, 260.0, 30.0, 110.0, 0.9, 0.0]
    network = constant_network(tmp_path / "n.onnx", output, names=None, sides=(480, 640))
    result = invoke(
        "track", short, "--network", network, "--camera", base / "camera.toml",
        "--out", tmp_path / "out", "--names", "rider, dog",
    )  # fmt: skip
    assert result.status == 0, result.err
    assert {row["kind"] for row in rows(tmp_path / "out" / "peds.csv")} == {"cyclist"}
