"""All elementary functions of symbolic intervals, without a mathematical library."""

from workbench.sensitivity.elementary_exp import cosh, exp, log, sinh, tanh
from workbench.sensitivity.elementary_inverse import acos, asin, atan
from workbench.sensitivity.elementary_trig import cos, sin, tan

__all__ = ["acos", "asin", "atan", "cos", "cosh", "exp", "log", "sin", "sinh", "tan", "tanh"]
