"""Whether the vehicle may be armed when the operator asks; each refusal is one sentence."""

from __future__ import annotations

from typing import Final

from workbench.runtime.onboard.faults import Found, Reaction
from workbench.runtime.onboard.found_in_car import reasons_not_to_arm
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.states import Mode, Request, Standing, State

MILD: Final = frozenset({Reaction.ALERT, Reaction.PLAN})
"""Reactions that do not speak against arming."""


def state_refusal(asked: Request, standing: Standing, mode: Mode) -> str:
    """Why ARM or REARM has no place here, or ''."""
    if mode is Mode.SHADOW:
        return "in mode shadow nothing is sent; start again in gate or drive"
    wanted = State.DISARMED if asked is Request.ARM else State.YIELDED
    if standing.state is not wanted:
        return f"{asked.value} needs the state {wanted.name}, it is {standing.state.name}"
    return "a fault is latched; disarm, then arm" if standing.latched else ""


def fault_refusal(
    found: tuple[Found, ...], intake: Intake, settings: OnboardSettings, now_us: int
) -> str:
    """The first fault that speaks against it, or ''.

    That covers what start-up asks for: all needed reports and none of another protocol, the maker,
    forward gear, speed unit and wheelbase against motion, the floating-point mode, the signature,
    fresh localisation and people, a car that stands with nobody on its pedals and nobody else
    commanding it; in GATE an upstream controller that is there.
    """
    reasons = reasons_not_to_arm(intake, settings.limits, now_us, maker=settings.maker)
    for each in (*found, *reasons):
        if each.fault.reaction not in MILD:
            return str(each)
    return ""
