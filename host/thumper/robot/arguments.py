"""Checks the arguments of `Robot`. A wrong one is a ThumperError: "CALL: ARGUMENT: problem; fix".

A doubtful one is a warning that names the caller's line.
"""

import math
import sys
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.maps.annotations import Annotations
from thumper.navigation.goal import check_place

MAX_DURATION_S = 600.0
MAX_DISTANCE_M = 50.0
COMMON_DEG = (30, 45, 60, 90, 120, 135, 150, 180, 270, 360)
ROUNDED_RAD = 0.005  # pi / 2 as 1.57
PLACE_KEYS = {"x_m", "y_m", "heading_deg", "heading_rad"}


Place = str | tuple[float, float] | tuple[float, float, float] | Mapping[str, float]


class DrivePlace(NamedTuple):
    """Where a drive goes."""

    x_m: float
    y_m: float
    heading_rad: float | None = None  # None: any


def wrong(call: str, name: str, problem: str) -> ThumperError:
    """Return the error for an argument."""
    return ThumperError(f"{call}: {name}: {problem}", exit_code=EXIT_USAGE)


def number(call: str, name: str, value: float) -> float:
    """Return a finite number."""
    try:
        if isinstance(value, str):  # float() takes "1"
            raise TypeError
        result = float(value)
    except (TypeError, ValueError, OverflowError):
        raise wrong(call, name, f"{value!r} is not a number") from None
    if not math.isfinite(result):
        raise wrong(call, name, f"{result} is not a finite number")
    return result


def between(call: str, name: str, value: float, low: float, high: float, unit: str) -> float:
    """Return a number from `low` to `high`."""
    result = number(call, name, value)
    if not low <= result <= high:
        raise wrong(call, name, f"choose {low:g}...{high:g} {unit}")
    return result


def above_zero(call: str, name: str, value: float, highest: float, unit: str) -> float:
    """Return a number of more than 0 and up to `highest`."""
    result = number(call, name, value)
    if not 0.0 < result <= highest:
        raise wrong(call, name, f"choose more than 0 and up to {highest:g} {unit}")
    return result


def duration_s(call: str, value: float) -> float:
    """Return a duration of more than 0 and up to `MAX_DURATION_S`."""
    return above_zero(call, "duration_s", value, MAX_DURATION_S, "s")


def speed(call: str, name: str, value: float, highest: float) -> float:
    """Return a speed of more than 0 and up to the configured `highest`."""
    unit = "m/s" if name == "v_m_s" else "rad/s"
    return above_zero(call, name, value, highest, f"{unit} ([navigation.limits] in the configuration)")


def distance_m(call: str, value: float) -> float:
    """Return a distance other than 0, up to `MAX_DISTANCE_M`; negative is backward."""
    result = number(call, "distance_m", value)
    if not 0.0 < abs(result) <= MAX_DISTANCE_M:
        raise wrong(call, "distance_m", f"choose other than 0, and {MAX_DISTANCE_M:g} m at most")
    return result


def angle_rad(
    call: str, without_unit: Sequence[object], rad: float | None, deg: float | None, name: str
) -> float | None:
    """Return an angle that is given in radians or in degrees; None if it is not given.

    Warns of degrees that are a common angle in radians, such as deg=1.57.

    Raises
    ------
    ThumperError
        It is given without a unit, in both, or in radians and more than a turn: that means degrees.
    """
    if without_unit:
        value = f"{without_unit[0]!r}"
        raise wrong(call, value, f"degrees or radians? Pass {name}deg={value} or {name}rad={value}")
    if rad is not None and deg is not None:
        raise wrong(call, f"{name}rad, {name}deg", "pass only one of them")
    if deg is not None:
        value_deg = number(call, f"{name}deg", deg)
        for common in COMMON_DEG:
            if abs(abs(value_deg) - math.radians(common)) < ROUNDED_RAD:
                meant = math.copysign(common, value_deg)
                fix = f"For {meant:g} degrees pass {name}deg={meant:g}"
                text = f"{call}: {name}deg={value_deg:g}: in radians? {fix}"
                warnings.warn(text, stacklevel=_callers_level())
        return math.radians(value_deg)
    if rad is None:
        return None
    result = number(call, f"{name}rad", rad)
    if abs(result) > math.tau:
        raise wrong(call, f"{name}rad", f"{result:g} is more than a turn; pass {name}deg={result:g}")
    return result


def _callers_level() -> int:
    """Return the `stacklevel` with which the calling function warns of the code that uses this package."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals["__name__"].startswith("thumper."):
        level, frame = level + 1, frame.f_back
    return level


def heading_rad(
    call: str, without_unit: Sequence[object], rad: float | None, deg: float | None
) -> float | None:
    """Return a heading of up to a turn, given in radians or in degrees; None if it is not given."""
    result = angle_rad(call, without_unit, rad, deg, "heading_")
    if result is not None and abs(result) > math.tau:
        raise wrong(call, "heading_deg", "choose -360 to 360 degrees")
    return result


def places(call: str, values: object, annotations: Annotations) -> tuple[DrivePlace, ...]:
    """Return the places of a list, each as `place` returns it."""
    if not isinstance(values, Iterable) or isinstance(values, str | Mapping):
        raise wrong(call, "places", "pass a list, such as [(1.0, 0.0), (1.0, 1.0)]")
    result = tuple(place(call, "places", value, annotations) for value in values)
    if not result:
        raise wrong(call, "places", "pass at least one")
    return result


def place(call: str, name: str, value: object, annotations: Annotations) -> DrivePlace:
    """Return a place: that of a name, (x_m, y_m), (x_m, y_m, heading_rad), or a mapping as `goto` takes."""
    if isinstance(value, str):
        return _saved_place(call, value, annotations)
    names = ("x_m", "y_m", "heading_rad")
    if isinstance(value, Sequence) and 2 <= len(value) <= len(names):
        value = dict(zip(names, value, strict=False))
    if not (isinstance(value, Mapping) and {"x_m", "y_m"} <= set(value) <= PLACE_KEYS):
        cure = "pass a saved name, (x_m, y_m), or dict(x_m=1.0, y_m=0.0, heading_deg=90)"
        raise wrong(call, name, f"{value!r} is no place; {cure}")
    found = DrivePlace(
        number(call, "x_m", value["x_m"]),
        number(call, "y_m", value["y_m"]),
        heading_rad(call, (), value.get("heading_rad"), value.get("heading_deg")),
    )
    check_place(f"{call}: {name}:", found.x_m, found.y_m)
    return found


def _saved_place(call: str, name: str, annotations: Annotations) -> DrivePlace:
    if not annotations.places:
        problem = "this map has no saved places; pass the map= or session= of one that has"
        raise wrong(call, repr(name), problem)
    try:
        saved = annotations.place(name)
    except ThumperError as error:
        raise ThumperError(f"{call}: {error}", exit_code=EXIT_USAGE) from None
    return DrivePlace(saved.x_m, saved.y_m, saved.yaw_rad)


def file_path(call: str, name: str, value: str | Path) -> Path:
    """Return a file path."""
    if not isinstance(value, str | Path) or str(value) in ("", ".") or "\0" in str(value):
        raise wrong(call, name, f"{value!r} is not a file path")
    return Path(value)
