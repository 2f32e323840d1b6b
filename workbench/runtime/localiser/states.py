"""What the vehicle's estimate is about, and how much of it is kept."""

from __future__ import annotations

from typing import Final

STATES: Final = ("x", "y", "heading", "speed", "steering", "speed_scale", "steering_zero")
"""Middle of the rear axle (m), heading (rad), speed (m/s), road wheels' angle (rad), reported over
true speed less 1, and what is reported (rad) when the wheels point straight ahead."""
VEHICLE_STATES: Final = 5
"""The first of them are the vehicle's; the other two its reports'."""
HYPOTHESES: Final = 32
"""Headings that are followed side by side until one is left."""
WINDOW: Final = 36
"""Ranges from a standing car that are awaited before it is placed."""
