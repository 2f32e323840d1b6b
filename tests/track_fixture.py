"""One painted scene, tracked once, for the tests of `workbench track`."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest
from cli_fixture import Result, invoke
from perception_models import colour_network
from track_scenes import SCENE, SIZE, camera_file, images_of

SECONDS = 8.0
Row = dict[str, str]


def rows(path: Path) -> list[Row]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def tracked(base: Path, images: Path, *options: object) -> Result:
    return invoke(
        "track", images, "--network", base / "net.onnx", "--camera", base / "camera.toml",
        "--out", base / "out", *options,
    )  # fmt: skip


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scene")
    camera_file(folder / "camera.toml")
    colour_network(folder / "net.onnx", size=(SIZE[1], SIZE[0]))
    images_of(folder / "images", SCENE, SECONDS)
    return folder


@pytest.fixture(scope="module")
def told(base: Path) -> Result:
    """What the command says of the standing scene."""
    result = tracked(base, base / "images", "--plot", base / "page.html", "--json")
    assert result.status == 0, result.err
    return result


@pytest.fixture(scope="module")
def seen(base: Path, told: Result) -> list[Row]:
    """tracks.csv of it; the other files lie beside it."""
    return rows(base / "out" / "tracks.csv")


@pytest.fixture(scope="module")
def short(base: Path) -> Path:
    """The first images of it."""
    return images_of(base / "short", SCENE, 0.4)


def at(table: list[Row], t_s: float, *states: str) -> list[Row]:
    return [row for row in table if float(row["t"]) == t_s and row["state"] in states]


def away(row: Row, place: tuple[float, float]) -> float:
    return math.hypot(float(row["x"]) - place[0], float(row["y"]) - place[1])


def holds(row: Row, place: tuple[float, float]) -> bool:
    return away(row, place) <= float(row["radius"])
