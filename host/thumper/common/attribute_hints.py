"""Errors for attributes that do not exist: they name the one that was meant."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

from thumper.common.texts import close_names

OTHER_NAMES = {  # what people try first, apart from names without their unit
    "yaw": "theta_rad",
    "yaw_rad": "theta_rad",
    "heading_rad": "theta_rad",
    "yaw_deg": "heading_deg",
    "position": "pose",
    "voltage": "battery_V",
    "speed": "wheel_speeds",
    "lidar": "scan",
    "move": "forward",
    "backward": "forward(-0.3)",
    "rotate": "turn",
    "success": "reached",
    "distance": "path_length_m",
}


class HintedAttributes:
    """Base of the classes that scripts read: the error for a wrong attribute names the right one."""

    __slots__ = ()
    _parts: ClassVar[Mapping[str, type]] = {}  # attributes whose own attributes may be meant

    if not TYPE_CHECKING:  # a type checker would take every name for right

        def __getattr__(self, name: str) -> None:
            """Raise AttributeError."""
            kind = type(self)
            hint = "" if name.startswith("_") else f"; {_hint(kind, self._parts, name)}"
            # Python adds its own guess, often a private name, for the object that it knows.
            raise AttributeError(f"{kind.__name__} has no {name!r}{hint}", name=name, obj=None)


def _hint(kind: type, parts: Mapping[str, type], name: str) -> str:
    """Return which attribute of the class or of its parts is meant; else all of the class."""
    places = {"": _names(kind), **{f"{part}.": _names(one) for part, one in parts.items()}}
    for meant in (_same, close_names):
        for prefix, names in places.items():
            if found := meant(name, names):
                return f"use {prefix}{found[0]}"
    return f"choose from: {', '.join(places[''])}"


def _same(name: str, names: list[str]) -> list[str]:
    """Return the attributes that have this name, have it with a unit, or are what others call so."""
    other = OTHER_NAMES.get(name, name)
    return [
        other if known == other.partition("(")[0] else known
        for known in names
        if known == other.partition("(")[0] or known.startswith(f"{name}_")
    ]


def _names(kind: type) -> list[str]:
    return [name for name in dir(kind) if not name.startswith("_")]
