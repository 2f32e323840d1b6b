"""The small pictures of a legend: a line, a mark or a patch, told apart without colour too."""

from __future__ import annotations

from typing import Final

from workbench.errors import InputError

_SHAPES: Final = {
    "o": '<circle cx="13" cy="7" r="4" fill="{c}"/>',
    ".": '<circle cx="13" cy="7" r="2" fill="{c}"/>',
    "s": '<rect x="9" y="3" width="8" height="8" fill="{c}"/>',
    "^": '<path d="M13 2L18 11H8Z" fill="{c}"/>',
    "v": '<path d="M13 12L18 3H8Z" fill="{c}"/>',
    "D": '<path d="M13 2L18 7L13 12L8 7Z" fill="{c}"/>',
    "X": '<path d="M9 3L17 11M17 3L9 11" stroke="{c}" stroke-width="4"/>',
    "x": '<path d="M9 3L17 11M17 3L9 11" stroke="{c}" stroke-width="1.5"/>',
    "+": '<path d="M13 2V12M8 7H18" stroke="{c}" stroke-width="1.5"/>',
    "|": '<path d="M13 2V12" stroke="{c}" stroke-width="2"/>',
    "*": '<path d="M13 1L15 5L19 5L16 8L17 12L13 10L9 12L10 8L7 5L11 5Z" fill="{c}"/>',
}
"""Matplotlib's marks, in a box of 26 by 14."""
_STROKES: Final = {
    "/": "M{x} 12l6 -10",
    "\\": "M{x} 2l6 10",
    "x": "M{x} 12l6 -10m0 10l-6 -10",
    ".": "M{x} 5h2m1 4h2",
}
"""Matplotlib's hatches, drawn from x on."""


def line(colour: str, dashes: str) -> str:
    """A stroke; dashes: as SVG writes them."""
    return (
        f'<line x1="1" y1="7" x2="25" y2="7" stroke="{colour}" stroke-width="2.5" '
        f'stroke-dasharray="{dashes}"/>'
    )


def mark(colour: str, shape: str) -> str:
    """One of matplotlib's marks. Raises InputError on one that has no picture here."""
    if shape not in _SHAPES:
        raise InputError(f"expected one of the marks {' '.join(_SHAPES)}, got {shape!r}")
    return _SHAPES[shape].format(c=colour)


def patch(colour: str, hatch: str) -> str:
    """A filled box with a pattern. Raises InputError on a hatch that has no picture here."""
    if hatch[:1] not in ("", *_STROKES):
        raise InputError(f"expected a hatch of one of {' '.join(_STROKES)}, got {hatch!r}")
    box = f'<rect x="1" y="2" width="24" height="10" fill="{colour}" fill-opacity=".7"/>'
    if not hatch:
        return box
    strokes = "".join(_STROKES[hatch[0]].format(x=x) for x in (2, 9, 16))
    return f'{box}<path d="{strokes}" stroke="currentColor" stroke-width="1" fill="none"/>'
