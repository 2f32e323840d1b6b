"""The page of `workbench track` holds images, boxes and the plan of every image drawn, fetches
nothing, and moves through them in a browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_report_browser import FLAGS
from track_fixture import SECONDS, Row, at, base, seen, told, tracked
from track_scenes import RED, Thing, images_of, times

__all__ = ["base", "seen", "told"]


def content_of(page: Path) -> Any:
    """What the player draws."""
    found = re.search(r'class="frames">(.*?)</script>', page.read_text(), flags=re.DOTALL)
    assert found is not None
    return json.loads(found.group(1))


def test_the_page_holds_images_and_plan(base: Path, seen: list[Row]) -> None:
    assert not re.search(r'(?:src|href)="(?!data:|#)', (base / "page.html").read_text())
    content = content_of(base / "page.html")
    assert len(content["frames"]) == len(times(SECONDS)) <= 48
    for frame in content["frames"]:
        assert frame["i"].startswith("data:image/jpeg;base64,")
        followed = {row["agent"] for row in at(seen, frame["t"], "born", "seen", "unseen")}
        assert {person["s"] for person in frame["p"]} == followed
        assert len(frame["a"]) == len(at(seen, frame["t"], "assumed"))
    first = content["frames"][0]["p"][0]
    # The vehicle stands at the origin, so that its frame is the global one.
    assert first["d"][:2] == [round(100 * float(seen[0][key])) for key in ("x", "y")]


def test_the_plan_is_in_the_vehicles_frame(base: Path, tmp_path: Path) -> None:
    """Somebody 9 m ahead and 2 m to the left of a vehicle that stands askew elsewhere."""
    x, y, heading = 30.0, -20.0, 2.2
    there = complex(x, y) + complex(9.0, 2.0) * np.exp(1j * heading)
    thing = Thing(RED, lambda t: (there.real, there.imag))
    images = images_of(tmp_path / "askew", (thing,), 0.4, pose=lambda t: (x, y, heading))
    (tmp_path / "poses.csv").write_text(
        f"t,x,y,heading\n0,{x},{y},{heading}\n9,{x},{y},{heading}\n"
    )
    result = tracked(
        base, images, "--out", tmp_path / "out", "--plot", tmp_path / "page.html",
        "--vehicle", tmp_path / "poses.csv", "--unsure", 0.02, 0.002, "--forget", 30,
    )  # fmt: skip
    assert result.status == 0, result.err
    first = content_of(tmp_path / "page.html")["frames"][0]
    (person,) = first["p"]
    assert np.hypot(person["d"][0] - 900.0, person["d"][1] - 200.0) < person["d"][2] < 300.0
    assert person["w"] == [person["d"][:2]]
    # Their shadow lies behind them, seen from the camera.
    (shadow,) = first["u"]
    middle = np.mean(shadow, axis=0)
    assert middle[0] > 1200.0
    assert middle[1] / (middle[0] - 112.0) == pytest.approx(200.0 / 788.0, abs=0.03)


def test_the_page_works_in_a_browser(base: Path, seen: list[Row], tmp_path: Path) -> None:
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("needs chromium")
    probe = """<script>
    const found = [], slider = document.querySelector(".scrubber");
    const say = (name) => found.push(document.querySelector(".readout dd." + name).textContent);
    const ink = (name) => document.querySelector("canvas." + name).toDataURL();
    setTimeout(function () {
      const before = [ink("seen"), ink("plan")];
      say("time"); say("tracks");
      slider.value = 18; slider.dispatchEvent(new Event("input"));
      say("time"); say("tracks");
      found.push(before[0] !== ink("seen"), before[1] !== ink("plan"));
      const plan = ink("plan");
      document.querySelector("input.unseen").click();
      found.push(plan !== ink("plan"));
      const result = document.createElement("output"); result.id = "probe";
      result.textContent = found.join(";"); document.body.append(result);
    }, 800);
    </script></body>"""
    page = tmp_path / "page.html"
    page.write_text((base / "page.html").read_text().replace("</body>", probe))
    done = subprocess.run(
        [browser, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", page.as_uri()],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert "CONSOLE" not in done.stderr
    followed = [len(at(seen, t_s, "born", "seen", "unseen")) for t_s in (0.0, 3.6)]
    expected = f"0.00 s;{followed[0]};3.60 s;{followed[1]};true;true;true"
    assert f'<output id="probe">{expected}</output>' in done.stdout
