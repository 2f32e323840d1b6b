"""A small CommonRoad scenario, in the two versions of the format, for the tests of importing."""

from __future__ import annotations

import gzip
from pathlib import Path


def bound(tag: str, points: list[tuple[float, float]]) -> str:
    """<leftBound> or <rightBound>."""
    rows = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in points)
    return f"<{tag}>{rows}</{tag}>"


def lanelet(
    name: int, centre: list[tuple[float, float]], follows: tuple[int, ...] = (), *, up: bool = False
) -> str:
    """A lane 4 m wide, along x, or along y."""
    left = [(x - 2.0, y) if up else (x, y + 2.0) for x, y in centre]
    right = [(x + 2.0, y) if up else (x, y - 2.0) for x, y in centre]
    refs = "".join(f'<successor ref="{each}"/>' for each in follows)
    bounds = bound("leftBound", left) + bound("rightBound", right)
    return f'<lanelet id="{name}">{bounds}{refs}</lanelet>'


def state(tag: str, step: int, x: float, y: float, rest: str = "") -> str:
    """<initialState> or <state>, exact."""
    return (
        f"<{tag}><position><point><x>{x}</x><y>{y}</y></point></position>"
        f"<time><exact>{step}</exact></time>{rest}</{tag}>"
    )


def obstacle(
    name: int, kind: str, shape: str, places: list[tuple[float, float]], *, version: str = "2020a"
) -> str:
    """A dynamic obstacle with one state per step, from 5 on."""
    first = state("initialState", 5, *places[0])
    rest = "".join(state("state", 5 + k, *xy) for k, xy in enumerate(places[1:], start=1))
    tag = "dynamicObstacle" if version == "2020a" else "obstacle"
    role = "" if version == "2020a" else "<role>dynamic</role>"
    return (
        f'<{tag} id="{name}">{role}<type>{kind}</type><shape>{shape}</shape>{first}'
        f"<trajectory>{rest}</trajectory></{tag}>"
    )


CIRCLE = "<circle><radius>0.35</radius></circle>"
BOX = "<rectangle><length>1.8</length><width>0.6</width></rectangle>"
CAR = "<rectangle><length>4</length><width>3</width></rectangle>"
WALK = [(10.0 + 0.1 * k, 3.0) for k in range(30)]
PROBLEM = (
    '<planningProblem id="100">'
    + state("initialState", 5, 4.0, 0.5, "<orientation><exact>0.1</exact></orientation>")
    + "<goalState/></planningProblem>"
)
LANES = (
    lanelet(1, [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0)], (2, 3))
    + lanelet(2, [(20.0, 0.0), (22.0, 12.0), (22.0, 30.0)], up=True)
    + lanelet(3, [(20.0, 0.0), (40.0, 1.0), (60.0, 1.0)])
    + lanelet(4, [(60.0, 0.8), (30.0, 0.8), (0.0, 0.8)])
)


def scene(version: str = "2020a", **parts: str) -> str:
    """The whole file; parts: problem, lanes, obstacles and top, instead of the usual ones."""
    obstacles = parts.get("obstacles") or "".join(
        obstacle(name, kind, shape, WALK, version=version)
        for name, kind, shape in ((7, "pedestrian", CIRCLE), (8, "bicycle", BOX), (9, "car", CAR))
    )
    top = parts.get("top", "<?xml version='1.0' encoding='UTF-8'?>")
    attributes = f'timeStepSize="0.2" commonRoadVersion="{version}" benchmarkID="T-1" author="A"'
    return (
        f"{top}<commonRoad {attributes}>{parts.get('lanes', LANES)}{obstacles}"
        f"{parts.get('problem', PROBLEM)}</commonRoad>"
    )


def written(folder: Path, text: str, *, packed: bool = False) -> Path:
    """The file."""
    file = folder / ("T-1.xml.gz" if packed else "T-1.xml")
    file.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    return file
