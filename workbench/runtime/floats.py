"""Whether the processor computes as the bounds assume: rounded to nearest, subnormals kept."""

from __future__ import annotations

# Names, not literals, in the probes below: the compiler of Python would fold literals at import
# time.
_ONE = 1.0
_SUBNORMAL = 5e-324
_SMALLEST_NORMAL = 2.0**-1022
_HALF_STEP = 2.0**-53
_STEP = 2.0**-52


def float_mode_fault() -> str | None:
    """What is wrong with this thread's floating-point mode, or None.

    Behaviour is probed, not a register read, so the test is the same on every processor:
    5e-324 * 1 > 0 and 2^-1022 / 2 > 0 (neither FTZ nor DAZ); 1 + 2^-53 = 1, -1 - 2^-53 = -1 and
    (1 + 2^-52) + 2^-53 = 1 + 2^-51 (to nearest, ties to even).
    """
    if not (_SUBNORMAL * _ONE > 0.0 and _SMALLEST_NORMAL / (_ONE + _ONE) > 0.0):
        return "subnormal numbers are flushed to zero (FTZ or DAZ is set)"
    up = _ONE + _HALF_STEP == _ONE
    down = -_ONE - _HALF_STEP == -_ONE
    even = (_ONE + _STEP) + _HALF_STEP == _ONE + 2.0 * _STEP
    if not (up and down and even):
        return "rounding is not to nearest"
    return None
