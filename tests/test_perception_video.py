"""Videos are read image by image at their own time stamps, which need not be even; what is broken,
empty, turned, or no video is refused with one sentence."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest
from track_scenes import video_of

from workbench.cli.main import PACKAGES_OF_EXTRAS
from workbench.errors import InputError
from workbench.perception import video
from workbench.perception.footage import footage
from workbench.perception.video import video_frames, video_length


def pictures(count: int) -> list[np.ndarray]:
    """Noise, which no codec makes short, and no two alike."""
    rng = np.random.default_rng(7)
    return [rng.integers(0, 256, (48, 64, 3), dtype=np.uint8) for _ in range(count)]


def lossy(path: Path, images: list[np.ndarray], codec: str) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.bit_rate = 4_000_000
        for image in images:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode(None))
    return path


def test_images_come_as_they_were_at_their_times(tmp_path: Path) -> None:
    images = pictures(6)
    path = video_of(tmp_path / "v.mkv", images)
    found = list(video_frames(path))
    assert [each.t_s for each in found] == pytest.approx([0.2 * k for k in range(6)], abs=1e-3)
    assert all(np.array_equal(a.image, b) for a, b in zip(found, images, strict=True))
    assert found[2].name == "v.mkv, image 3"
    assert found[0].image.dtype == np.uint8


def test_uneven_time_stamps_are_kept(tmp_path: Path) -> None:
    stamps = [3, 4, 9, 10, 31]
    path = video_of(tmp_path / "v.mkv", pictures(5), stamps=stamps)
    found = [each.t_s for each in video_frames(path)]
    assert found == pytest.approx([0.2 * stamp for stamp in stamps], abs=1e-3)


@pytest.mark.parametrize(
    ("name", "codec"), [("v.mp4", "mpeg4"), ("v.avi", "mpeg4"), ("v.webm", "libvpx")]
)
def test_usual_containers_are_read(name: str, codec: str, tmp_path: Path) -> None:
    path = lossy(tmp_path / name, pictures(9), codec)
    found = list(video_frames(path))
    assert [each.t_s for each in found] == pytest.approx([k / 25 for k in range(9)], abs=2e-3)
    assert {each.image.shape for each in found} == {(48, 64, 3)}


def test_the_length_is_about_right(tmp_path: Path) -> None:
    assert video_length(video_of(tmp_path / "v.mkv", pictures(11))) == 11
    assert video_length(lossy(tmp_path / "v.mp4", pictures(11), "mpeg4")) == 11


def test_footage_begins_when_it_is_said_to(tmp_path: Path) -> None:
    path = video_of(tmp_path / "v.mkv", pictures(3), stamps=[5, 6, 8])
    shots = footage(path, rate_hz=None, start_s=100.0)
    assert shots.count == 3
    assert [each.t_s for each in shots.frames] == pytest.approx([100.0, 100.2, 100.6], abs=2e-3)
    plain = [each.t_s for each in footage(path, rate_hz=None, start_s=None).frames]
    assert plain == pytest.approx([1.0, 1.2, 1.6], abs=1e-3)
    with pytest.raises(InputError, match="leave the rate out"):
        footage(path, rate_hz=5.0, start_s=None)


@pytest.mark.parametrize("name", ["v.mp4", "v.avi", "v.mkv"])
@pytest.mark.parametrize("part", [0.02, 0.4, 0.8])
def test_a_video_that_was_cut_short_is_refused(name: str, part: float, tmp_path: Path) -> None:
    path = tmp_path / name
    if name.endswith("mkv"):
        video_of(path, pictures(20))
    else:
        lossy(path, pictures(20), "mpeg4")
    whole = path.read_bytes()
    path.write_bytes(whole[: round(part * len(whole))])
    with pytest.raises(InputError, match=name.replace(".", r"\.")) as refused:
        list(video_frames(path))
    assert "\n" not in str(refused.value)


def test_damage_that_the_decoder_can_tell_is_refused(tmp_path: Path) -> None:
    path = lossy(tmp_path / "v.mp4", pictures(20), "mpeg4")
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 400] = bytes(400)
    path.write_bytes(content)
    with pytest.raises(InputError, match="damaged or ends early"):
        list(video_frames(path))


def shown(t_s: float | None, *, corrupt: bool = False) -> SimpleNamespace:
    image = np.zeros((2, 2, 3), dtype=np.uint8)
    return SimpleNamespace(time=t_s, is_corrupt=corrupt, rotation=0, to_ndarray=lambda **_: image)


@pytest.mark.parametrize(
    ("frames", "said"),
    [
        ([shown(0.0), shown(0.2), shown(0.2)], "image 3: expected a time stamp after 0.2"),
        ([shown(0.4), shown(0.2)], "image 2: expected a time stamp after 0.4"),
        ([shown(0.0), shown(None)], "image 2: expected a time stamp"),
        ([shown(0.0), shown(0.2, corrupt=True)], "image 2: it is damaged"),
        ([], "found no image in it"),
    ],
)
def test_streams_that_cannot_be_followed_are_refused(
    frames: list[SimpleNamespace], said: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """No container here can be written so wrong; its decoder is stood in for."""
    path = video_of(tmp_path / "v.mkv", pictures(2))
    monkeypatch.setattr(video, "_decoded", lambda path, container: iter(frames))
    with pytest.raises(InputError, match=said):
        list(video_frames(path))


@pytest.mark.parametrize("content", [b"", b"no video", bytes(5000)])
def test_what_is_no_video_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "v.mp4"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"v\.mp4: expected a video"):
        list(video_frames(path))
    with pytest.raises(InputError, match=r"v\.mp4: expected a video"):
        footage(path, rate_hz=None, start_s=None)


def test_sound_alone_and_nothing_at_all_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "sound.wav"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 80), dtype=np.int16), layout="mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
    with pytest.raises(InputError, match="found no images"):
        list(video_frames(path))
    with pytest.raises(InputError, match="no such video"):
        list(video_frames(tmp_path / "absent.mp4"))


def test_a_video_that_wants_to_be_turned_is_refused(tmp_path: Path) -> None:
    path = lossy(tmp_path / "v.mp4", pictures(3), "mpeg4")
    content = path.read_bytes()
    upright = bytes.fromhex(
        "00010000 00000000 00000000 00000000 00010000 00000000".replace(" ", "")
    )
    over = bytes.fromhex("ffff0000 00000000 00000000 00000000 ffff0000 00000000".replace(" ", ""))
    head = content.rindex(b"tkhd")
    place = content.index(upright, head)
    path.write_bytes(content[:place] + over + content[place + len(over) :])
    with pytest.raises(InputError, match="turned by"):
        list(video_frames(path))


def test_without_pyav_the_extra_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    (tmp_path / "v.mp4").write_bytes(b"")
    with pytest.raises(ImportError) as missing:
        list(video_frames(tmp_path / "v.mp4"))
    assert missing.value.name in PACKAGES_OF_EXTRAS["perception"]
