"""In a real browser every page of the product, wide and on a phone, logs nothing, fits the width,
shows its pictures, moves its players, saves its tables and leads from a picture to what it means.

One start of the browser: an outer page holds every page twice, in frames of both widths, and
collects what a script that is added to each of them reports.
"""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from typing import Any

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")
pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

from page_cases import PAGES, survey
from test_every_page import made
from test_report_browser import FLAGS

WIDTHS = (1100, 390)
PROBE = """<script>
addEventListener("load", async function () {
  const found = {}, all = (query) => Array.from(document.querySelectorAll(query));
  const root = document.documentElement, fits = () => root.scrollWidth <= root.clientWidth;
  found.width = innerWidth;
  found.fits = fits();
  found.pictures = all("svg[role=img], canvas.view").length;
  found.empty = all("svg[role=img], canvas.view").filter(function (each) {
    const box = each.getBoundingClientRect();
    return box.width < 100 || box.height < 50;
  }).length;
  all("details").forEach((each) => { each.open = true; });
  found.fitsOpen = fits();
  found.tables = all(".table").length;
  let saved = null, name = "";
  URL.createObjectURL = function (blob) { saved = blob; return "#"; };
  HTMLAnchorElement.prototype.click = function () { name = this.download; };
  found.csv = [];
  for (const button of all("button.csv")) {
    button.click();
    found.csv.push([name, await saved.text()]);
  }
  found.players = all(".scene").map(function (player) {
    const slider = player.querySelector(".scrubber"), clock = player.querySelector("dd.time");
    const seen = () => [clock.textContent, ...Array.from(player.querySelectorAll("canvas.view"),
      (canvas) => canvas.toDataURL())];
    const before = seen();
    slider.value = slider.max;
    slider.dispatchEvent(new Event("input"));
    return seen().map((each, k) => each !== before[k]);
  });
  const links = all("svg a");
  found.led = links.map((link) => document.querySelector(link.href.baseVal) !== null);
  if (links.length) {
    links[0].dispatchEvent(new MouseEvent("click", { bubbles: true, cancelable: true }));
    await new Promise((done) => setTimeout(done, 100));
    const goal = document.querySelector(location.hash).getBoundingClientRect();
    found.arrived = [location.hash, goal.top > -1 && goal.top < innerHeight];
  }
  parent.postMessage(JSON.stringify(found), "*");
});
</script></body>"""
OUTER = """<!DOCTYPE html><html><body><script>
const found = {};
addEventListener("message", function (event) {
  const frame = Array.from(frames).findIndex((each) => each === event.source);
  found[document.querySelectorAll("iframe")[frame].name] = JSON.parse(event.data);
  const out = document.getElementById("probe");
  out.textContent = JSON.stringify(found);
});
</script><output id="probe"></output>%s</body></html>"""
WRONG = """<div style="width:3000px">wide</div><svg role="img" width="9" height="9"></svg>
<div class="table"><table><caption>gone</caption></table></div><script>nothing.here();</script>"""
Found = dict[str, dict[str, Any]]
NAMES = [make.__name__ for make in PAGES]


def frame(name: str, width: int) -> str:
    return (
        f'<iframe name="{name} {width}" src="{name}.html" width="{width}" height="900" '
        'style="border:0"></iframe>'
    )


@pytest.fixture(scope="module")
def browsed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Found, list[str]]:
    """What the pages report, and the console."""
    browser = next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
    )
    if browser is None:
        pytest.skip("needs the optional tool chromium or chromium-browser or google-chrome")
    folder = tmp_path_factory.mktemp("pages")
    frames = []
    for make in PAGES:
        name = make.__name__
        text = made(make)[0].replace("</body>", PROBE)
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
        frames += [frame(name, width) for width in WIDTHS]
    bad = made(survey)[0].replace("</body>", f"{WRONG}{PROBE}")
    (folder / "wrong.html").write_text(bad, encoding="utf-8")
    frames.append(frame("wrong", WIDTHS[0]))
    (folder / "outer.html").write_text(OUTER % "".join(frames), encoding="utf-8")
    flags = [each for each in FLAGS if "budget" not in each and "window-size" not in each]
    done = subprocess.run(
        [browser, *flags, "--virtual-time-budget=20000", "--window-size=1200,1000",
         f"--user-data-dir={folder / 'profile'}", (folder / "outer.html").as_uri()],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    match = re.search(r'<output id="probe">(.*?)</output>', done.stdout, re.DOTALL)
    assert match, f"nothing was reported: {console or done.stderr[-2000:]}"
    return json.loads(html.unescape(match.group(1)) or "{}"), console


def test_nothing_is_logged(browsed: tuple[Found, list[str]]) -> None:
    assert [line for line in browsed[1] if "wrong.html" not in line] == []


def test_what_is_wrong_is_noticed(browsed: tuple[Found, list[str]]) -> None:
    wrong = browsed[0][f"wrong {WIDTHS[0]}"]
    assert (wrong["fits"], wrong["empty"]) == (False, 1)
    assert len(wrong["csv"]) < wrong["tables"]
    assert any("nothing is not defined" in line for line in browsed[1])


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", NAMES)
def test_it_fits_shows_moves_and_saves(
    browsed: tuple[Found, list[str]], name: str, width: int
) -> None:
    found = browsed[0][f"{name} {width}"]
    assert (found["width"], found["fits"], found["fitsOpen"]) == (width, True, True)
    assert found["pictures"] > 0
    assert found["empty"] == 0
    assert len(found["csv"]) == found["tables"] > 0
    for file, text in found["csv"]:
        assert file.endswith(".csv")
        lines = text.split("\r\n")
        assert len(lines) > 1
        assert lines[-1] == ""
    assert all(all(moved) for moved in found["players"])
    assert all(found["led"])


@pytest.mark.parametrize("width", WIDTHS)
def test_players_points_and_numbers_are_there(browsed: tuple[Found, list[str]], width: int) -> None:
    found = browsed[0]
    for name in ("demo", "replay", "simulation", "track"):
        assert found[f"{name} {width}"]["players"] == [[True] * (3 if name == "track" else 2)]
    front = found[f"front {width}"]
    assert len(front["led"]) > 1
    address, in_view = front["arrived"]
    assert address.startswith("#point-")
    assert in_view
    # More digits than are shown, nothing where nothing is, commas and quotes kept apart.
    saved = dict(found[f"survey {width}"]["csv"])["numbers.csv"]
    assert saved == 'what,value (s)\r\na,0.123456789\r\n"b, ""c""",\r\n'
