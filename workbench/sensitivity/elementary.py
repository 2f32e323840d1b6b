"""All elementary functions of symbolic intervals, without a mathematical library."""

from workbench.sensitivity.elementary_exp import cosh, exp, log, sinh, tanh
from workbench.sensitivity.elementary_inverse import acos, asin, atan, atan2
from workbench.sensitivity.elementary_power import power
from workbench.sensitivity.elementary_trig import cos, sin, tan

__all__ = [
    "acos",
    "asin",
    "atan",
    "atan2",
    "cos",
    "cosh",
    "exp",
    "log",
    "power",
    "sin",
    "sinh",
    "tan",
    "tanh",
]
