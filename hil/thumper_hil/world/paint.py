"""Colour and height of a box, as the camera sees it."""

from dataclasses import dataclass

from thumper.common.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Paint:
    """How a box looks; all its sides are alike."""

    colour: tuple[int, int, int]  # red, green, blue, 0...255
    height_m: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PaintedBox:
    """A coloured box; `sides_m`, shape (4, 4), are segments x0 y0 x1 y1."""

    sides_m: FloatArray
    paint: Paint
