"""A folder of recordings as users have them: CSV files, made by formula."""

from __future__ import annotations

from pathlib import Path

from replay_fixture import on_circle

_AHEAD_M = 0.3
_VEHICLES = "recording,agent,kind,t,x,y,heading,v,v_lat,a,yaw_rate"
_PEDS = "recording,agent,kind,t,x,y"
_SHAPES = "recording,agent,front,rear,half_width,wheelbase"


def write_recordings(folder: Path) -> Path:
    """Two drives of 3 s on a circle in the shipped vehicle's shape, one past somebody standing."""
    folder.mkdir()
    vehicles, peds, shapes = [_VEHICLES], [_PEDS], [_SHAPES]
    for name in ("peopled", "empty"):
        for k in range(31):
            s = on_circle(0.1 * k, radius_m=40.0, speed_mps=2.5, ahead_m=_AHEAD_M)
            vehicles.append(
                f"{name},ego,car,{s.t_s:.1f},{s.x_m:.6f},{s.y_m:.6f},{s.heading_rad:.6f},"
                f"{s.speed_mps:.3f},0,0,{s.yaw_rate_radps:.6f}"
            )
        shapes.append(f"{name},ego,{2.26 - _AHEAD_M},{0.47 + _AHEAD_M},0.8825,1.75")
    peds += [f"peopled,p1,ped,{0.1 * k:.1f},6.0,-3.0" for k in range(31)]
    for stem, lines in (("vehicles", vehicles), ("peds", peds), ("shapes", shapes)):
        (folder / f"{stem}.csv").write_text("\n".join(lines) + "\n")
    return folder
