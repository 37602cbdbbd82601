"""A goal as it is asked for over the bus."""

import math
from collections.abc import Mapping
from typing import Any

from thumper.bounds import check_place
from thumper.errors import ThumperError
from thumper.navigation.goal import Goal


def goal_of(content: Mapping[str, Any]) -> Goal:
    """x_m, y_m, and perhaps yaw_rad and tolerance_m; nothing else, and all of them numbers."""
    known = {"x_m", "y_m", "yaw_rad", "tolerance_m"}
    numbers = {
        name: float(value)
        for name, value in content.items()
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    }
    if set(numbers) != set(content) or not {"x_m", "y_m"} <= set(numbers) <= known:
        raise ThumperError("a goal is x_m, y_m and perhaps yaw_rad and tolerance_m, all of them numbers")
    tolerance_m = numbers.get("tolerance_m", 0.1)
    if not 0.02 <= tolerance_m <= 1.0:
        raise ThumperError("a goal's tolerance is 0.02...1 m")
    check_place("the goal", numbers["x_m"], numbers["y_m"])
    return Goal(
        x_m=numbers["x_m"],
        y_m=numbers["y_m"],
        theta_rad=numbers.get("yaw_rad"),
        tolerance_m=tolerance_m,
    )
