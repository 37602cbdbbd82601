"""Checks the arguments of `Robot`: a wrong one is a ThumperError that names the call. Pure."""

import math
from collections.abc import Sequence
from pathlib import Path

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.navigation.goal import check_place

MAX_DURATION_S = 600.0
MAX_DISTANCE_M = 50.0


def number(call: str, value: float) -> float:
    """Return a finite number."""
    result = _as_float(call, value)
    if not math.isfinite(result):
        raise ThumperError(f"{call}: pass finite numbers", exit_code=EXIT_USAGE)
    return result


def duration_s(call: str, value: float) -> float:
    """Return a duration of more than 0 and up to `MAX_DURATION_S`."""
    result = _as_float(call, value)
    if not 0.0 < result <= MAX_DURATION_S:  # also refuses nan
        raise ThumperError(
            f"{call}: choose a duration of more than 0 and up to {MAX_DURATION_S:g} s", exit_code=EXIT_USAGE
        )
    return result


def speed(call: str, name: str, value: float, highest: float) -> float:
    """Return a speed of more than 0 and up to the configured `highest`."""
    result = number(call, value)
    if not 0.0 < result <= highest:
        raise ThumperError(
            f"{name}: choose more than 0 and up to {highest:g} ([navigation.limits])", exit_code=EXIT_USAGE
        )
    return result


def distance_m(call: str, value: float) -> float:
    """Return a distance other than 0, up to `MAX_DISTANCE_M`; negative is backward."""
    result = number(call, value)
    if not 0.0 < abs(result) <= MAX_DISTANCE_M:
        raise ThumperError(
            f"{call}: choose a distance other than 0 and up to {MAX_DISTANCE_M:g} m", exit_code=EXIT_USAGE
        )
    return result


def angle_rad(
    call: str, without_unit: Sequence[object], rad: float | None, deg: float | None, name: str
) -> float | None:
    """Return an angle that is given in radians or in degrees; None if it is not given.

    Raises
    ------
    ThumperError
        It is given without a unit, or in both.
    """
    if without_unit:
        value = f"{without_unit[0]!r}"
        raise ThumperError(
            f"{call}: {value} degrees or radians? Pass {name}deg={value} or {name}rad={value}",
            exit_code=EXIT_USAGE,
        )
    if rad is not None and deg is not None:
        raise ThumperError(f"{call}: pass {name}rad or {name}deg, not both", exit_code=EXIT_USAGE)
    if deg is not None:
        return math.radians(number(call, deg))
    return None if rad is None else number(call, rad)


def heading(call: str, rad: float) -> float:
    """Return a heading of up to a turn."""
    result = number(call, rad)
    if abs(result) > math.tau:  # few scripts mean more than a turn, but many mean degrees
        raise ThumperError(
            f"{call}: a heading of {result:g} rad is more than a turn; write math.radians({result:g})",
            exit_code=EXIT_USAGE,
        )
    return result


def places(call: str, values: object) -> tuple[tuple[float, ...], ...]:
    """Return places (x_m, y_m) or (x_m, y_m, heading_rad)."""
    try:
        result = tuple(_place(call, *value) for value in values)  # type: ignore[attr-defined]
    except TypeError as error:
        raise ThumperError(
            f"{call}: pass a list of places, such as [(1.0, 0.0), (1.0, 1.0)], each with a heading_rad if "
            "you like",
            exit_code=EXIT_USAGE,
        ) from error
    if not result:
        raise ThumperError(f"{call}: pass at least one place", exit_code=EXIT_USAGE)
    for place in result:
        check_place(f"{call}: the place", *place[:2])
    return result


def _place(call: str, x_m: float, y_m: float, *heading_rad: float) -> tuple[float, ...]:
    if len(heading_rad) > 1:
        raise TypeError
    return number(call, x_m), number(call, y_m), *(heading(call, rad) for rad in heading_rad)


def file_path(name: str, value: str | Path) -> Path:
    """Return a file path."""
    if not isinstance(value, str | Path) or str(value) in ("", ".") or "\0" in str(value):
        raise ThumperError(f"{name}: {value!r} is not a file path", exit_code=EXIT_USAGE)
    return Path(value)


def _as_float(call: str, value: float) -> float:
    try:
        if isinstance(value, str):  # float() takes "1"
            raise TypeError
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ThumperError(f"{call}: {value!r} is not a number", exit_code=EXIT_USAGE) from error
