"""What a goal may be, whoever asks: the command line, a script, the bus."""

import math

from thumper.errors import EXIT_USAGE, ThumperError

FARTHEST_M = 1000.0


def check_place(what: str, x_m: float, y_m: float) -> None:
    """Refuse a place in `map` that no robot drives to; `what` names it.

    Raises
    ------
    ThumperError
        It is farther than 1000 m from the map's origin, or no number.
    """
    if not math.hypot(x_m, y_m) <= FARTHEST_M:
        raise ThumperError(
            f"{what} ({x_m:g}, {y_m:g}) is farther than {FARTHEST_M:g} m from the map's origin",
            exit_code=EXIT_USAGE,
        )
