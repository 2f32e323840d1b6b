"""What `workbench track` cannot use is refused with one sentence and exit status 2, and leaves
nothing behind: no new file, and no old one changed."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from cli_fixture import invoke
from perception_models import NAMES, constant_network
from track_fixture import base, short, tracked
from track_scenes import SIZE

from workbench.estimation.camera import gem_e2_camera_path

__all__ = ["base", "short"]


def changed(base: Path, folder: Path, what: str) -> list[object]:
    """The words of a call with one thing wrong."""
    images, network, camera = base / "images", base / "net.onnx", base / "camera.toml"
    more: list[object] = []
    if what == "text":
        network = folder / "text.onnx"
        network.write_text("no network")
    elif what == "outputs":
        network = constant_network(folder / "odd.onnx", np.zeros((1, 5, 9)), names=NAMES)
    elif what == "cats":
        network = constant_network(folder / "c.onnx", np.zeros((1, 6, 9)), names=("cat", "dog"))
    elif what == "key":
        text = camera.read_text()
        camera = folder / "camera.toml"
        camera.write_text(re.sub(r"(?m)^pitch_rad.*\n", "", text))
    elif what == "size":
        camera = gem_e2_camera_path()
    elif what in ("image", "small", "turned", "back"):
        images = folder / "images"
        shutil.copytree(base / "images", images)
        spoil(images, what)
    elif what == "empty":
        images = folder / "nothing"
        images.mkdir()
    elif what == "late":
        (folder / "poses.csv").write_text("t,x,y,heading\n0,0,0,0\n3,0,0,0\n")
        more = ["--vehicle", folder / "poses.csv", "--unsure", 0.1, 0.01]
    elif what == "rate":
        more = ["--rate", 5]
    elif what == "unsure":
        more = ["--unsure", 0.1, 0.01]
    return [images, "--network", network, "--camera", camera, *more]


def spoil(images: Path, what: str) -> None:
    last = images / "030.png"
    if what == "image":
        last.write_bytes(last.read_bytes()[:200])
    elif what == "small":
        PIL.Image.new("RGB", (320, 240)).save(last)
    elif what == "turned":
        tag = PIL.Image.Exif()
        tag[0x0112] = 6
        PIL.Image.new("RGB", SIZE).save(last, exif=tag)
    else:
        table = images / "frames.csv"
        table.write_text(table.read_text().replace("030.png,6.0", "030.png,5.8"))


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("text", "ONNX Runtime cannot load it"),
        ("outputs", "name the head"),
        ("cats", "one of the classes person"),
        ("key", "pitch_rad"),
        ("size", "expected an image of 2064 x 1544 pixels"),
        ("image", "cannot be read as an image"),
        ("small", "got 320 x 240"),
        ("turned", "EXIF orientation 6"),
        ("back", "times that increase"),
        ("empty", "found none"),
        ("late", "expected poses from before"),
        ("rate", "leave the rate out"),
        ("unsure", "expected beside --vehicle"),
    ],
)
def test_what_cannot_be_used_leaves_nothing_behind(
    base: Path, tmp_path: Path, what: str, said: str
) -> None:
    words = changed(base, tmp_path, what)
    before = sorted(tmp_path.rglob("*"))
    page = tmp_path / "deep" / "page.html"
    result = invoke("track", *words, "--out", tmp_path / "new" / "out", "--plot", page)
    assert result.status == 2
    lines = [line for line in result.err.splitlines() if not line.startswith("looking: ")]
    assert len(lines) == 1
    assert said in lines[0]
    assert sorted(tmp_path.rglob("*")) == before


def test_a_failed_run_keeps_what_was_there(base: Path, short: Path, tmp_path: Path) -> None:
    assert tracked(base, short, "--out", tmp_path / "out").status == 0
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    words = changed(base, tmp_path, "image")
    assert invoke("track", *words, "--out", tmp_path / "out").status == 2
    assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


def test_a_full_disk_keeps_what_was_there(
    base: Path, short: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert tracked(base, short, "--out", tmp_path / "out").status == 0
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    write = Path.write_text

    def full(self: Path, text: str, **options: str) -> int:
        if "vehicles" in self.name:
            raise OSError(28, "No space left on device", str(self))
        return write(self, text, **options)

    monkeypatch.setattr(Path, "write_text", full)
    result = tracked(base, short, "--out", tmp_path / "out", "--recording", "another")
    assert result.status == 2
    assert "No space left" in result.err
    assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


def test_a_folder_in_the_way_of_a_table_is_refused_at_once(
    base: Path, short: Path, tmp_path: Path
) -> None:
    (tmp_path / "out" / "vehicles.csv").mkdir(parents=True)
    result = tracked(base, short, "--out", tmp_path / "out")
    assert result.status == 2
    assert "it is a folder" in result.err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["vehicles.csv"]
    result = tracked(base, short, "--out", tmp_path, "--plot", tmp_path / "peds.csv")
    assert result.status == 2
    assert "expected another file than the table" in result.err


def test_the_vehicles_own_table_is_not_written_over(
    base: Path, short: Path, tmp_path: Path
) -> None:
    table = tmp_path / "vehicles.csv"
    table.write_text("t,x,y,heading\n0,0,0,0\n9,0,0,0\n")
    result = tracked(base, short, "--out", tmp_path, "--vehicle", table, "--unsure", 0, 0)
    assert result.status == 2
    assert "expected another folder" in result.err
    assert table.read_text().startswith("t,x")


def test_without_the_extra_it_is_named(
    base: Path, short: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    result = tracked(base, short, "--out", tmp_path / "out")
    assert result.status == 2
    assert "pip install 'reach-workbench[perception]'" in result.err
    assert not (tmp_path / "out").exists()
