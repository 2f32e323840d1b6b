"""A scenario file with every key there is, for the tests of reading."""

from __future__ import annotations

from pathlib import Path

from workbench.simulation.scenarios.scenario import Scenario
from workbench.simulation.scenarios.scenario_file import load_scenario

HEAD = """
title = "A title"
story = \"\"\"
A story of
two lines.\"\"\"
waypoints = [[0, 0], [10, 0], [20, 0], [30, 0]]
duration_s = 20
passed_m = 25.0
"""
EXPECTED = """
[expected]
LookAhead = "passes"
FailSafe = "brakes"
both = "any"
"""
_SENSING = """
[sensing]
position_m = 0.07
heading_rad = 0.01
speed_mps = 0.06
dropped = 0.1
person_m = 0.5
person_mps = 0.3
delay_s = [0.02, 0.05]
watched_m = 25.0
assumes_unseen = false

[[sensing.dropouts]]
what = "localisation"
from_s = 3.0
until_s = 4.5

[[sensing.ghosts]]
x_m = 12.0
y_m = 1.0
from_s = 2.0
until_s = 3.0

[[sensing.occluders]]
x_min_m = 10.0
y_min_m = 2.0
x_max_m = 14.0
y_max_m = 4.0
"""
_GOALS = """
[[goals]]
name = "door"
x_m = 12.0
y_m = 8.0
spread_m = 1.5
"""
_PEOPLE = """
[[people]]
walker = "scripted"
name = "one"
kind = "cyclist"
body_radius_m = 0.8
frame = "plane"
begin = [1.0, 5.0]
start_mps = 1.0
acceleration_mps2 = 0.9
there_s = [0.0, 12.0]
legs = [
    { to = [3.0, 5.0], speed_mps = 1.5 },
    { to = [3.0, -5.0], speed_mps = 1.4, at_s = 2.0 },
    { to = [4.0, 5.0], speed_mps = 1.3, car_within_m = 6.0, delay_s = 0.5 },
    { to = [5.0, 5.0], speed_mps = 1.2, car_station_m = 9.0 },
    { to = [6.0, 5.0], speed_mps = 1.1, delay_s = 2.0 },
]

[[people]]
walker = "standing"
name = "two"
frame = "path"
begin = [12.0, -3.0]
there_s = [1.0, 2.0]

[[people]]
walker = "group"
name = "three"
begin = [5.0, 5.0]
offsets = [[0.0, 0.0], [1.0, 0.5]]

[[people]]
walker = "field"
frame = "path"
obstacles = [[6.0, 6.0, 1.0]]
heeds_car = false
noise_mps2 = 0.3
limits = [2.0, 1.0]
relaxation_s = 0.5
softening_m = 1.0
obstacle = [2.0, 0.4]
vehicle = [1.0, 0.8]

[[people.members]]
name = "four"
begin = [2.0, 3.0]
velocity = [1.0, 0.0]
goals = [[9.0, 3.0]]
speed_mps = 1.2

[[people]]
walker = "adversary"
name = "five"
begin = [20.0, 6.0]
velocity = [0.0, -1.0]
limits = [2.2, 1.1]
car_within_m = 9.0
ahead_m = 2.0
standoff_m = 0.5
gives_up_s = 8.0

[[people]]
walker = "random"
name = "six"
begin = [15.0, 7.0]
velocity = [0.5, 0.0]
limits = [2.0, 1.5]
hold_s = [0.5, 1.5]

[[people]]
walker = "recorded"
folder = "records"
recording = "square"
agents = ["7"]
from_s = 10.0
about = [1.0, 0.0]
to = [2.0, 0.0]
turn_rad = 0.0
body_radius_m = 0.4
"""
_PEDS = """recording,agent,kind,t,x,y
square,7,ped,10.0,1.0,2.0
square,7,ped,11.0,2.0,2.0
square,8,ped,10.0,5.0,5.0
square,8,ped,11.0,5.0,6.0
other,9,ped,0.0,0.0,0.0
other,9,ped,1.0,0.0,0.0
"""
ALL = HEAD + EXPECTED + _SENSING + _GOALS + _PEOPLE


def load(folder: Path, text: str, name: str = "scene") -> Scenario:
    """The scenario of a text, beside a folder of recordings."""
    (folder / "records").mkdir(exist_ok=True)
    (folder / "records" / "peds.csv").write_text(_PEDS)
    file = folder / f"{name}.toml"
    file.write_text(text)
    return load_scenario(file)
