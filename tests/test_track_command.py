"""`workbench track` on painted scenes: every true place and velocity is in the disc that is told,
numbers survive a short hiding, whoever is hidden is assumed where they are, tracks end after
--forget, and later images change nothing."""

from __future__ import annotations

import csv
import itertools
import math
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from track_fixture import SECONDS, Row, at, away, base, holds, rows, seen, short, told, tracked
from track_scenes import (
    GREEN,
    GREEN_WALKER,
    RED,
    RED_WALKER,
    SCENE,
    Thing,
    images_of,
    painted,
    standing,
    times,
    video_of,
)

__all__ = ["base", "seen", "short", "told"]


def drive(t_s: float) -> tuple[float, float, float]:
    """A slow drive along a bend."""
    return 0.5 * t_s, 0.02 * t_s**2, 0.08 * math.sin(0.5 * t_s)


def visible(thing: Thing, t_s: float, *, pose: tuple[float, float, float] = (0, 0, 0)) -> bool:
    return bool((painted(SCENE, t_s, pose) == thing.colour).all(axis=2).any())


def agent_of(thing: Thing, t_s: float, table: list[Row], boxes: list[Row]) -> Row:
    """The track of the box that shows this colour's pixels."""
    image = (painted(SCENE, t_s, (0, 0, 0)) == thing.colour).all(axis=2)
    left, right = np.flatnonzero(image.any(axis=0))[[0, -1]]
    (box,) = [
        row for row in boxes
        if float(row["t"]) == t_s and row["kind"] == "ped"
        and abs(float(row["left"]) - left) < 1.5 and abs(float(row["right"]) - right - 1) < 1.5
    ]  # fmt: skip
    (found,) = [row for row in at(table, t_s, "born", "seen") if row["agent"] == box["agent"]]
    return found


def sightings(base: Path, seen: list[Row], thing: Thing) -> Iterator[tuple[float, Row]]:
    boxes = rows(base / "out" / "detections.csv")
    for t_s in times(SECONDS):
        if visible(thing, t_s):
            yield t_s, agent_of(thing, t_s, seen, boxes)


@pytest.mark.parametrize("thing", [RED_WALKER, GREEN_WALKER])
def test_every_true_place_and_velocity_is_in_its_disc(
    base: Path, seen: list[Row], thing: Thing
) -> None:
    count = 0
    for t_s, row in sightings(base, seen, thing):
        assert holds(row, thing.at(t_s))
        ahead, behind = thing.at(t_s + 1e-6), thing.at(t_s)
        v = ((ahead[0] - behind[0]) / 1e-6, (ahead[1] - behind[1]) / 1e-6)
        apart = math.hypot(float(row["vx"]) - v[0], float(row["vy"]) - v[1])
        assert apart <= float(row["v_radius"]) + 1e-6
        count += 1
    assert count > 20


def test_a_number_survives_a_short_hiding(base: Path, seen: list[Row]) -> None:
    found = list(sightings(base, seen, RED_WALKER))
    assert max(b[0] - a[0] for a, b in itertools.pairwise(found)) > 0.7
    assert {row["agent"] for _, row in found} == {found[0][1]["agent"]}
    for t_s in times(SECONDS):
        if not visible(RED_WALKER, t_s):
            (own,) = [row for row in at(seen, t_s, "unseen") if row["agent"] == "1"]
            assert holds(own, RED_WALKER.at(t_s))


def test_a_track_ends_after_forget_s_and_somebody_new_comes_out(
    base: Path, seen: list[Row]
) -> None:
    found = list(sightings(base, seen, GREEN_WALKER))
    before, after = found[0][1]["agent"], found[-1][1]["agent"]
    assert before != after
    last_s = max(t_s for t_s, row in found if row["agent"] == before)
    since = [row for row in seen if row["agent"] == before and float(row["t"]) > last_s]
    for row in since:
        assert (row["state"] == "lost") == (float(row["t"]) - last_s > 1.0)
    assert [row["state"] for row in since].count("lost") == 1
    first = next(row for row in seen if row["agent"] == after)
    assert first["state"] == "born"


def test_whoever_is_hidden_is_assumed_where_they_are(seen: list[Row]) -> None:
    hidden = 0
    for thing in (RED_WALKER, GREEN_WALKER):
        for t_s in times(SECONDS):
            if not visible(thing, t_s):
                shadows = [r for r in at(seen, t_s, "assumed") if r["where"].startswith("behind")]
                assert any(holds(row, thing.at(t_s)) for row in shadows)
                assert all(float(row["v_radius"]) == 7.0 for row in shadows)
                hidden += 1
    assert hidden > 15
    where = {row["where"] for row in at(seen, 0.0, "assumed")}
    assert {"left edge", "right edge"} < where


def test_answers_use_nothing_later(base: Path, seen: list[Row], tmp_path: Path) -> None:
    """The first half of the images alone gives the first half of the rows."""
    some = tmp_path / "some"
    some.mkdir()
    listed = rows(base / "images" / "frames.csv")[:20]
    for row in listed:
        shutil.copy(base / "images" / row["file"], some / row["file"])
    (some / "frames.csv").write_text(
        "file,t\n" + "".join(f"{row['file']},{row['t']}\n" for row in listed)
    )
    assert tracked(base, some, "--out", tmp_path / "out", "--recording", "images").status == 0
    until_s = float(listed[-1]["t"])
    assert rows(tmp_path / "out" / "tracks.csv") == [r for r in seen if float(r["t"]) <= until_s]


def test_a_video_says_the_same_as_its_images(base: Path, seen: list[Row], tmp_path: Path) -> None:
    video = video_of(
        tmp_path / "drive.mkv", [painted(SCENE, t_s, standing(t_s)) for t_s in times(SECONDS)]
    )
    result = tracked(base, video, "--out", tmp_path / "out", "--recording", "images")
    assert result.status == 0, result.err
    assert rows(tmp_path / "out" / "tracks.csv") == seen


@pytest.mark.parametrize("reference", [0.0, 0.3])
def test_a_moving_vehicle_puts_people_where_they_are(
    base: Path, tmp_path: Path, reference: float
) -> None:
    """Poses at other times than the images, off by all but a little of their half widths."""
    images = images_of(tmp_path / "images", SCENE, 4.0, pose=drive)
    with (tmp_path / "poses.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["t", "x", "y", "heading", "x_half", "y_half", "heading_half"])
        for k in range(-1, 43):
            t_s = 7.0 + 0.1 * k + 0.03
            x, y, heading = drive(t_s - 7.0)
            x, y = x + reference * math.cos(heading), y + reference * math.sin(heading)
            table.writerow([t_s, x + 0.09, y - 0.09, heading + 0.009, 0.1, 0.1, 0.01])
    result = tracked(
        base, images, "--out", tmp_path / "out", "--vehicle", tmp_path / "poses.csv",
        "--start", 7, "--reference-ahead", reference,
    )  # fmt: skip
    assert result.status == 0, result.err
    table = rows(tmp_path / "out" / "tracks.csv")
    looked = 0
    for t_s in times(4.0):
        for thing in (RED_WALKER, GREEN_WALKER):
            if visible(thing, t_s, pose=drive(t_s)):
                own = [r for r in table if float(r["t"]) == 7.0 + t_s and r["state"] in
                       ("born", "seen") and holds(r, thing.at(t_s))]  # fmt: skip
                assert own
                looked += 1
    assert looked > 30
    first = min(at(table, 7.0, "born"), key=lambda row: away(row, RED_WALKER.at(0.0)))
    assert away(first, RED_WALKER.at(0.0)) < 0.8
    for row in rows(tmp_path / "out" / "vehicles.csv"):
        x, y, heading = drive(float(row["t"]) - 7.0)
        assert abs(float(row["x"]) - x - 0.3 * math.cos(heading)) < 0.15
        assert abs(float(row["y"]) - y - 0.3 * math.sin(heading)) < 0.15


def test_the_scene_hides_what_the_tests_need_hidden() -> None:
    """Each colour is somebody's own, and both walkers vanish for a while."""
    assert len({thing.colour for thing in SCENE}) == 3
    for colour, walker in ((RED, RED_WALKER), (GREEN, GREEN_WALKER)):
        shown = [bool((painted(SCENE, t, (0, 0, 0)) == colour).all(axis=2).any())
                 for t in times(SECONDS)]  # fmt: skip
        assert shown[0]
        assert shown[-1]
        assert not all(shown)
        assert walker.colour == colour
