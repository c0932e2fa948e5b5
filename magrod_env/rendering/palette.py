"""Colours of a frame, RGB in 0..255, kept apart for the common kinds of colour blindness (Okabe, Ito)."""

from typing import Final

Colour = tuple[int, int, int]

BACKGROUND: Final[Colour] = (240, 243, 246)
PANE: Final[Colour] = (253, 254, 255)
PANE_EDGE: Final[Colour] = (214, 220, 227)
GRID: Final[Colour] = (236, 240, 244)
GRID_ORIGIN: Final[Colour] = (220, 227, 234)
TEXT: Final[Colour] = (38, 50, 62)
TEXT_MUTED: Final[Colour] = (118, 131, 145)

ROD: Final[Colour] = (150, 182, 196)
CLAMP: Final[Colour] = (92, 104, 118)
NORTH: Final[Colour] = (213, 84, 24)
SOUTH: Final[Colour] = (0, 106, 176)

FIELD: Final[Colour] = (92, 74, 160)
TARGET: Final[Colour] = (0, 146, 110)
PATH: Final[Colour] = (164, 200, 188)
TRACE: Final[Colour] = (226, 150, 0)
ALARM: Final[Colour] = (196, 52, 40)


def blend(first: Colour, second: Colour, weight: float) -> Colour:
    """The colour `weight` (0..1) of the way from `first` to `second`."""
    red, green, blue = (round(a + weight * (b - a)) for a, b in zip(first, second, strict=True))
    return red, green, blue
