"""The worst that bounds, rounding and clocks allow at once, held against the observation."""

from __future__ import annotations

import dataclasses
import math
import random

from onboard_sensors import (
    BOUNDS,
    OWN,
    PACMOD2,
    STEERING_RATIO,
    Frame,
    Radii,
    Sender,
    SenderClock,
    localisation,
    pacmod2_reports,
    people,
)
from onboard_truth import CarState

from workbench.runtime.arc import Interval
from workbench.runtime.observation import Observation, tracked_people
from workbench.runtime.onboard.dead_reckoning import (
    Driven,
    Pose,
    Quantity,
    Sampled,
    per_wheelbase,
    reckoned,
    way_m,
)
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.observing import Integrals, NotObserved, observe
from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.onboard.stamps import StampBounds
from workbench.runtime.person_tubes import TubeKind
from workbench.runtime.protocols import PersonKind, SentPerson

INTEGRALS = Integrals((0.0, 0.0), (0.0, 0.0), 2.8)
EXACT = dataclasses.replace(
    BOUNDS,
    stamps=StampBounds(delay_us=(0, 20_000), drift_ppm=0, window_us=5_000_000),
    report_delay_us=(0, 0),
    speed_gain=(1.0, 1.0),
    speed_error_mps=0.0051,
    acceleration_mps2=(0.0, 0.0),
    steering_wheel_error_rad=0.0006,
    road_wheel=lambda angle: (angle / STEERING_RATIO, angle / STEERING_RATIO),
    steering_rate_radps=0.0,
    wheelbase_m=(1.75, 1.75),
    unseen_speed_mps=2.5,
)
"""Nothing changes unless it is sent."""
NO_RADII = (0.0, 0.0, 0.0, 0.0)
STANDING = CarState(0.0, 0.0, 0.0, 0.0, 0.0)
NOBODY = SentPerson(7, PersonKind.ON_FOOT, 5.0, 5.0, 0.3, 0.0, 0.0, 0.1, 0.0)


def sender(*, delay_us: int = 0, drift_ppm: float = 0.0) -> Sender:
    clock = SenderClock(-1_000_000, drift_ppm)
    return Sender(random.Random(1), clock, (delay_us, delay_us))


def seen(
    frames: list[Frame],
    *,
    now_us: int,
    settings: SensorBounds = EXACT,
    speed_mps: float = 0.0,
    wheel_rad: float = 0.0,
) -> Observation | NotObserved:
    """The observation of these frames, with reports of constant speed and angle up to now."""
    intake = Intake(PACMOD2, OWN, stamps=settings.stamps)
    reports = pacmod2_reports(speed_mps=speed_mps, wheel_rad=wheel_rad)
    steady = [(at, *report) for at in range(0, now_us + 1, 25_000) for report in reports]
    for arrival, identifier, data in sorted([*frames, *steady], key=lambda frame: frame[0]):
        intake.receive(identifier, data, arrival)
    return observe(intake, now_us=now_us, integrals=INTEGRALS, settings=settings)


def observed(frames: list[Frame], **how: float | int | SensorBounds) -> Observation:
    found = seen(frames, **how)  # type: ignore[arg-type]
    assert isinstance(found, Observation), str(found)
    return found


def whole(
    car: CarState, *, radii: Radii = NO_RADII, errors: Radii = NO_RADII, at_us: int = 100_000
) -> list[Frame]:
    """One localisation with these errors, and nobody around."""
    local = localisation(sender(), car, at_us, radii=radii, errors=errors)
    return [*local, *people(sender(), (), at_us, watched_radius_m=40.0)]


def contains(interval: Interval, value: float) -> bool:
    return interval[0] <= value <= interval[1]


def check_rounding_of_the_pose(sign: float = 1.0) -> None:
    """Value and radius are each rounded by nearly half a count, both the wrong way."""
    for name, axis, half in (("x", 0, 5e-4), ("y", 1, 5e-4), ("heading", 2, 5e-5)):
        radius, estimate = 0.01 + 0.98 * half, sign * 0.98 * half
        place = [0.0, 0.0, 0.0]
        place[axis] = estimate + sign * radius
        errors = [0.0, 0.0, 0.0, 0.0]
        errors[axis] = -sign * radius
        radii = [0.0, 0.0, 0.0, 0.0]
        radii[axis] = radius
        car = CarState(place[0], place[1], place[2], 0.0, 0.0)
        frames = whole(car, radii=(*radii,), errors=(*errors,))  # type: ignore[arg-type]
        found = observed(frames, now_us=101_000)
        assert contains(getattr(found, name), place[axis]), (name, getattr(found, name))


def check_rounding_of_people() -> None:
    """A person on the rim of a disc whose centre and radius were rounded away from them."""
    off, tiny = 0.0049, 0.00249
    sent = dataclasses.replace(
        NOBODY, x_m=5.0 + off, y_m=5.0 + off, position_radius_m=0.3 + tiny, velocity_radius_mps=0.0
    )
    x = sent.x_m + sent.position_radius_m * math.sqrt(0.5)
    y = sent.y_m + sent.position_radius_m * math.sqrt(0.5)
    disc = person_disc(sent)
    assert math.hypot(x - disc[0], y - disc[1]) <= disc[2]
    # And of velocities, which are counted in 2.5 mm/s.
    spun = dataclasses.replace(
        NOBODY, x_speed_mps=1.0 + 0.00124, y_speed_mps=0.00124, velocity_radius_mps=0.1 + 0.00124
    )
    found = observed([*whole(STANDING)[:4], *crowd(spun)], now_us=101_000)
    velocity = found.people[0].guard.velocity
    vx, vy = (v + spun.velocity_radius_mps * math.sqrt(0.5) for v in (1.00124, 0.00124))
    assert math.hypot(vx - velocity.x, vy - velocity.y) <= velocity.radius


def crowd(*sent: SentPerson, at_us: int = 100_000, watched_radius_m: float = 40.0) -> list[Frame]:
    return list(people(sender(), sent, at_us, watched_radius_m=watched_radius_m))


def person_disc(sent: SentPerson) -> tuple[float, float, float]:
    found = observed([*whole(STANDING)[:4], *crowd(sent)], now_us=101_000)
    position = found.people[0].guard.position
    return position.x, position.y, position.radius


def check_people_move_on(*, age_s: float = 0.2, later_us: int = 250_000) -> None:
    """One who runs straight on as fast as can be is in their guard and where they intend to be."""
    sent = dataclasses.replace(
        NOBODY, x_speed_mps=2.5, age_s=age_s, position_radius_m=0.01, velocity_radius_mps=0.0
    )
    found = observed([*whole(STANDING)[:4], *crowd(sent)], now_us=100_000 + later_us)
    (person,) = tracked_people(found)
    x = 5.0 + 2.5 * (age_s + later_us / 1e6)
    for tube in person.tubes:
        for bound in tube.bounds:
            piece = [p for p in bound if p.from_s <= 0.0][-1]
            s = -piece.from_s
            centre = piece.x_m + piece.vx_mps * s, piece.y_m + piece.vy_mps * s
            radius = piece.radius_m + piece.growth_mps * s + 0.5 * piece.growth2_mps2 * s * s
            assert math.hypot(x - centre[0], 5.0 - centre[1]) <= radius, (tube.kind, piece)
    assert [tube.kind for tube in person.tubes] == [TubeKind.INTENT, TubeKind.GUARD]


def check_watched(*, speed_mps: float = 5.0, later_us: int = 400_000) -> None:
    """Somebody just outside of what was watched, ahead, who runs towards the car: they are beyond
    the disc of now. The radius was rounded up by nearly a quarter of a metre."""
    radius, at_us = 30.0 - 0.249, 100_000
    start = CarState(0.0, 0.0, 0.0, speed_mps, 0.0)
    local = localisation(sender(), start, at_us, radii=NO_RADII, errors=NO_RADII)
    frames = [*local, *crowd(at_us=at_us, watched_radius_m=radius)]
    for bearing in (0.0, math.pi):
        found = observed(frames, now_us=at_us + later_us, speed_mps=speed_mps)
        run_m = EXACT.unseen_speed_mps * later_us / 1e6
        x, y = (radius - run_m) * math.cos(bearing), (radius - run_m) * math.sin(bearing)
        watched = found.watched
        assert math.hypot(x - watched.x_m, y - watched.y_m) >= watched.radius_m
        assert watched.radius_m > radius - 2.0 * (run_m + speed_mps * later_us / 1e6) - 1.0


def check_watched_by_an_uncertain_car() -> None:
    """The car is anywhere in its box: whoever was just out of its sight is not within the disc."""
    for sign in (-1.0, 1.0):
        car = CarState(sign, sign, 0.0, 0.0, 0.0)
        frames = whole(car, radii=(1.0, 1.0, 0.0, 0.0), errors=(-sign, -sign, 0.0, 0.0))
        found = observed(frames, now_us=101_000)
        x = car.x_m - sign * 39.75 * math.sqrt(0.5)
        assert math.hypot(x - found.watched.x_m, x - found.watched.y_m) >= found.watched.radius_m


def check_clock_of_a_late_frame(*, drift_ppm: int = 0) -> None:
    """Two sets, the first as quick, the second as late as can be, of a car that drives at 5 m/s."""
    settings = dataclasses.replace(
        EXACT, stamps=StampBounds(delay_us=(0, 20_000), drift_ppm=drift_ppm, window_us=20_000_000)
    )
    for first_us, second_us in ((0, 20_000), (20_000, 0), (20_000, 20_000), (0, 0)):
        for drift in (-drift_ppm, drift_ppm):
            one = Sender(random.Random(1), SenderClock(-1_000_000, drift), (first_us, first_us))
            last_us = 100_000 if not drift_ppm else 5_100_000
            frames = list(localisation(one, at(0), 0, radii=NO_RADII, errors=NO_RADII))
            one.delay_us = (second_us, second_us)
            two = at(last_us)
            frames += localisation(one, two, last_us, radii=NO_RADII, errors=NO_RADII)
            frames += crowd(at_us=last_us)
            now_us = last_us + 300_000
            found = observed(frames, now_us=now_us, settings=settings, speed_mps=5.0)
            assert contains(found.x, at(now_us).x_m), (first_us, second_us, found.x)


def at(at_us: int) -> CarState:
    """A car that drives along the x axis at 5 m/s."""
    return CarState(5.0 * at_us / 1e6, 0.0, 0.0, 5.0, 0.0)


def check_speed_between_reports() -> None:
    """Speed and angle change as fast as they may from the very instant of the last report on."""
    changing = dataclasses.replace(
        EXACT,
        acceleration_mps2=(-3.0, 2.0),
        steering_rate_radps=0.4,
        report_delay_us=(0, 15_000),
    )
    frames = whole(CarState(0.0, 0.0, 0.0, 4.0, 0.0), radii=(0.0, 0.0, 0.0, 9.0))
    for late_us in (0, 15_000):
        found = observed(frames, now_us=124_999, settings=changing, speed_mps=4.0)
        since_s = (24_999 + late_us) / 1e6
        for acceleration, rate in ((-3.0, -0.4), (2.0, 0.4)):
            assert contains(found.speed, 4.0 + acceleration * since_s)
            assert contains(found.steering, rate * since_s)


def check_velocity_at_the_guards_instant() -> None:
    """Somebody who speeds up all the time, of whom the stamp's instant is not quite known."""
    for delay_us in (0, 20_000):
        crowded = Sender(random.Random(1), SenderClock(-1_000_000, 0.0), (delay_us, delay_us))
        sent = dataclasses.replace(NOBODY, x_speed_mps=1.0, velocity_radius_mps=0.0)
        frames = [*whole(STANDING)[:4], *people(crowded, (sent,), 100_000, watched_radius_m=40.0)]
        guard = observed(frames, now_us=125_000).people[0].guard
        velocity = 1.0 + 1.5 * (0.025 + guard.at_s)
        assert abs(velocity - guard.velocity.x) <= guard.velocity.radius


def check_an_arc() -> None:
    """Half a second along a circle, of the shortest and the longest wheelbase: the closed form lies
    in the box, which is narrow where the wheelbase is known."""
    steady = Quantity((Sampled((3.0, 3.0), 0, 0),), (0.0, 0.0), (-9.0, 9.0))
    angle = Quantity((Sampled((0.3, 0.3), 0, 0),), (0.0, 0.0), (-1.0, 1.0))
    start = Pose((1.0, 1.0), (2.0, 2.0), (0.5, 0.5))
    for lengths_m in ((1.75, 1.75), (1.7, 1.8)):
        driven = Driven(steady, angle, per_wheelbase(lengths_m))
        found = reckoned(start, driven, then_us=(0, 0), now_us=500_000)
        assert found is not None
        for length_m in lengths_m:
            rate = 3.0 * math.tan(0.3) / length_m
            end = 0.5 + 0.5 * rate
            assert contains(found.heading, end)
            assert contains(found.x, 1.0 + 3.0 / rate * (math.sin(end) - math.sin(0.5)))
            assert contains(found.y, 2.0 + 3.0 / rate * (math.cos(0.5) - math.cos(end)))
        known = lengths_m[0] == lengths_m[1]
        assert not known or found.heading[1] - found.heading[0] < 1e-9
        assert not known or found.x[1] - found.x[0] < 0.03
    way = way_m(steady, from_us=0, until_us=500_000)
    assert way is not None
    assert contains(way, 1.5)
    assert way[1] - way[0] < 1e-9


def check_clock_that_drifts() -> None:
    check_clock_of_a_late_frame(drift_ppm=500)


CHECKS = (
    check_an_arc,
    check_clock_that_drifts,
    check_velocity_at_the_guards_instant,
    check_rounding_of_the_pose,
    check_rounding_of_people,
    check_people_move_on,
    check_watched,
    check_watched_by_an_uncertain_car,
    check_clock_of_a_late_frame,
    check_speed_between_reports,
)
