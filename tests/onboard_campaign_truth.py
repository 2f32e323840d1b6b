"""When a fault was there and could be noticed: from the bus and the world, not from the core."""

from __future__ import annotations

from onboard_campaign_world import Phased, Truth
from onboard_core_cases import DRIVE_BY_WIRE, SENSORS, bundle
from onboard_world import Injector
from onboard_world_injectors import LOCALISATION, PEOPLE
from onboard_world_plant import PACMOD2, REPORT_US

from workbench.runtime.onboard.core import TurnResult
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.states import State
from workbench.runtime.protocols import Decoded, decode

BUDGET_US = {"LOC_RADII": SENSORS.localisation_age_us, "PERSON_TRACK": SENSORS.people_age_us}
FOLLOW_US, WHEEL_RAD, PEDAL = 500_000, 0.6, 0.15
FROZEN_US, FROZEN_MPS = 600_000, 0.6
BRAKED_MPS2, BRAKED_AFTER_US, STANDS_MPS = 2.0, 150_000 + 200_000 + 33_333, 0.05


def own(world: Phased, made: Injector, found: TurnResult) -> int | None:
    """As the injector says."""
    return made.condition_us


def when_raised(world: Phased, made: Injector, found: TurnResult) -> int | None:
    """What is raised inside has no instant but the one that the core gives it."""
    return None


def shown_by(*identifiers: int) -> Truth:
    """With the last frame of these before the turn: what shows it may come later than it began."""

    def truth(world: Phased, made: Injector, found: TurnResult) -> int | None:
        return next(
            (
                each.at_us
                for each in reversed(world.trace)
                if made.start_us <= each.at_us <= found.at_us
                and each.frame.identifier in identifiers
            ),
            None,
        )

    return truth


def aged(last: str) -> Truth:
    """When the last whole set's stamp is older than its budget, by the sender's own clock."""

    ids = LOCALISATION if last == "LOC_RADII" else PEOPLE

    def truth(world: Phased, made: Injector, found: TurnResult) -> int | None:
        sender = world.localiser if ids is LOCALISATION else world.tracker
        sets: list[list[int]] = []
        for each in world.trace:
            if each.frame.identifier == ids[0]:
                sets.append([])
            if each.frame.identifier in ids and each.frame.by is None and sets:
                sets[-1].append(each.at_us)
        whole = 4 if ids is LOCALISATION else 1 + 3 * len(world.tracker.walkers)
        begun = [of[0] for of in sets if len(of) == whole and of[-1] <= found.at_us]
        return begun[-1] - sender.delay_us + BUDGET_US[last]

    return truth


def by_age(last: str, identifiers: tuple[int, ...]) -> Truth:
    """`aged` where the age is what was found, else `shown_by`."""

    def truth(world: Phased, made: Injector, found: TurnResult) -> int | None:
        lost = {Fault.LOCALISATION_LOST, Fault.PEOPLE_LOST}
        by = aged(last) if lost & {each.fault for each in found.faults} else shown_by(*identifiers)
        return by(world, made, found)

    return truth


def silent_since(world: Phased, made: Injector, found: TurnResult) -> int | None:
    """100 ms after the last frame that was heard."""
    heard = [e.at_us for e in world.trace if e.frame.sender != "monitor"]
    return max(at_us for at_us in heard if at_us <= made.start_us) + 100_000


def reports(world: Phased, name: str) -> list[tuple[int, dict[str, float]]]:
    """(instant, values) of every report of a kind that was on the bus."""
    number = PACMOD2.by_name[name].frame_id
    found = []
    for each in world.trace:
        if each.frame.identifier == number:
            said = decode(PACMOD2, number, each.frame.data)
            assert isinstance(said, Decoded)
            found.append((each.at_us, dict(said.values)))
    return found


def not_following(world: Phased, made: Injector, found: TurnResult) -> int | None:
    """When output and command had been apart for longer than allowed, by the reports."""
    first = []
    for name, most in (("STEERING_RPT_1", WHEEL_RAD), ("BRAKE_RPT", PEDAL), ("ACCEL_RPT", PEDAL)):
        since_us = None
        for at_us, values in reports(world, name):
            if at_us > found.at_us:
                break
            apart = abs(values["OUTPUT_VALUE"] - values["COMMANDED_VALUE"]) > most
            since_us = (at_us if since_us is None else since_us) if apart else None
        if since_us is not None:
            first.append(since_us + FOLLOW_US)
    return min(first, default=None)


def pushed(world: Phased, made: Injector, found: TurnResult) -> int | None:
    """When the speed report had stayed the same for longer than allowed, and what was commanded
    since, by the middles of the maps, added up to more than it may."""
    speeds = [each for each in reports(world, "VEHICLE_SPEED_RPT") if each[0] <= found.at_us]
    since_us = speeds[-1][0]
    for at_us, values in reversed(speeds):
        if values != speeds[-1][1]:
            break
        since_us = at_us
    pedals, total, before = DRIVE_BY_WIRE.pedals, 0.0, None
    for at_us, number, data in world.of_monitor("ACCEL_CMD"):
        said = decode(PACMOD2, number, data)
        assert isinstance(said, Decoded)
        ratio = said.values["ACCEL_CMD"]
        now = (at_us, pedals.accelerator.middle(ratio) if ratio > 0.0 else 0.0)
        if before is not None and at_us > since_us:
            total += before[1] * (at_us - max(before[0], since_us)) / 1e6
            if total > FROZEN_MPS:
                over_us = (total - FROZEN_MPS) / max(before[1], 1e-9) * 1e6
                return max(round(at_us - over_us), since_us + FROZEN_US)
        before = now
    return None


def brakes_too_little(world: Phased, made: Injector, found: TurnResult) -> int | None:
    """When a speed report was above what the brake's bounds allow after BRAKE began."""
    turns = world.notes.turns
    begins = next(
        t for t in turns if t.at_us >= made.start_us and t.state in (State.BRAKING, State.FAULT)
    )
    if begins.observation is None or begins.decided_us is None:
        return None
    most_mps = begins.observation.speed[1]
    for at_us, values in reports(world, "VEHICLE_SPEED_RPT"):
        braked_us = at_us - begins.decided_us - BRAKED_AFTER_US
        if braked_us > 0:
            allowed = max(most_mps - BRAKED_MPS2 * braked_us / 1e6, STANDS_MPS)
            if values["VEHICLE_SPEED"] - DRIVE_BY_WIRE.speed_error_mps > allowed:
                return at_us
    return None


assert bundle(0).manifest.brake.deceleration_min_mps2 == BRAKED_MPS2


def lost_upstream(name: str) -> Truth:
    """100 ms after its last command was read, which happens once per turn."""

    def truth(world: Phased, made: Injector, found: TurnResult) -> int | None:
        return world.read_us[name] + 100_000

    return truth


def disabled_upstream(world: Phased, made: Injector, found: TurnResult) -> int | None:
    """With its first frame of ENABLE 0."""
    last_us = world.upstream_us["GLOBAL_CMD"]
    return last_us - (last_us - made.start_us) // REPORT_US * REPORT_US
