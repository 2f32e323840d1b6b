"""Synthetic tubes, bounds and scenes for the tests of the report pages."""

from __future__ import annotations

import math

import numpy as np

from workbench.claims import Assumption, Rigor, Verdict
from workbench.report.curves import Growth, Origin, SampledRuns, TubeCurves
from workbench.report.demo import DemoReport
from workbench.report.page import Claim
from workbench.report.replay import ReplayReport
from workbench.report.tables import Table
from workbench.simulation.frames import Frame, LevelVerdicts, PersonFrame, PolicyAnswer

NAMES = ("x", "y", "steering", "speed", "heading", "speed_integral", "offset_integral")
UNITS = ("m", "m", "rad", "m/s", "rad", "m", "m s")
RADII = np.array([0.2, 0.2, 0.02, 0.2, 0.05, 0.0, 0.0])
RATES = np.array([0.15, -0.6, 0.4, -0.8, -0.3, 0.0, 0.0])
HOSTILE = "</script><script>alert('x')</script> & \"quoted\" $\\frac{1}{ <b>bold</b>"


def half_widths(times: np.ndarray, factor: float) -> np.ndarray:
    grown = RADII * np.exp(np.outer(times, RATES)) + 0.02 * times[:, None]
    return grown * (1.0 + factor * times[:, None])


def centre(times: np.ndarray) -> np.ndarray:
    y = 0.3 * np.exp(-0.7 * times) * np.cos(1.2 * times)
    rows = [
        2.6 * times,
        y,
        -0.2 * y,
        2.8 - 0.3 * np.exp(-times),
        -0.4 * y,
        0.2 * times,
        0.1 * times,
    ]
    return np.stack(rows, axis=1)


def tube() -> TubeCurves:
    times = np.linspace(0.0, 3.0, 61)
    low, high = (centre(times) + sign * half_widths(times, 0.08) for sign in (-1.0, 1.0))
    return TubeCurves(
        NAMES,
        UNITS,
        times,
        np.minimum(low[:-1], low[1:]),
        np.maximum(high[:-1], high[1:]),
        low,
        high,
        Rigor.NUMERICAL,
    )


def samples() -> SampledRuns:
    times = np.linspace(0.0, 3.0, 61)
    spread = np.random.default_rng(3).uniform(-1.0, 1.0, (40, 1, len(NAMES)))
    return SampledRuns(times, centre(times) + spread * half_widths(times, 0.0))


def growths() -> tuple[Growth, ...]:
    times = np.linspace(0.0, 3.0, 61)
    learned = half_widths(times, 0.0) * (1.15 - 0.1 * times[:, None])
    return (
        Growth("sampled maximum", Origin.SAMPLES, Rigor.SAMPLED, times, half_widths(times, 0.0)),
        Growth(
            "learned exponential",
            Origin.LEARNED,
            Rigor.SAMPLED,
            times,
            learned,
            finding="refuted",
            detail="10 traces; witness 17",
        ),
        Growth(
            "sensitivity and remainder",
            Origin.PROVED,
            Rigor.ENCLOSED,
            times,
            half_widths(times, 0.08),
            finding="implied by proof",
        ),
        Growth(
            "weighted norm",
            Origin.PROVED,
            Rigor.NUMERICAL,
            times,
            half_widths(times, 0.3) + 0.8 * (np.exp(1.6 * times)[:, None] - 1.0),
            detail="weights 1, 1, 4, 1, 3",
        ),
    )


def person(name: str, t_s: float, start: tuple[float, float], steps: int) -> PersonFrame:
    x, y = start[0], start[1] + 0.9 * t_s
    discs = tuple((x, y + 0.9 * k * 0.05, 0.3 + 0.4 * k * 0.05) for k in range(steps + 1))
    guarded = tuple((x, y + 0.45 * k, 0.4 + 0.5 * k) for k in range(5))
    return PersonFrame(name, x, y, 0.3, discs, guarded)


def frame(t_s: float, names: tuple[str, ...], *, steps: int = 60) -> Frame:
    x = 2.6 * t_s
    gap = abs(14.0 - x) + abs(-4.0 + 0.9 * t_s) - 4.0
    verdict = Verdict.SAFE if gap > 5.0 else Verdict.UNPROVED if gap > 1.0 else Verdict.INVALID
    occupancy = tuple(
        (x + 0.9 + 0.13 * k, 0.004 * k, 0.002 * k, 1.5 + 0.004 * k, 0.7 + 0.006 * k)
        for k in range(steps)
    )
    return Frame(
        t_s=t_s,
        x_m=x,
        y_m=0.1 * math.sin(x),
        heading=0.1 * math.cos(x),
        front_m=2.3,
        rear_m=0.5,
        half_width_m=0.65,
        speed_mps=2.6,
        verdict=verdict,
        action="TRACK" if verdict is Verdict.SAFE else "BRAKE",
        reason=f"clearance to {names[0]} {verdict.value.lower()}",
        clearance_m=round(gap, 3) if verdict is not Verdict.INVALID else None,
        occupancy=occupancy if verdict is not Verdict.INVALID else (),
        people=tuple(
            person(name, t_s, (14.0 + 1.7 * k, -4.0 - 2.0 * (k % 3)), steps)
            for k, name in enumerate(names)
        ),
        path=tuple((0.5 * k, 0.1 * math.sin(0.5 * k)) for k in range(60)),
        stop_occupancy=occupancy[: steps // 2],
        sent="TRACK" if gap > 4.0 else "BRAKE",
        policies=_policies(verdict, gap, names[0]),
        levels=(
            LevelVerdicts("track", (verdict, Verdict.SAFE, Verdict.SAFE)),
            LevelVerdicts("stop", (Verdict.UNPROVED, verdict, Verdict.SAFE)),
        ),
        violations=(f"PEOPLE: {names[0]} left the guard",) if 0.0 < gap < 2.0 else (),
        alert=f"{names[0]}: braking is not proved to keep clear" if gap < 1.5 else None,
    )


def _policies(verdict: Verdict, gap: float, name: str) -> tuple[PolicyAnswer, ...]:
    safe = Verdict.SAFE if gap > 6.0 else Verdict.UNPROVED
    return (
        PolicyAnswer("LookAhead", verdict, "TRACK", f"as expected of {name}"),
        PolicyAnswer("FailSafe", safe, "BRAKE", f"no new plan: near {name}"),
    )


def frames(count: int = 40, names: tuple[str, ...] = ("Ada", "Ben")) -> tuple[Frame, ...]:
    return tuple(frame(0.1 * k, names) for k in range(count))


ASSUMPTIONS = (
    Assumption("model", "The car moves as the kinematic bicycle with W.", "not yet measured"),
    Assumption("people", "Nobody leaves the growing disc.", "constant velocity"),
)


def demo_report() -> DemoReport:
    return DemoReport(
        lead=("The tube is proved for three seconds.", "The learned bound is refuted."),
        claims=(
            Claim("Tube contains every trajectory", Rigor.NUMERICAL),
            Claim("Learned bound", Rigor.SAMPLED),
            Claim("Inclusion functions contain the field's range", Rigor.ENCLOSED),
        ),
        tube=tube(),
        samples=samples(),
        growths=growths(),
        frames=frames(),
        deciding="both",
        numbers=(Table("times", ("what", "median (ms)"), (("decision", 0.42), ("load", 80.0))),),
        assumptions=ASSUMPTIONS,
    )


def replay_report(name: str = "kitti_0000", count: int = 40) -> ReplayReport:
    return ReplayReport(
        recording=name,
        summary="40 queries, 31 % braked, smallest separation 0.42 m, median 0.4 ms, p99 0.9 ms",
        frames=frames(count, tuple(f"person {k}" for k in range(20))),
        settings=Table("settings", ("setting", "value"), (("reference speed", "recorded"),)),
        numbers=(),
        notes=("3 samples above 8 m/s were left out.",),
        assumptions=ASSUMPTIONS,
    )
