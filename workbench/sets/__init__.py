"""Sets with named axes and outward-rounded end points (standard library only)."""

from workbench.sets.box import Box

__all__ = ["Box"]
